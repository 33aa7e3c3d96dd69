//! Cuts trajectories at gaps in time.

use super::builder::{TrackBuilder, empty};
use super::thresholds::{AMBIGUOUS_TURN, LEAST_SAMPLES};
use crate::recording::RecordedTrajectory;
use crate::recording::clock::Clock;
use crate::recording::reading::{Cut, Dropped, LoadedRecording, Rows};
use std::f64::consts::TAU;

/// Adds the stretches of a trajectory between long gaps, except those of few samples; returns the samples of the longest.
///
/// A trajectory continues across gaps of up to nine missing rows, an angle by the turn that suits its velocity before and after; where that
/// is ambiguous, or a gap is longer, it is cut unless it has to stay whole.
pub fn add(file: &str, builder: TrackBuilder, whole: bool, reading: &mut LoadedRecording) -> usize {
    let TrackBuilder { label, rows, mut track, error, input, missing, .. } = builder;
    let (bounds, turned) = cross_gaps(file, &track, &rows, whole, reading);
    turn(&mut track, &turned);
    let name = match &label {
        Some(label) => format!("{file} trajectory {label}"),
        None => file.to_string(),
    };
    let n = reading.recording.n();
    let take = reading.takes.last().map_or(0, |take| take + 1);
    let mut most = 0;
    for pair in bounds.windows(2) {
        let (start, end) = (pair[0], pair[1]);
        let (samples, first, last) = (end - start, rows.row(start), rows.row(end.saturating_sub(1)));
        most = most.max(samples);
        if samples < LEAST_SAMPLES && !whole {
            reading.dropped.push(Dropped { file: file.to_string(), first, last, samples });
            continue;
        }
        let part = if bounds.len() == 2 {
            track.name.clone_from(&name);
            std::mem::replace(&mut track, empty())
        } else {
            let cut = |values: &[f64]| values.get(start * n..end * n).unwrap_or(&[]).to_vec();
            RecordedTrajectory {
                name: format!("{name} rows {first}-{last}"),
                times: track.times[start..end].to_vec(),
                q: cut(&track.q),
                v: cut(&track.v),
                a: cut(&track.a),
                force: cut(&track.force),
            }
        };
        reading.recording.tracks.push(part);
        if !error.is_empty() {
            reading.errors.push(error[start * n..end * n].to_vec());
        }
        if !input.is_empty() {
            let count = input.len() / bounds[bounds.len() - 1];
            reading.inputs.push(input[start * count..end * count].to_vec());
        }
        if !missing.is_empty() {
            // Only of whole trajectories.
            reading.missing.resize(reading.recording.tracks.len(), Vec::new());
            let at = reading.missing.len() - 1;
            reading.missing[at] = missing[start * n..end * n].to_vec();
        }
        reading.rows.push(rows.part(start, end));
        reading.takes.push(take);
    }
    most
}

/// Records the gaps of a trajectory. Returns the bounds of the pieces, including the first and the last, and the samples from which angles
/// have to be shifted by full turns.
fn cross_gaps(
    file: &str,
    track: &RecordedTrajectory,
    rows: &Rows,
    whole: bool,
    reading: &mut LoadedRecording,
) -> (Vec<usize>, Vec<(usize, Vec<f64>)>) {
    let clock = Clock::of(&track.times);
    let (mut bounds, mut turned) = (vec![0], Vec::new());
    for (k, pair) in track.times.windows(2).enumerate() {
        let seconds = pair[1] - pair[0];
        if seconds <= clock.longest {
            continue;
        }
        let turns =
            clock.reaches_across(seconds).then(|| turns(track, &reading.recording.periodic, &clock, k)).flatten();
        if let Some(turns) = turns {
            let missing = clock.missing(seconds);
            reading.bridged.gaps += 1;
            reading.bridged.rows += missing;
            reading.bridged.longest = reading.bridged.longest.max(missing);
            turned.push((k + 1, turns));
        } else if !whole {
            let (before, after) = (rows.row(k), rows.row(k + 1));
            reading.cuts.push(Cut { file: file.to_string(), before, after, seconds, steps: seconds / clock.step });
            bounds.push(k + 1);
        }
    }
    bounds.push(track.len());
    (bounds, turned)
}

/// Number of full turns by which each coordinate must be shifted from sample `k + 1` on, so that it crosses the gap before that sample with
/// its velocity before and after; `None` if that is ambiguous.
fn turns(track: &RecordedTrajectory, periodic: &[bool], clock: &Clock, k: usize) -> Option<Vec<f64>> {
    let (n, gap) = (periodic.len(), track.times[k + 1] - track.times[k]);
    let speed = |i: usize, before: Option<usize>| {
        let at = before?;
        let step = track.times.get(at + 1)? - track.times[at];
        (step <= clock.longest).then(|| (track.q[(at + 1) * n + i] - track.q[at * n + i]) / step)
    };
    let of = |i: usize| {
        if !periodic[i] {
            return Some(0.0);
        }
        let travel = match (speed(i, k.checked_sub(1)), speed(i, Some(k + 1))) {
            (Some(a), Some(b)) if (a - b).abs() * gap > AMBIGUOUS_TURN => return None,
            (Some(a), Some(b)) => 0.5 * (a + b) * gap,
            (a, b) => a.or(b)? * gap,
        };
        let turns = ((travel - (track.q[(k + 1) * n + i] - track.q[k * n + i])) / TAU).round();
        turns.is_finite().then_some(turns)
    };
    (0..n).map(of).collect()
}

/// Shifts the coordinates by full turns from each of these samples on.
fn turn(track: &mut RecordedTrajectory, turned: &[(usize, Vec<f64>)]) {
    let Some((_, first)) = turned.first() else { return };
    let n = first.len();
    let mut sums = vec![0.0; n];
    for (number, (from, turns)) in turned.iter().enumerate() {
        let end = turned.get(number + 1).map_or(track.len(), |(next, _)| *next);
        sums.iter_mut().zip(turns).for_each(|(sum, turns)| *sum += turns);
        if sums.iter().any(|sum| *sum != 0.0) {
            for q in track.q[from * n..end * n].chunks_exact_mut(n) {
                q.iter_mut().zip(&sums).for_each(|(q, sum)| *q += TAU * sum);
            }
        }
    }
}
