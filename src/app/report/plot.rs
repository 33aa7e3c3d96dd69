//! Plots in SVG, for any numbers: values that are not finite leave gaps, and every range is made finite and not empty before it is drawn.

mod axes;
mod heat_map;
mod lines;
mod orbits;
mod png;
mod svg;

pub use heat_map::heat_maps;
pub use lines::line_plot;
pub use orbits::{OrbitPlot, orbit_picture, trace_plot};
pub use png::png;

use super::grids::Turn;
use crate::analysis::Grid;
use crate::report::html::escape;
use axes::TITLE_HEIGHT;
use std::fmt::Write as _;
use svg::{Panel, short};

/// Larger numbers are omitted, so that arithmetic on axes does not overflow.
const LARGEST: f64 = 1e150;

/// Why a picture cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// No finite value (no positive one, on a logarithmic axis).
    #[error("nothing finite to plot in `{0}`")]
    Empty(String),
}

/// One line of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; empty for none.
    pub name: String,
    /// Points; those that are not finite leave gaps.
    pub points: Vec<(f64, f64)>,
    /// `true` to draw the line thin on top of the others, which are then wide: for lines that should coincide.
    pub over: bool,
}

impl Series {
    /// A line through `(x[k], y[k])`.
    pub fn new(name: &str, x: &[f64], y: &[f64]) -> Self {
        Self { name: name.into(), points: x.iter().copied().zip(y.iter().copied()).collect(), over: false }
    }

    /// A line through points `(angle, other)` with the angle on the vertical axis, folded into a turn if one is given.
    pub(crate) fn folded(name: &str, path: Vec<(f64, f64)>, turn: Option<Turn>) -> Self {
        let path = turn.map_or_else(|| path.clone(), |turn| turn.fold(&path));
        Self { name: name.into(), points: path.into_iter().map(|(x, other)| (other, x)).collect(), over: false }
    }

    /// Draws this line thin on top of the others.
    #[must_use]
    pub fn over(self) -> Self {
        Self { over: true, ..self }
    }
}

/// A value that a thin line marks on the vertical axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The value.
    pub value: f64,
    /// Its name.
    pub name: String,
}

/// Lines over a common axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinePlot {
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// `true` if the vertical axis is logarithmic; values that are not positive leave gaps.
    pub log_y: bool,
    /// The turn that the vertical axis shows, for angles that leave it.
    pub turn: Option<Turn>,
    /// Value to be marked.
    pub level: Option<Level>,
    /// `true` to draw the lines grey because they are not determined.
    pub open: bool,
    /// Lines.
    pub series: Vec<Series>,
}

/// Paths in a plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Named paths. A single path is coloured by time. Of several paths, the first is wide; the others are thin lines on top of it, shown
    /// up to one extent of the first beyond it.
    pub paths: Vec<Series>,
    /// `true` if both axes have the same scale (a plane in space).
    pub equal: bool,
    /// The turn that the horizontal axis shows, for angles that leave it.
    pub turn: Option<Turn>,
}

/// A grid as colours.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Title, which states the meaning of the colours.
    pub title: String,
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Values.
    pub grid: Grid,
    /// Range of the colours; `None` for the extremes of the grid.
    pub range: Option<(f64, f64)>,
    /// `true` if colours diverge from 0 (differences).
    pub diverging: bool,
    /// Points to mark by a dot.
    pub marks: Vec<(f64, f64)>,
    /// `true` for every value that is not determined, which is greyed out; empty if all are.
    pub open: Vec<bool>,
}

fn fine(x: f64) -> bool {
    x.abs() < LARGEST
}

fn values(series: &[Series], part: fn(&(f64, f64)) -> f64) -> impl Iterator<Item = f64> {
    series.iter().flat_map(|s| &s.points).filter(|p| fine(p.0) && fine(p.1)).map(part)
}

fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|&x| fine(x)).fold(None, |found, x| {
        let (low, high) = found.unwrap_or((x, x));
        Some((low.min(x), high.max(x)))
    })
}

/// Extremes of the values, widened if they coincide.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) = extremes(values)?;
    let least = 1e-9 * low.abs().max(high.abs());
    if high - low > least {
        return Some((low, high));
    }
    let room = if high == 0.0 { 1.0 } else { 0.1 * high.abs() };
    Some((low - room, high + room))
}

/// Range of the first path, extended to the other paths by at most its own extent.
fn window(paths: &[Series], part: fn(&(f64, f64)) -> f64) -> Option<(f64, f64)> {
    let all = range(values(paths, part))?;
    let Some((low, high)) = paths.first().and_then(|first| range(values(std::slice::from_ref(first), part))) else {
        return Some(all);
    };
    Some((all.0.max(low - (high - low)), all.1.min(high + (high - low))))
}

/// Splits a line into segments of finite points.
fn stretches(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let whole = points.split(|&(x, y)| !(fine(x) && fine(y)));
    whole.filter(|stretch| !stretch.is_empty()).map(<[_]>::to_vec).collect()
}

/// Fonts that exist on every machine.
const FONT: &str = "system-ui,-apple-system,Segoe UI,Roboto,Helvetica,Arial,sans-serif";
/// Distance between panels.
const GAP: f64 = 8.0;

/// A picture in SVG. On a page its panels wrap; in a file they form one row.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    panels: Vec<Panel>,
    blank: bool,
}

impl Picture {
    /// Number of panels.
    pub fn panels(&self) -> usize {
        self.panels.len()
    }

    /// `true` if it only shows zeros, or a path that does not move.
    pub fn is_blank(&self) -> bool {
        self.blank
    }

    /// Combines the panels of several pictures.
    pub fn beside(pictures: impl IntoIterator<Item = Self>) -> Self {
        let start = Self { panels: Vec::new(), blank: true };
        pictures.into_iter().fold(start, |all, next| Self {
            panels: [all.panels, next.panels].concat(),
            blank: all.blank && next.blank,
        })
    }

    /// An SVG file with a title, which may be empty.
    pub fn to_svg(&self, title: &str) -> String {
        let top = if title.is_empty() { 0.0 } else { TITLE_HEIGHT };
        let height = top + self.panels.iter().map(|panel| panel.height).fold(0.0, f64::max);
        let (mut body, mut x) = (String::new(), 0.0);
        for panel in &self.panels {
            let (place, width, height) = (short(x), short(panel.width), short(panel.height));
            let _ = writeln!(
                body,
                "<svg x=\"{place}\" y=\"{top}\" width=\"{width}\" height=\"{height}\">{}</svg>",
                panel.body()
            );
            x += panel.width + GAP;
        }
        if !title.is_empty() {
            let mut line = Panel::new(x - GAP, top);
            line.title(8.0, title);
            body += &line.body();
        }
        let (width, height) = (short((x - GAP).max(0.0)), short(height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"{FONT}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{body}</svg>\n"
        )
    }

    /// The panels for a page, one element each.
    pub(in crate::app::report) fn to_html(&self, description: &str) -> String {
        let description = escape(description);
        let panel = |panel: &Panel| {
            let (width, height) = (short(panel.width), short(panel.height));
            format!(
                "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" font-family=\"{FONT}\" \
                 role=\"img\" aria-label=\"{description}\">{}</svg>\n",
                panel.body()
            )
        };
        self.panels.iter().map(panel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: &[(f64, f64)], log_y: bool) -> Result<Picture, PlotError> {
        let series = vec![Series { name: "a".into(), points: points.to_vec(), over: false }];
        let [x_label, y_label] = ["t [s]", "y [m]"].map(String::from);
        line_plot(&LinePlot { x_label, y_label, log_y, series, ..LinePlot::default() })
    }

    /// `true` if it is drawn and all its numbers are finite.
    fn is_sound(picture: &Picture) -> bool {
        let svg = picture.to_svg("T");
        svg.starts_with("<svg xmlns") && svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf")
    }

    #[test]
    fn strange_series_neither_hang_nor_panic() {
        let (nan, inf) = (f64::NAN, f64::INFINITY);
        for log in [false, true] {
            for empty in [&[][..], &[(0.0, nan)], &[(nan, 1.0)], &[(0.0, inf), (1.0, -inf)]] {
                assert_eq!(plot(empty, log), Err(PlotError::Empty("y [m]".into())));
            }
            for good in [
                &[(0.0, 1.0)][..],
                &[(0.0, 5.0), (1.0, 5.0), (2.0, 5.0)],
                &[(0.0, 1.0), (1.0, inf), (2.0, nan), (3.0, 2.0), (4.0, 3.0)],
                &[(0.0, 1e-300), (1.0, 1e140), (2.0, 1e300)],
                &[(0.0, 0.0), (1.0, -1.0), (2.0, 1.0)],
                &[(7.0, 1e-12), (7.0, 2e-12)],
            ] {
                assert!(is_sound(&plot(good, log).unwrap()), "{good:?}");
            }
        }
        assert!(plot(&[(0.0, 0.0), (1.0, -1.0)], true).is_err());
    }

    #[test]
    fn labels_are_drawn_once() {
        let svg = plot(&[(0.0, 1.0), (1.0, 2.0)], false).unwrap().to_svg("T");
        for label in ["T", "t [s]", "y [m]"] {
            assert_eq!(svg.matches(&format!(">{label}</text>")).count(), 1, "{label}");
        }
    }

    #[test]
    fn zeros_and_paths_that_stay_are_blank() {
        assert!(plot(&[(0.0, 0.0), (1.0, 0.0), (2.0, f64::NAN)], false).unwrap().is_blank());
        assert!(!plot(&[(0.0, 0.0), (1.0, 1e-9)], false).unwrap().is_blank());
        assert!(!plot(&[(0.0, 2.0), (1.0, 2.0)], false).unwrap().is_blank());
        let path = |points: &[(f64, f64)]| {
            let paths = vec![Series { name: String::new(), points: points.to_vec(), over: false }];
            trace_plot(&Trace { paths, ..Trace::default() }).unwrap().is_blank()
        };
        assert!(path(&[(1.0, 0.0), (1.0, 0.0)]) && !path(&[(1.0, 0.0), (1.0, 0.5)]));
        let [blank, seen] = [0.0, 1.0].map(|y| plot(&[(0.0, y)], false).unwrap());
        let both = Picture::beside([blank.clone(), seen]);
        assert!(both.panels() == 2 && !both.is_blank() && Picture::beside([blank]).is_blank());
        assert!(crate::report::figure("a.svg", "A", plot(&[(0.0, 0.0)], false), "").is_none());
    }

    #[test]
    fn strange_grids_neither_hang_nor_panic() {
        let map = |values: Vec<f64>| HeatMap {
            title: "G".into(),
            x_label: "x".into(),
            y_label: "y".into(),
            grid: Grid { x: vec![0.0, 1.0], y: vec![0.0, 1.0], values },
            range: None,
            diverging: false,
            marks: vec![(0.0, 1.0)],
            open: Vec::new(),
        };
        for values in [vec![1.0; 4], vec![f64::NAN, 1.0, 2.0, f64::INFINITY], vec![0.0; 4]] {
            let blank = values.iter().all(|z| *z == 0.0);
            let both = [map(values.clone()), HeatMap { diverging: true, ..map(values) }];
            let picture = heat_maps(&both).unwrap();
            assert!(is_sound(&picture) && picture.panels() == 2 && picture.is_blank() == blank);
        }
        let values = vec![1.0, 2.0, 3.0, 4.0];
        let greyed = HeatMap { open: vec![false, true, false, true], ..map(values.clone()) };
        assert!(is_sound(&heat_maps(std::slice::from_ref(&greyed)).unwrap()));
        assert_ne!(heat_maps(&[greyed]).unwrap(), heat_maps(&[map(values)]).unwrap());
        assert!(heat_maps(&[map(vec![f64::NAN; 4])]).is_err());
        assert!(heat_maps(&[map(vec![1.0; 3])]).is_err());
        assert!(heat_maps(&[]).is_err());
    }

    #[test]
    fn traces() {
        let circle: Vec<_> = (0..500).map(|k| ((0.05 * f64::from(k)).cos(), (0.05 * f64::from(k)).sin())).collect();
        let path = |points| Series { name: "p".into(), points, over: false };
        let trace = |paths| {
            let [x_label, y_label] = ["x", "y"].map(String::from);
            trace_plot(&Trace { x_label, y_label, paths, equal: true, turn: None })
        };
        assert!(is_sound(&trace(vec![path(circle), path(vec![])]).unwrap()));
        assert!(is_sound(&trace(vec![path(vec![(0.0, 0.0)])]).unwrap()));
        assert!(trace(vec![]).is_err());
        // A path that runs away does not shrink the first one.
        let line = |from: f64, to: f64| path(vec![(0.0, from), (1.0, to)]);
        let of = |paths: &[Series]| window(paths, |p| p.1).unwrap();
        assert_eq!(of(&[line(0.0, 2.0), line(1.0, 1e100)]), (0.0, 4.0));
        assert_eq!(of(&[line(0.0, 2.0), line(-1.0, 1.0)]), (-1.0, 2.0));
        assert_eq!(of(&[path(vec![]), line(-1.0, 7.0)]), (-1.0, 7.0));
        assert_eq!(trace(vec![line(0.0, 2.0), line(0.0, 2.1)]).unwrap().panels(), 1);
    }

    #[test]
    fn long_series_are_small_and_stay_true() {
        // A slow wave of a hundred thousand points, and one that no eye resolves.
        let wave = |turns: f64| -> Vec<(f64, f64)> {
            (0..100_000).map(|k| (f64::from(k), (turns * f64::from(k) / 1e5 * std::f64::consts::TAU).sin())).collect()
        };
        let size = |points: &[(f64, f64)]| plot(points, false).unwrap().to_svg("").len();
        assert!(size(&wave(3.0)) < 10_000, "{}", size(&wave(3.0)));
        assert!(size(&wave(40_000.0)) < 60_000, "{}", size(&wave(40_000.0)));
    }
}
