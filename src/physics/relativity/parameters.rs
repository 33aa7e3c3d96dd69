//! Parameters of a system whose metric comes nearest to a learned one: mass, spin, charge.

use crate::analysis::{matrices_at_rest, nearest_factor};
use crate::lagrangian::{EulerLagrange, SystemInstance, configure_values};
use crate::linalg::{Workspace, solve};
use std::collections::BTreeMap;

/// Steps of Levenberg and Marquardt, at most.
const STEPS: usize = 60;
/// Change of a parameter by which derivatives are taken, relative; the result does not depend on it.
const DIFFERENCE: f64 = 1e-5;

/// Values by symbol.
type Values = BTreeMap<String, f64>;

/// Residuals of the metric of a system with these parameters beside a learned one, each point relative to the size of its metric, after
/// the best factor; `None` where there is no such system.
fn residuals(system: &SystemInstance<f64>, values: &Values, learned: &[f64], points: &[f64]) -> Option<Vec<f64>> {
    let model = configure_values::<f64>(system.system.clone(), values).ok()?.build().ok()?;
    let n = model.coordinates();
    let exact = matrices_at_rest(model.as_ref(), points);
    let factor = nearest_factor(n * n, &exact, learned);
    let pairs = exact.chunks_exact(n * n).zip(learned.chunks_exact(n * n));
    let all: Vec<f64> = pairs
        .flat_map(|(g, h)| {
            let size = g.iter().map(|x| x * x).sum::<f64>().sqrt();
            g.iter().zip(h).map(move |(a, b)| (factor * b - a) / size)
        })
        .collect();
    all.iter().all(|x| x.is_finite()).then_some(all)
}

fn square(residuals: &[f64]) -> f64 {
    residuals.iter().map(|r| r * r).sum()
}

/// The values of the parameters of `system`, by symbol, for which its metric comes nearest to that of `learned` up to a factor at `points`,
/// `(points, n)`: least squares by the method of Levenberg and Marquardt from `start`;
/// `None` where one of the two metrics is not finite.
pub fn nearest_parameters(
    system: &SystemInstance<f64>,
    learned: &dyn EulerLagrange<f64>,
    points: &[f64],
    start: &Values,
) -> Option<Values> {
    let learned = matrices_at_rest(learned, points);
    let of = |values: &Values| residuals(system, values, &learned, points);
    let (mut values, symbols) = (start.clone(), start.keys().cloned().collect::<Vec<_>>());
    let (mut now, count) = (of(&values)?, symbols.len());
    let (mut damping, mut workspace) = (1e-3, Workspace::default());
    for _ in 0..STEPS {
        let mut columns = Vec::with_capacity(count);
        for symbol in &symbols {
            let step = DIFFERENCE * (1.0 + values[symbol].abs());
            let moved = |by: f64| {
                let mut values = values.clone();
                values.entry(symbol.clone()).and_modify(|x| *x += by);
                of(&values)
            };
            let (more, less) = (moved(step)?, moved(-step)?);
            columns.push(more.iter().zip(&less).map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<f64>>());
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut normal: Vec<f64> = columns.iter().flat_map(|a| columns.iter().map(move |b| dot(a, b))).collect();
        let down: Vec<f64> = columns.iter().map(|column| -dot(column, &now)).collect();
        (0..count).for_each(|k| normal[k * count + k] *= 1.0 + damping);
        let mut step = vec![0.0; count];
        solve(count, &normal, &down, &mut step, &mut workspace).ok()?;
        let mut trial = values.clone();
        symbols.iter().zip(&step).for_each(|(symbol, step)| *trial.entry(symbol.clone()).or_default() += step);
        let small = symbols.iter().zip(&step).all(|(symbol, step)| step.abs() < 1e-12 * (1.0 + values[symbol].abs()));
        match of(&trial).filter(|then| square(then) <= square(&now)) {
            Some(then) => (values, now, damping) = (trial, then, damping * 0.1),
            None => damping *= 10.0,
        }
        if small || damping > 1e12 {
            break;
        }
    }
    Some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{build, configure};
    use crate::relativity::{CentralCoordinates, Chart};

    #[test]
    fn mass_and_spin_are_found_from_far_off() {
        let around = CentralCoordinates::Cartesian(Chart::default());
        let given = [("M".to_string(), "1.3".to_string()), ("a".to_string(), "-0.7".to_string())];
        let (hole, system) =
            (build::<f64>("kerr-cartesian", &given).unwrap(), configure("kerr-cartesian", &[]).unwrap());
        let start = [("M".to_string(), 0.8), ("a".to_string(), 0.2)].into();
        let points = around.points(200, (2.0, 20.0));
        let found = nearest_parameters(&system, &*hole, &points, &start).unwrap();
        assert!((found["M"] - 1.3).abs() < 1e-9 && (found["a"] + 0.7).abs() < 1e-9, "{found:?}");
    }
}
