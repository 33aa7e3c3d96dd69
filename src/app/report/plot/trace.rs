//! Paths in a plane, side by side.

use super::axes::{Area, Axis, BELOW, Kind, TITLE_HEIGHT, frame, room_left};
use super::colours::{MARK, VIRIDIS, at, hex};
use super::svg::Panel;
use super::{Picture, PlotError, Trace, fine, stretches, window};

/// Size of a panel.
const SIZE: (f64, f64) = (420.0, 400.0);
/// Room right of the data.
const RIGHT: f64 = 14.0;
/// Pieces of one colour.
const PIECES: usize = 64;
/// Width of a path.
const WIDTH: f64 = 1.0;
/// The brightest colour that is seen on white.
const BRIGHTEST: f64 = 0.92;

/// Draws paths side by side, the same axes for all, from dark (start) to bright (end); a dot marks the start.
///
/// # Errors
/// [`PlotError::Empty`] if nothing can be shown.
pub fn trace_plot(trace: &Trace) -> Result<Picture, PlotError> {
    let empty = || PlotError::Empty(trace.title.clone());
    let room = |(low, high): (f64, f64)| (low - 0.04 * (high - low), high + 0.04 * (high - low));
    let (x, y) = (window(&trace.paths, |p| p.0).ok_or_else(empty)?, window(&trace.paths, |p| p.1).ok_or_else(empty)?);
    let (x, mut horizontal, kind) = match trace.turn.map(|turn| (turn.low(), turn.high())) {
        Some(turn) => (turn, turn, Kind::Angle),
        None => (x, room(x), Kind::Linear),
    };
    let inside = |p: &(f64, f64)| x.0 <= p.0 && p.0 <= x.1 && y.0 <= p.1 && p.1 <= y.1;
    let mut upright = room(y);
    let height = SIZE.1 - TITLE_HEIGHT - BELOW - 6.0;
    let left = room_left(&Axis::new(upright.0, upright.1, Kind::Linear, ""), height);
    let area = Area { left, top: TITLE_HEIGHT, width: SIZE.0 - left - RIGHT, height };
    if trace.equal {
        let per_pixel = f64::max((horizontal.1 - horizontal.0) / area.width, (upright.1 - upright.0) / area.height);
        let widened = |(low, high): (f64, f64), pixels: f64| {
            let (middle, half) = (0.5 * (low + high), 0.5 * per_pixel * pixels);
            (middle - half, middle + half)
        };
        (horizontal, upright) = (widened(horizontal, area.width), widened(upright, area.height));
    }
    let axes = (
        &Axis::new(horizontal.0, horizontal.1, kind, &trace.x_label),
        &Axis::new(upright.0, upright.1, Kind::Linear, &trace.y_label),
    );

    let longest = trace.paths.iter().map(|path| path.points.len()).max().unwrap_or(0).max(1);
    let piece = longest.div_ceil(PIECES).max(2);
    let mut panels = Vec::new();
    for path in &trace.paths {
        // What leaves the window is a gap.
        let gap = (f64::NAN, f64::NAN);
        let points: Vec<(f64, f64)> = path.points.iter().map(|p| if inside(p) { *p } else { gap }).collect();
        let Some(&first) = points.iter().find(|p| fine(p.0) && fine(p.1)) else { continue };
        let mut inner = Panel::new(area.width, area.height);
        let mut start = 0;
        while start + 1 < points.len() {
            // Pieces share their end points.
            let end = (start + piece).min(points.len() - 1);
            let colour = hex(at(VIRIDIS, BRIGHTEST * start as f64 / longest as f64));
            let lines = stretches(&points[start..=end]).into_iter().filter(|stretch| stretch.len() > 1);
            let lines = lines.map(|s| s.into_iter().map(|p| area.point(axes, p)).collect()).collect::<Vec<_>>();
            inner.lines(&lines, &colour, WIDTH);
            start = end;
        }
        inner.dots(&[area.point(axes, first)], MARK, 7.0);
        let title = if path.name.is_empty() { trace.title.clone() } else { format!("{}: {}", trace.title, path.name) };
        let mut panel = Panel::new(SIZE.0, SIZE.1);
        frame(&mut panel, area, axes, &title);
        panel.inset((area.left, area.top), &inner);
        panels.push(panel);
    }
    if panels.is_empty() { Err(empty()) } else { Ok(Picture { panels }) }
}
