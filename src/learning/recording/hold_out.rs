//! Division of a recording into training and validation by whole trajectories.

use crate::names::pluralize;
use crate::random::RngStream;
use crate::recording::{RecordedTrajectory, Recording};
use rand::seq::SliceRandom;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::Range;
use thiserror::Error;

/// Part of a recording that is held out for validation.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeldOut {
    /// Nothing: all data are used for training.
    Nothing,
    /// Whole trajectories, by number, ascending.
    Tracks(Vec<usize>),
    /// The end of the only trajectory: samples `start..` after a gap of `gap` samples that is not used.
    End {
        /// First sample held out.
        start: usize,
        /// Samples before it that are left out.
        gap: usize,
    },
}

/// Why nothing can be held out.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum HoldOutError {
    /// The requested value is not a share.
    #[error("share of the data held out: expected 0, or a number between 0 and 1, found {0}")]
    Fraction(f64),
    /// The only trajectory is too short to be divided.
    #[error("{} too few to hold out {fraction} of them after a gap of {gap}: both parts need {least}", pluralize(*samples, "sample is", "samples are"))]
    Short {
        /// Samples of the trajectory.
        samples: usize,
        /// Share requested.
        fraction: f64,
        /// The gap in samples.
        gap: usize,
        /// Samples that each part needs.
        least: usize,
    },
}

impl HeldOut {
    /// Chooses what to hold out: takes in random order until they contain `fraction` of all samples, skipping takes that would make it more
    /// than twice as many, at least one and not all. Of a single trajectory it holds out the last part, after a gap of `gap` samples, so
    /// that no smoothing window crosses from one side to the other, with at least `least` samples on both sides. A share of 0 holds nothing
    /// out.
    ///
    /// `takes` has the number of the take of every trajectory; trajectories of one take are held out together, unless there is no other
    /// take.
    ///
    /// # Errors
    /// [`HoldOutError`].
    pub fn choose(
        recording: &Recording,
        takes: &[usize],
        fraction: f64,
        (gap, least): (usize, usize),
        seed: u64,
    ) -> Result<Self, HoldOutError> {
        if fraction == 0.0 {
            return Ok(Self::Nothing);
        }
        if !(fraction > 0.0 && fraction < 1.0) {
            return Err(HoldOutError::Fraction(fraction));
        }
        let samples = recording.samples();
        let wanted = ((fraction * samples as f64).round() as usize).max(1);
        if recording.tracks.len() < 2 {
            let start = samples.saturating_sub(wanted);
            if wanted < least || start < gap + least {
                return Err(HoldOutError::Short { samples, fraction, gap, least });
            }
            return Ok(Self::End { start, gap });
        }
        let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (track, take) in takes.iter().enumerate() {
            parts.entry(*take).or_default().push(track);
        }
        if parts.len() < 2 {
            parts = (0..recording.tracks.len()).map(|track| (track, vec![track])).collect();
        }
        let parts: Vec<Vec<usize>> = parts.into_values().collect();
        let samples = |part: usize| parts[part].iter().map(|track| recording.tracks[*track].len()).sum::<usize>();
        let mut order: Vec<usize> = (0..parts.len()).collect();
        order.shuffle(&mut RngStream::HeldOut.generator(seed));
        let mut held = Vec::new();
        let mut count = 0;
        for &part in &order {
            let length = samples(part);
            if count < wanted && count + length <= 2 * wanted && held.len() + 1 < order.len() {
                count += length;
                held.push(part);
            }
        }
        if held.is_empty() {
            held.extend(order.into_iter().min_by_key(|part| (samples(*part), *part)));
        }
        let mut held: Vec<usize> = held.into_iter().flat_map(|part| parts[part].clone()).collect();
        held.sort_unstable();
        Ok(Self::Tracks(held))
    }

    /// `true` if a whole trajectory is held out.
    pub fn has_track(&self, track: usize) -> bool {
        matches!(self, Self::Tracks(held) if held.contains(&track))
    }

    /// Training and validation.
    pub fn divide(&self, recording: &Recording) -> (Recording, Recording) {
        let with = |tracks: Vec<RecordedTrajectory>| Recording { tracks, ..bare(recording) };
        match self {
            Self::Nothing => (recording.clone(), bare(recording)),
            Self::Tracks(held) => {
                let part = |inside: bool| {
                    let tracks = recording.tracks.iter().enumerate();
                    tracks.filter(|(k, _)| held.contains(k) == inside).map(|(_, track)| track.clone()).collect()
                };
                (with(part(false)), with(part(true)))
            }
            Self::End { start, gap } => {
                let part = |range: Range<usize>, which: &str| {
                    let tracks = recording.tracks.iter().take(1);
                    tracks.map(|track| section(track, recording.n(), range.clone(), which)).collect()
                };
                let end = recording.samples();
                let (start, end) = ((*start).min(end), end);
                (with(part(0..start.saturating_sub(*gap), "beginning")), with(part(start..end, "end")))
            }
        }
    }

    /// Describes the held-out part in words, such as `run3.csv, run7.csv`.
    pub fn describe(&self, recording: &Recording) -> String {
        match self {
            Self::Nothing => "nothing".to_string(),
            Self::Tracks(held) => held
                .iter()
                .filter_map(|k| recording.tracks.get(*k))
                .map(|t| t.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
            Self::End { start, gap } => format!(
                "the last {} of the only trajectory, after a gap of {gap}",
                pluralize(recording.samples().saturating_sub(*start), "sample", "samples")
            ),
        }
    }
}

#[cfg(test)]
/// Divides a recording into training and validation, see [`HeldOut::choose`].
///
/// # Errors
/// [`HoldOutError`].
pub fn hold_out(
    recording: &Recording,
    fraction: f64,
    gap: usize,
    seed: u64,
) -> Result<(Recording, Recording), HoldOutError> {
    let takes: Vec<usize> = (0..recording.tracks.len()).collect();
    Ok(HeldOut::choose(recording, &takes, fraction, (gap, 2), seed)?.divide(recording))
}

/// Copies the coordinates of a recording without its trajectories.
fn bare(recording: &Recording) -> Recording {
    let (coordinates, periodic) = (recording.coordinates.clone(), recording.periodic.clone());
    Recording { coordinates, periodic, tracks: Vec::new() }
}

/// Cuts a range of samples out of a track of `n` coordinates.
fn section(track: &RecordedTrajectory, n: usize, range: Range<usize>, which: &str) -> RecordedTrajectory {
    let part = |values: &[f64]| values.get(range.start * n..range.end * n).unwrap_or(&[]).to_vec();
    RecordedTrajectory {
        name: format!("{} ({which})", track.name),
        times: track.times[range.clone()].to_vec(),
        q: part(&track.q),
        v: part(&track.v),
        a: part(&track.a),
        force: part(&track.force),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(lengths: &[usize]) -> Recording {
        let tracks = lengths.iter().enumerate().map(|(k, length)| RecordedTrajectory {
            name: format!("run{k}"),
            times: (0..*length).map(|j| j as f64).collect(),
            q: (0..2 * length).map(|j| (100 * k + j) as f64).collect(),
            v: vec![],
            a: vec![],
            force: vec![1.0; 2 * length],
        });
        Recording { coordinates: vec!["x".into(), "y".into()], periodic: vec![false; 2], tracks: tracks.collect() }
    }

    #[test]
    fn trajectories_stay_whole() {
        let all = recording(&[20, 30, 40, 20, 30]);
        let mut choices = std::collections::BTreeSet::new();
        for seed in 0..20 {
            let (training, validation) = hold_out(&all, 0.2, 5, seed).unwrap();
            assert!(validation.samples() >= 28 && !training.tracks.is_empty());
            assert_eq!(training.samples() + validation.samples(), all.samples());
            let mut tracks = [training.tracks, validation.tracks.clone()].concat();
            tracks.sort_by(|a, b| a.name.cmp(&b.name));
            assert_eq!(tracks, all.tracks);
            assert_eq!(hold_out(&all, 0.2, 5, seed).unwrap().1, validation);
            choices.insert(validation.tracks.iter().map(|t| t.name.clone()).collect::<Vec<_>>());
        }
        assert!(choices.len() > 3, "{choices:?}");
        // A long trajectory is not taken for a small share.
        for seed in 0..10 {
            assert_eq!(hold_out(&recording(&[100, 20, 100]), 0.1, 1, seed).unwrap().1.samples() % 100, 20);
        }
        // Even if nearly all is requested, something remains for training.
        assert_eq!(hold_out(&recording(&[9, 9]), 0.99, 1, 0).unwrap().0.tracks.len(), 1);
    }

    #[test]
    fn takes_stay_whole() {
        let all = recording(&[20, 30, 40, 20, 30, 25]);
        for seed in 0..20 {
            let HeldOut::Tracks(held) = HeldOut::choose(&all, &[0, 0, 1, 1, 2, 3], 0.2, (5, 2), seed).unwrap() else {
                panic!("several trajectories")
            };
            assert!([&[0, 1][..], &[2, 3], &[4], &[5], &[4, 5]].contains(&held.as_slice()), "{held:?}");
        }
        // If there is a single take, some of its parts are held out.
        let held = HeldOut::choose(&all, &[7; 6], 0.2, (5, 2), 0).unwrap();
        assert!(matches!(held, HeldOut::Tracks(held) if !held.is_empty() && held.len() < 6));
    }

    #[test]
    fn the_end_of_a_single_one() {
        let one = recording(&[100]);
        let held = HeldOut::choose(&one, &[0], 0.2, (10, 2), 0).unwrap();
        assert_eq!(held, HeldOut::End { start: 80, gap: 10 });
        let (training, validation) = held.divide(&one);
        assert_eq!((training.samples(), validation.samples()), (70, 20));
        assert_eq!((training.tracks[0].q[139], validation.tracks[0].q[0]), (139.0, 160.0));
        assert!(validation.tracks[0].v.is_empty() && validation.tracks[0].validate(2).is_ok());
        assert!(held.describe(&one).contains("last 20 samples"));
        assert!(matches!(hold_out(&one, 0.5, 60, 0), Err(HoldOutError::Short { .. })));
        // Both parts are long enough to be smoothed, or nothing is held out.
        let choose = |least| HeldOut::choose(&one, &[0], 0.2, (10, least), 0);
        assert_eq!(choose(20), Ok(HeldOut::End { start: 80, gap: 10 }));
        assert!(matches!(choose(21), Err(HoldOutError::Short { least: 21, .. })));
        let (all, nothing) = hold_out(&one, 0.0, 0, 0).unwrap();
        assert_eq!((all, nothing.tracks.len()), (one.clone(), 0));
        for bad in [1.0, f64::NAN, -0.1] {
            assert!(matches!(hold_out(&one, bad, 0, 0), Err(HoldOutError::Fraction(_))));
        }
    }
}
