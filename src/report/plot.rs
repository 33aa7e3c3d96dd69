//! Adapter to `kuva`: the only file that names it. Pictures are PNG, drawn at twice the size they are shown at.
//!
//! It hangs on infinities with a logarithmic axis and draws nonsense for `NaN` and empty ranges, so everything is made
//! finite and every range is given before it sees them.

use crate::analysis::Grid;
use kuva::PngBackend;
use kuva::plot::{ColorMap, Heatmap, LinePlot as Line, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;
use std::sync::Arc;

/// Colours that people with any colour vision tell apart (Wong 2011), yellow left out.
const COLOURS: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#333333"];
/// Points drawn of one series at most.
const MAX_POINTS: usize = 3000;
/// Numbers larger than this are left out: axes need room for arithmetic.
const LARGEST: f64 = 1e150;
/// Decades below the largest value that a logarithmic axis shows.
const DECADES: f64 = 1e-18;

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// No finite value (no positive one, on a logarithmic axis).
    #[error("nothing finite to plot in `{0}`")]
    Empty(String),
    /// The renderer failed.
    #[error("cannot draw `{0}`: {1}")]
    Renderer(String, String),
}

/// One line of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; empty for none.
    pub name: String,
    /// Points; those that are not finite leave gaps.
    pub points: Vec<(f64, f64)>,
    /// Whether to draw it thin over the others, which are then drawn wide: lines that ought to coincide.
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

/// Lines over a common axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LinePlot {
    /// Title.
    pub title: String,
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Whether the vertical axis is logarithmic; values that are not positive leave gaps.
    pub log_y: bool,
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
    /// Whether both axes have one scale (a plane of space).
    pub equal: bool,
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
    /// Whether colours diverge from 0 (differences).
    pub diverging: bool,
    /// Points to mark by a dot.
    pub marks: Vec<(f64, f64)>,
}

/// PNG of lines.
///
/// # Errors
/// [`PlotError`] if nothing can be shown.
pub fn line_png(plot: &LinePlot) -> Result<Vec<u8>, PlotError> {
    let mut series = plot.series.clone();
    let all_x = range(series.iter().flat_map(|s| &s.points).map(|p| p.0));
    for series in &mut series {
        for point in &mut series.points {
            if plot.log_y && point.1 <= 0.0 {
                point.1 = f64::NAN;
            }
        }
    }
    let top = values(&series, |p| p.1).fold(f64::NEG_INFINITY, f64::max);
    if plot.log_y {
        for point in series.iter_mut().flat_map(|s| &mut s.points) {
            if point.1 < top * DECADES {
                point.1 = f64::NAN;
            }
        }
    }
    let empty = || PlotError::Empty(plot.title.clone());
    let (y, x) = (range(values(&series, |p| p.1)).ok_or_else(empty)?, all_x.ok_or_else(empty)?);

    let mut plots = Vec::new();
    let several = series.len() > 1;
    // Points without lines want room around them.
    let scattered = series.iter().all(|s| runs(&s.points).iter().all(|run| run.len() == 1));
    let margin = if scattered { 0.04 * (x.1 - x.0) } else { 0.0 };
    let overlaid = several && series.iter().any(|s| s.over);
    for (index, series) in series.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let mut named = series.name.is_empty() || !several;
        for run in runs(&series.points) {
            if run.len() == 1 {
                let size = if scattered { 5.0 } else { 2.5 };
                let mut points = ScatterPlot::new().with_data(run).with_color(colour).with_size(size);
                if !named {
                    points = points.with_legend(&*series.name);
                    named = true;
                }
                plots.push(Plot::Scatter(points));
                continue;
            }
            let width = if overlaid && !series.over { 5.0 } else { 1.8 };
            let mut line = Line::new().with_data(run).with_color(colour).with_stroke_width(width);
            if !named {
                line = line.with_legend(&*series.name);
                named = true;
            }
            plots.push(Plot::Line(line));
        }
    }
    let layout = style(Layout::auto_from_plots(&plots), &plot.title, &plot.x_label, &plot.y_label)
        .with_width(760.0)
        .with_height(430.0)
        .with_x_axis_min(x.0 - margin)
        .with_x_axis_max(x.1 + margin);
    let layout = if plot.log_y {
        let whole = |v: f64, up: bool| 10f64.powf(if up { v.log10().ceil() } else { v.log10().floor() });
        let (low, high) = (values(&series, |p| p.1).fold(f64::INFINITY, f64::min), top);
        let (low, high) = (whole(low, false), whole(high, true));
        let high = if high > low { high } else { low * 10.0 };
        layout
            .with_log_y()
            .with_y_axis_min(low)
            .with_y_axis_max(high)
            .with_y_tick_format(TickFormat::Custom(Arc::new(decade)))
    } else {
        let room = 0.05 * (y.1 - y.0);
        layout.with_y_axis_min(y.0 - room).with_y_axis_max(y.1 + room).with_y_tick_format(numbers())
    };
    draw(&plot.title, render_multiple(plots, layout.with_x_tick_format(numbers())))
}

/// PNG of paths side by side, the same axes for all, from dark (start) to bright (end).
///
/// # Errors
/// [`PlotError`] if nothing can be shown.
pub fn trace_png(trace: &Trace) -> Result<Vec<u8>, PlotError> {
    let empty = || PlotError::Empty(trace.title.clone());
    let x = window(&trace.paths, |p| p.0).ok_or_else(empty)?;
    let y = window(&trace.paths, |p| p.1).ok_or_else(empty)?;
    let total = trace.paths.iter().map(|path| path.points.len()).max().unwrap_or(0).max(1) as f64;
    let room = (0.04 * (x.1 - x.0), 0.04 * (y.1 - y.0));
    let (mut all, mut layouts) = (Vec::new(), Vec::new());
    for path in &trace.paths {
        let mut plots = Vec::new();
        // What leaves the window is a gap.
        let inside = |p: &(f64, f64)| x.0 <= p.0 && p.0 <= x.1 && y.0 <= p.1 && p.1 <= y.1;
        let points = path.points.iter().map(|p| if inside(p) { *p } else { (f64::NAN, f64::NAN) });
        let points: Vec<(f64, f64)> = points.collect();
        let piece = points.len().div_ceil(80).max(2);
        let mut start = 0;
        while start + 1 < points.len() {
            // Pieces share their end points.
            let end = (start + piece).min(points.len() - 1);
            let colour = ColorMap::Viridis.map(0.92 * start as f64 / total);
            for run in runs(&points[start..=end]) {
                plots.push(Plot::Line(Line::new().with_data(run).with_color(&*colour).with_stroke_width(1.4)));
            }
            start = end;
        }
        if let Some(&first) = points.iter().find(|p| fine(p.0) && fine(p.1)) {
            plots.push(Plot::Scatter(ScatterPlot::new().with_data(vec![first]).with_color("#D55E00").with_size(4.0)));
        }
        if plots.is_empty() {
            continue;
        }
        let title = if path.name.is_empty() { trace.title.clone() } else { format!("{}: {}", trace.title, path.name) };
        let layout = style(Layout::auto_from_plots(&plots), &title, &trace.x_label, &trace.y_label)
            .with_x_axis_min(x.0 - room.0)
            .with_x_axis_max(x.1 + room.0)
            .with_y_axis_min(y.0 - room.1)
            .with_y_axis_max(y.1 + room.1)
            .with_x_tick_format(numbers())
            .with_y_tick_format(numbers());
        layouts.push(if trace.equal { layout.with_equal_aspect() } else { layout });
        all.push(plots);
    }
    let panels = all.len();
    let scene = Figure::new(1, panels.max(1))
        .with_plots(all)
        .with_layouts(layouts)
        .with_cell_size(460.0, 420.0)
        .with_padding(24.0)
        .render();
    draw(&trace.title, scene)
}

/// PNG of grids side by side, each with its colour bar; gaps are grey.
///
/// # Errors
/// [`PlotError`] if a grid has no finite value or fewer than two values per axis.
pub fn heat_maps_png(maps: &[HeatMap]) -> Result<Vec<u8>, PlotError> {
    let title = maps.first().map(|map| map.title.clone()).unwrap_or_default();
    let (mut all, mut layouts) = (Vec::new(), Vec::new());
    for map in maps {
        let empty = || PlotError::Empty(map.title.clone());
        let columns = map.grid.x.len();
        let (low, high) = extremes(map.grid.values.iter().copied()).ok_or_else(empty)?;
        if columns < 2 || map.grid.y.len() < 2 || map.grid.values.len() != columns * map.grid.y.len() {
            return Err(empty());
        }
        let edges = |axis: &[f64]| {
            let half = 0.5 * (axis[axis.len() - 1] - axis[0]) / (axis.len() - 1) as f64;
            (axis[0] - half, axis[axis.len() - 1] + half)
        };
        let (x, y) = (edges(&map.grid.x), edges(&map.grid.y));
        let mut shown = map.range.unwrap_or((low, high));
        if map.diverging {
            let reach = shown.0.abs().max(shown.1.abs());
            shown = (-reach, reach);
        }
        let colours = if map.diverging { ColorMap::RedBlue } else { ColorMap::Viridis };
        // The renderer scales colours to the extremes of its data: undo that, to share one range between grids.
        let colour = move |fraction: f64| {
            let value = low + fraction * (high - low);
            let place = (value - shown.0) / (shown.1 - shown.0);
            if fraction.is_nan() {
                "#bdbdbd".to_string()
            } else if place.is_nan() {
                colours.map(0.5)
            } else {
                colours.map(place.clamp(0.0, 1.0))
            }
        };
        let finite = |z: f64| if fine(z) { z } else { f64::NAN };
        let rows = map.grid.values.chunks(columns).map(|row| row.iter().map(|&z| finite(z)).collect::<Vec<f64>>());
        // Rows are drawn from the bottom here: the y range runs upwards.
        let heat = Heatmap::new()
            .with_data(rows)
            .with_color_map(ColorMap::Custom(Arc::new(colour)))
            .with_x_range(x.0, x.1)
            .with_y_range(y.0, y.1)
            .with_cell_size(1.08);
        let mut plots = vec![Plot::Heatmap(heat)];
        if !map.marks.is_empty() {
            let marks = ScatterPlot::new().with_data(map.marks.clone()).with_color(COLOURS[1]).with_size(1.1);
            plots.push(Plot::Scatter(marks));
        }
        // The colour bar of a constant has no ticks.
        let title = if high > low { map.title.clone() } else { format!("{} = {}", map.title, number(low)) };
        layouts.push(
            style(Layout::auto_from_plots(&plots), &title, &map.x_label, &map.y_label)
                .with_show_grid(false)
                .with_x_axis_min(x.0)
                .with_x_axis_max(x.1)
                .with_y_axis_min(y.0)
                .with_y_axis_max(y.1)
                .with_clamp_axis()
                .with_x_tick_format(numbers())
                .with_y_tick_format(numbers())
                .with_colorbar_tick_format(numbers()),
        );
        all.push(plots);
    }
    if all.is_empty() {
        return Err(PlotError::Empty(title));
    }
    let panels = all.len();
    let scene = Figure::new(1, panels)
        .with_plots(all)
        .with_layouts(layouts)
        .with_cell_size(430.0, 370.0)
        .with_padding(24.0)
        .render();
    draw(&title, scene)
}

fn style(layout: Layout, title: &str, x_label: &str, y_label: &str) -> Layout {
    layout
        .with_title(plain(title))
        .with_x_label(plain(x_label))
        .with_y_label(plain(y_label))
        .with_title_size(17)
        .with_label_size(15)
        .with_tick_size(13)
        .with_body_size(13)
}

/// A text without mathematics: the renderer takes a dollar for its beginning.
fn plain(text: &str) -> String {
    text.replace('$', "\\$")
}

fn draw(title: &str, scene: kuva::render::render::Scene) -> Result<Vec<u8>, PlotError> {
    PngBackend::new().with_scale(2.0).render_scene(&scene).map_err(|error| PlotError::Renderer(title.into(), error))
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

/// Uninterrupted stretches of finite points, thinned to what a picture can show.
fn runs(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let stride = points.len().div_ceil(MAX_POINTS).max(1);
    let mut runs = vec![Vec::new()];
    let last = points.len().saturating_sub(1);
    for (k, &point) in points.iter().enumerate() {
        if !(fine(point.0) && fine(point.1)) {
            runs.push(Vec::new());
        } else if let Some(run) = runs.last_mut().filter(|_| k % stride == 0 || k == last) {
            run.push(point);
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}

fn numbers() -> TickFormat {
    TickFormat::Custom(Arc::new(number))
}

/// A tick in at most four digits.
fn number(x: f64) -> String {
    if x == 0.0 || x.abs() < 1e-300 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&x.abs()) {
        return format!("{x:.1e}").replace(".0e", "e");
    }
    let digits = (3 - x.abs().log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{x:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.replace('-', "\u{2212}")
}

/// A tick of a logarithmic axis.
fn decade(x: f64) -> String {
    if (1e-2..1e4).contains(&x) {
        return number(x);
    }
    let exponent = x.log10().round() as i32;
    let factor = x / 10f64.powi(exponent);
    if (factor - 1.0).abs() < 1e-6 { format!("1e{exponent}") } else { format!("{x:.0e}") }
}

#[cfg(test)]
mod tests;
