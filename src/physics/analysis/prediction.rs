//! Predictions of recorded motion that a model has not seen: their errors, and the time for which they are valid.
//!
//! A recording is cut into windows; every predictor gets an estimated state before a window and predicts the coordinates at the times of
//! its samples, which are compared with the measured ones. A smoothed estimate has seen samples after its own time, so the window begins
//! after the last of them.

use super::statistics::quantile;
use super::thresholds::{LEAST_STEPS, STEPS_PER_SAMPLE, TIME_ROUNDING};
use super::{ValidTime, angle_difference, relative_error, valid_time};
use crate::data::{Split, StateEstimate};
use crate::lagrangian::EulerLagrange;
use crate::recording::{Smoothed, hermite};
use crate::rollout::{Force, RolloutError, RolloutOptions, SampledForce, Start, rollout_each};
use serde::{Deserialize, Serialize};

/// A stretch of recorded motion to be predicted from a state before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Estimated coordinates of the state, `(n)`.
    pub q: Vec<f64>,
    /// Estimated velocities of the state, `(n)`.
    pub v: Vec<f64>,
    /// Time from the state to the start of the window, the last sample that the estimate has seen, in s.
    pub lead: f64,
    /// Times of the samples that follow, from the start of the window, ascending, in s.
    pub times: Vec<f64>,
    /// Measured coordinates at these times, `(samples, n)`.
    pub measured: Vec<f64>,
    /// Known external forces from the state to the end of the window, if there were any.
    pub force: Option<SampledForce<f64>>,
}

impl Window {
    /// Consecutive windows of `seconds` through the samples `interior` of a track of `n` coordinates, each from the estimated state,
    /// `(samples, n)`, at its first sample; a shorter remainder is left out.
    pub fn cut(states: StateEstimate<'_>, interior: std::ops::Range<usize>, n: usize, seconds: f64) -> Vec<Self> {
        Self::unseen(states, &[], (interior, n), seconds)
    }

    /// The first window of `seconds` of every motion that lasts so long, from its first accurate state.
    pub fn beginnings(part: &Split, seconds: f64) -> Vec<Self> {
        let (n, estimated) = (part.recording.n(), part.estimated());
        let first = |(estimate, states): (&StateEstimate<'_>, &Smoothed)| {
            let samples = states.interior().start..states.times.len();
            Self::cut(*estimate, samples, n, seconds).into_iter().next()
        };
        estimated.iter().zip(&part.states).filter_map(first).collect()
    }

    /// As [`Window::cut`], but each window begins at the last sample that the estimate of its state has used, `reach` after the state.
    pub fn unseen(
        StateEstimate { track, q, v, between }: StateEstimate<'_>,
        reach: &[usize],
        (interior, n): (std::ops::Range<usize>, usize),
        seconds: f64,
    ) -> Vec<Self> {
        let state = |values: &[f64], sample: usize| values[sample * n..(sample + 1) * n].to_vec();
        let mut windows = Vec::new();
        let mut start = interior.start;
        while start < interior.end {
            let seen = reach.get(start).copied().unwrap_or(start).clamp(start, interior.end - 1);
            let origin = track.times[seen];
            // The last sample may be early or late by a rounding error of the times.
            let length =
                track.times[seen..interior.end].partition_point(|t| t - origin <= seconds * (1.0 + TIME_ROUNDING));
            let end = seen + length;
            let whole = end < interior.end || track.times[end - 1] - origin >= seconds * (1.0 - TIME_ROUNDING);
            if !whole || length < 2 {
                break;
            }
            let force = track.force.get(start * n..end * n).and_then(|values| {
                let times = track.times[start..end].iter().map(|t| t - track.times[start]).collect();
                SampledForce::new(n, times, values.to_vec()).ok().map(|force| force.between(between))
            });
            windows.push(Self {
                q: state(q, start),
                v: state(v, start),
                lead: origin - track.times[start],
                times: track.times[seen + 1..end].iter().map(|t| t - origin).collect(),
                measured: track.q[(seen + 1) * n..end * n].to_vec(),
                force,
            });
            // Windows follow each other; their states lie before them.
            start = (start + 1).max(end - 1 - (seen - start));
        }
        windows
    }
}

/// Coordinates at the times of every window's samples, `(samples, n)`; not finite where a predictor failed.
pub type Predictions = Vec<Vec<f64>>;

/// The motion of a model under the known forces; `NaN` from where it ends before its time. The result does not depend on `threads`.
pub fn predict_by_motion(model: &dyn EulerLagrange<f64>, windows: &[Window], threads: usize) -> Predictions {
    follow(model, windows, threads).0
}

/// The motion of a model as by [`predict_by_motion`], and why it ended before its time, for every window.
pub fn follow(
    model: &dyn EulerLagrange<f64>,
    windows: &[Window],
    threads: usize,
) -> (Predictions, Vec<Option<RolloutError>>) {
    let n = model.coordinates();
    let forces = windows.iter().map(|window| window.force.as_ref().map(|force| force as &dyn Force<f64>));
    let starts: Vec<Start<'_, f64>> =
        windows.iter().zip(forces).map(|(window, force)| Start { q: &window.q, v: &window.v, force }).collect();
    let end = windows.iter().filter_map(|window| Some(window.lead + window.times.last()?)).fold(0.0, f64::max);
    let shortest = windows.iter().flat_map(|w| w.times.first().copied().into_iter().chain(steps(&w.times)));
    let step = shortest.fold(end, f64::min);
    // A little longer, so that rounding leaves the last sample of every window inside.
    let max_steps = LEAST_STEPS + (STEPS_PER_SAMPLE * end / step) as usize;
    let options = RolloutOptions::new(end * (1.0 + 1e-12), step).energy(false).max_steps(max_steps);
    let motions = rollout_each(model, &starts, &options, threads);
    let pairs = windows.iter().zip(motions);
    pairs
        .map(|(window, motion)| {
            (along(&motion.trajectory.t, &motion.trajectory.q, &motion.trajectory.v, n, window), motion.stop)
        })
        .unzip()
}

fn steps(times: &[f64]) -> impl Iterator<Item = f64> {
    times.windows(2).map(|pair| pair[1] - pair[0])
}

/// Coordinates between the samples of a motion, by cubic Hermite interpolation, at the times of a window.
fn along(t: &[f64], q: &[f64], v: &[f64], n: usize, window: &Window) -> Vec<f64> {
    let mut positions = Vec::with_capacity(window.measured.len());
    for time in window.times.iter().map(|time| window.lead + time) {
        let after = t.partition_point(|t| *t < time);
        if after == 0 || after >= t.len() {
            positions.extend(std::iter::repeat_n(f64::NAN, n));
            continue;
        }
        let (before, h) = (after - 1, t[after] - t[after - 1]);
        let [[a, b, c, d], _] = hermite((time - t[before]) / h, h);
        let at = |values: &[f64], k: usize, i: usize| values[k * n + i];
        positions.extend(
            (0..n).map(|i| a * at(q, before, i) + b * at(v, before, i) + c * at(q, after, i) + d * at(v, after, i)),
        );
    }
    positions
}

/// Predicts that the velocity before the window continues, as a baseline for models.
pub fn predict_by_constant_velocity(windows: &[Window]) -> Predictions {
    let prediction = |window: &Window| {
        let times = window.times.iter().map(|t| window.lead + t);
        let along = times.flat_map(|t| window.q.iter().zip(&window.v).map(move |(q, v)| q + t * v));
        along.collect()
    };
    windows.iter().map(prediction).collect()
}

/// Distance of predicted and measured coordinates a given time after the start of the windows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PredictionError {
    /// Time after the start in s.
    pub seconds: f64,
    /// Root mean square over windows and coordinates, over the scales of the coordinates; `NaN` if a prediction is missing.
    pub rms: f64,
    /// Median over the windows of the root mean square over the coordinates; a missing prediction counts as infinite.
    pub median: f64,
    /// 90th percentile: nine windows of ten are below this.
    pub p90: f64,
    /// Windows.
    pub windows: usize,
    /// Windows without a prediction for this time.
    pub missing: usize,
}

/// Distances of predicted and measured coordinates `seconds` after the start, at the sample nearest to it, `(n)` for every window;
/// angles, marked by `periodic`, count modulo a turn.
fn distances(
    windows: &[Window],
    predictions: &Predictions,
    periodic: &[bool],
    seconds: f64,
) -> impl Iterator<Item = Vec<f64>> {
    let n = periodic.len();
    windows.iter().zip(predictions).filter_map(move |(window, predicted)| {
        let near = |k: &usize| (window.times[*k] - seconds).abs();
        let at = (0..window.times.len()).min_by(|a, b| near(a).total_cmp(&near(b)))?;
        let row = at * n..(at + 1) * n;
        let pairs = window.measured.get(row.clone())?.iter().zip(predicted.get(row)?).zip(periodic);
        Some(pairs.map(|((&m, &p), &angle)| if angle { angle_difference(m, p) } else { (m - p).abs() }).collect())
    })
}

/// Errors `seconds` after the start of all coordinates together, each over its scale: 1 where all have the same unit, otherwise the spread
/// of its motion; a coordinate without a spread is left out.
pub fn prediction_error(
    windows: &[Window],
    predictions: &Predictions,
    (periodic, scales): (&[bool], &[f64]),
    seconds: f64,
) -> PredictionError {
    let moving = scales.iter().filter(|scale| **scale > 0.0).count() as f64;
    let together = |distances: Vec<f64>| {
        let scaled = distances.iter().zip(scales).filter(|(_, scale)| **scale > 0.0);
        (scaled.map(|(distance, scale)| (distance / scale).powi(2)).sum::<f64>() / moving).sqrt()
    };
    let mut errors: Vec<f64> = distances(windows, predictions, periodic, seconds).map(together).collect();
    let missing = errors.iter().filter(|error| !error.is_finite()).count();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let rms = if missing > 0 { f64::NAN } else { rms };
    let [median, p90] = quantiles(&mut errors, [0.5, 0.9]);
    PredictionError { seconds, rms, median, p90, windows: errors.len(), missing }
}

/// Median over the windows of the error of every coordinate `seconds` after the start, in its own unit.
pub(crate) fn coordinate_errors(
    windows: &[Window],
    predictions: &Predictions,
    periodic: &[bool],
    seconds: f64,
) -> Vec<f64> {
    let all: Vec<Vec<f64>> = distances(windows, predictions, periodic, seconds).collect();
    let of = |i: usize| quantiles(&mut all.iter().map(|distances| distances[i]).collect::<Vec<_>>(), [0.5])[0];
    (0..periodic.len()).map(of).collect()
}

/// Quantiles of errors; a missing one counts as infinite.
fn quantiles<const N: usize>(errors: &mut [f64], shares: [f64; N]) -> [f64; N] {
    errors.iter_mut().filter(|error| !error.is_finite()).for_each(|error| *error = f64::INFINITY);
    errors.sort_by(f64::total_cmp);
    shares.map(|share| quantile(errors, share))
}

/// Time for which the prediction of each window was valid ([`valid_time`]), errors relative to the `spread` of the motion; at least to
/// the end of the window where the error stays small.
pub fn window_valid_times(
    windows: &[Window],
    predictions: &Predictions,
    periodic: &[bool],
    spread: &[f64],
) -> Vec<ValidTime> {
    let n = periodic.len().max(1);
    let of = |(window, predicted): (&Window, &Vec<f64>)| {
        let pairs = window.measured.chunks_exact(n).zip(predicted.chunks_exact(n));
        valid_time(&window.times, pairs.map(|(q, p)| relative_error(q, p, periodic, spread)), true)
    };
    windows.iter().zip(predictions).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::{OSCILLATOR, SINGULAR};
    use crate::recording::RecordedTrajectory;
    use crate::rollout::Between;

    /// The track with its own positions and these velocities as states.
    fn estimate<'a>(track: &'a RecordedTrajectory, v: &'a [f64]) -> StateEstimate<'a> {
        StateEstimate { track, q: &track.q, v, between: Between::Linear }
    }

    /// A swing `cos t` every tenth of a second.
    fn swing(samples: usize) -> (RecordedTrajectory, Vec<f64>) {
        let times: Vec<f64> = (0..samples).map(|k| 0.1 * k as f64).collect();
        let q = times.iter().map(|t| t.cos()).collect();
        let v = times.iter().map(|t| -t.sin()).collect();
        (RecordedTrajectory { name: "swing".into(), times, q, v: vec![], a: vec![], force: vec![] }, v)
    }

    #[test]
    fn windows_follow_each_other() {
        let (track, v) = swing(40);
        let windows = Window::cut(estimate(&track, &v), 2..38, 1, 0.5);
        assert_eq!(windows.len(), 7);
        assert_eq!((windows[1].q[0], windows[1].v[0]), (track.q[7], v[7]));
        assert_eq!((windows[1].times.len(), windows[1].measured[4]), (5, track.q[12]));
        assert!((windows[1].times[4] - 0.5).abs() < 1e-12);
        assert!(Window::cut(estimate(&track, &v), 2..38, 1, 9.0).is_empty());
        assert!(Window::cut(estimate(&track, &v), 2..38, 1, 0.01).is_empty());
    }

    /// Whatever the samples of a window are, its start does not know them.
    #[test]
    fn starts_have_not_seen_their_windows() {
        let (track, v) = swing(60);
        let reach: Vec<usize> = (0..60).map(|k| (k + 4).min(59)).collect();
        let windows = Window::unseen(estimate(&track, &v), &reach, (4..60, 1), 1.0);
        assert_eq!(windows.len(), 5);
        for (k, window) in windows.iter().enumerate() {
            assert!((window.lead - 0.4).abs() < 1e-12 && window.q[0] == track.q[4 + 10 * k], "{window:?}");
            assert_eq!((window.times.len(), window.measured[0]), (10, track.q[4 + 10 * k + 5]));
        }
        // Predictions are of the times of the samples.
        let motion = predict_by_motion(&OSCILLATOR, &windows, 1);
        assert!(prediction_error(&windows, &motion, (&[false], &[1.0]), 1.0).rms < 1e-5);
        let line = predict_by_constant_velocity(&windows[..1]);
        assert!((line[0][0] - (track.q[4] + 0.5 * v[4])).abs() < 1e-12);
    }

    #[test]
    fn the_right_model_predicts_and_a_straight_line_does_not() {
        let (track, v) = swing(60);
        let windows = Window::cut(estimate(&track, &v), 0..60, 1, 1.0);
        let error = |predictions: &Predictions| prediction_error(&windows, predictions, (&[false], &[1.0]), 1.0);
        let motion = error(&predict_by_motion(&OSCILLATOR, &windows, 2));
        // Tolerances of the roll-out, and interpolation over a tenth of a radian.
        assert!(motion.rms < 1e-5 && motion.windows == 5 && motion.missing == 0, "{motion:?}");
        let line = error(&predict_by_constant_velocity(&windows));
        // |cos(t + 1) - cos t + sin t| over the circle: its root mean square is sqrt((1 - cos 1)^2 + (1 - sin 1)^2)/sqrt 2.
        assert!((line.rms - 0.34).abs() < 0.05, "{line:?}");
        assert_eq!(line.seconds, 1.0);
        // The swing has a spread of 1/sqrt 2; a straight line leaves it by 0.4 of that within a second, the motion never.
        let valid = |predictions: &Predictions| window_valid_times(&windows, predictions, &[false], &[0.5f64.sqrt()]);
        assert!(
            valid(&predict_by_motion(&OSCILLATOR, &windows, 2))
                .iter()
                .all(|v| v.at_least && v.time == windows[0].times[9])
        );
        assert!(valid(&predict_by_constant_velocity(&windows)).iter().any(|v| !v.at_least && v.time < 0.9));
    }

    #[test]
    fn predictions_that_end_are_counted() {
        let (mut track, mut v) = swing(30);
        track.q.fill(0.0);
        v.fill(-1.0);
        let windows = Window::cut(estimate(&track, &v), 0..30, 1, 1.4);
        let error = prediction_error(&windows, &predict_by_motion(&SINGULAR, &windows, 1), (&[false], &[1.0]), 1.4);
        assert!(error.missing == error.windows && error.rms.is_nan() && error.median == f64::INFINITY, "{error:?}");
        let early = prediction_error(&windows, &predict_by_motion(&SINGULAR, &windows, 1), (&[false], &[1.0]), 0.1);
        // Measured is 0, predicted -t - t^2/2.
        assert!(early.missing == 0 && (early.rms - 0.105).abs() < 1e-6, "{early:?}");
    }

    #[test]
    fn angles_count_modulo_a_turn() {
        let window =
            Window { q: vec![0.0], v: vec![0.0], lead: 0.0, times: vec![1.0], measured: vec![7.0], force: None };
        let error = |periodic| {
            prediction_error(std::slice::from_ref(&window), &vec![vec![0.5]], (&[periodic], &[1.0]), 1.0).rms
        };
        assert!((error(true) - (6.5 - std::f64::consts::TAU)).abs() < 1e-12);
        assert_eq!(error(false), 6.5);
    }

    #[test]
    fn unlike_units_are_pooled_over_their_scales_and_stated_apart() {
        let window = |error: f64| {
            let (measured, predicted) = (vec![1.0, 5.0, 0.0], vec![1.0 + error, 5.0 - 100.0 * error, 7.0]);
            (Window { q: vec![0.0; 3], v: vec![0.0; 3], lead: 0.0, times: vec![1.0], measured, force: None }, predicted)
        };
        let (windows, predictions): (Vec<Window>, Predictions) = [0.1, 0.2, 0.3].map(window).into_iter().unzip();
        let pooled = prediction_error(&windows, &predictions, (&[false; 3], &[1.0, 100.0, 0.0]), 1.0);
        assert!((pooled.median - 0.2).abs() < 1e-12 && (pooled.p90 - 0.28).abs() < 1e-12, "{pooled:?}");
        let apart = coordinate_errors(&windows, &predictions, &[false; 3], 1.0);
        assert!((apart[0] - 0.2).abs() < 1e-12 && (apart[1] - 20.0).abs() < 1e-12 && apart[2] == 7.0, "{apart:?}");
    }
}
