//! Sizes of known forces, of the inertias that they move, and of the errors to expect from a model.

use super::thresholds::FORCE_ERROR;
use crate::data::dataset::{Dataset, DatasetError};
use crate::network::Sizes;
use crate::recording::INERTIAL_SHARE;
use crate::scalar::Scalar;

/// Mean, standard deviation and root mean square of column `i` of `(states, n)` numbers.
fn moments<S: Scalar>(values: &[S], n: usize, i: usize) -> [f64; 3] {
    let column = || values.iter().skip(i).step_by(n).map(|x| x.to_f64());
    let count = column().count().max(1) as f64;
    let mean = column().sum::<f64>() / count;
    let variance = column().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    [mean, variance.sqrt(), mean.hypot(variance.sqrt())]
}

/// Spread of the known force of every coordinate, `(n)`.
pub(crate) fn force_spreads<S: Scalar>(data: &Dataset<S>) -> Vec<f64> {
    let n = data.coordinates();
    (0..n).map(|i| moments(data.force(), n, i)[1]).collect()
}

/// Inertia along every coordinate, `(n)` in physical units, estimated by assuming that a fixed share of the force causes the acceleration.
fn inertias<S: Scalar>(data: &Dataset<S>) -> Vec<f64> {
    let n = data.coordinates();
    let one = |(i, spread): (usize, f64)| {
        let acceleration = moments(data.a(), n, i)[1];
        if acceleration > 0.0 && spread > 0.0 { INERTIAL_SHARE * spread / acceleration } else { 1.0 }
    };
    force_spreads(data).into_iter().enumerate().map(one).collect()
}

/// Expected sizes of the terms of a model, from states with known forces and the scales of the coordinates.
pub(crate) fn sizes<S: Scalar>(data: &Dataset<S>, scale: &[f64]) -> Sizes {
    let n = data.coordinates();
    let positive = |size: f64| if size.is_finite() && size > 0.0 { size } else { 1.0 };
    let velocity = inertias(data).into_iter().zip(scale).map(|(inertia, s)| positive(s * inertia.sqrt())).collect();
    let friction = force_spreads(data).into_iter().zip(scale).map(|(spread, s)| positive(s * spread)).collect();
    let potential = (0..n).map(|i| scale[i] * moments(data.force(), n, i)[2]).fold(0.0, f64::max);
    Sizes { velocity, potential: positive(potential), friction }
}

/// Sets residuals of force, scaled by the expected errors: the noise of the forces, the noise of the accelerations times the inertia, both
/// `(n)` in physical units, and a share of the spread of the force.
///
/// # Errors
/// As [`Dataset::with_force_residuals`].
pub(crate) fn by_forces<S: Scalar>(
    data: Dataset<S>,
    like: &Dataset<S>,
    [force, acceleration]: [&[f64]; 2],
) -> Result<Dataset<S>, DatasetError> {
    let errors = force.iter().zip(inertias(like).into_iter().zip(acceleration)).zip(force_spreads(like));
    let scale = errors.map(|((noise, (inertia, error)), spread)| {
        let all = noise.hypot(inertia * error).hypot(FORCE_ERROR * spread);
        S::of_f64(all)
    });
    let scale = scale.collect();
    data.with_force_residuals(scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forces on 4 kg and 1 kg, the second together with a constant weight.
    fn driven() -> Dataset<f64> {
        let wave = |k: usize, phase: f64| (std::f64::consts::TAU * k as f64 / 40.0 + phase).sin();
        let rows = || (0..400).map(|k| [wave(k, 0.0), wave(k, 1.0)]);
        let a: Vec<f64> = rows().flatten().collect();
        let force = rows().flat_map(|[a, b]| [4.0 * a, b + 30.0]).collect();
        Dataset::new(2, a.clone(), a.clone(), a).unwrap().with_forces(force).unwrap()
    }

    #[test]
    fn sizes_are_those_of_the_forces_and_of_what_they_move() {
        let found = sizes(&driven(), &[1.0, 2.0]);
        // The squared factors are inertias in scaled coordinates: half of what they would be if the whole force caused acceleration.
        let inertia: Vec<f64> = found.velocity.iter().map(|v| v * v).collect();
        assert!((inertia[0] - 2.0).abs() < 1e-9 && (inertia[1] - 2.0).abs() < 1e-9, "{inertia:?}");
        assert!((found.potential / 60.0 - 1.0).abs() < 1e-3, "{}", found.potential);
        let ratio = found.friction[0] / found.friction[1];
        assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
    }

    #[test]
    fn residuals_count_over_the_errors_to_expect() {
        let data = driven();
        let scale = |noise: [f64; 2], error: [f64; 2]| {
            let found = by_forces(data.clone(), &data, [&noise, &error]).unwrap();
            found.force_scale().to_vec()
        };
        let spread = force_spreads(&data);
        let quiet = scale([0.0; 2], [0.0; 2]);
        assert!((quiet[0] / spread[0] - 0.1).abs() < 1e-12 && (quiet[1] / spread[1] - 0.1).abs() < 1e-12);
        // Noise of a force enters the residual directly, noise of an acceleration through the inertia.
        assert!((scale([30.0, 0.0], [0.0; 2])[0] / 30.0 - 1.0).abs() < 1e-3);
        assert!((scale([0.0; 2], [0.0, 100.0])[1] / 50.0 - 1.0).abs() < 1e-3);
        let still = Dataset::new(1, vec![1.0; 3], vec![1.0; 3], vec![1.0; 3]).unwrap();
        assert!(by_forces(still.clone(), &still, [&[0.1], &[0.1]]).is_err());
        let unforced = still.clone().with_forces(vec![0.0; 3]).unwrap();
        assert!(by_forces(unforced.clone(), &unforced, [&[0.0], &[0.0]]).is_err());
    }
}
