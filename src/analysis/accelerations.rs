//! Errors of accelerations in physical units.

use super::summary::quantile;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Distribution of `|a_learned - a_exact|` of one coordinate, in the unit of its acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AccelerationError {
    /// Mean absolute error.
    pub mean: f64,
    /// Root of the mean squared error.
    pub rms: f64,
    /// Median absolute error.
    pub median: f64,
    /// 95 % of the states are better.
    pub p95: f64,
    /// 99 % of the states are better.
    pub p99: f64,
    /// Largest absolute error.
    pub max: f64,
    /// States compared.
    pub count: usize,
    /// States left out because a model has no finite acceleration there.
    pub failed: usize,
}

/// Errors of `learned` against `exact` at a batch of states, one entry per coordinate.
///
/// `q` and `v` are `(batch, n)` in physical units. States where either model fails are counted, not compared.
pub fn acceleration_errors<S: Scalar>(
    exact: &dyn EulerLagrange<S>,
    learned: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
) -> Vec<AccelerationError> {
    const CHUNK: usize = 256;
    let n = exact.coordinates();
    let mut errors = vec![Vec::new(); n];
    let mut failed = 0;
    let (mut a, mut b) = (Terms::default(), Terms::default());
    let size = CHUNK * n.max(1);
    for (q, v) in q.chunks(size).zip(v.chunks(size)) {
        for (model, terms) in [(exact, &mut a), (learned, &mut b)] {
            terms.acceleration.clear();
            // Failed rows are `NaN` in the result; the others are right.
            let _ = model.terms(q, v, Request::ACCELERATION, terms);
            terms.acceleration.resize(q.len(), S::NAN);
        }
        for (a, b) in a.acceleration.chunks(n).zip(b.acceleration.chunks(n)) {
            if a.iter().chain(b).all(|x| x.is_finite()) {
                for (errors, (&a, &b)) in errors.iter_mut().zip(a.iter().zip(b)) {
                    errors.push((a - b).abs().to_f64());
                }
            } else {
                failed += 1;
            }
        }
    }
    errors.into_iter().map(|errors| distribution(errors, failed)).collect()
}

fn distribution(mut errors: Vec<f64>, failed: usize) -> AccelerationError {
    errors.sort_by(f64::total_cmp);
    let count = errors.len();
    let mean = |map: fn(f64) -> f64| errors.iter().map(|&e| map(e)).sum::<f64>() / count as f64;
    AccelerationError {
        mean: mean(|e| e),
        rms: mean(|e| e * e).sqrt(),
        median: quantile(&errors, 0.5),
        p95: quantile(&errors, 0.95),
        p99: quantile(&errors, 0.99),
        max: quantile(&errors, 1.0),
        count,
        failed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::models::{OSCILLATOR, PENDULUM, SINGULAR};

    #[test]
    fn known_distribution() {
        let q: Vec<f64> = (0..=1000).map(|k| 0.001 * f64::from(k)).collect();
        let error = acceleration_errors(&OSCILLATOR, &PENDULUM, &q, &vec![0.0; q.len()])[0];
        // |q - sin q| grows with q.
        assert!((error.max - (1.0 - 1.0_f64.sin())).abs() < 1e-12);
        assert!((error.median - (0.5 - 0.5_f64.sin())).abs() < 1e-12);
        let mean = 0.5 - (1.0 - 1.0_f64.cos());
        assert!((error.mean - mean).abs() < 1e-3 * mean + 1e-4, "{error:?}");
        assert!(error.rms > error.mean && error.p95 < error.p99 && error.p99 < error.max);
        assert_eq!((error.count, error.failed), (1001, 0));
    }

    #[test]
    fn failures_are_counted() {
        let error = acceleration_errors::<f64>(&OSCILLATOR, &SINGULAR, &[-2.0, 0.0], &[0.0, 0.0])[0];
        assert_eq!((error.count, error.failed, error.max), (1, 1, 1.0));
        let none = acceleration_errors::<f64>(&OSCILLATOR, &SINGULAR, &[], &[])[0];
        assert!(none.mean.is_nan() && none.count == 0);
    }
}
