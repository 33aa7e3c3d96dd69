//! The trajectory test: learned motion against exact motion from random starts, and the beginning of it in dense samples, for pictures.

use super::thresholds::{
    DRAWN_BEYOND_VALID, DRAWN_LYAPUNOV_TIMES, DRAWN_SAMPLES, DRAWN_TURNS, LEARNED_STEPS, MOST_DRAWN_TURNS,
    RENORMALISATIONS, RUNS_AT_ONCE, SEPARATION_TOLERANCE,
};
use super::{
    CoordinateError, EnergyError, Lyapunov, Statistics, ValidTime, coordinate_error, energy_drift, relative_error,
    spread, statistics, valid_time, velocity_error,
};
use crate::lagrangian::{EulerLagrange, SystemError, SystemInstance, project};
use crate::random::RngStream;
use crate::rollout::{Domain, Integrable, Integrator, Rollout, RolloutError, RolloutOptions, Trajectory, rollout_many};
use crate::scalar::Scalar;
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Bounds of random starts, in physical units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StartBox {
    /// `(lower, upper)` of each coordinate.
    pub q: Vec<(f64, f64)>,
    /// `(lower, upper)` of each velocity.
    pub v: Vec<(f64, f64)>,
}

impl StartBox {
    /// `count` starts, uniform within the bounds; the same seed gives the same starts.
    ///
    /// A start depends only on the seed and on the starts before it: more starts extend the list.
    pub fn starts<S: Scalar>(&self, count: usize, seed: u64) -> Vec<(Vec<S>, Vec<S>)> {
        let mut random = RngStream::Trajectories.generator(seed);
        let mut draw = |bounds: &[(f64, f64)]| -> Vec<S> {
            bounds.iter().map(|(lower, upper)| S::of_f64(lower + (upper - lower) * random.random::<f64>())).collect()
        };
        (0..count).map(|_| (draw(&self.q), draw(&self.v))).collect()
    }
}

/// The test as the paper makes it: random starts, exact motion by [`RolloutOptions::reference`], learned motion at rtol 1e-6 and
/// atol 1e-8.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryTest<S> {
    /// The initial states of motions.
    pub bounds: StartBox,
    /// Number of starts; the paper takes 4.
    pub starts: usize,
    /// Seed of the starts.
    pub seed: u64,
    /// Duration.
    pub t_end: f64,
    /// Distance of samples.
    pub dt: f64,
    /// Which coordinates are angles.
    pub periodic: Vec<bool>,
    /// Energy below which the energy error is not taken relative to `|E(0)|`.
    pub energy_scale: f64,
    /// Integrator of the learned motion.
    pub method: Integrator,
    /// Relative tolerance of the learned motion.
    pub rtol: f64,
    /// Absolute tolerance of the learned motion.
    pub atol: f64,
    /// Steps after which a learned motion is abandoned.
    pub max_steps: usize,
    /// Region in which the learned motion must stay; `None` sets no limit.
    pub domain: Option<Domain<S>>,
    /// `true` to estimate Lyapunov exponents of the exact motion.
    pub lyapunov: bool,
    /// Threads.
    pub threads: usize,
}

/// One start.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryRun<S> {
    /// Exact motion.
    pub exact: Rollout<S>,
    /// Learned motion.
    pub learned: Rollout<S>,
    /// Distance of the two.
    pub coordinates: CoordinateError,
    /// `|v_learned - v_exact|` per coordinate, `(len, n)`.
    pub velocities: Vec<f64>,
    /// Exact energy along the learned motion.
    pub energy: EnergyError,
    /// Exact energy along the exact motion: the error of the reference itself.
    pub reference_energy: EnergyError,
    /// Learned energy along the learned motion.
    pub drift: EnergyError,
    /// Chaos of the exact motion, if requested and found.
    pub lyapunov: Option<Lyapunov>,
    /// Error of the learned coordinates relative to the spread of the exact ones, one per sample of both.
    pub relative: Vec<f64>,
    /// Time of valid prediction of the learned motion.
    pub valid: ValidTime,
}

/// Figures of one start, for reports and scripts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrajectorySummary {
    /// Coordinates at the start.
    pub q: Vec<f64>,
    /// Velocities at the start.
    pub v: Vec<f64>,
    /// Time up to which learned and exact motion could be compared.
    pub compared_until: f64,
    /// Errors of each coordinate.
    pub coordinate_error: Vec<Statistics>,
    /// Errors of each velocity.
    pub velocity_error: Vec<Statistics>,
    /// Normalised error of the exact energy along the learned motion.
    pub energy_error: Statistics,
    /// Normalised drift of the learned energy.
    pub energy_drift: Statistics,
    /// Largest finite-time Lyapunov exponent of the exact motion, if it was requested.
    pub lyapunov_exponent: Option<f64>,
    /// Time of valid prediction of the learned motion.
    pub valid: ValidTime,
    /// The time in Lyapunov times, if the exact motion is chaotic.
    pub valid_lyapunov_times: Option<f64>,
    /// Evaluations of the learned acceleration.
    pub evaluations: usize,
    /// Reason why the learned motion ended early.
    pub stopped: Option<String>,
    /// Reason why the exact motion ended early.
    pub reference_stopped: Option<String>,
}

impl<S: Integrable> TrajectoryTest<S> {
    /// The paper's pendulum test: 4 starts, `t` in `[0, 100]`, `dt` 0.1, rtol 1e-6, atol 1e-8, on one thread.
    pub fn new(bounds: StartBox, periodic: Vec<bool>) -> Self {
        Self {
            bounds,
            starts: 4,
            seed: 0,
            t_end: 100.0,
            dt: 0.1,
            periodic,
            energy_scale: 0.0,
            method: Integrator::Dopri5,
            rtol: 1e-6,
            atol: 1e-8,
            max_steps: LEARNED_STEPS,
            domain: None,
            lyapunov: false,
            threads: 1,
        }
    }

    /// Runs the starts of the box with both models; the results are in their order and do not depend on `threads`.
    #[cfg(test)]
    pub fn run(&self, exact: &dyn EulerLagrange<S>, learned: &dyn EulerLagrange<S>) -> Vec<TrajectoryRun<S>> {
        self.run_from(&self.bounds.starts::<S>(self.starts, self.seed), exact, learned)
    }

    /// As `run`, with the random starts of the box put on the mass shell of `system` or projected onto the constraints of `exact`;
    /// where that fails, the motions of the start report it.
    ///
    /// # Errors
    /// [`SystemError::State`] if box and system differ in the number of coordinates.
    pub fn run_constrained(
        &self,
        system: &SystemInstance<S>,
        exact: &dyn EulerLagrange<S>,
        learned: &dyn EulerLagrange<S>,
    ) -> Result<Vec<TrajectoryRun<S>>, SystemError> {
        let mut starts = self.bounds.starts::<S>(self.starts, self.seed);
        for (q, v) in &mut starts {
            system.impose_constraint(q, v)?;
            if let Some(manifold) = exact.manifold() {
                let _ = project(manifold, q, v);
            }
        }
        Ok(self.run_from(&starts, exact, learned))
    }

    fn run_from(
        &self,
        starts: &[(Vec<S>, Vec<S>)],
        exact: &dyn EulerLagrange<S>,
        learned: &dyn EulerLagrange<S>,
    ) -> Vec<TrajectoryRun<S>> {
        let (reference, options) = self.options();
        let scale = S::of_f64(self.energy_scale);
        // Part by part, so that an interrupted test keeps the runs of earlier parts.
        let pairs = starts.chunks(RUNS_AT_ONCE).flat_map(|part| {
            let truths = rollout_many(exact, part, &reference, self.threads);
            let learned = rollout_many(learned, part, &options, self.threads);
            part.iter().zip(truths.into_iter().zip(learned))
        });
        pairs
            .map(|((q, v), (truth, learned))| {
                let coordinates = coordinate_error(&truth.trajectory, &learned.trajectory, &self.periodic);
                let relative = self.relative(&truth.trajectory, &learned.trajectory);
                TrajectoryRun {
                    velocities: velocity_error(&truth.trajectory, &learned.trajectory),
                    energy: EnergyError::of(exact, &learned.trajectory, scale),
                    reference_energy: energy_drift(&truth.trajectory, scale),
                    drift: energy_drift(&learned.trajectory, scale),
                    lyapunov: if self.lyapunov {
                        Lyapunov::of(exact, q, v, &self.leaps(&reference)).ok()
                    } else {
                        None
                    },
                    valid: valid_time(&coordinates.t, relative.iter().copied(), learned.stop.is_none()),
                    coordinates,
                    relative,
                    exact: truth,
                    learned,
                }
            })
            .collect()
    }

    /// Options of the exact motion and of the learned one.
    pub(super) fn options(&self) -> (RolloutOptions<S>, RolloutOptions<S>) {
        let reference = RolloutOptions::reference(S::of_f64(self.t_end), S::of_f64(self.dt));
        let options = reference
            .clone()
            .method(self.method)
            .tolerances(S::of_f64(self.rtol), S::of_f64(self.atol))
            .domain(self.domain.clone())
            .max_steps(self.max_steps);
        (reference, options)
    }

    /// Error of the learned coordinates relative to the spread of the exact ones, sample by sample as far as both go.
    fn relative(&self, exact: &Trajectory<S>, learned: &Trajectory<S>) -> Vec<f64> {
        let n = exact.coordinates;
        let periodic: Vec<bool> = (0..n).map(|i| self.periodic.get(i).copied().unwrap_or(false)).collect();
        let plain = |values: &[S]| values.iter().map(|x| x.to_f64()).collect::<Vec<_>>();
        let (q, p) = (plain(&exact.q), plain(&learned.q));
        let spread = spread(&q, &periodic);
        let pairs = q.chunks_exact(n.max(1)).zip(p.chunks_exact(n.max(1)));
        pairs.map(|(q, p)| relative_error(q, p, &periodic, &spread)).collect()
    }

    /// Options of the Lyapunov estimate.
    fn leaps(&self, reference: &RolloutOptions<S>) -> RolloutOptions<S> {
        let tolerance = S::max(S::of_f64(SEPARATION_TOLERANCE), reference.rtol);
        reference.clone().dt(S::of_f64(self.t_end.abs() / RENORMALISATIONS)).tolerances(tolerance, tolerance)
    }
}

impl<S: Scalar> TrajectoryRun<S> {
    /// `true` if a cancellation flag ended one of the motions.
    pub(crate) fn is_interrupted(&self) -> bool {
        [&self.exact, &self.learned].iter().any(|motion| matches!(motion.stop, Some(RolloutError::Stopped { .. })))
    }

    /// Lyapunov time of the exact motion, if it is chaotic.
    pub fn chaos(&self) -> Option<f64> {
        self.lyapunov.filter(Lyapunov::is_chaotic).map(|lyapunov| lyapunov.lyapunov_time())
    }

    /// Numbers of the run.
    pub fn summary(&self) -> TrajectorySummary {
        let n = self.exact.trajectory.coordinates;
        let each = |errors: &[f64]| (0..n).map(|i| statistics(errors.iter().skip(i).step_by(n).copied())).collect();
        let start = |values: &[S]| values.iter().map(|x| x.to_f64()).collect::<Vec<_>>();
        let (q, v) = match (self.exact.trajectory.is_empty(), self.learned.trajectory.is_empty()) {
            (false, _) => self.exact.trajectory.state(0),
            (true, false) => self.learned.trajectory.state(0),
            (true, true) => (&[][..], &[][..]),
        };
        TrajectorySummary {
            q: start(q),
            v: start(v),
            compared_until: self.coordinates.t.last().copied().unwrap_or(0.0),
            coordinate_error: each(&self.coordinates.per_coordinate),
            velocity_error: each(&self.velocities),
            energy_error: self.energy.statistics(),
            energy_drift: self.drift.statistics(),
            lyapunov_exponent: self.lyapunov.map(|l| l.exponent),
            valid: self.valid,
            valid_lyapunov_times: self.chaos().map(|time| self.valid.time / time),
            evaluations: self.learned.statistics.evaluations,
            stopped: self.learned.stop.as_ref().map(ToString::to_string),
            reference_stopped: self.exact.stop.as_ref().map(ToString::to_string),
        }
    }
}

/// Exact and learned motion from one start, in the same dense samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Portrait<S> {
    /// Exact motion.
    pub exact: Trajectory<S>,
    /// Learned motion.
    pub learned: Trajectory<S>,
}

impl<S: Integrable> TrajectoryTest<S> {
    /// The time up to which a motion is drawn: a few Lyapunov times of a chaotic motion, and somewhat beyond the time of valid prediction;
    /// some swings of a regular one.
    pub fn shown_until(&self, run: &TrajectoryRun<S>) -> f64 {
        let trajectory = &run.exact.trajectory;
        let end = trajectory.t.last().map_or(0.0, |t| t.to_f64());
        match run.chaos() {
            Some(time) => {
                let until = (DRAWN_BEYOND_VALID * run.valid.time)
                    .clamp(DRAWN_LYAPUNOV_TIMES.0 * time, DRAWN_LYAPUNOV_TIMES.1 * time);
                until.min(nth_turn(trajectory, &self.periodic, MOST_DRAWN_TURNS).unwrap_or(end)).min(end)
            }
            None => nth_turn(trajectory, &self.periodic, DRAWN_TURNS).unwrap_or(end).min(end),
        }
    }

    /// Repeats the motions of a test up to [`TrajectoryTest::shown_until`], in dense samples.
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
            let (t_end, dt) = (S::of_f64(until), S::of_f64(until / DRAWN_SAMPLES));
            let dense = |model: &dyn EulerLagrange<S>, options: RolloutOptions<S>| {
                let options = options.t_end(t_end).dt(dt).energy(false);
                rollout_many(model, &start, &options, 1).remove(0).trajectory
            };
            let (reference, options) = self.options();
            Portrait { exact: dense(exact, reference), learned: dense(learned, options) }
        };
        runs.iter().map(portrait).collect()
    }
}

/// The time at which any coordinate has turned `most` times: its velocity changed sign or, for an angle, it made half a revolution.
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
    use crate::models::{OSCILLATOR, PENDULUM, SINGULAR};

    fn test() -> TrajectoryTest<f64> {
        let bounds = StartBox { q: vec![(-0.1, 0.1)], v: vec![(-0.01, 0.01)] };
        TrajectoryTest { t_end: 10.0, ..TrajectoryTest::new(bounds, vec![true]) }
    }

    #[test]
    fn a_model_against_itself_and_a_near_one() {
        let same = test().run(&PENDULUM, &PENDULUM);
        assert_eq!(same.len(), 4);
        for run in &same {
            let summary = run.summary();
            assert!(summary.coordinate_error[0].max < 1e-5 && summary.energy_error.max < 1e-4, "{summary:?}");
            assert_eq!((summary.compared_until, summary.stopped.clone()), (10.0, None));
            assert!(run.reference_energy.statistics().max < 1e-8);
        }
        for run in &same {
            assert_eq!((run.valid.time, run.valid.at_least, run.chaos()), (10.0, true, None));
            assert!(run.relative.iter().all(|e| *e < 1e-3));
        }
        let other = test().run(&PENDULUM, &OSCILLATOR);
        assert!(other.iter().any(|run| run.summary().coordinate_error[0].max > 1e-5));
        let threaded = TrajectoryTest { threads: 3, lyapunov: true, ..test() }.run(&PENDULUM, &OSCILLATOR);
        for (a, b) in other.iter().zip(&threaded) {
            assert_eq!(a.learned, b.learned);
            assert!(b.lyapunov.unwrap().exponent < 0.3);
        }
    }

    #[test]
    fn failures_shorten_the_comparison_and_summaries_serialise() {
        let run = &TrajectoryTest { starts: 1, ..test() }.run(&PENDULUM, &SINGULAR)[0];
        let summary = run.summary();
        assert!(summary.stopped.as_ref().unwrap().contains("singular"));
        assert!(summary.compared_until < 2.0 && summary.compared_until > 1.0);
        assert!(!summary.valid.at_least && summary.valid.time <= summary.compared_until);
        let text = serde_json::to_string(&summary).unwrap();
        let back: TrajectorySummary = serde_json::from_str(&text).unwrap();
        assert_eq!((back.stopped, back.evaluations), (summary.stopped, summary.evaluations));
        assert!((back.energy_error.max - summary.energy_error.max).abs() < 1e-14);
    }

    #[test]
    fn relativistic_starts_are_on_the_mass_shell() {
        let system = SystemInstance::<f64>::named("ads3-geodesic", &[]).unwrap();
        let exact = system.build().unwrap();
        let start = system.system.trajectory(3).start;
        // Nothing drawn for the velocity of t is used.
        for t_dot in [(0.0, 0.0), (-9.0, 9.0)] {
            let mut v = start.velocities.clone();
            v[0] = t_dot;
            let bounds = StartBox { q: start.positions.clone(), v };
            let test = TrajectoryTest { t_end: 0.5, dt: 0.01, ..TrajectoryTest::new(bounds, vec![false; 3]) };
            let runs = test.run_constrained(&system, exact.as_ref(), exact.as_ref()).unwrap();
            assert_eq!(runs.len(), 4);
            for run in runs {
                let summary = run.summary();
                let mut v = summary.v.clone();
                system.impose_constraint(&summary.q, &mut v).unwrap();
                assert_eq!((v, summary.q[0]), (summary.v, 0.0));
                assert_eq!((summary.compared_until, summary.reference_stopped), (0.5, None));
            }
        }
        let short = TrajectoryTest::new(StartBox { q: vec![(0.0, 1.0)], v: vec![(0.0, 1.0)] }, vec![false]);
        assert!(short.run_constrained(&system, exact.as_ref(), exact.as_ref()).is_err());
    }

    #[test]
    fn starts_extend_and_repeat() {
        let bounds = StartBox { q: vec![(0.0, 6.0), (1.0, 2.0)], v: vec![(-1.0, 1.0); 2] };
        let four = bounds.starts::<f64>(4, 7);
        assert_eq!(bounds.starts::<f64>(6, 7)[..4], four[..]);
        assert_ne!(bounds.starts::<f64>(4, 8), four);
        // Initial weights are drawn from another stream.
        assert_ne!(four[0].0[0], 6.0 * RngStream::Weights.generator(7).random::<f64>());
        assert!(four.iter().all(|(q, v)| (1.0..2.0).contains(&q[1]) && v.iter().all(|v| v.abs() <= 1.0)));
    }

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
        // A chaotic motion of Lyapunov time 2: four of these times are drawn, more if the prediction stays valid longer, never beyond the
        // end.
        runs[0].lyapunov = Some(Lyapunov { exponent: 0.5, time: 100.0 });
        for (valid, until) in [(1.0, 8.0), (10.0, 13.0), (100.0, 24.0)] {
            runs[0].valid = ValidTime { time: valid, at_least: false };
            assert_eq!(test.shown_until(&runs[0]), until);
        }
    }
}
