//! Errors of the energy and of other quantities that the exact motion conserves; the steady loss of energy in recorded motion, which
//! indicates friction.

use super::thresholds::{
    FRICTION_SIGNIFICANCE, LEAST_LOSING, LEAST_LOSS, LEAST_STRETCH_ENERGIES, LEAST_STRETCH_SAMPLES, LEAST_STRETCHES,
    LOSS_STRETCHES, STRETCH_SAMPLES,
};
use super::{Statistics, statistics};
use crate::data::Split;
use crate::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use crate::rollout::Trajectory;
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

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

    /// Error of the exact system's energy along any trajectory, above all a learned one: `|E(t) - E(0)| / max(|E(0)|, scale)`.
    ///
    /// `scale`, in units of energy, keeps the quotient meaningful where `E(0)` is near 0; a natural choice is the kinetic
    /// energy of a typical state.
    pub fn of<S: Scalar>(exact: &dyn EulerLagrange<S>, trajectory: &Trajectory<S>, scale: S) -> Self {
        normalised(trajectory, &trajectory.energy_by(exact), scale)
    }
}

/// As [`EnergyError::of`], with the energies stored in the trajectory, those of the model that moved: how well the integration conserves the
/// learned energy. Empty if none are stored.
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

/// `|C - C(0)| / |C(0)|` (Euclidean norms), by `C(0)` and `C`.
pub(crate) fn conserved_change(first: &[f64], vector: &[f64]) -> f64 {
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    distance(vector, first) / distance(first, &vec![0.0; first.len()])
}

/// `|C(t) - C(0)| / |C(0)|` (Euclidean norms) of the system's conserved vector along any trajectory, one value per sample; `None` for a
/// system without one, or if the trajectory has another number of coordinates.
///
/// `NaN` where both `C(0)` and the difference vanish.
pub fn conserved_error<S: Scalar>(system: &SystemInstance<S>, trajectory: &Trajectory<S>) -> Option<Vec<f64>> {
    system.system.conserved?;
    let vectors: Option<Vec<Vec<f64>>> = (0..trajectory.len())
        .map(|k| {
            let (q, v) = trajectory.state(k);
            system.conserved(q, v)
        })
        .collect();
    let vectors = vectors?;
    let Some(first) = vectors.first() else { return Some(Vec::new()) };
    Some(vectors.iter().map(|vector| conserved_change(first, vector)).collect())
}

/// Energy that recorded motion loses by a model that conserves it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyLoss {
    /// Mean loss per second over the mean kinetic energy `p.v/2`; negative where energy is gained.
    pub per_second: f64,
    /// Its standard error, from the scatter between stretches.
    pub error: f64,
    /// Fraction of the segments that lose energy.
    pub losing: f64,
    /// Stretches examined.
    pub stretches: usize,
    /// Mean length of a stretch in s.
    pub seconds: f64,
}

impl EnergyLoss {
    /// `true` if motion loses energy steadily: in nearly all stretches, significantly, and by a relevant amount.
    pub(crate) fn is_steady(&self) -> bool {
        let lost = self.per_second * self.seconds;
        let significant = self.per_second > FRICTION_SIGNIFICANCE * self.error;
        self.stretches >= LEAST_STRETCHES && significant && self.losing >= LEAST_LOSING && lost > LEAST_LOSS
    }
}

/// Energy lost along the estimated states of recorded motion, with the work of known forces subtracted: the slope of straight lines through
/// `E - work` over stretches of the trajectories. `None` if the model gives no energy.
pub fn energy_loss(model: &dyn EulerLagrange<f64>, part: &Split) -> Option<EnergyLoss> {
    let n = model.coordinates();
    let pieces = LOSS_STRETCHES.div_ceil(part.states.len().max(1)).max(1);
    let (mut slopes, mut seconds) = (Vec::new(), 0.0);
    let (mut kinetic, mut count) = (0.0, 0.0);
    let mut terms = Terms::default();
    for (track, states) in part.recording.tracks.iter().zip(&part.states) {
        let rows = states.interior();
        let length = rows.len() / pieces;
        for first in
            (rows.start..rows.end).step_by(length.max(1)).take(pieces).filter(|_| length >= LEAST_STRETCH_SAMPLES)
        {
            let stride = length.div_ceil(STRETCH_SAMPLES);
            let (mut line, mut work) = (Vec::new(), 0.0);
            for row in first..first + length {
                let at = |values: &[f64], row: usize| values[row * n..(row + 1) * n].to_vec();
                let power = |row: usize| -> f64 {
                    let force = track.force.get(row * n..(row + 1) * n).unwrap_or_default();
                    force.iter().zip(&states.v[row * n..]).map(|(f, v)| f * v).sum()
                };
                if row > first {
                    work += 0.5 * (power(row) + power(row - 1)) * (states.times[row] - states.times[row - 1]);
                }
                if (row - first) % stride == 0 {
                    let (q, v) = (at(&states.q, row), at(&states.v, row));
                    if model.terms(&q, &v, Request::ENERGY, &mut terms).is_ok() && terms.energy[0].is_finite() {
                        line.push((states.times[row], terms.energy[0] - work));
                        kinetic += 0.5 * terms.momentum.iter().zip(&v).map(|(p, v)| p * v).sum::<f64>();
                        count += 1.0;
                    }
                }
            }
            if line.len() >= LEAST_STRETCH_ENERGIES {
                seconds += line[line.len() - 1].0 - line[0].0;
                slopes.push(slope(&line));
            }
        }
    }
    let number = slopes.len() as f64;
    let unit = (kinetic / count).abs();
    let mean = slopes.iter().sum::<f64>() / number;
    let variance = slopes.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (number - 1.0);
    let loss = EnergyLoss {
        per_second: -mean / unit,
        error: (variance / number).sqrt() / unit,
        losing: slopes.iter().filter(|s| **s < 0.0).count() as f64 / number,
        stretches: slopes.len(),
        seconds: seconds / number,
    };
    (loss.per_second.is_finite() && loss.error.is_finite()).then_some(loss)
}

/// Slope of the line of least squares through points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let (t, e) = points.iter().fold((0.0, 0.0), |(t, e), p| (t + p.0 / count, e + p.1 / count));
    let (up, down) =
        points.iter().fold((0.0, 0.0), |(up, down), p| (up + (p.0 - t) * (p.1 - e), down + (p.0 - t).powi(2)));
    up / down
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::StartBox;
    use crate::lagrangian::System;
    use crate::models::{OSCILLATOR, PENDULUM};
    use crate::rollout::{RolloutOptions, rollout};

    #[test]
    fn exact_motion_keeps_it_and_foreign_motion_does_not() {
        let options = RolloutOptions::<f64>::reference(10.0, 0.1);
        let own = rollout(&PENDULUM, &[2.0], &[0.0], &options).trajectory;
        let error = EnergyError::of(&PENDULUM, &own, 0.0);
        assert!(error.statistics().max < 1e-10, "{:e}", error.statistics().max);
        assert!((error.initial + 2.0_f64.cos()).abs() < 1e-15);
        assert!(energy_drift(&own, 0.0).statistics().max < 1e-10);

        let foreign = rollout(&OSCILLATOR, &[2.0], &[0.0], &options).trajectory;
        let error = EnergyError::of(&PENDULUM, &foreign, 0.0);
        // At the lowest point: kinetic 2, potential -1, against -cos 2.
        let expected = (1.0 + 2.0_f64.cos()) / 2.0_f64.cos().abs();
        assert!((error.statistics().max - expected).abs() < 0.02 * expected, "{:?}", error.statistics());
        assert!(energy_drift(&foreign, 0.0).statistics().max < 1e-10);
    }

    #[test]
    fn the_scale_bounds_the_denominator() {
        let still = Trajectory { coordinates: 1, t: vec![0.0, 1.0], q: vec![0.0, 1.0], v: vec![0.0; 2], energy: None };
        assert_eq!(EnergyError::of(&OSCILLATOR, &still, 2.0).error, [0.0, 0.25]);
        assert!(energy_drift(&still, 1.0).error.is_empty());
    }

    #[test]
    fn exact_motion_keeps_it() {
        let mut seen = Vec::new();
        for system in System::unconstrained().iter().filter(|system| system.conserved.is_some()) {
            let (n, parameters) = (system.size.default(), &system.parameters);
            // Other values than the defaults, which are mostly 1.
            let given: Vec<(String, String)> =
                parameters.iter().map(|p| (p.symbol.to_string(), "1.25".into())).collect();
            let system = SystemInstance::<f64>::named(&system.name, &given).unwrap();
            let (exact, test) = (system.build().unwrap(), system.system.trajectory(n));
            let bounds = StartBox { q: test.start.positions, v: test.start.velocities };
            for (q, mut v) in bounds.starts::<f64>(4, 5) {
                system.impose_constraint(&q, &mut v).unwrap();
                let run = rollout(exact.as_ref(), &q, &v, &RolloutOptions::reference(test.t_end, test.dt));
                assert!(run.stop.is_none(), "{:?}", run.stop);
                let mut trajectory = run.trajectory;
                let error = conserved_error(&system, &trajectory).unwrap();
                assert_eq!(error.len(), trajectory.len());
                assert!(error.iter().all(|&e| e < 1e-9), "{}: {error:?}", system.system.name);
                // One velocity more at one time: the vector changes.
                let last = trajectory.v.len() - n;
                trajectory.v[last..].iter_mut().for_each(|v| *v *= 1.5);
                let error = conserved_error(&system, &trajectory).unwrap();
                assert!((error[error.len() - 1] - 0.5).abs() < 1e-6, "{}", system.system.name);
            }
            seen.push(system.system.name.clone());
        }
        assert_eq!(seen.len(), 10, "{seen:?}");
    }

    #[test]
    fn a_great_circle_left_by_an_angle_shows_that_angle() {
        let system = SystemInstance::<f64>::named("sphere-geodesic", &[]).unwrap();
        // Along the equator, then along a circle tilted by 0.01.
        let (q, v) = (vec![1.0, 0.3, 1.0, 0.3], vec![0.0, 2.0, 0.0, 2.0]);
        let mut trajectory = Trajectory { coordinates: 2, t: vec![0.0, 1.0], q, v, energy: None };
        trajectory.q[0] = std::f64::consts::FRAC_PI_2;
        trajectory.q[2] = std::f64::consts::FRAC_PI_2;
        (trajectory.v[2], trajectory.v[3]) = (2.0 * 0.01_f64.sin(), 2.0 * 0.01_f64.cos());
        let error = conserved_error(&system, &trajectory).unwrap();
        assert_eq!(error[0], 0.0);
        assert!((error[1] - 2.0 * 0.005_f64.sin()).abs() < 1e-15, "{error:?}");
        assert!(conserved_error(&SystemInstance::<f64>::named("double-pendulum", &[]).unwrap(), &trajectory).is_none());
    }
}
