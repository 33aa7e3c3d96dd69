//! Readings that a sensor held while the motion went on.
//!
//! A driver that misses a new reading repeats the previous one, digit by digit. Such a reading is late by a step, an error of the motion's
//! velocity times the step, which averaging does not remove. It is treated as missing and interpolated from the readings around it.

use super::thresholds::{
    EXAMINED_MARKS, FINE_STEPS, FRESH_NEIGHBOURS, LEAST_MARKED_CHANGES, MANY_REPETITIONS, MOST_REPETITIONS,
    MOVING_STEPS, RESTING_CHANGE, RESTING_REPETITIONS, WHOLE_MARKS, WHOLE_SHARE,
};
use super::{Recording, quantile};

/// A recording without held readings.
pub(crate) struct Filled {
    pub recording: Recording,
    /// `true` for readings that were held, `(samples, n)` by trajectory.
    pub held: Vec<Vec<bool>>,
}

impl Filled {
    /// Marks missing readings, which `recording` already interpolates, as held too.
    pub fn without(this: Option<Self>, recording: &Recording, missing: &[Vec<bool>]) -> Option<Self> {
        if !missing.iter().flatten().any(|missing| *missing) {
            return this;
        }
        let none = || recording.tracks.iter().map(|track| vec![false; track.q.len()]).collect();
        let mut filled = this.unwrap_or_else(|| Self { recording: recording.clone(), held: none() });
        for (held, missing) in filled.held.iter_mut().zip(missing) {
            held.iter_mut().zip(missing).for_each(|(held, missing)| *held |= missing);
        }
        Some(filled)
    }

    /// Number of held readings of coordinate `i`.
    pub fn count(&self, i: usize) -> usize {
        let n = self.recording.n();
        self.held.iter().flat_map(|track| track.iter().skip(i).step_by(n)).filter(|held| **held).count()
    }
}

/// Fills in held readings; `None` if there are none. Trajectories with repeated measurements of a state keep their readings.
pub(crate) fn filled(recording: &Recording) -> Option<Filled> {
    let n = recording.n();
    let mut filled = recording.clone();
    let mut held: Vec<Vec<bool>> = recording.tracks.iter().map(|track| vec![false; track.q.len()]).collect();
    for i in 0..n {
        let scale = SensorResolution::of(recording, i);
        for ((track, filled), held) in recording.tracks.iter().zip(&mut filled.tracks).zip(&mut held) {
            let values: Vec<f64> = track.q.iter().skip(i).step_by(n).copied().collect();
            let fresh = scale.fresh(&track.times, &values);
            for sample in (0..values.len()).filter(|&k| !fresh[k]) {
                held[sample * n + i] = true;
                filled.q[sample * n + i] = between(&track.times, &values, &fresh, sample);
            }
        }
    }
    held.iter().flatten().any(|held| *held).then_some(Filled { recording: filled, held })
}

/// The resolution of a sensor.
struct SensorResolution {
    /// Smallest change of a reading.
    smallest: f64,
    /// `true` if the sensor holds readings however slow the motion is.
    holds: bool,
}

impl SensorResolution {
    fn of(recording: &Recording, i: usize) -> Self {
        let n = recording.n();
        let changes = recording.tracks.iter().flat_map(|track| {
            let values = || track.q.iter().skip(i).step_by(n);
            values().zip(values().skip(1)).map(|(a, b)| (b - a).abs())
        });
        let (repeated, mut changes): (Vec<f64>, Vec<f64>) = changes.partition(|change| *change == 0.0);
        let often = repeated.len() as f64 > MANY_REPETITIONS * changes.len() as f64;
        let smallest = changes.iter().copied().fold(f64::INFINITY, f64::min);
        Self { smallest, holds: often && quantile(&mut changes, 0.5) > FINE_STEPS * smallest }
    }

    /// Marks readings as fresh (`true`) or held (`false`).
    fn fresh(&self, times: &[f64], values: &[f64]) -> Vec<bool> {
        let mut fresh = vec![true; values.len()];
        if times.windows(2).any(|pair| pair[1] <= pair[0]) {
            return fresh;
        }
        let least = MOVING_STEPS * self.smallest;
        let mut last = 0;
        for next in (1..values.len()).filter(|&k| values[k] != values[k - 1]) {
            // `last` begins the run that ends before `next`.
            let (first, held) = (last, next - last - 1);
            last = next;
            if held == 0 || held > MOST_REPETITIONS || first == 0 {
                continue;
            }
            let (before, after) = (values[first] - values[first - 1], values[next] - values[first]);
            let steps = (held + 1) as f64;
            let goes_on = before * after > 0.0 && before.abs() >= least && after.abs() >= least * steps;
            let rests = held >= RESTING_REPETITIONS && after.abs() < RESTING_CHANGE * steps * before.abs();
            if goes_on && !rests || self.holds && held < RESTING_REPETITIONS {
                fresh[first + 1..next].fill(false);
            }
        }
        fresh
    }
}

/// Spacing of the encoder marks of coordinate `i`, if its small changes are multiples of a spacing.
pub(crate) fn marks(recording: &Recording, i: usize) -> Option<f64> {
    let SensorResolution { smallest, .. } = SensorResolution::of(recording, i);
    let n = recording.n();
    let changes = recording.tracks.iter().flat_map(|track| {
        let values = || track.q.iter().skip(i).step_by(n);
        values().zip(values().skip(1)).map(|(a, b)| ((b - a) / smallest).abs())
    });
    let small: Vec<f64> = changes.filter(|marks| *marks > 0.5 && *marks < EXAMINED_MARKS).collect();
    let whole = small.iter().filter(|marks| (*marks - marks.round()).abs() < WHOLE_MARKS).count();
    (small.len() >= LEAST_MARKED_CHANGES && whole as f64 > WHOLE_SHARE * small.len() as f64).then_some(smallest)
}

/// Interpolates a held reading by the polynomial through the fresh readings around it.
fn between(times: &[f64], values: &[f64], fresh: &[bool], sample: usize) -> f64 {
    let before = (0..sample).rev().filter(|&k| fresh[k]).take(FRESH_NEIGHBOURS);
    let after = (sample + 1..values.len()).filter(|&k| fresh[k]).take(FRESH_NEIGHBOURS);
    let around: Vec<usize> = before.chain(after).collect();
    let weight = |k: usize| {
        let others = around.iter().filter(|&&other| other != k);
        others.map(|&other| (times[sample] - times[other]) / (times[k] - times[other])).product::<f64>()
    };
    around.iter().map(|&k| weight(k) * values[k]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RngStream;
    use crate::recording::RecordedTrajectory;
    use rand::Rng;

    fn recording(q: Vec<f64>) -> Recording {
        let times = (0..q.len()).map(|k| 0.005 * k as f64).collect();
        let track =
            RecordedTrajectory { name: "run".into(), times, q, v: Vec::new(), a: Vec::new(), force: Vec::new() };
        Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] }
    }

    #[test]
    fn held_readings_are_filled_in_and_others_are_kept() {
        let mut rng = RngStream::Test.generator(3);
        let exact: Vec<f64> = (0..800).map(|k| (0.02 * f64::from(k)).sin()).collect();
        let noisy: Vec<f64> = exact.iter().map(|x| x + 1e-4 * rng.random_range(-1.0..1.0)).collect();
        let mut held = noisy.clone();
        for k in 1..held.len() {
            if rng.random_bool(0.125) {
                held[k] = held[k - 1];
            }
        }
        let found = filled(&recording(held.clone())).unwrap();
        let repeated = held.windows(2).filter(|pair| pair[0] == pair[1]).count();
        assert!(found.count(0) <= repeated && repeated - found.count(0) < 5, "{repeated} {}", found.count(0));
        let worst = |values: &[f64]| {
            // At the ends of the recording a run has readings on one side only.
            let far = exact.iter().zip(values).skip(5).take(790).filter(|(x, _)| x.abs() < 0.9);
            far.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
        };
        let now = worst(&found.recording.tracks[0].q);
        assert!(worst(&held) > 0.015 && now < 1e-3, "{now}");
        // Motion without them, a scale whose marks are passed slowly or fast, rest, and rest that ends at once.
        let marks = |size: f64| exact.iter().map(|x| (x / size).round() * size).collect::<Vec<f64>>();
        let rest: Vec<f64> = exact.iter().map(|x| x.max(0.3)).collect();
        for kept in [exact.clone(), noisy.clone(), marks(1e-3), marks(1e-2), marks(0.1), rest, vec![1.0; 50]] {
            assert!(filled(&recording(kept)).is_none());
        }
        for (readings, distance) in
            [(marks(1e-3), Some(1e-3)), (marks(1e-2), Some(1e-2)), (exact, None), (noisy, None), (held, None)]
        {
            let found = super::marks(&recording(readings), 0);
            assert!(found.zip(distance).is_none_or(|(a, b): (f64, f64)| (a / b - 1.0).abs() < 1e-6));
            assert_eq!(found.is_some(), distance.is_some(), "{found:?} {distance:?}");
        }
    }
}
