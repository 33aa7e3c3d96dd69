//! Points around a centre, and how far the metrics of two models are apart there.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};

/// Golden angle, and the ratio of the additive recurrence that goes with it: both fill evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
const RATIO: f64 = 0.754_877_666_246_692_8;
/// Points evaluated at once.
const CHUNK: usize = 512;

/// Distances, uniform in their logarithm, with the directions of a Fibonacci sphere.
pub(super) fn directions(points: usize, (low, high): (f64, f64)) -> impl Iterator<Item = (f64, [f64; 3])> {
    (0..points).map(move |k| {
        let (z, angle) = (1.0 - (2.0 * k as f64 + 1.0) / points as f64, GOLDEN_ANGLE * k as f64);
        let across = (1.0 - z * z).sqrt();
        (low * (high / low).powf((k as f64 * RATIO).fract()), [across * angle.cos(), across * angle.sin(), z])
    })
}

/// Metrics at points, at rest, `(points, n, n)`.
///
/// # Errors
/// Those of the model.
pub(super) fn metrics(model: &dyn EulerLagrange<f64>, points: &[f64]) -> Result<Vec<f64>, MechanicsError> {
    let n = model.coordinates();
    let (mut all, mut terms) = (Vec::with_capacity(points.len() * n), Terms::default());
    for chunk in points.chunks(CHUNK * n) {
        model.terms(chunk, &vec![0.0; chunk.len()], Request::MASS_MATRIX, &mut terms)?;
        all.extend_from_slice(&terms.mass_matrix);
    }
    Ok(all)
}

/// Errors of a metric over the size of the exact one, both by the Frobenius norm of the components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetricDeviation {
    /// Median of the points.
    pub median: f64,
    /// Error that 99 of 100 points do not exceed.
    pub p99: f64,
}

/// Factor `s` for which `s g` comes nearest to `h`, points of equal weight, each relative to the size of `g`.
pub(super) fn factor(n: usize, g: &[f64], h: &[f64]) -> f64 {
    let pairs = g.chunks_exact(n * n).zip(h.chunks_exact(n * n));
    let size = |g: &[f64]| g.iter().map(|x| x * x).sum::<f64>();
    let sum: f64 = pairs.clone().map(|(g, h)| g.iter().zip(h).map(|(a, b)| a * b).sum::<f64>() / size(g)).sum();
    sum / pairs.count().max(1) as f64
}

/// Deviation of `learned/factor` from `exact` at points.
///
/// # Errors
/// Those of the models.
pub fn metric_deviation(
    (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>),
    factor: f64,
    points: &[f64],
) -> Result<MetricDeviation, MechanicsError> {
    let n = exact.coordinates();
    let (g, h) = (metrics(exact, points)?, metrics(learned, points)?);
    let pairs = g.chunks_exact(n * n).zip(h.chunks_exact(n * n));
    let mut errors: Vec<f64> = pairs
        .map(|(g, h)| {
            let size: f64 = g.iter().map(|x| x * x).sum();
            (g.iter().zip(h).map(|(a, b)| (a - b / factor).powi(2)).sum::<f64>() / size).sqrt()
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let at = |share: usize| errors.get((errors.len() * share / 100).min(errors.len().max(1) - 1)).copied();
    Ok(MetricDeviation { median: at(50).unwrap_or(f64::NAN), p99: at(99).unwrap_or(f64::NAN) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::build;
    use crate::relativity::{Around, Chart};

    #[test]
    fn directions_and_distances_fill_a_shell_evenly() {
        type Place = (f64, [f64; 3]);
        let all: Vec<Place> = directions(1000, (1.0, 100.0)).collect();
        let mean = |of: &dyn Fn(&Place) -> f64| all.iter().map(of).sum::<f64>() / 1000.0;
        assert!((mean(&|(r, _)| r.ln()) - 10.0_f64.ln()).abs() < 0.01);
        for i in 0..3 {
            assert!(mean(&|(_, d)| d[i]).abs() < 5e-3);
            assert!((mean(&|(_, d)| d[i] * d[i]) - 1.0 / 3.0).abs() < 5e-3);
        }
    }

    #[test]
    fn the_deviation_of_a_metric_is_that_of_its_components() {
        let around = Around::Cartesian(Chart::default());
        let with =
            |mass: &str| build::<f64>("schwarzschild-cartesian", &[("M".to_string(), mass.to_string())]).unwrap();
        let (exact, other) = (with("1"), with("1.01"));
        let points = around.points(500, (10.0, 10.0));
        let same = metric_deviation((&*exact, &*exact), 1.0, &points).unwrap();
        assert_eq!((same.median, same.p99), (0.0, 0.0));
        // f = 2 M/r changes by 0.002 in the direction of a null vector of length sqrt 2 in all four coordinates.
        let found = metric_deviation((&*exact, &*other), 1.0, &points).unwrap();
        let size = metrics(&*exact, &points[..4]).unwrap().iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!((found.median - 0.004 / size).abs() < 1e-6 && (found.p99 - found.median).abs() < 1e-9, "{found:?}");
        let scaled: Vec<f64> = metrics(&*exact, &points).unwrap().iter().map(|x| 2.5 * x).collect();
        assert!((factor(4, &metrics(&*exact, &points).unwrap(), &scaled) - 2.5).abs() < 1e-14);
    }
}
