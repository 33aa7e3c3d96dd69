//! Survey of recorded motion, before anything is learned from it.

mod coordinate;
mod first_order;
mod motionless;
mod report;
mod suspicious;
mod thresholds;
mod warnings;

pub(crate) use coordinate::CoordinateSurvey;
pub(crate) use motionless::{Stillness, is_uniform, stillness};
pub(crate) use suspicious::{Kind, Warning, find as find_suspicious};
use thresholds::AMBIGUOUS_STEP;

use crate::recording::clock::Clock;
use crate::recording::read::FileFacts;
use crate::recording::smooth::{SmoothError, SmoothOptions, Smoothing};
use crate::recording::{Bridged, Cut, Dropped, HeldOut, LoadedRecording, Recording, Targets};
pub use first_order::FirstOrder;
use serde::Serialize;
use warnings::compare;

/// Settings of a survey.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveyOptions {
    /// Settings of derivatives.
    pub smooth: SmoothOptions,
    /// Share of the samples that would be held out for validation.
    pub validation: f64,
    /// Seed for the choice of held-out data.
    pub seed: u64,
}

impl Default for SurveyOptions {
    fn default() -> Self {
        Self { smooth: SmoothOptions::default(), validation: 0.2, seed: 0 }
    }
}

/// Survey of one trajectory.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct TrajectorySurvey {
    /// Its name.
    pub name: String,
    /// Row of its first sample in the file.
    pub first_row: u64,
    /// Row of its last sample.
    pub last_row: u64,
    /// Its samples.
    pub samples: usize,
    /// First time in s.
    pub start: f64,
    /// Last time in s.
    pub end: f64,
    /// Samples per second, from the typical step.
    pub rate: f64,
    /// Standard deviation of the steps that are not gaps, over the typical step.
    pub jitter: f64,
}

/// Results of a survey.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Survey {
    /// Files read.
    pub files: usize,
    /// The format that was recognised in every file.
    pub formats: Vec<FileFacts>,
    /// Column of time; none if times follow from the rate.
    pub time: Option<String>,
    /// Samples of all trajectories.
    pub samples: usize,
    /// Median step in s.
    pub step: f64,
    /// The trajectories.
    pub(crate) tracks: Vec<TrajectorySurvey>,
    /// Rows left out because they repeat the row before.
    pub duplicates: usize,
    /// Rows left out because a field is empty or `NaN`.
    pub incomplete: usize,
    /// Short gaps in time, across which trajectories continue.
    pub bridged: Bridged,
    /// Long gaps in time, which cut trajectories.
    pub cuts: Vec<Cut>,
    /// Stretches between gaps that are too short.
    pub dropped: Vec<Dropped>,
    /// The coordinates.
    pub(crate) coordinates: Vec<CoordinateSurvey>,
    /// Places that do not look like smooth motion with noise; if there are very many, the first.
    pub(crate) suspicious: Vec<Warning>,
    /// Number of suspicious places.
    pub suspicious_count: usize,
    /// Degree of the polynomials of smoothing.
    pub degree: usize,
    /// The quantity that a fit should learn from.
    pub targets: Targets,
    /// Part that would be held out for validation.
    pub(crate) held_out: Option<HeldOut>,
    /// The held-out data in words.
    pub held_out_text: String,
    /// `true` if a coordinate deviates from uniform motion by more than its noise.
    pub accelerates: bool,
    /// Names of coordinates that do not move: nothing can be learned about them.
    pub motionless: Vec<String>,
    /// Names of coordinates that are functions of those before them, so that they cannot be learned separately.
    pub copies: Vec<String>,
    /// Set if the motion is of first order; recognising that requires other columns.
    pub first_order: Option<FirstOrder>,
    /// Problems of the data that matter for learning.
    pub warnings: Vec<String>,
}

/// The smoothing of positions alone, and the one that a fit uses: it includes measured velocities if they agree with the positions.
///
/// # Errors
/// [`SmoothError`] for options out of range, or trajectories too short for any window.
pub(crate) fn plan(recording: &Recording, options: &SmoothOptions) -> Result<(Smoothing, Smoothing), SmoothError> {
    let alone = Smoothing::choose(recording, &SmoothOptions { velocities: false, ..options.clone() })?;
    let holds = |i: usize| compare(recording, i, 1, &alone).holds();
    let trusted = options.velocities && recording.has_velocities() && (0..recording.n()).all(holds);
    let planned = if trusted { Smoothing::choose(recording, options)? } else { alone.clone() };
    Ok((alone, planned))
}

/// Surveys a recording. Every sample is examined once, but windows of smoothing are tried only at evenly spaced places, so that ten
/// million samples take seconds.
///
/// # Errors
/// [`SmoothError`] for options out of range, or trajectories too short for any window.
pub fn survey(reading: &LoadedRecording, options: &SurveyOptions) -> Result<Survey, SmoothError> {
    let recording = &reading.recording;
    let n = recording.n();
    let (alone, planned) = plan(recording, &options.smooth)?;
    let mut coordinates: Vec<CoordinateSurvey> =
        (0..n).map(|i| CoordinateSurvey::new(recording, i, &alone, &planned.coordinates[i])).collect();
    let (mut suspicious, mut suspicious_count) = (Vec::new(), 0);
    let row = |track: usize, at: usize| reading.rows[track].row(at);
    for (i, coordinate) in coordinates.iter_mut().enumerate() {
        suspicious_count += find_suspicious(recording, &row, (i, coordinate.noise), &mut suspicious);
        if coordinate.periodic {
            count_ambiguous_turns(reading, i, coordinate);
        }
    }
    let tracks = recording.tracks.iter().zip(&reading.rows).filter(|(track, _)| !track.is_empty());
    let tracks = tracks.map(|(track, rows)| {
        let Clock { step, spread, .. } = Clock::of(&track.times);
        let last = track.len() - 1;
        TrajectorySurvey {
            name: track.name.clone(),
            first_row: rows.row(0),
            last_row: rows.row(last),
            samples: track.len(),
            start: track.times[0],
            end: track.times[last],
            rate: 1.0 / step,
            jitter: spread / step,
        }
    });
    let (share, apart, seed) = (options.validation, planned.apart(recording), options.seed);
    let held_out = HeldOut::choose(recording, &reading.takes, share, apart, seed).ok();
    let mut survey = Survey {
        files: reading.files,
        formats: reading.formats.clone(),
        time: reading.time.clone(),
        samples: recording.samples(),
        step: alone.step,
        tracks: tracks.collect(),
        duplicates: reading.duplicates,
        incomplete: reading.incomplete,
        bridged: reading.bridged,
        cuts: reading.cuts.clone(),
        dropped: reading.dropped.clone(),
        coordinates,
        suspicious,
        suspicious_count,
        degree: planned.degree,
        targets: Targets::advised(recording, &planned),
        held_out_text: held_out.as_ref().map(|held| held.describe(recording)).unwrap_or_default(),
        held_out,
        accelerates: (0..n).any(|i| !is_uniform(recording, i, &alone)),
        motionless: Vec::new(),
        copies: Vec::new(),
        first_order: FirstOrder::of(reading, &alone),
        warnings: Vec::new(),
    };
    let still = stillness(recording, &alone);
    let names = |copies: bool| {
        let of = still.iter().filter(move |(_, how)| matches!(how, Stillness::Copy(_)) == copies);
        of.map(|(i, _)| recording.coordinates[*i].clone()).collect()
    };
    (survey.motionless, survey.copies) = (names(false), names(true));
    survey.warnings = warnings::warnings(&survey, &still);
    Ok(survey)
}

/// Counts the steps of an angle that are too long to be unwrapped. Steps across gaps are left out: they decide where trajectories are cut.
fn count_ambiguous_turns(reading: &LoadedRecording, i: usize, coordinate: &mut CoordinateSurvey) {
    let n = reading.recording.n();
    for (track, rows) in reading.recording.tracks.iter().zip(&reading.rows) {
        let clock = Clock::of(&track.times);
        for k in (1..track.len()).filter(|k| clock.missing(track.times[*k] - track.times[k - 1]) == 0) {
            if (track.q[k * n + i] - track.q[(k - 1) * n + i]).abs() > AMBIGUOUS_STEP {
                coordinate.ambiguous_turns += 1;
                coordinate.first_ambiguous.get_or_insert_with(|| (track.name.clone(), rows.row(k)));
            }
        }
    }
}

#[cfg(test)]
mod tests;
