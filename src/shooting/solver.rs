//! Multiple shooting as an argmin solver: one iteration is one epoch, the cost is the validation loss.

use crate::optimizers::Schedule;
use crate::optimizers::{Method, Moments, Update};
use crate::random::RandomGenerator;
use crate::scalar::{Real, Scalar};
use crate::shooting::objective::{ShootingObjective, ShootingReport};
use crate::shooting::segments::Segments;
use crate::shooting::settings::Shooting;
use crate::shooting::starts::Curvature;
use crate::training::checkpoint::{CheckpointManager, Clock, OptimizerState, PhaseState, Shot};
use crate::training::epoch::{Epoch, Means};
use crate::training::solver::{Hooks, Progress, Saver, TrainingState};
use argmin::core::{Error, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use argmin::kv;
use rand::seq::SliceRandom;
use std::sync::atomic::Ordering;

/// At most one in this many validation segments may be left out of a loss that counts.
const LEFT_OUT: usize = 20;
/// Gauss-Newton steps of all starts before the first epoch.
const PREPARATION: usize = 3;

/// Problem of an argmin run.
pub(super) struct ShootingProblem<S> {
    pub shots: ShootingObjective<S>,
    pub training: Segments<S>,
    pub validation: Segments<S>,
}

/// Segments' starts with their curvature.
struct Starts<S> {
    at: Vec<S>,
    curvature: Curvature<S>,
}

impl<S: Scalar> Starts<S> {
    fn of(segments: &Segments<S>) -> Self {
        Self { at: segments.starts().to_vec(), curvature: Curvature::default() }
    }

    fn refine(&mut self, shots: &mut ShootingObjective<S>, weights: &[S], segments: &Segments<S>) {
        shots.refine(weights, segments, &mut self.at, &mut self.curvature, 1.0);
    }
}

/// Adam or RAdam over mini-batches of segments, Gauss and Newton for their starts.
pub(super) struct ShootingSolver<S> {
    settings: Shooting,
    hooks: Hooks,
    course: OptimizerState<S>,
    gradient: Vec<S>,
    starts: Starts<S>,
    start_gradient: Vec<S>,
    validation_starts: Starts<S>,
    /// Sum of the gaps over the batches of the epoch.
    gap: f64,
    /// `true` if the course began in an earlier sitting.
    restored: bool,
    clock: Clock,
    saver: Option<Saver<S>>,
    pub history: Vec<Epoch>,
    /// Validation loss of the weights that were given.
    pub start_loss: f64,
}

impl<S: Scalar> ShootingSolver<S> {
    pub fn new(
        settings: &Shooting,
        problem: &ShootingProblem<S>,
        rng: RandomGenerator,
        hooks: &Hooks,
        saver: Option<Saver<S>>,
    ) -> Self {
        let mut course = OptimizerState::new(rng, problem.training.len());
        course.epoch = saver.as_ref().map_or(0, |saver| saver.ended.history.len());
        Self {
            settings: settings.clone(),
            hooks: hooks.clone(),
            course,
            gradient: Vec::new(),
            starts: Starts::of(&problem.training),
            start_gradient: vec![<S as Real>::zero(); problem.training.starts().len()],
            validation_starts: Starts::of(&problem.validation),
            gap: 0.0,
            restored: false,
            clock: Clock::after(0.0),
            saver,
            history: Vec::new(),
            start_loss: f64::INFINITY,
        }
    }

    /// Goes on from a checkpoint; `None` if that is of other segments.
    pub fn restore(
        &mut self,
        problem: &ShootingProblem<S>,
        course: OptimizerState<S>,
        history: Vec<Epoch>,
        shot: Shot<S>,
    ) -> Option<()> {
        let lengths = |course: &OptimizerState<S>, starts: &[S], validation: &[S]| {
            [course.order.len(), starts.len(), validation.len()]
        };
        let expected = lengths(&self.course, &self.starts.at, &self.validation_starts.at);
        if lengths(&course, &shot.starts, &shot.validation_starts) != expected {
            return None;
        }
        self.starts.curvature = Curvature::restore(&problem.training, &shot.matrices, &shot.jacobian)?;
        (self.starts.at, self.validation_starts.at) = (shot.starts, shot.validation_starts);
        (self.course, self.history, self.restored) = (course, history, true);
        // Behind the first epoch nobody calls `init`.
        self.gradient.resize(self.course.weights.len(), <S as Real>::zero());
        (self.gap, self.start_loss, self.clock) = (shot.gap, shot.start_loss, Clock::after(shot.seconds));
        Some(())
    }

    /// Seconds of multiple shooting, all sittings together.
    pub fn seconds(&self) -> f64 {
        self.clock.seconds()
    }

    /// Writes a checkpoint, if somebody keeps them and one is due.
    fn save_if(&self, state: &TrainingState<S>, is_due: impl Fn(&CheckpointManager) -> bool) {
        let Some(Saver { keeper, ended, seconds }) = self.saver.as_ref().filter(|saver| is_due(&saver.keeper)) else {
            return;
        };
        let best = state.get_best_param().or(state.get_param());
        let (matrices, jacobian) = self.starts.curvature.stored();
        let underway = PhaseState {
            course: self.course.clone(),
            history: self.history.clone(),
            best: best.unwrap_or(&ended.weights).clone(),
            best_loss: state.get_best_cost(),
            best_epoch: state.get_last_best_iter(),
            shooting: Some(Shot {
                seconds: self.clock.seconds(),
                start_loss: self.start_loss,
                gap: self.gap,
                starts: self.starts.at.clone(),
                validation_starts: self.validation_starts.at.clone(),
                matrices: matrices.to_vec(),
                jacobian: jacobian.to_vec(),
            }),
        };
        keeper.save(*seconds, ended, Some(&underway));
    }

    fn interrupted(&self) -> bool {
        self.hooks.interrupt.load(Ordering::Relaxed)
    }

    fn rate(&self, epoch: f64) -> f64 {
        Schedule::Cosine.rate(self.settings.rate, 0.0, 1.0, epoch, self.settings.epochs as f64)
    }

    /// Validation loss from starts that fit the weights, infinite if it means nothing.
    fn judge(&mut self, problem: &mut ShootingProblem<S>) -> f64 {
        let ShootingProblem { shots, validation, .. } = problem;
        let weights = &self.course.weights;
        self.validation_starts.refine(shots, weights, validation);
        let rows: Vec<u32> = (0..validation.len() as u32).collect();
        let report = shots.loss(weights, validation, &self.validation_starts.at, &rows);
        let loss = report.loss.to_f64();
        let is_judged = loss.is_finite() && LEFT_OUT * report.left_out <= validation.len();
        if is_judged { loss } else { f64::INFINITY }
    }

    /// One update of the weights and of the starts of the segments `rows` of the order.
    fn take_step(&mut self, problem: &mut ShootingProblem<S>, rows: std::ops::Range<usize>, rate: f64, steps: usize) {
        let OptimizerState { order, weights, moments, means, step, .. } = &mut self.course;
        *step += 1;
        let step = *step;
        let ShootingProblem { shots, training, .. } = problem;
        let rows = &order[rows];
        let Starts { at, curvature } = &mut self.starts;
        let share = self.settings.start_share;
        shots.settle(weights, training, (at, rows), (curvature, &mut self.start_gradient), share);
        let gradients = (self.gradient.as_mut_slice(), self.start_gradient.as_mut_slice());
        let report: ShootingReport<S> = shots.step(weights, training, &self.starts.at, rows, gradients);
        means.left_out += report.left_out;
        let settings = &self.settings;
        let update = Update {
            method: settings.method,
            rate,
            weight_decay: settings.weight_decay,
            decaying: shots.model().weights(),
            clip: settings.clip,
        };
        let norm = if report.left_out < rows.len() {
            moments.update_on(Some(shots.pool()), weights, &mut self.gradient, &update)
        } else {
            f64::NAN
        };
        if !norm.is_finite() {
            means.skipped += 1;
            return;
        }
        // The gradient is of a mean, the curvature of a sum.
        let sum = S::of_f64(report.residuals as f64);
        self.start_gradient.iter_mut().for_each(|g| *g *= sum);
        self.starts.curvature.correct(training, &mut self.starts.at, &self.start_gradient, settings.start_share);
        let loss = report.loss.to_f64();
        means.taken += 1;
        means.loss += loss;
        self.gap += report.gap.to_f64();
        means.penalty += report.penalty.to_f64();
        means.penalised += report.penalised;
        means.norm += norm;
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Step { step, steps, rate, loss });
        }
    }
}

impl<S: Scalar> Solver<ShootingProblem<S>, TrainingState<S>> for ShootingSolver<S> {
    fn name(&self) -> &str {
        match self.settings.method {
            Method::Adam => "multiple shooting (Adam)",
            Method::Radam => "multiple shooting (RAdam)",
            Method::Soap => "multiple shooting (SOAP)",
        }
    }

    fn init(
        &mut self,
        problem: &mut Problem<ShootingProblem<S>>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        let problem = problem.problem.as_mut().ok_or_else(|| Error::msg("the shooting problem is missing"))?;
        if self.restored {
            return Ok((state, None));
        }
        let OptimizerState { weights, moments, .. } = &mut self.course;
        if let Some(given) = state.get_param() {
            weights.clone_from(given);
        }
        let matrices = problem.shots.model().matrices().into_iter();
        *moments = Moments::for_method(self.settings.method, weights.len(), matrices);
        self.gradient.resize(weights.len(), <S as Real>::zero());
        for _ in 1..PREPARATION {
            self.starts.refine(&mut problem.shots, weights, &problem.training);
            self.validation_starts.refine(&mut problem.shots, weights, &problem.validation);
        }
        self.start_loss = self.judge(problem);
        let cost = self.start_loss;
        Ok((state.cost(cost), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<ShootingProblem<S>>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        let problem = problem.problem.as_mut().ok_or_else(|| Error::msg("the shooting problem is missing"))?;
        let segments = self.course.order.len();
        let begun = self.course.iteration as f64;
        if self.course.batch == 0 {
            if self.course.iteration.is_multiple_of(self.settings.curvature_every as u64) {
                self.starts.refine(&mut problem.shots, &self.course.weights, &problem.training);
            }
            let OptimizerState { order, rng, means, .. } = &mut self.course;
            order.shuffle(rng);
            (*means, self.gap) = (Means::default(), 0.0);
        }
        let batch = self.settings.batch.min(segments);
        let steps = segments.div_ceil(batch);
        while self.course.batch < steps {
            let k = self.course.batch;
            let rate = self.rate(begun + k as f64 / steps as f64);
            let rows = k * batch..((k + 1) * batch).min(segments);
            self.take_step(problem, rows, rate, steps * self.settings.epochs);
            self.course.batch += 1;
            if self.interrupted() {
                return Ok((state, None));
            }
            self.save_if(&state, CheckpointManager::is_due);
        }
        let means = std::mem::take(&mut self.course.means);
        self.course.batch = 0;
        self.course.iteration += 1;
        self.course.epoch += 1;
        let cost = self.judge(problem);
        let taken = means.taken.max(1) as f64;
        let epoch = Epoch {
            epoch: self.course.iteration as usize,
            phase: 1,
            rate: self.rate(begun),
            training_loss: means.loss / taken,
            penalty: means.penalty / taken,
            penalised: means.penalised as f64 / (segments * problem.training.steps()) as f64,
            validation_loss: cost,
            gradient_norm: means.norm / taken,
            left_out: means.left_out,
            skipped: means.skipped,
            seconds: self.clock.seconds(),
        };
        let record = kv!(
            "training_loss" => epoch.training_loss;
            "gap" => self.gap / taken;
            "rate" => epoch.rate;
            "penalty" => epoch.penalty;
        );
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Epoch(&epoch));
        }
        self.history.push(epoch);
        Ok((state.param(self.course.weights.clone()).cost(cost), Some(record)))
    }

    fn terminate(&mut self, state: &TrainingState<S>) -> TerminationStatus {
        let interrupted = self.interrupted();
        self.save_if(state, |keeper| interrupted || keeper.is_due_after(self.course.epoch));
        if interrupted {
            return TerminationStatus::Terminated(TerminationReason::Interrupt);
        }
        TerminationStatus::NotTerminated
    }
}
