//! Time steps of recorded motion: gaps, uneven clocks, and the rows that a fit leaves out because of them.

use crate::data::Split;
use crate::names::{percent, pluralize};
use crate::pipeline::thresholds::ROUNDING_OF_TIME_STEPS;
use crate::recording::{Bridged, Clock, LoadedRecording, Targets};
use serde::Serialize;

/// Part of `summary.json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct TimeSteps {
    /// Short gaps, across which trajectories continue.
    bridged: Bridged,
    /// Number of long gaps, which cut trajectories.
    cuts: usize,
    /// Standard deviation of the steps that are not gaps over the usual one, on the trajectory where it is largest.
    jitter: f64,
    left_out: LeftOut,
}

/// Number of rows whose accelerations were not used for training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct LeftOut {
    /// Rows between gaps that are too few for a trajectory.
    between_gaps: usize,
    /// Samples of the training part without a full window, at the ends of its trajectories.
    at_ends: usize,
    /// Samples of the training part that have too few neighbours because of a gap.
    near_gaps: usize,
}

impl TimeSteps {
    /// Summarises the time steps of a recording and the rows of its part `training` that are not used with these targets.
    pub fn new(reading: &LoadedRecording, training: &Split, targets: Targets) -> Self {
        let jitter = reading.recording.tracks.iter().map(|track| Clock::of(&track.times).jitter());
        let [at_ends, near_gaps] = training.left_out(targets);
        let left_out =
            LeftOut { between_gaps: reading.dropped.iter().map(|part| part.samples).sum(), at_ends, near_gaps };
        Self { bridged: reading.bridged, cuts: reading.cuts.len(), jitter: jitter.fold(0.0, f64::max), left_out }
    }

    /// Describes the time steps in words; empty if they are even and there is no gap.
    pub fn lines(&self) -> Vec<String> {
        let mut parts = Vec::new();
        let Bridged { gaps, rows, longest } = self.bridged;
        if gaps > 0 {
            let (gaps, rows) = (pluralize(gaps, "short gap", "short gaps"), pluralize(rows, "row", "rows"));
            parts.push(format!("trajectories go on across {gaps} ({rows} missing, at most {longest} in one)"));
        }
        if self.cuts > 0 {
            parts.push(format!("{} trajectories", pluralize(self.cuts, "long gap cuts", "long gaps cut")));
        }
        if self.jitter > ROUNDING_OF_TIME_STEPS {
            parts.push(format!("time steps vary by {}", percent(self.jitter)));
        }
        if parts.is_empty() {
            return Vec::new();
        }
        let LeftOut { between_gaps, at_ends, near_gaps } = self.left_out;
        let rows = pluralize(between_gaps, "row", "rows");
        let samples = pluralize(at_ends, "training sample", "training samples");
        let lost = format!(
            "not learned from: {rows} between gaps, {samples} at ends and {near_gaps} near gaps, without full windows"
        );
        vec![parts.join("; "), lost]
    }
}
