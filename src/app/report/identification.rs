//! Pictures of an identification and of a formula: what was measured and fitted, the residuals, their autocorrelation.

use super::{Figure, HeatMap, Level, LinePlot, Series, figure, file_part, heat_maps, line_plot, median_of, with_unit};
use crate::analysis::Grid;
use crate::formula::FoundFormula;
use crate::identification::{Identified, ResidualPath};
use crate::names::number;
use crate::report::thresholds::{DRAWN_COORDINATES, DRAWN_LAGS, LINE_POINTS};

/// Measured and fitted values for pictures.
struct Fitted<'a> {
    /// Names of the coordinates, as used in file names.
    names: Vec<&'a str>,
    /// `true` if forces on the coordinates were fitted.
    is_force: bool,
    units: Vec<&'static str>,
    noise: Vec<f64>,
    paths: &'a [ResidualPath],
}

/// Draws, for each coordinate, measured and fitted values of the segment with the median residual, all residuals over time, and their
/// autocorrelation; also the correlations of the constants. `periodic` marks coordinates that are angles.
pub fn identification_figures(found: &Identified, periodic: &[bool]) -> Vec<Figure> {
    let is_force = found.segments == 0;
    let fit = Fitted {
        names: found.residuals.iter().map(|residual| residual.coordinate.as_str()).collect(),
        is_force,
        units: units(periodic, is_force),
        noise: found.residuals.iter().map(|residual| residual.noise).collect(),
        paths: &found.paths,
    };
    fit.figures().chain(correlations(found)).collect()
}

/// Draws measured and fitted values of held-out motion like [`identification_figures`]; nothing for the formula of a model.
pub fn formula_figures(found: &FoundFormula) -> Vec<Figure> {
    let fit = Fitted {
        names: found.coordinates.iter().map(String::as_str).collect(),
        is_force: false,
        units: units(&found.periodic, false),
        noise: found.noise.clone(),
        paths: &found.paths,
    };
    if found.paths.is_empty() { Vec::new() } else { fit.figures().collect() }
}

fn units(periodic: &[bool], is_force: bool) -> Vec<&'static str> {
    periodic.iter().map(|angle| if *angle && !is_force { "rad" } else { "SI" }).collect()
}

impl Fitted<'_> {
    fn figures(&self) -> impl Iterator<Item = Figure> {
        (0..self.names.len().min(DRAWN_COORDINATES)).flat_map(|i| self.of(i)).flatten()
    }

    /// Draws the pictures of coordinate `i`.
    fn of(&self, i: usize) -> [Option<Figure>; 3] {
        let (name, unit, noise) = (self.names[i], self.units[i], number(self.noise[i]));
        let file = |what: &str| format!("{what}_{}.svg", file_part(name));
        let what = if self.is_force { format!("force on {name}") } else { name.to_string() };
        let noise = match self.is_force {
            true => format!("The fit weighs averages of these, whose noise is {noise}."),
            false => format!("The noise is {noise}."),
        };
        [
            figure(
                &file("fitted"),
                format!("Measured and fitted {what}"),
                line_plot(&self.fitted(i, &with_unit(&what, unit))),
                "The stretch whose residual is the median of all stretches.",
            ),
            figure(
                &file("residuals"),
                format!("Residuals of {what}"),
                line_plot(&self.residuals(i, unit)),
                format!("Measured minus fitted, at all samples. {noise}"),
            ),
            figure(
                &file("autocorrelation"),
                format!("Autocorrelation of the residuals of {what}"),
                line_plot(&self.lags(i, &what)),
                "That of a model that fits scatters about 0, apart from the lags within which the initial states of short stretches \
                 take up residuals.",
            ),
        ]
    }

    fn fitted(&self, i: usize, label: &str) -> LinePlot {
        let n = self.names.len();
        let errors: Vec<f64> = self.paths.iter().map(mean_square).collect();
        let path = median_of(&errors).map_or_else(ResidualPath::default, |k| self.paths[k].clone());
        let measured: Vec<f64> = column(&path.measured, n, i).collect();
        let fitted: Vec<f64> = measured.iter().zip(column(&path.residuals, n, i)).map(|(y, r)| y - r).collect();
        let lines = [("measured", &measured), ("fitted", &fitted)];
        let lines = lines.map(|(name, values)| Series::new(name, &path.times, values));
        let [measured, fitted] = lines;
        plot(["t [s]", label], vec![measured, fitted.over()])
    }

    fn residuals(&self, i: usize, unit: &str) -> LinePlot {
        let n = self.names.len();
        let samples: usize = self.paths.iter().map(|path| path.times.len()).sum();
        let stride = samples.div_ceil(LINE_POINTS).max(1);
        let mut points = Vec::new();
        for path in self.paths {
            points.extend(path.times.iter().copied().zip(column(&path.residuals, n, i)).step_by(stride));
            // A gap separates the segments.
            points.push((f64::NAN, f64::NAN));
        }
        let level = Some(Level { value: 0.0, name: String::new() });
        let series = vec![Series { name: String::new(), points, over: false }];
        LinePlot { level, ..plot(["t [s]", &format!("residual [{unit}]")], series) }
    }

    fn lags(&self, i: usize, what: &str) -> LinePlot {
        let n = self.names.len();
        let (mut sums, mut counts) = (vec![0.0; DRAWN_LAGS + 1], vec![0.0; DRAWN_LAGS + 1]);
        for path in self.paths {
            let values: Vec<f64> = column(&path.residuals, n, i).collect();
            for lag in 0..=DRAWN_LAGS.min(values.len().saturating_sub(1)) {
                for (a, b) in values.iter().zip(&values[lag..]).filter(|(a, b)| a.is_finite() && b.is_finite()) {
                    sums[lag] += a * b;
                    counts[lag] += 1.0;
                }
            }
        }
        let variance = sums[0] / f64::max(counts[0], 1.0);
        let seen: Vec<usize> = (1..=DRAWN_LAGS).filter(|&lag| counts[lag] > 1.0).collect();
        let over_lags = |of: &dyn Fn(usize) -> f64| seen.iter().map(|&lag| (lag as f64, of(lag))).collect::<Vec<_>>();
        let points = over_lags(&|lag| sums[lag] / counts[lag] / variance);
        let own = Series { name: what.to_string(), points, over: false };
        let bound = |sign: f64| over_lags(&|lag| sign * 1.96 / counts[lag].sqrt());
        let points = [bound(1.0), vec![(f64::NAN, f64::NAN)], bound(-1.0)].concat();
        let bounds = Series { name: "95 % of white noise".to_string(), points, over: false };
        let level = Some(Level { value: 0.0, name: String::new() });
        let series = vec![own, bounds];
        LinePlot { level, ..plot(["lag [samples]", "autocorrelation"], series) }
    }
}

/// Number of map points along the side of a cell.
const CELL: usize = 16;

/// Draws the correlations of the constants' errors as a map, with a cell for each pair.
fn correlations(found: &Identified) -> Option<Figure> {
    let names = &found.correlations.names;
    if names.len() < 2 {
        return None;
    }
    let places: Vec<f64> = (0..names.len() * CELL).map(|k| 0.5 + (k as f64 + 0.5) / CELL as f64).collect();
    let row = |row: &Vec<f64>| row.iter().flat_map(|&x| [x; CELL]).collect::<Vec<f64>>().repeat(CELL);
    let map = HeatMap {
        title: String::new(),
        x_label: "constant".to_string(),
        y_label: "constant".to_string(),
        grid: Grid { x: places.clone(), y: places, values: found.correlations.matrix.iter().flat_map(row).collect() },
        range: Some((-1.0, 1.0)),
        diverging: true,
        marks: Vec::new(),
        open: Vec::new(),
    };
    let names: Vec<String> = names.iter().enumerate().map(|(k, name)| format!("{}: {name}", k + 1)).collect();
    figure("correlations.svg", "Correlations of the constants", heat_maps(&[map]), names.join(", "))
}

/// Column `i` of `(samples, n)`.
fn column(values: &[f64], n: usize, i: usize) -> impl Iterator<Item = f64> + '_ {
    values.iter().skip(i).step_by(n).copied()
}

/// Mean square of the residuals of a segment.
fn mean_square(path: &ResidualPath) -> f64 {
    path.residuals.iter().filter(|r| r.is_finite()).map(|r| r * r).sum::<f64>() / path.times.len().max(1) as f64
}

fn plot([x_label, y_label]: [&str; 2], series: Vec<Series>) -> LinePlot {
    LinePlot { x_label: x_label.into(), y_label: y_label.into(), series, ..LinePlot::default() }
}
