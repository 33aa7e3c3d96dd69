//! Trajectories without gaps in time.

use super::builder::{Growing, empty};
use crate::recording::RecordedTrajectory;
use crate::recording::reading::{Cut, Dropped, LoadedRecording};
use crate::recording::statistics::steps;

/// Fewest samples of a trajectory.
pub const LEAST: usize = 16;

/// Adds the stretches of a trajectory between gaps, the short ones left out; gives the samples of the longest.
///
/// A gap is a step longer than one and a half usual steps; if sampling is uneven, longer than the usual step and six
/// robust standard deviations of the steps.
pub fn add(file: &str, growing: Growing, reading: &mut LoadedRecording) -> usize {
    let Growing { label, rows, mut track, .. } = growing;
    let (usual, spread) = steps(&track.times);
    let longest = usual + (0.5 * usual).max(6.0 * spread);
    let mut bounds = vec![0];
    for (k, pair) in track.times.windows(2).enumerate() {
        let seconds = pair[1] - pair[0];
        if seconds > longest {
            let (before, after) = (rows.row(k), rows.row(k + 1));
            reading.cuts.push(Cut { file: file.to_string(), before, after, seconds, steps: seconds / usual });
            bounds.push(k + 1);
        }
    }
    bounds.push(track.len());
    let name = match &label {
        Some(label) => format!("{file} trajectory {label}"),
        None => file.to_string(),
    };
    let n = reading.recording.n();
    let mut most = 0;
    for pair in bounds.windows(2) {
        let (start, end) = (pair[0], pair[1]);
        let (samples, first, last) = (end - start, rows.row(start), rows.row(end.saturating_sub(1)));
        most = most.max(samples);
        if samples < LEAST {
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
        reading.rows.push(rows.part(start, end));
    }
    most
}
