//! The files and rows that recorded samples come from, and the rows that were left out.

use super::thresholds::{INERTIAL_SHARE, LARGE_ACCELERATION_ERROR};
use crate::lagrangian::SystemInstance;
use crate::recording::read::FileFacts;
use crate::recording::smooth::{Chosen, Smoothing, noise};
use crate::recording::statistics::deviation;
use crate::recording::units::si;
use crate::recording::{Columns, Recording};
use serde::{Deserialize, Serialize};

/// Line numbers of all samples, run-length encoded: from sample `.0` on, sample `k` is on line `k - .0 + .1`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rows(Vec<(usize, u64)>);

impl Rows {
    /// Records that sample `sample` is on line `row`; samples must arrive in order.
    pub(crate) fn note(&mut self, sample: usize, row: u64) {
        if self.0.is_empty() || self.row(sample) != row {
            self.0.push((sample, row));
        }
    }

    /// Line of a sample, from 1.
    pub fn row(&self, sample: usize) -> u64 {
        let run = self.0.partition_point(|(first, _)| *first <= sample);
        match run.checked_sub(1).and_then(|k| self.0.get(k)) {
            Some((first, row)) => row + (sample - first) as u64,
            None => sample as u64 + 1,
        }
    }

    /// The rows of samples `start..end`, counted from 0.
    pub(crate) fn part(&self, start: usize, end: usize) -> Self {
        let mut rows = Self(vec![(0, self.row(start))]);
        for (first, row) in self.0.iter().filter(|(first, _)| *first > start && *first < end) {
            rows.0.push((first - start, *row));
        }
        rows
    }
}

/// A gap in time at which a trajectory was cut.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cut {
    /// The file.
    pub file: String,
    /// Row of the last sample before the gap.
    pub before: u64,
    /// Row of the first sample after it.
    pub after: u64,
    /// Length of the step in s.
    pub seconds: f64,
    /// Length of the step in typical steps.
    pub steps: f64,
}

/// Short gaps in time, across which trajectories continue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Bridged {
    /// Their number.
    pub gaps: usize,
    /// Rows that are missing in them.
    pub rows: usize,
    /// Rows that are missing in the longest.
    pub longest: usize,
}

/// A piece between gaps that is too short to be used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dropped {
    /// The file.
    pub file: String,
    /// Row of its first sample.
    pub first: u64,
    /// Row of its last sample.
    pub last: u64,
    /// Its samples.
    pub samples: usize,
}

/// A recording and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedRecording {
    /// Recorded motion, in SI.
    pub recording: Recording,
    /// Rows of the samples of every trajectory.
    pub rows: Vec<Rows>,
    /// Files read.
    pub files: usize,
    /// Column that gave the times; none if they follow from the rate.
    pub time: Option<String>,
    /// Rows left out because they repeat the row before, digit by digit.
    pub duplicates: usize,
    /// Rows left out because a field is empty or `NaN`.
    pub incomplete: usize,
    /// Missing position readings in rows of trajectories that stay whole, `(samples, n)` for each; in the recording they are interpolated
    /// linearly. Empty if none is missing.
    pub missing: Vec<Vec<bool>>,
    /// Gaps in time.
    pub cuts: Vec<Cut>,
    /// Pieces between gaps that were left out.
    pub dropped: Vec<Dropped>,
    /// Short gaps, across which trajectories continue.
    pub bridged: Bridged,
    /// Standard deviations of the positions of every trajectory, `(samples, n)` each; empty if they are in no columns.
    pub errors: Vec<Vec<f64>>,
    /// Inputs of every trajectory, `(samples, inputs)` each, in the order of their columns; empty if there are none.
    pub inputs: Vec<Vec<f64>>,
    /// Number of the take of every trajectory: trajectories cut from one take by gaps share it.
    pub takes: Vec<usize>,
    /// Meaning of the columns, which have the names of the first file's header without units; without files it is empty.
    pub columns: Columns,
    /// The format that was recognised in every file.
    pub formats: Vec<FileFacts>,
}

impl LoadedRecording {
    /// SI units of the coordinates as far as the description or the first file's header gives them, empty texts otherwise.
    pub fn coordinate_units(&self) -> Vec<String> {
        let header = self.formats.first().map(|facts| &facts.units);
        let unit = |name: &String| {
            let given = self.columns.units.iter().find(|(column, _)| column == name).map(|(_, unit)| unit);
            given.or_else(|| header?.get(name)).and_then(|unit| si(unit)).unwrap_or_default()
        };
        self.columns.coords.iter().map(unit).collect()
    }

    /// Names the coordinates by the measured quantities of a system file, whose columns they are in the order of the quantities.
    /// Nothing changes for a system without a table `[measured]`.
    #[must_use]
    pub fn measured_by(mut self, system: &SystemInstance<f64>) -> Self {
        if !system.readings().is_empty() {
            self.recording.coordinates = system.measured().map(str::to_string).collect();
        }
        self
    }
}

impl From<Recording> for LoadedRecording {
    /// Wraps a recording from memory; its rows are its samples, counted from 1.
    fn from(recording: Recording) -> Self {
        let rows = vec![Rows::default(); recording.tracks.len()];
        let takes = (0..recording.tracks.len()).collect();
        let (cuts, dropped, errors, inputs) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let bridged = Bridged::default();
        let (columns, formats) = (Columns::default(), Vec::new());
        Self {
            recording,
            rows,
            files: 0,
            time: None,
            duplicates: 0,
            incomplete: 0,
            missing: Vec::new(),
            cuts,
            dropped,
            bridged,
            errors,
            inputs,
            takes,
            columns,
            formats,
        }
    }
}

/// The quantity that a network learns from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Targets {
    /// Measured accelerations.
    Measured,
    /// Accelerations from local polynomials.
    Smoothed,
    /// Known forces, compared with the model's forces at measured or smoothed accelerations.
    Forces,
    /// The motion itself, starting with the network that smoothed or measured accelerations give.
    Motion,
}

impl Targets {
    /// Returns its name in options and configurations.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Smoothed => "smoothed",
            Self::Forces => "forces",
            Self::Motion => "motion",
        }
    }

    /// Describes it in a few words.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Measured => "Measured accelerations",
            Self::Smoothed => "Accelerations from local polynomials",
            Self::Forces => "Known forces",
            Self::Motion => "The motion",
        }
    }

    /// `true` if measured accelerations are used where they exist.
    pub(crate) fn takes_measured(self) -> bool {
        matches!(self, Self::Measured | Self::Forces)
    }

    /// The quantity that suits the data: measured accelerations if there are any; known forces if they are noisier than the accelerations;
    /// smoothed accelerations if they are accurate to `LARGE_ACCELERATION_ERROR`; otherwise the motion itself.
    pub(crate) fn advised(recording: &Recording, smoothing: &Smoothing) -> Self {
        if recording.has_accelerations() {
            Self::Measured
        } else if recording.is_driven() && forces_are_noisier(recording, smoothing) {
            Self::Forces
        } else if smoothing.acceleration_error() <= LARGE_ACCELERATION_ERROR {
            Self::Smoothed
        } else {
            Self::Motion
        }
    }
}

/// `true` if, for any coordinate, the noise of a known force exceeds the error of the acceleration expressed as a force: residuals should
/// be those of the noisier quantity.
fn forces_are_noisier(recording: &Recording, smoothing: &Smoothing) -> bool {
    let n = recording.n();
    let tracks = || recording.tracks.iter().map(|track| (track.times.as_slice(), track.force.as_slice()));
    let noisier = |(i, chosen): (usize, &Chosen)| {
        let spread = deviation(recording.tracks.iter().flat_map(|track| track.force.iter().skip(i).step_by(n)));
        noise(tracks(), n, i).sigma > INERTIAL_SHARE * chosen.quality.relative() * spread
    };
    smoothing.coordinates.iter().enumerate().any(noisier)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_have_one_name() {
        for targets in [Targets::Measured, Targets::Smoothed, Targets::Forces, Targets::Motion] {
            assert_eq!(serde_json::to_string(&targets).unwrap(), format!("\"{}\"", targets.name()));
        }
    }

    #[test]
    fn rows_skip_what_was_left_out() {
        let mut rows = Rows::default();
        for (sample, row) in [2, 3, 4, 7, 8, 10].into_iter().enumerate() {
            rows.note(sample, row);
        }
        assert_eq!(rows.0.len(), 3);
        assert_eq!((0..7).map(|k| rows.row(k)).collect::<Vec<_>>(), [2, 3, 4, 7, 8, 10, 11]);
        let part = rows.part(2, 5);
        assert_eq!((0..3).map(|k| part.row(k)).collect::<Vec<_>>(), [4, 7, 8]);
        assert_eq!(Rows::default().row(4), 5);
    }
}
