//! Paths in a plane, exact ones wide with learned ones thin over them: orbits around a centre, one panel for each; traces.

use super::axes::{Area, Axis, AxisScale, BELOW, ROW, TITLE_HEIGHT, TOP, frame, room_left};
use super::svg::{LINES, MARK, OVER, Panel, UNDER, VIRIDIS, at, entry_width, hex};
use super::{Picture, PlotError, Series, Trace, fine, range, stretches, values, window};

/// Size of a panel.
const SIZE: (f64, f64) = (420.0, 428.0);
/// Margin right of the data.
const RIGHT: f64 = 14.0;
/// Colour of the disc around the origin.
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
    /// Panels, each with title and orbits. The orbits that are not `over` determine the range of a panel; without such orbits, all do.
    pub panels: Vec<(String, Vec<Series>)>,
}

/// Draws orbits, both axes of a panel having one scale.
///
/// # Errors
/// [`PlotError::Empty`] if a panel has nothing to show.
pub fn orbit_picture(plot: &OrbitPlot) -> Result<Picture, PlotError> {
    let panels = plot.panels.iter().map(|(title, orbits)| draw(plot, title, orbits)).collect::<Result<Vec<_>, _>>()?;
    if panels.is_empty() { Err(PlotError::Empty("orbits".to_string())) } else { Ok(Picture { panels, blank: false }) }
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
    let top = TITLE_HEIGHT + ROW;
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
            let look = if over { (LINES[index % LINES.len()], OVER) } else { UNDER };
            // Any position outside the panel is suitable.
            let near =
                |(x, y): (f64, f64)| (x.clamp(-area.width, 2.0 * area.width), y.clamp(-area.height, 2.0 * area.height));
            let lines = stretches(&orbit.points).into_iter().filter(|stretch| stretch.len() > 1);
            let lines = lines.map(|s| s.into_iter().map(|p| near(area.point(axes, p))).collect()).collect::<Vec<_>>();
            inner.lines(&lines, look.0, look.1);
            if !orbit.name.is_empty() {
                panel.entry((entry, TITLE_HEIGHT + 3.0), look, &orbit.name);
                entry += entry_width(&orbit.name);
            }
        }
    }
    panel.inset((area.left, area.top), &inner);
    Ok(panel)
}

/// Size of a panel.
const TRACE_SIZE: (f64, f64) = (420.0, 384.0);
/// Margin right of the data.
const TRACE_RIGHT: f64 = 14.0;
/// Number of pieces with a uniform colour.
const PIECES: usize = 64;
/// Width of a path.
const WIDTH: f64 = 1.0;
/// The brightest colour that is visible on white.
const BRIGHTEST: f64 = 0.92;

/// Draws paths over each other, or one from dark (start) to bright (end); a dot marks the start.
///
/// # Errors
/// [`PlotError::Empty`] if nothing can be shown.
pub fn trace_plot(trace: &Trace) -> Result<Picture, PlotError> {
    let empty = || PlotError::Empty(trace.y_label.clone());
    let room = |(low, high): (f64, f64)| (low - 0.04 * (high - low), high + 0.04 * (high - low));
    let (x, y) = (window(&trace.paths, |p| p.0).ok_or_else(empty)?, window(&trace.paths, |p| p.1).ok_or_else(empty)?);
    let (mut horizontal, kind) = match trace.turn {
        Some(turn) => ((turn.low(), turn.high()), AxisScale::Angle),
        None => (room(x), AxisScale::Linear),
    };
    let mut upright = room(y);
    let height = TRACE_SIZE.1 - TOP - BELOW - 6.0;
    let left = room_left(&Axis::new(upright.0, upright.1, AxisScale::Linear, ""), height);
    let legend = if trace.paths.len() > 1 { ROW } else { 0.0 };
    let area = Area { left, top: TOP + legend, width: TRACE_SIZE.0 - left - TRACE_RIGHT, height };
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

    let within = |range: (f64, f64), at: f64| range.0 <= at && at <= range.1;
    let inside = |p: &(f64, f64)| within(horizontal, p.0) && within(upright, p.1);
    let (mut panel, mut inner) = (Panel::new(TRACE_SIZE.0, TRACE_SIZE.1 + legend), Panel::new(area.width, area.height));
    frame(&mut panel, area, axes, "");
    let (mut start, mut entry) = (None, left);
    for (index, path) in trace.paths.iter().enumerate() {
        // Points outside the window form a gap.
        let gap = (f64::NAN, f64::NAN);
        let points: Vec<(f64, f64)> = path.points.iter().map(|p| if inside(p) { *p } else { gap }).collect();
        start = start.or(points.iter().find(|p| fine(p.0) && fine(p.1)).copied());
        let lines = |points: &[(f64, f64)]| -> Vec<Vec<(f64, f64)>> {
            let lines = stretches(points).into_iter().filter(|stretch| stretch.len() > 1);
            lines.map(|s| s.into_iter().map(|p| area.point(axes, p)).collect()).collect()
        };
        if trace.paths.len() == 1 {
            by_time(&points).for_each(|(piece, colour)| inner.lines(&lines(piece), &colour, WIDTH));
            continue;
        }
        let look = if index == 0 { UNDER } else { (LINES[index % LINES.len()], OVER) };
        inner.lines(&lines(&points), look.0, look.1);
        panel.entry((entry, TOP + 3.0), look, &path.name);
        entry += entry_width(&path.name);
    }
    inner.dots(&[area.point(axes, start.ok_or_else(empty)?)], MARK, 7.0);
    panel.inset((area.left, area.top), &inner);
    let stays = |part: fn(&(f64, f64)) -> f64| {
        let mut all = values(&trace.paths, part);
        let first = all.next();
        all.all(|x| Some(x) == first)
    };
    Ok(Picture { panels: vec![panel], blank: stays(|p| p.0) && stays(|p| p.1) })
}

/// Splits a path into pieces that share their ends, each with its colour.
fn by_time(points: &[(f64, f64)]) -> impl Iterator<Item = (&[(f64, f64)], String)> {
    let last = points.len().saturating_sub(1);
    let piece = points.len().div_ceil(PIECES).max(2);
    (0..last).step_by(piece).map(move |start| {
        let colour = hex(at(VIRIDIS, BRIGHTEST * start as f64 / points.len() as f64));
        (&points[start..=(start + piece).min(last)], colour)
    })
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
        let svg = drawn.to_svg("");
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
        let ticks = |picture: &Picture| picture.to_svg("").matches("</text>").count();
        assert_eq!(ticks(&whole), ticks(&cut));
        let nothing = vec![Series { name: String::new(), points: vec![(f64::NAN, 1.0)], over: false }];
        assert_eq!(orbit_picture(&plot(vec![("T".to_string(), nothing)])), Err(PlotError::Empty("T".to_string())));
        assert!(orbit_picture(&plot(Vec::new())).is_err());
    }
}
