//! Motions to be drawn: the part of a test that an eye can follow, in dense samples.

use super::{TrajectoryRun, TrajectoryTest};
use crate::lagrangian::EulerLagrange;
use crate::rollout::{Integrable, Options, Trajectory, rollout_many};
use crate::scalar::Scalar;

/// Samples of a drawn motion.
const SAMPLES: f64 = 4000.0;
/// Lyapunov times that are drawn of a chaotic motion, at least and at most.
const LYAPUNOV_TIMES: (f64, f64) = (4.0, 12.0);
/// Time span of a portrait over the time of valid prediction, so that it is seen how the two part.
const BEYOND: f64 = 1.3;
/// Turns of its liveliest coordinate that are drawn of a regular motion: ten swings.
const TURNS: usize = 20;
/// The same of a chaotic motion, at most: weak chaos parts neighbours only after many swings.
const MOST_TURNS: usize = 40;

/// Exact and learned motion from one start, in the same dense samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Portrait<S> {
    /// Exact motion.
    pub exact: Trajectory<S>,
    /// Learned motion.
    pub learned: Trajectory<S>,
}

impl<S: Integrable> TrajectoryTest<S> {
    /// The time up to which a motion is drawn: of a chaotic one a few Lyapunov times, and somewhat beyond the time of valid
    /// prediction; of a regular one some swings.
    pub fn shown_until(&self, run: &TrajectoryRun<S>) -> f64 {
        let trajectory = &run.exact.trajectory;
        let end = trajectory.t.last().map_or(0.0, |t| t.to_f64());
        match run.chaos() {
            Some(time) => {
                let until = (BEYOND * run.valid.time).clamp(LYAPUNOV_TIMES.0 * time, LYAPUNOV_TIMES.1 * time);
                until.min(nth_turn(trajectory, &self.periodic, MOST_TURNS).unwrap_or(end)).min(end)
            }
            None => nth_turn(trajectory, &self.periodic, TURNS).unwrap_or(end).min(end),
        }
    }

    /// Motions of a test once more, up to [`TrajectoryTest::shown_until`], in dense samples.
    pub fn portraits(
        &self,
        exact: &dyn EulerLagrange<S>,
        learned: &dyn EulerLagrange<S>,
        runs: &[TrajectoryRun<S>],
    ) -> Vec<Portrait<S>> {
        let portrait = |run: &TrajectoryRun<S>| {
            let (until, truth) = (self.shown_until(run), &run.exact.trajectory);
            if truth.is_empty() || until <= 0.0 {
                return Portrait { exact: truth.clone(), learned: run.learned.trajectory.clone() };
            }
            let (q, v) = truth.state(0);
            let start = [(q.to_vec(), v.to_vec())];
            let (t_end, dt) = (S::of_f64(until), S::of_f64(until / SAMPLES));
            let dense = |model: &dyn EulerLagrange<S>, options: Options<S>| {
                let options = Options { t_end, dt, energy: false, ..options };
                rollout_many(model, &start, &options, 1).remove(0).trajectory
            };
            let (reference, options) = self.options();
            Portrait { exact: dense(exact, reference), learned: dense(learned, options) }
        };
        runs.iter().map(portrait).collect()
    }
}

/// The time at which the first coordinate has turned so many times: changed the sign of its velocity or, an angle, gone half
/// round.
fn nth_turn<S: Scalar>(trajectory: &Trajectory<S>, periodic: &[bool], most: usize) -> Option<f64> {
    let n = trajectory.coordinates;
    let mut turns = vec![0; n];
    for k in 1..trajectory.len() {
        let ((q, v), (before, was)) = (trajectory.state(k), trajectory.state(k - 1));
        for i in 0..n {
            let half = |x: S| (x.to_f64() / std::f64::consts::PI).floor();
            let forwards = |v: S| v.to_f64() > 0.0;
            let turned = forwards(v[i]) != forwards(was[i]);
            let angle = periodic.get(i).copied().unwrap_or(false);
            turns[i] += usize::from(turned || angle && half(q[i]) != half(before[i]));
            if turns[i] >= most {
                return Some(trajectory.t[k].to_f64());
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{Lyapunov, StartBox, ValidTime};
    use crate::rollout::models::OSCILLATOR;

    #[test]
    fn drawn_motions_are_dense_and_short() {
        let bounds = StartBox { q: vec![(1.0, 1.0)], v: vec![(0.0, 0.0)] };
        let test = TrajectoryTest { starts: 1, ..TrajectoryTest::<f64>::new(bounds, vec![false]) };
        let mut runs = test.run(&OSCILLATOR, &OSCILLATOR);
        // q = cos t turns at every multiple of pi.
        let until = test.shown_until(&runs[0]);
        assert!((until - 20.0 * std::f64::consts::PI).abs() < 0.11, "{until}");
        let portrait = &test.portraits(&OSCILLATOR, &OSCILLATOR, &runs)[0];
        for motion in [&portrait.exact, &portrait.learned] {
            assert!(motion.len() >= 4000 && (motion.t.last().unwrap() - until).abs() < 1e-9);
            assert!(motion.t.iter().zip(&motion.q).all(|(t, q)| (q - t.cos()).abs() < 1e-4));
        }
        // A chaotic one of Lyapunov time 2: four of them, more if the prediction holds longer, never beyond the end.
        runs[0].lyapunov = Some(Lyapunov { exponent: 0.5, time: 100.0 });
        for (valid, until) in [(1.0, 8.0), (10.0, 13.0), (100.0, 24.0)] {
            runs[0].valid = ValidTime { time: valid, at_least: false };
            assert_eq!(test.shown_until(&runs[0]), until);
        }
    }
}
