//! Finds samples that do not look like motion: spikes, jumps, kinks, frozen sensors.

use super::thresholds::{
    FROZEN_STEP_GRID, FROZEN_STEP_NOISE, KEPT_WARNINGS, LEAST_FROZEN, LONGEST_CONTRAST, SCALE_SAMPLES,
    SUSPICIOUS_CONTRAST,
};
use crate::recording::Recording;
use crate::recording::clock::Clock;
use crate::recording::smooth::contrast_weights;
use crate::recording::statistics::robust_deviation;
use serde::Serialize;

/// Number of points of a contrast: seven for sixth differences.
const POINTS: usize = 7;

/// Kind of a suspicious place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Kind {
    /// One sample far from its neighbours.
    Outlier,
    /// The position jumps: everything after is shifted.
    Jump,
    /// The velocity jumps, as in an impact.
    Kink,
    /// The same value repeated although the motion continues before and after.
    Frozen,
}

/// A place in the data that does not look like smooth motion with noise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Warning {
    /// Name of the trajectory.
    pub track: String,
    /// Row of the file (line, or row of an array, from 1).
    pub row: u64,
    /// Trajectory and sample, both from 0.
    #[serde(skip)]
    pub place: (usize, usize),
    /// Name of the coordinate.
    pub coordinate: String,
    /// Kind of the place.
    pub kind: Kind,
    /// Value of the coordinate there.
    pub value: f64,
    /// Offset of the sample or of all later ones; of a kink, the change of the velocity; of a frozen sensor,
    /// the number of equal values.
    pub size: f64,
}

/// The alternating binomial coefficients that an outlier, a jump and a kink leave in sixth differences.
const PATTERNS: [(Kind, &[f64]); 3] = [
    (Kind::Outlier, &[1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0]),
    (Kind::Jump, &[1.0, -5.0, 10.0, -10.0, 5.0, -1.0]),
    (Kind::Kink, &[1.0, -4.0, 6.0, -4.0, 1.0]),
];

/// Finds the suspicious places of coordinate `i`, describes the first of them and returns their number.
///
/// Sixth differences, scaled to the noise of one sample, contain only noise where motion is smooth. Where one exceeds six standard
/// deviations (robust, from their median) and its neighbours have the opposite sign (in coarsely sampled motion they have the same one),
/// the pattern around it identifies the fault. `row` is the row of a sample of a trajectory.
pub fn find(
    recording: &Recording,
    row: &dyn Fn(usize, usize) -> u64,
    (i, sigma): (usize, f64),
    found: &mut Vec<Warning>,
) -> usize {
    let n = recording.n();
    let (mut count, mut z) = (0, Vec::new());
    for (number, track) in recording.tracks.iter().enumerate() {
        let mut report = |at: usize, kind: Kind, size: f64| {
            count += 1;
            if found.len() < KEPT_WARNINGS {
                let (name, coordinate) = (track.name.clone(), recording.coordinates[i].clone());
                let (row, value, place) = (row(number, at), track.q[at * n + i], (number, at));
                found.push(Warning { track: name, row, place, coordinate, kind, value, size });
            }
        };
        let q = |at: usize| track.q[at * n + i];
        frozen(track.len(), q, sigma, |at, length| report(at, Kind::Frozen, length as f64));
        if track.len() < 2 * POINTS {
            continue;
        }
        differences(&track.times, q, &mut z);
        let stride = (z.len() / SCALE_SAMPLES).max(1);
        let mut sampled: Vec<f64> = z.iter().step_by(stride).copied().collect();
        let limit = SUSPICIOUS_CONTRAST * robust_deviation(&mut sampled).max(sigma);
        let mut quiet_from = 0;
        for k in 1..z.len() - 1 {
            let far = z[k].abs() > limit && z[k] * z[k - 1] < 0.0 && z[k] * z[k + 1] < 0.0;
            let peak = z[k].abs() >= z[k - 1].abs() && z[k].abs() >= z[k + 1].abs();
            if far && peak && k >= quiet_from {
                let (kind, at, size) = classify(&z, k);
                let step = track.times[at] - track.times[at - 1];
                report(at, kind, if kind == Kind::Kink { size / step } else { size });
                quiet_from = k + POINTS;
            }
        }
    }
    count
}

/// Contrasts of seven neighbours each, starting with samples 0 to 6; 0 across a gap, where motion would not look like noise.
fn differences(times: &[f64], q: impl Fn(usize) -> f64, z: &mut Vec<f64>) {
    z.clear();
    let clock = Clock::of(times);
    let longest = LONGEST_CONTRAST * (POINTS - 1) as f64 * clock.step;
    let mut weights = [0.0; POINTS];
    for (start, window) in times.windows(POINTS).enumerate() {
        if window[POINTS - 1] - window[0] > longest {
            z.push(0.0);
            continue;
        }
        if start == 0 || !clock.even {
            contrast_weights(window, &mut weights);
        }
        let origin = q(start);
        z.push(weights.iter().enumerate().map(|(j, weight)| weight * (q(start + j) - origin)).sum());
    }
}

/// Finds the pattern that explains most of the contrasts around the peak `k`; returns its kind, its first sample and its size.
fn classify(z: &[f64], k: usize) -> (Kind, usize, f64) {
    // Contrast `j` concerns samples `j..j + 7`; scaled by the norm of the seven weights of equal steps.
    let norm = PATTERNS[0].1.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut best = (0.0, Kind::Outlier, k + POINTS / 2, 0.0);
    // Divided by the peak, so that no square overflows.
    let peak = z[k].abs();
    for (kind, pattern) in PATTERNS {
        for first in (k + 2).saturating_sub(pattern.len())..=k {
            let Some(part) = z.get(first..first + pattern.len()) else { continue };
            let product: f64 = part.iter().zip(pattern).map(|(x, p)| x / peak * p).sum();
            let square: f64 = pattern.iter().map(|p| p * p).sum();
            if product * product / square > best.0 {
                // The first contrast of the pattern ends at the first bad sample.
                best = (product * product / square, kind, first + POINTS - 1, product / square * norm * peak);
            }
        }
    }
    (best.1, best.2, best.3)
}

/// Calls `report` with the first sample and the length of runs of equal values that the motion jumps into or out of.
fn frozen(samples: usize, q: impl Fn(usize) -> f64, sigma: f64, mut report: impl FnMut(usize, usize)) {
    let step = |k: usize| (q(k) - q(k - 1)).abs();
    let stride = (samples / SCALE_SAMPLES).max(1);
    let grid = (1..samples).step_by(stride).map(step).filter(|x| *x > 0.0).fold(f64::INFINITY, f64::min);
    let jump = FROZEN_STEP_NOISE * sigma + FROZEN_STEP_GRID * grid;
    let mut start = 0;
    for k in 1..=samples {
        if k < samples && q(k) == q(start) {
            continue;
        }
        let jumps = (start > 0 && step(start) > jump) || (k < samples && step(k) > jump);
        if k - start >= LEAST_FROZEN && jumps {
            report(start, k - start);
        }
        start = k;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::RecordedTrajectory;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn survey(change: impl Fn(usize, f64) -> f64) -> Vec<(u64, Kind, f64)> {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let times: Vec<f64> = (0..3000).map(|k| f64::from(k) * 0.01).collect();
        let mut noisy = |x: f64| x + 1e-3 * Distribution::<f64>::sample(&StandardNormal, &mut rng);
        let clean: Vec<f64> = times.iter().map(|t| noisy((3.0 * t).sin() + 0.2 * (11.0 * t).cos())).collect();
        let q = clean.iter().enumerate().map(|(k, x)| change(k, *x)).collect();
        let track = RecordedTrajectory { name: "t".into(), times, q, v: vec![], a: vec![], force: vec![] };
        let recording = Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] };
        let mut found = Vec::new();
        let count = find(&recording, &|_, at| at as u64 + 1, (0, 1e-3), &mut found);
        assert_eq!(count, found.len());
        found.into_iter().map(|s| (s.row, s.kind, s.size)).collect()
    }

    #[test]
    fn what_happened_is_told() {
        assert_eq!(survey(|_, x| x), []);
        let near = |found: Vec<(u64, Kind, f64)>, row: u64, kind: Kind, size: f64| {
            let [(at, what, by)] = found[..] else { panic!("{found:?}") };
            assert_eq!((at, what), (row, kind));
            assert!((by / size - 1.0).abs() < 0.1, "{by} {size}");
        };
        near(survey(|k, x| if k == 1234 { x + 0.05 } else { x }), 1235, Kind::Outlier, 0.05);
        near(survey(|k, x| if k == 1234 { 1e155 } else { x }), 1235, Kind::Outlier, 1e155);
        near(survey(|k, x| if k == 1234 { -1e300 } else { x }), 1235, Kind::Outlier, -1e300);
        near(survey(|k, x| if k >= 1234 { x - 0.1 } else { x }), 1235, Kind::Jump, -0.1);
        let frozen = survey(|k, x| if (500..540).contains(&k) { 0.25 } else { x });
        assert!(frozen.contains(&(501, Kind::Frozen, 40.0)), "{frozen:?}");
        let kinked = survey(|k, x| if k >= 2000 { x + 5.0 * (k - 2000) as f64 * 0.01 } else { x });
        let [(row, Kind::Kink, size)] = kinked[..] else { panic!("{kinked:?}") };
        assert!((2000..=2003).contains(&row) && (size / 5.0 - 1.0).abs() < 0.2, "{row} {size}");
    }

    #[test]
    fn grids_are_not_frozen() {
        // Values on a grid of 0.05 rest at every turning point.
        let found = survey(|_, x| (x / 0.05).round() * 0.05);
        assert!(found.iter().all(|(_, kind, _)| *kind != Kind::Frozen), "{found:?}");
    }
}
