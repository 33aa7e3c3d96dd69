//! Recorded trajectories with the states estimated from them, and their noise.

use crate::recording::RecordedTrajectory;

/// A recorded trajectory with the states that were estimated from it, by smoothing for instance.
#[derive(Clone, Copy, Debug)]
pub struct StateEstimate<'a> {
    /// Measured values.
    pub track: &'a RecordedTrajectory,
    /// Estimated positions, `(samples, n)` in physical units, unwrapped as in the track.
    pub q: &'a [f64],
    /// Estimated velocities, `(samples, n)`.
    pub v: &'a [f64],
}

/// Standard deviations of the noise of what was measured, in physical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Of each position, `(n)`, positive.
    pub q: Vec<f64>,
    /// Of each velocity, `(n)`, positive; empty if velocities were not measured or shall not be used.
    pub v: Vec<f64>,
}
