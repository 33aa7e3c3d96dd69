//! Paths in a plane: orbits around a centre, one panel for each, what is exact wide, what was learned thin over it; traces
//! side by side.

use super::axes::{Area, Axis, AxisScale, BELOW, TITLE_HEIGHT, frame, room_left};
use super::svg::{Anchor, LINES, MARK, Panel, VIRIDIS, at, hex, text_width};
use super::{Picture, PlotError, Series, Trace, fine, range, stretches, values, window};

/// Size of a panel.
const SIZE: (f64, f64) = (420.0, 428.0);
/// Room right of the data.
const RIGHT: f64 = 14.0;
/// Height of the legend, size of its texts, length of its lines.
const LEGEND: (f64, f64, f64) = (18.0, 12.5, 22.0);
/// Colour and width of the lines below, and of those over them.
const BELOW_LINE: (&str, f64) = ("#7FB8DC", 3.4);
const OVER_WIDTH: f64 = 1.1;
/// Colour of a hole.
const HOLE: &str = "#c3c9d4";

/// Orbits in a plane around the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct OrbitPlot {
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Radius of a disc around the origin, such as a horizon.
    pub hole: Option<f64>,
    /// Panels: title and orbits of each. The panel shows those that are not `over` whole, all if there are no others.
    pub panels: Vec<(String, Vec<Series>)>,
}

/// Draws orbits, both axes of a panel having one scale.
///
/// # Errors
/// [`PlotError::Empty`] if a panel has nothing to show.
pub fn orbit_picture(plot: &OrbitPlot) -> Result<Picture, PlotError> {
    let panels = plot.panels.iter().map(|(title, orbits)| draw(plot, title, orbits)).collect::<Result<Vec<_>, _>>()?;
    if panels.is_empty() { Err(PlotError::Empty("orbits".to_string())) } else { Ok(Picture { panels }) }
}

fn draw(plot: &OrbitPlot, title: &str, orbits: &[Series]) -> Result<Panel, PlotError> {
    let empty = || PlotError::Empty(title.to_string());
    let under: Vec<Series> = orbits.iter().filter(|orbit| !orbit.over).cloned().collect();
    let shown = if under.is_empty() { orbits } else { &under };
    let hole = plot.hole.filter(|radius| radius.is_finite() && *radius > 0.0);
    let sides = [-hole.unwrap_or(0.0), hole.unwrap_or(0.0)];
    let of = |part: fn(&(f64, f64)) -> f64| range(values(shown, part).chain(sides).chain([0.0]));
    if values(shown, |p| p.0).next().is_none() {
        return Err(empty());
    }
    let (x, y) = (of(|p| p.0).ok_or_else(empty)?, of(|p| p.1).ok_or_else(empty)?);

    let mut panel = Panel::new(SIZE.0, SIZE.1);
    let top = TITLE_HEIGHT + LEGEND.0;
    let height = SIZE.1 - top - BELOW - 6.0;
    let left = room_left(&Axis::new(y.0, y.1, AxisScale::Linear, ""), height);
    let area = Area { left, top, width: SIZE.0 - left - RIGHT, height };
    let unit = 1.08 * f64::max((x.1 - x.0) / area.width, (y.1 - y.0) / area.height);
    let axis = |(low, high): (f64, f64), pixels: f64, label: &str| {
        let (middle, half) = (0.5 * (low + high), 0.5 * unit * pixels);
        Axis::new(middle - half, middle + half, AxisScale::Linear, label)
    };
    let axes = (&axis(x, area.width, &plot.x_label), &axis(y, area.height, &plot.y_label));
    frame(&mut panel, area, axes, title);

    let mut inner = Panel::new(area.width, area.height);
    if let Some(radius) = hole {
        inner.dots(&[area.point(axes, (0.0, 0.0))], HOLE, 2.0 * radius / unit);
    }
    let mut entry = left;
    for over in [false, true] {
        for (index, orbit) in orbits.iter().enumerate().filter(|(_, orbit)| orbit.over == over) {
            let (colour, width) = if over { (LINES[index % LINES.len()], OVER_WIDTH) } else { BELOW_LINE };
            // Any position outside will do.
            let near =
                |(x, y): (f64, f64)| (x.clamp(-area.width, 2.0 * area.width), y.clamp(-area.height, 2.0 * area.height));
            let lines = stretches(&orbit.points).into_iter().filter(|stretch| stretch.len() > 1);
            let lines = lines.map(|s| s.into_iter().map(|p| near(area.point(axes, p))).collect()).collect::<Vec<_>>();
            inner.lines(&lines, colour, width);
            if !orbit.name.is_empty() {
                let middle = TITLE_HEIGHT + 3.0;
                panel.segments(&[[(entry, middle), (entry + LEGEND.2, middle)]], colour, width.max(2.0));
                panel.text((entry + LEGEND.2 + 5.0, middle + 4.0), LEGEND.1, Anchor::Start, &orbit.name);
                entry += LEGEND.2 + 5.0 + text_width(&orbit.name, LEGEND.1) + 14.0;
            }
        }
    }
    panel.inset((area.left, area.top), &inner);
    Ok(panel)
}

/// Size of a panel.
const TRACE_SIZE: (f64, f64) = (420.0, 400.0);
/// Room right of the data.
const TRACE_RIGHT: f64 = 14.0;
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
        Some(turn) => (turn, turn, AxisScale::Angle),
        None => (x, room(x), AxisScale::Linear),
    };
    let inside = |p: &(f64, f64)| x.0 <= p.0 && p.0 <= x.1 && y.0 <= p.1 && p.1 <= y.1;
    let mut upright = room(y);
    let height = TRACE_SIZE.1 - TITLE_HEIGHT - BELOW - 6.0;
    let left = room_left(&Axis::new(upright.0, upright.1, AxisScale::Linear, ""), height);
    let area = Area { left, top: TITLE_HEIGHT, width: TRACE_SIZE.0 - left - TRACE_RIGHT, height };
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
        &Axis::new(upright.0, upright.1, AxisScale::Linear, &trace.y_label),
    );

    let longest = trace.paths.iter().map(|path| path.points.len()).max().unwrap_or(0).max(1);
    let piece = longest.div_ceil(PIECES).max(2);
    let mut panels = Vec::new();
    for path in &trace.paths {
        // Points outside the window form a gap.
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
        let mut panel = Panel::new(TRACE_SIZE.0, TRACE_SIZE.1);
        frame(&mut panel, area, axes, &title);
        panel.inset((area.left, area.top), &inner);
        panels.push(panel);
    }
    if panels.is_empty() { Err(empty()) } else { Ok(Picture { panels }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(name: &str, radius: f64) -> Series {
        let angles = (0..=90).map(|k| f64::from(k) * std::f64::consts::TAU / 90.0);
        let points = angles.map(|angle| (radius * angle.cos(), radius * angle.sin())).collect();
        Series { name: name.to_string(), points, over: false }
    }

    fn plot(panels: Vec<(String, Vec<Series>)>) -> OrbitPlot {
        OrbitPlot { x_label: "x [m]".to_string(), y_label: "y [m]".to_string(), hole: Some(2.0), panels }
    }

    #[test]
    fn orbits_share_a_panel_with_the_hole() {
        let pair = |r: f64| vec![circle("learned", 1.01 * r).over(), circle("exact", r)];
        let drawn =
            orbit_picture(&plot(vec![("near".to_string(), pair(6.0)), ("far".to_string(), pair(12.0))])).unwrap();
        let svg = drawn.to_svg();
        assert_eq!(drawn.panels(), 2);
        assert_eq!((svg.matches(">exact</text>").count(), svg.matches(">learned</text>").count()), (2, 2));
        assert_eq!(svg.matches(HOLE).count(), 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        // The learned orbit is drawn last.
        assert!(svg.find(">exact</text>") < svg.find(">learned</text>"));
    }

    #[test]
    fn orbits_that_run_away_do_not_shrink_the_others() {
        let mut away = circle("learned", 3.0).over();
        let whole = orbit_picture(&plot(vec![("T".to_string(), vec![circle("", 6.0), away.clone()])])).unwrap();
        away.points.extend([(1e9, -1e9), (f64::NAN, 0.0), (f64::INFINITY, 1.0)]);
        let cut = orbit_picture(&plot(vec![("T".to_string(), vec![circle("", 6.0), away])])).unwrap();
        let ticks = |picture: &Picture| picture.to_svg().matches("</text>").count();
        assert_eq!(ticks(&whole), ticks(&cut));
        let nothing = vec![Series { name: String::new(), points: vec![(f64::NAN, 1.0)], over: false }];
        assert_eq!(orbit_picture(&plot(vec![("T".to_string(), nothing)])), Err(PlotError::Empty("T".to_string())));
        assert!(orbit_picture(&plot(Vec::new())).is_err());
    }
}
