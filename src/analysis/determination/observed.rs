//! Observations that a model is compared with.

use crate::data::{RecordingSplit, RecordingSplitError};
use crate::recording::Targets;

/// States with the accelerations that were learned from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observed {
    /// Coordinates, `(states, n)`.
    pub q: Vec<f64>,
    /// Velocities, `(states, n)`.
    pub v: Vec<f64>,
    /// Accelerations, `(states, n)`.
    pub a: Vec<f64>,
    /// Known external forces, `(states, n)`, or nothing.
    pub force: Vec<f64>,
    /// Number of errors of the accelerations that are independent, of each coordinate.
    pub independent: Vec<f64>,
}

/// States over which means are taken, at most about.
const PLACES: usize = 2000;

/// Held-out states `(q, v)`, evenly spaced, over which means are taken; those learned from if nothing was held out.
pub fn places(measured: &RecordingSplit) -> (Vec<f64>, Vec<f64>) {
    let part = if measured.test.states.is_empty() { &measured.training } else { &measured.test };
    let n = part.recording.n();
    let stride = part.recording.samples().div_ceil(PLACES).max(1);
    let (mut q, mut v) = (Vec::new(), Vec::new());
    for states in &part.states {
        for row in states.interior().step_by(stride) {
            q.extend_from_slice(&states.q[row * n..(row + 1) * n]);
            v.extend_from_slice(&states.v[row * n..(row + 1) * n]);
        }
    }
    (q, v)
}

/// States that are looked at; of more, evenly spaced ones.
const STATES: usize = 4000;

impl Observed {
    /// The states that a fit learned from.
    ///
    /// Errors of smoothed accelerations are the same within a window; those of a model change with the state and are of one
    /// sign over half a swing: samples within half the fast period count as one.
    ///
    /// # Errors
    /// As [`RecordingSplit::datasets`].
    pub fn new(measured: &RecordingSplit, targets: Targets) -> Result<Self, RecordingSplitError> {
        let data = measured.datasets::<f64>(targets)?.training.remove(0);
        let n = data.coordinates();
        let stride = data.len().div_ceil(STATES).max(1);
        let some = |values: &[f64]| values.chunks_exact(n).step_by(stride).flatten().copied().collect::<Vec<_>>();
        let samples = measured.training.recording.samples() as f64;
        let derived = targets != Targets::Measured;
        let smoothing = &measured.smoothing;
        let independent = smoothing.coordinates.iter().map(|c| {
            let half = std::f64::consts::PI * c.quality.velocity / c.quality.acceleration / smoothing.step;
            let half = if half.is_finite() { half } else { 1.0 };
            (samples / half.max(if derived { c.quality.window as f64 } else { 1.0 })).clamp(1.0, samples)
        });
        Ok(Self {
            q: some(data.q()),
            v: some(data.v()),
            a: some(data.a()),
            force: some(data.force()),
            independent: independent.collect(),
        })
    }
}
