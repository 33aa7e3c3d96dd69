//! Plots in SVG, from numbers that may be anything: what is not finite leaves a gap, and every range is finite and not
//! empty before it is drawn.

mod axes;
mod colours;
mod heat_map;
mod lines;
mod orbits;
mod picture;
mod png;
mod simplify;
mod svg;
mod trace;

pub use heat_map::heat_maps;
pub use lines::line_plot;
pub use orbits::{OrbitPlot, orbit_picture};
pub use picture::Picture;
pub use png::png;
pub use trace::trace_plot;

use super::turn::Turn;
use crate::analysis::Grid;

/// Numbers larger than this are left out: axes need room for arithmetic.
const LARGEST: f64 = 1e150;

/// Why there is no picture.
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
    /// `true` if to draw it thin over the others, which are then drawn wide: lines that ought to coincide.
    pub over: bool,
}

impl Series {
    /// A line through `(x[k], y[k])`.
    pub fn new(name: &str, x: &[f64], y: &[f64]) -> Self {
        Self { name: name.into(), points: x.iter().copied().zip(y.iter().copied()).collect(), over: false }
    }

    /// The same line drawn thin over the others.
    #[must_use]
    pub fn over(self) -> Self {
        Self { over: true, ..self }
    }
}

/// A value that a vertical axis marks by a thin line.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The value.
    pub value: f64,
    /// Its name.
    pub name: String,
}

/// Lines over a common axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LinePlot {
    /// Title.
    pub title: String,
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// `true` if the vertical axis is logarithmic; values that are not positive leave gaps.
    pub log_y: bool,
    /// The turn that the vertical axis shows, for an angle that leaves it somewhere.
    pub turn: Option<Turn>,
    /// A value to be marked.
    pub level: Option<Level>,
    /// Lines.
    pub series: Vec<Series>,
}

/// A path in a plane, coloured by time.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Title.
    pub title: String,
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Paths with a name each, drawn side by side with the same axes; points at equal places in the lists have equal
    /// colours. The first is shown whole, the others as far as they keep within its extent of it.
    pub paths: Vec<Series>,
    /// `true` if both axes have one scale (a plane of space).
    pub equal: bool,
    /// The turn that the horizontal axis shows, for an angle that leaves it somewhere.
    pub turn: Option<Turn>,
}

/// A grid as colours.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Title.
    pub title: String,
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Values.
    pub grid: Grid,
    /// Colours between these values; `None`: between the extremes of the grid.
    pub range: Option<(f64, f64)>,
    /// `true` if colours diverge from 0 (differences).
    pub diverging: bool,
    /// Points to mark by a dot.
    pub marks: Vec<(f64, f64)>,
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

/// Extremes with room between them, whatever the values.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) = extremes(values)?;
    let least = 1e-9 * low.abs().max(high.abs());
    if high - low > least {
        return Some((low, high));
    }
    let room = if high == 0.0 { 1.0 } else { 0.1 * high.abs() };
    Some((low - room, high + room))
}

/// Range of the first path, and of all as far as within its extent of that range.
fn window(paths: &[Series], part: fn(&(f64, f64)) -> f64) -> Option<(f64, f64)> {
    let all = range(values(paths, part))?;
    let Some((low, high)) = paths.first().and_then(|first| range(values(std::slice::from_ref(first), part))) else {
        return Some(all);
    };
    Some((all.0.max(low - (high - low)), all.1.min(high + (high - low))))
}

/// Uninterrupted stretches of finite points.
fn stretches(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let whole = points.split(|&(x, y)| !(fine(x) && fine(y)));
    whole.filter(|stretch| !stretch.is_empty()).map(<[_]>::to_vec).collect()
}

#[cfg(test)]
mod tests;
