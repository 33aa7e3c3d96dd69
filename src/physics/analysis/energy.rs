//! Energy error of a trajectory and drift of its learned energy.

use super::{Statistics, statistics};
use crate::lagrangian::EulerLagrange;
use crate::rollout::Trajectory;
use crate::scalar::Scalar;

/// Normalised energy error over time, without unit.
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyError {
    /// Times.
    pub t: Vec<f64>,
    /// `|E(t) - E(0)| / max(|E(0)|, scale)`.
    pub error: Vec<f64>,
    /// `E(0)`.
    pub initial: f64,
}

impl EnergyError {
    /// Mean, maximum and last value.
    pub(crate) fn statistics(&self) -> Statistics {
        statistics(self.error.iter().copied())
    }
}

/// The energy of the exact system along any trajectory, a learned one above all: `|E(t) - E(0)| / max(|E(0)|, scale)`.
///
/// `scale`, in units of energy, keeps the quotient meaningful where `E(0)` is near 0; a natural choice is the kinetic
/// energy of a typical state.
pub fn energy_error<S: Scalar>(exact: &dyn EulerLagrange<S>, trajectory: &Trajectory<S>, scale: S) -> EnergyError {
    normalised(trajectory, &trajectory.energy_by(exact), scale)
}

/// The same with the energies stored in the trajectory, those of the model that moved: how well the integration keeps
/// the learned energy. Empty if none are stored.
pub fn energy_drift<S: Scalar>(trajectory: &Trajectory<S>, scale: S) -> EnergyError {
    normalised(trajectory, trajectory.energy.as_deref().unwrap_or_default(), scale)
}

fn normalised<S: Scalar>(trajectory: &Trajectory<S>, energy: &[S], scale: S) -> EnergyError {
    let initial = energy.first().copied().unwrap_or(S::nan());
    let by = S::max(initial.abs(), scale.abs());
    EnergyError {
        t: trajectory.t.iter().zip(energy).map(|(t, _)| t.to_f64()).collect(),
        error: energy.iter().map(|&e| ((e - initial).abs() / by).to_f64()).collect(),
        initial: initial.to_f64(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::models::{OSCILLATOR, PENDULUM};
    use crate::rollout::{Options, rollout};

    #[test]
    fn exact_motion_keeps_it_and_foreign_motion_does_not() {
        let options = Options::<f64>::reference(10.0, 0.1);
        let own = rollout(&PENDULUM, &[2.0], &[0.0], &options).trajectory;
        let error = energy_error(&PENDULUM, &own, 0.0);
        assert!(error.statistics().max < 1e-10, "{:e}", error.statistics().max);
        assert!((error.initial + 2.0_f64.cos()).abs() < 1e-15);
        assert!(energy_drift(&own, 0.0).statistics().max < 1e-10);

        let foreign = rollout(&OSCILLATOR, &[2.0], &[0.0], &options).trajectory;
        let error = energy_error(&PENDULUM, &foreign, 0.0);
        // At the lowest point: kinetic 2, potential -1, against -cos 2.
        let expected = (1.0 + 2.0_f64.cos()) / 2.0_f64.cos().abs();
        assert!((error.statistics().max - expected).abs() < 0.02 * expected, "{:?}", error.statistics());
        assert!(energy_drift(&foreign, 0.0).statistics().max < 1e-10);
    }

    #[test]
    fn the_scale_bounds_the_denominator() {
        let still = Trajectory { coordinates: 1, t: vec![0.0, 1.0], q: vec![0.0, 1.0], v: vec![0.0; 2], energy: None };
        assert_eq!(energy_error(&OSCILLATOR, &still, 2.0).error, [0.0, 0.25]);
        assert!(energy_drift(&still, 1.0).error.is_empty());
    }
}
