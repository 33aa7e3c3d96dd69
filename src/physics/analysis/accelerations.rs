//! Errors of accelerations in physical units.

use super::summary::ErrorDistribution;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::scalar::Scalar;

/// `|a_learned - a_exact|` at a batch of states, one entry per coordinate, in the unit of its acceleration.
///
/// `q` and `v` are `(batch, n)` in physical units. States where either model fails are counted, not compared.
pub fn acceleration_errors<S: Scalar>(
    exact: &dyn EulerLagrange<S>,
    learned: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
) -> Vec<ErrorDistribution> {
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
            terms.acceleration.resize(q.len(), S::nan());
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
    errors.into_iter().map(|errors| ErrorDistribution::of(errors, failed)).collect()
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
