//! Pictures of an identification: what was measured and fitted, the residuals, their autocorrelation.

use super::{Figure, HeatMap, Level, LinePlot, Series, figure, file_part, heat_maps, line_plot};
use crate::analysis::Grid;
use crate::identification::{Identified, ResidualPath};
use crate::names::number;

/// Coordinates that have pictures.
const COORDINATES: usize = 8;
/// Points of a line, at most.
const POINTS: usize = 4000;
/// Largest lag of an autocorrelation, in samples.
const LAGS: usize = 40;

/// Measured and fitted values of the stretch with the median residual, all residuals over time, and their autocorrelation, for each
/// coordinate; the correlations of the constants. `periodic` are the coordinates that are angles.
pub fn identification_figures(found: &Identified, periodic: &[bool]) -> Vec<Figure> {
    let n = found.residuals.len();
    let of = |i: usize| {
        let name = &found.residuals[i].coordinate;
        let file = |what: &str| format!("{what}_{}.svg", file_part(name));
        let (what, unit) = match (found.segments, periodic.get(i)) {
            (0, _) => (format!("force on {name}"), "SI"),
            (_, Some(true)) => (name.clone(), "rad"),
            _ => (name.clone(), "SI"),
        };
        let [fitted, residuals, correlation] =
            [fitted(found, i, unit), residuals(found, i, unit), lags(found, i, &what)];
        [
            figure(
                &file("fitted"),
                format!("Measured and fitted {what}"),
                line_plot(&fitted),
                "The stretch whose residual is the median of all stretches.",
            ),
            figure(
                &file("residuals"),
                format!("Residuals of {what}"),
                line_plot(&residuals),
                format!("Measured minus fitted, at all samples. The noise is {}.", number(found.residuals[i].noise)),
            ),
            figure(
                &file("autocorrelation"),
                format!("Autocorrelation of the residuals of {what}"),
                line_plot(&correlation),
                "That of a model that fits scatters about 0, apart from the lags within which the initial states of short stretches \
                 take up residuals.",
            ),
        ]
    };
    (0..n.min(COORDINATES)).flat_map(of).flatten().chain(correlations(found)).collect()
}

/// Points of a map along the side of a cell.
const CELL: usize = 16;

/// Correlations of the errors of the constants as a map, a cell for each pair.
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
    };
    let names: Vec<String> = names.iter().enumerate().map(|(k, name)| format!("{}: {name}", k + 1)).collect();
    figure("correlations.svg", "Correlations of the constants", heat_maps(&[map]), names.join(", "))
}

/// Column `i` of `(samples, n)`.
fn column(values: &[f64], n: usize, i: usize) -> impl Iterator<Item = f64> + '_ {
    values.iter().skip(i).step_by(n).copied()
}

/// Sum of squares of the residuals of a stretch over its samples.
fn mean_square(path: &ResidualPath) -> f64 {
    path.residuals.iter().filter(|r| r.is_finite()).map(|r| r * r).sum::<f64>() / path.times.len().max(1) as f64
}

fn plot([title, x_label, y_label]: [&str; 3], series: Vec<Series>) -> LinePlot {
    let (title, x_label, y_label) = (title.into(), x_label.into(), y_label.into());
    LinePlot { title, x_label, y_label, log_y: false, turn: None, level: None, series }
}

fn fitted(found: &Identified, i: usize, unit: &str) -> LinePlot {
    let n = found.residuals.len();
    let mut order: Vec<&ResidualPath> = found.paths.iter().collect();
    order.sort_by(|a, b| mean_square(a).total_cmp(&mean_square(b)));
    let path = order.get(order.len() / 2).map_or_else(ResidualPath::default, |path| (*path).clone());
    let measured: Vec<f64> = column(&path.measured, n, i).collect();
    let fitted: Vec<f64> = measured.iter().zip(column(&path.residuals, n, i)).map(|(y, r)| y - r).collect();
    let lines = [("measured", &measured), ("fitted", &fitted)];
    let lines = lines.map(|(name, values)| Series::new(name, &path.times, values));
    let [measured, fitted] = lines;
    plot(["", "t [s]", &format!("value [{unit}]")], vec![measured, fitted.over()])
}

fn residuals(found: &Identified, i: usize, unit: &str) -> LinePlot {
    let n = found.residuals.len();
    let samples: usize = found.paths.iter().map(|path| path.times.len()).sum();
    let stride = samples.div_ceil(POINTS).max(1);
    let mut points = Vec::new();
    for path in &found.paths {
        points.extend(path.times.iter().copied().zip(column(&path.residuals, n, i)).step_by(stride));
        // Stretches are not joined.
        points.push((f64::NAN, f64::NAN));
    }
    let level = Some(Level { value: 0.0, name: String::new() });
    let series = vec![Series { name: String::new(), points, over: false }];
    LinePlot { level, ..plot(["", "t [s]", &format!("residual [{unit}]")], series) }
}

fn lags(found: &Identified, i: usize, what: &str) -> LinePlot {
    let n = found.residuals.len();
    let (mut sums, mut counts) = (vec![0.0; LAGS + 1], vec![0.0; LAGS + 1]);
    for path in &found.paths {
        let values: Vec<f64> = column(&path.residuals, n, i).collect();
        for lag in 0..=LAGS.min(values.len().saturating_sub(1)) {
            for (a, b) in values.iter().zip(&values[lag..]).filter(|(a, b)| a.is_finite() && b.is_finite()) {
                sums[lag] += a * b;
                counts[lag] += 1.0;
            }
        }
    }
    let variance = sums[0] / f64::max(counts[0], 1.0);
    let seen: Vec<usize> = (1..=LAGS).filter(|&lag| counts[lag] > 1.0).collect();
    let over_lags = |of: &dyn Fn(usize) -> f64| seen.iter().map(|&lag| (lag as f64, of(lag))).collect::<Vec<_>>();
    let points = over_lags(&|lag| sums[lag] / counts[lag] / variance);
    let own = Series { name: what.to_string(), points, over: false };
    let bound = |sign: f64| over_lags(&|lag| sign * 1.96 / counts[lag].sqrt());
    let points = [bound(1.0), vec![(f64::NAN, f64::NAN)], bound(-1.0)].concat();
    let bounds = Series { name: "95 % of white noise".to_string(), points, over: false };
    let level = Some(Level { value: 0.0, name: String::new() });
    let series = vec![own, bounds];
    LinePlot { level, ..plot(["", "lag [samples]", "autocorrelation"], series) }
}
