//! Distance of two trajectories over time, and the time of valid prediction: how long a predicted motion stays close to the
//! true one.
//!
//! The error of a prediction `p` of coordinates `q`, relative to the spread `s_i` of each coordinate, is
//!
//! ```text
//! e(t) = sqrt( mean over i of ((p_i(t) - q_i(t)) / s_i)^2 )
//! ```
//!
//! Differences of angles are taken modulo `2 pi`. The prediction is valid until `e` first exceeds [`VALID`]; the time is resolved to the
//! spacing of the samples. In Lyapunov times it counts the factors of `e = 2.718..` by which the error has grown until then, whatever the
//! pace of the motion; after Pathak et al., Phys. Rev. Lett. 120, 024102 (2018), who take one norm over all components.

use super::thresholds::{ROUNDING_SPREAD, VALID};
use crate::rollout::Trajectory;
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Time for which a prediction was valid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidTime {
    /// Time of the first sample whose error exceeds [`VALID`], or of the last sample.
    pub time: f64,
    /// `true` if the error had not exceeded it by the last sample: the true time is longer.
    pub at_least: bool,
}

/// Median of valid times over several starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidTimes {
    /// [`VALID`].
    pub threshold: f64,
    /// Median of the times.
    pub median: f64,
    /// `true` if the true median is longer, because too many predictions were valid to their end.
    pub at_least: bool,
    /// Starts.
    pub starts: usize,
    /// Median over the starts, each in its own Lyapunov time; none unless the exact motion is known to be chaotic.
    pub lyapunov_times: Option<f64>,
    /// `true` if the true one is longer.
    pub lyapunov_at_least: bool,
    /// Starts whose exact motion is chaotic.
    pub chaotic: usize,
}

/// Root mean square distance of each of `periodic.len()` coordinates from its mean over samples `(samples, n)`. For an angle it is taken on
/// the circle, and an angle that rotates evenly has at most `pi / sqrt 3`. `NaN` without a finite sample.
pub fn spread(samples: &[f64], periodic: &[bool]) -> Vec<f64> {
    let n = periodic.len();
    let column = |i: usize| samples.iter().skip(i).step_by(n.max(1)).copied().filter(|x| x.is_finite());
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (count, sum) = values.fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x));
        sum / count
    };
    let of = |(i, &angle): (usize, &bool)| {
        let middle = if angle {
            f64::atan2(mean(&mut column(i).map(f64::sin)), mean(&mut column(i).map(f64::cos)))
        } else {
            mean(&mut column(i))
        };
        let distance = |x: f64| if angle { angle_difference(x, middle) } else { x - middle };
        mean(&mut column(i).map(|x| distance(x).powi(2))).sqrt()
    };
    periodic.iter().enumerate().map(of).collect()
}

/// The error `e` of predicted coordinates; coordinates that do not move have no spread and are left out. `NaN` if the prediction
/// is not finite or nothing moves.
pub fn relative_error(exact: &[f64], predicted: &[f64], periodic: &[bool], spread: &[f64]) -> f64 {
    if predicted.iter().any(|x| !x.is_finite()) {
        return f64::NAN;
    }
    let (mut count, mut sum) = (0, 0.0);
    for ((&q, &p), (&angle, &size)) in exact.iter().zip(predicted).zip(periodic.iter().zip(spread)) {
        // Rounding errors do not count as motion.
        if size > ROUNDING_SPREAD * q.abs() {
            let difference = if angle { angle_difference(q, p) } else { p - q };
            (count, sum) = (count + 1, sum + (difference / size).powi(2));
        }
    }
    if count == 0 { f64::NAN } else { (sum / f64::from(count)).sqrt() }
}

/// Time for which a prediction with these errors was valid. `complete` says that the prediction reached the last sample: its error after
/// that is unknown.
pub fn valid_time(times: &[f64], errors: impl IntoIterator<Item = f64>, complete: bool) -> ValidTime {
    let mut wrong = times.iter().zip(errors).filter(|(_, error)| error.is_nan() || *error > VALID);
    match wrong.next() {
        Some((&time, _)) => ValidTime { time, at_least: false },
        None => ValidTime { time: times.last().copied().unwrap_or(0.0), at_least: complete },
    }
}

impl ValidTimes {
    /// Medians over starts, each with the Lyapunov time of its exact motion if that is chaotic; `None` without starts.
    pub fn of(starts: &[(ValidTime, Option<f64>)]) -> Option<Self> {
        let all = median(starts.iter().map(|(valid, _)| *valid).collect())?;
        let scaled = |(valid, lyapunov): &(ValidTime, Option<f64>)| {
            lyapunov.map(|time| ValidTime { time: valid.time / time, ..*valid })
        };
        let chaotic: Vec<ValidTime> = starts.iter().filter_map(scaled).collect();
        let count = chaotic.len();
        let lyapunov = median(chaotic);
        Some(Self {
            threshold: VALID,
            median: all.time,
            at_least: all.at_least,
            starts: starts.len(),
            lyapunov_times: lyapunov.map(|valid| valid.time),
            lyapunov_at_least: lyapunov.is_some_and(|valid| valid.at_least),
            chaotic: count,
        })
    }
}

/// The median, which is a lower bound if one of the times up to it is.
fn median(mut times: Vec<ValidTime>) -> Option<ValidTime> {
    times.sort_by(|a, b| a.time.total_cmp(&b.time));
    let (low, high) = (times.len().checked_sub(1)? / 2, times.len() / 2);
    let time = 0.5 * (times[low].time + times[high].time);
    Some(ValidTime { time, at_least: times[..=high].iter().any(|valid| valid.at_least) })
}

/// Absolute errors of coordinates over the times that both trajectories reach.
#[derive(Clone, Debug, PartialEq)]
pub struct CoordinateError {
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Times.
    pub t: Vec<f64>,
    /// `|q_learned - q_exact|` per coordinate, `(len, n)`; angles modulo `2 pi`, at most `pi`.
    pub per_coordinate: Vec<f64>,
}

impl CoordinateError {
    /// Largest error at every time of some coordinates with the same unit; `NaN` where one of them is.
    pub fn largest(&self, coordinates: &[usize]) -> Vec<f64> {
        let rows = self.per_coordinate.chunks_exact(self.coordinates.max(1));
        let worst = |row: &[f64]| {
            let errors = coordinates.iter().filter_map(|&i| row.get(i).copied());
            errors.fold(0.0, |worst: f64, error| if error <= worst || worst.is_nan() { worst } else { error })
        };
        rows.map(worst).collect()
    }
}

/// Distance of two angles on the circle, in `[0, pi]`.
pub fn angle_difference<S: Scalar>(a: S, b: S) -> S {
    let turn = S::pi() + S::pi();
    let difference = (a - b).abs().wrap_angle();
    S::min(difference, turn - difference)
}

/// Errors of `learned` against `exact`, sample by sample, as far as both go; `periodic[i]` marks angles.
///
/// Samples are matched by their place: both trajectories must come from the same sample times. A `periodic` shorter than
/// `n` leaves the remaining coordinates plain.
pub fn coordinate_error<S: Scalar>(
    exact: &Trajectory<S>,
    learned: &Trajectory<S>,
    periodic: &[bool],
) -> CoordinateError {
    let n = exact.coordinates.min(learned.coordinates);
    let len = exact.len().min(learned.len());
    let mut result = CoordinateError {
        coordinates: n,
        t: exact.t[..len].iter().map(|t| t.to_f64()).collect(),
        per_coordinate: Vec::with_capacity(len * n),
    };
    for k in 0..len {
        let (a, b) = (exact.state(k).0, learned.state(k).0);
        for i in 0..n {
            let angle = periodic.get(i).copied().unwrap_or(false);
            let error = if angle { angle_difference(a[i], b[i]) } else { (a[i] - b[i]).abs() }.to_f64();
            result.per_coordinate.push(error);
        }
    }
    result
}

/// `|v_learned - v_exact|` per coordinate, `(len, n)`, as far as both go; samples are matched as by [`coordinate_error`].
pub fn velocity_error<S: Scalar>(exact: &Trajectory<S>, learned: &Trajectory<S>) -> Vec<f64> {
    exact.v.iter().zip(&learned.v).map(|(&a, &b)| (a - b).abs().to_f64()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    #[test]
    fn errors_are_relative_to_the_spread_of_the_motion() {
        // Two swings of amplitudes 2 and 0.1 and one coordinate that stands still.
        let samples: Vec<f64> = (0..1000)
            .flat_map(|k| {
                let phase = TAU * f64::from(k) / 1000.0;
                [5.0 + 2.0 * phase.cos(), 0.1 * phase.sin(), 7.0]
            })
            .collect();
        let spread = spread(&samples, &[false; 3]);
        assert!((spread[0] - 2f64.sqrt()).abs() < 1e-9 && (spread[1] - 0.1 / 2f64.sqrt()).abs() < 1e-9);
        assert!(spread[2] < 1e-12);
        let error = relative_error(&[5.0, 0.0, 7.0], &[5.0 + 2f64.sqrt(), 0.0, 9.0], &[false; 3], &spread);
        assert!((error - 0.5f64.sqrt()).abs() < 1e-9, "{error}");
        assert!(relative_error(&[5.0, 0.0, 7.0], &[f64::NAN, 0.0, 7.0], &[false; 3], &spread).is_nan());
    }

    #[test]
    fn angles_count_on_the_circle() {
        let around: Vec<f64> = (0..3000).map(|k| 0.1 * f64::from(k)).collect();
        assert!((spread(&around, &[true])[0] - PI / 3f64.sqrt()).abs() < 0.01);
        // About 0 from both sides.
        let swing = [0.1, TAU - 0.1, 4.0 * TAU + 0.1, -0.1];
        assert!((spread(&swing, &[true])[0] - 0.1).abs() < 1e-9);
        assert!((relative_error(&[0.05], &[TAU - 0.05], &[true], &[0.1]) - 1.0).abs() < 1e-9);
        assert!(spread(&[], &[true])[0].is_nan());
    }

    #[test]
    fn a_prediction_is_valid_until_its_error_first_exceeds_the_threshold() {
        let times = [0.0, 0.5, 1.0, 1.5];
        let valid = |errors: [f64; 4], complete| valid_time(&times, errors, complete);
        assert_eq!(valid([0.0, VALID, 0.41, 0.1], true), ValidTime { time: 1.0, at_least: false });
        assert_eq!(valid([0.0, f64::NAN, 0.0, 0.0], true), ValidTime { time: 0.5, at_least: false });
        assert_eq!(valid([0.0, 0.1, 0.2, 0.3], true), ValidTime { time: 1.5, at_least: true });
        // A prediction that gave up stays invalid.
        assert_eq!(valid([0.0, 0.1, 0.2, 0.3], false), ValidTime { time: 1.5, at_least: false });
        // An error that grows as e^t from 1e-4 is valid for ln 4000 Lyapunov times.
        let times: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let grown = valid_time(&times, times.iter().map(|t| 1e-4 * t.exp()), true);
        assert!((grown.time - 4000f64.ln()).abs() < 0.011, "{grown:?}");
    }

    #[test]
    fn medians_say_when_they_are_bounds() {
        let valid = |time, at_least| ValidTime { time, at_least };
        let of = |times: &[(f64, bool)]| {
            let starts: Vec<_> = times.iter().map(|&(t, bound)| (valid(t, bound), None)).collect();
            let all = ValidTimes::of(&starts).unwrap();
            (all.median, all.at_least, all.lyapunov_times)
        };
        assert_eq!(of(&[(3.0, false), (9.0, true), (1.0, false)]), (3.0, false, None));
        assert_eq!(of(&[(3.0, false), (9.0, true)]), (6.0, true, None));
        assert_eq!(of(&[(1.0, true), (3.0, false), (4.0, false)]), (3.0, true, None));
        let mixed = [(valid(8.0, false), Some(2.0)), (valid(50.0, true), None), (valid(9.0, false), Some(1.0))];
        let all = ValidTimes::of(&mixed).unwrap();
        assert_eq!((all.median, all.lyapunov_times, all.chaotic), (9.0, Some(6.5), 2));
        assert!(!all.at_least && !all.lyapunov_at_least && ValidTimes::of(&[]).is_none());
    }

    fn trajectory(q: &[f64]) -> Trajectory<f64> {
        Trajectory { coordinates: 2, t: vec![0.0, 1.0], q: q.to_vec(), v: vec![0.0; 4], energy: None }
    }

    #[test]
    fn velocities_are_compared_as_far_as_both_go() {
        let exact = Trajectory { v: vec![1.0, -2.0, 3.0, 4.0], ..trajectory(&[0.0; 4]) };
        let learned = Trajectory { t: vec![0.0], q: vec![0.0; 2], v: vec![1.5, 2.0], ..trajectory(&[]) };
        assert_eq!(velocity_error(&exact, &learned), [0.5, 4.0]);
    }

    #[test]
    fn angles_go_round() {
        let (a, b) = (trajectory(&[0.1, 0.0, 1.0, 0.0]), trajectory(&[2.0 * PI - 0.1, 0.5, 1.0 + 6.0 * PI, 7.0]));
        let error = coordinate_error(&a, &b, &[true]);
        assert!((error.per_coordinate[0] - 0.2).abs() < 1e-14);
        assert_eq!(error.per_coordinate[1], 0.5);
        assert!(error.per_coordinate[2] < 1e-14);
        assert_eq!((error.largest(&[0, 1]), error.largest(&[1])), (vec![0.5, 7.0], vec![0.5, 7.0]));
        assert!(error.largest(&[0])[1] < 1e-14);
        let lost = CoordinateError { per_coordinate: vec![f64::NAN, 1.0, 2.0, 1.0], ..error };
        assert!(lost.largest(&[0, 1])[0].is_nan() && lost.largest(&[0, 1])[1] == 2.0);
        assert!((angle_difference(0.0_f64, PI) - PI).abs() < 1e-15);
        assert_eq!(angle_difference(3.0_f64, 3.0), 0.0);
    }

    #[test]
    fn the_shorter_one_decides() {
        let mut short = trajectory(&[0.0; 4]);
        short.t.pop();
        short.q.truncate(2);
        short.v.truncate(2);
        assert_eq!(coordinate_error(&trajectory(&[1.0; 4]), &short, &[]).per_coordinate, [1.0; 2]);
    }
}
