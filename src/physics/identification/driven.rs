//! What the motion of a segment follows: recorded times, known forces and inputs, and the equations of motion.

use super::Between;
use crate::lagrangian::Equations;
use crate::recording::{RecordedTrajectory, Recording};
use crate::scalar::update;

/// Successive samples of a trajectory that are fitted by one motion, with its own initial state.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    pub track: usize,
    /// First sample, and number of samples.
    pub first: usize,
    pub samples: usize,
    /// Position and velocity at the first sample, `(2, n)`.
    pub start: Vec<f64>,
}

/// Everything that the integration needs: the recorded times and forces, and the equations.
#[derive(Clone, Debug)]
pub(crate) struct DrivenEquations<'a> {
    pub recording: &'a Recording,
    pub equations: &'a Equations,
    /// Number of constants by which derivatives are taken.
    pub chosen: usize,
    pub between: Between,
    /// Inputs of every trajectory; empty for a system without inputs.
    pub inputs: Vec<Inputs<'a>>,
    /// Typical step between samples in s, and number of integration steps in it.
    pub step: f64,
    pub substeps: usize,
}

/// Measured functions of the time on which the forces depend.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inputs<'a> {
    /// Times of the samples.
    pub times: &'a [f64],
    /// Values, `(samples, inputs)`.
    pub values: &'a [f64],
}

impl DrivenEquations<'_> {
    /// Writes the known functions at a time of a trajectory: the time itself, then the inputs.
    pub(super) fn known(&self, track: usize, t: f64, into: &mut [f64]) {
        into[0] = t;
        let Some(Inputs { times, values }) = self.inputs.get(track) else { return };
        let values_at = &mut into[1..];
        values_at.fill(0.0);
        let after = times.partition_point(|known| *known <= t).clamp(1, times.len().max(2) - 1).min(times.len() - 1);
        let (before, after_time) = (times[after.saturating_sub(1)], times[after]);
        let share = if after_time > before { ((t - before) / (after_time - before)).clamp(0.0, 1.0) } else { 1.0 };
        let count = values_at.len();
        self.between.weigh(times, (after, share), |at, weight| {
            update(values_at, &values[at * count..], |x, value| *x += weight * value);
        });
    }
}

/// Known forces `(n)` at the share `x` of the interval that ends at a sample; 0 for a trajectory without known forces.
pub(super) fn forces(track: &RecordedTrajectory, between: Between, (sample, x): (usize, f64), into: &mut [f64]) {
    let n = into.len();
    into.fill(0.0);
    if track.force.is_empty() {
        return;
    }
    between.weigh(&track.times, (sample, x), |at, weight| {
        let row = &track.force[at * n..][..n];
        update(into, row, |force, known| *force += weight * known);
    });
}
