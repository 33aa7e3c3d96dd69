//! Multiple shooting as an argmin solver: one iteration is one epoch, the cost is the validation loss.

use crate::network::Layout;
use crate::scalar::{Real, Scalar};
use crate::training::checkpoint::Clock;
use crate::training::optimizer::{Method, Moments, Update};
use crate::training::schedule::Schedule;
use crate::training::shooting::objective::{ShotReport, Shots};
use crate::training::shooting::segments::Segments;
use crate::training::shooting::settings::Shooting;
use crate::training::shooting::starts::Curvature;
use crate::training::solver::{Epoch, Hooks, Progress, TrainingState};
use argmin::core::{Error, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use argmin::kv;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::sync::atomic::Ordering;

/// At most one in this many validation segments may be left out of a loss that counts.
const LEFT_OUT: usize = 20;
/// Gauss-Newton steps of all starts before the first epoch.
const PREPARATION: usize = 3;

/// What argmin solves.
pub(super) struct ShootingProblem<S> {
    pub shots: Shots<S>,
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

    fn refine(&mut self, shots: &mut Shots<S>, weights: &[S], segments: &Segments<S>) {
        shots.refine(weights, segments, &mut self.at, &mut self.curvature, 1.0);
    }
}

/// Adam or RAdam over mini-batches of segments, Gauss and Newton for their starts.
pub(super) struct ShootingSolver<S> {
    settings: Shooting,
    hooks: Hooks,
    rng: ChaCha8Rng,
    order: Vec<u32>,
    weights: Vec<S>,
    moments: Moments<S>,
    gradient: Vec<S>,
    starts: Starts<S>,
    start_gradient: Vec<S>,
    validation_starts: Starts<S>,
    clock: Clock,
    step: usize,
    epoch: usize,
    pub history: Vec<Epoch>,
    /// Validation loss of the weights that were given.
    pub start_loss: f64,
}

/// Sums over the steps of an epoch.
#[derive(Default)]
struct Means {
    loss: f64,
    gap: f64,
    penalty: f64,
    norm: f64,
    penalised: usize,
    left_out: usize,
    skipped: usize,
    taken: usize,
}

impl<S: Scalar> ShootingSolver<S> {
    pub fn new(
        settings: &Shooting,
        problem: &ShootingProblem<S>,
        rng: ChaCha8Rng,
        hooks: &Hooks,
        clock: Clock,
    ) -> Self {
        Self {
            settings: settings.clone(),
            hooks: hooks.clone(),
            rng,
            order: (0..problem.training.len() as u32).collect(),
            weights: Vec::new(),
            moments: Moments::new(0),
            gradient: Vec::new(),
            starts: Starts::of(&problem.training),
            start_gradient: vec![<S as Real>::zero(); problem.training.starts().len()],
            validation_starts: Starts::of(&problem.validation),
            clock,
            step: 0,
            epoch: 0,
            history: Vec::new(),
            start_loss: f64::INFINITY,
        }
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
        self.validation_starts.refine(shots, &self.weights, validation);
        let rows: Vec<u32> = (0..validation.len() as u32).collect();
        let report = shots.loss(&self.weights, validation, &self.validation_starts.at, &rows);
        let loss = report.loss.to_f64();
        let is_judged = loss.is_finite() && LEFT_OUT * report.left_out <= validation.len();
        if is_judged { loss } else { f64::INFINITY }
    }

    /// One update of the weights and of the starts of the segments `rows` of the order.
    fn take_step(
        &mut self,
        problem: &mut ShootingProblem<S>,
        rows: std::ops::Range<usize>,
        rate: f64,
        steps: usize,
        means: &mut Means,
    ) {
        self.step += 1;
        let ShootingProblem { shots, training, .. } = problem;
        let rows = &self.order[rows];
        let Starts { at, curvature } = &mut self.starts;
        let share = self.settings.start_share;
        shots.settle(&self.weights, training, (at, rows), (curvature, &mut self.start_gradient), share);
        let gradients = (self.gradient.as_mut_slice(), self.start_gradient.as_mut_slice());
        let report: ShotReport<S> = shots.step(&self.weights, training, &self.starts.at, rows, gradients);
        means.left_out += report.left_out;
        let settings = &self.settings;
        let update = Update { method: settings.method, rate, weight_decay: settings.weight_decay, clip: settings.clip };
        let norm = if report.left_out < rows.len() {
            self.moments.update_on(Some(shots.pool()), &mut self.weights, &mut self.gradient, &update)
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
        means.gap += report.gap.to_f64();
        means.penalty += report.penalty.to_f64();
        means.penalised += report.penalised;
        means.norm += norm;
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Step { step: self.step, steps, rate, loss });
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
        if let Some(weights) = state.get_param() {
            self.weights.clone_from(weights);
        }
        let layout = Layout::new(problem.shots.architecture());
        self.moments = Moments::for_method(self.settings.method, self.weights.len(), layout.matrices());
        self.gradient.resize(self.weights.len(), <S as Real>::zero());
        for _ in 1..PREPARATION {
            self.starts.refine(&mut problem.shots, &self.weights, &problem.training);
            self.validation_starts.refine(&mut problem.shots, &self.weights, &problem.validation);
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
        let segments = self.order.len();
        if self.epoch.is_multiple_of(self.settings.curvature_every) {
            self.starts.refine(&mut problem.shots, &self.weights, &problem.training);
        }
        self.order.shuffle(&mut self.rng);
        let batch = self.settings.batch.min(segments);
        let steps = segments.div_ceil(batch);
        let mut means = Means::default();
        for k in 0..steps {
            let rate = self.rate(self.epoch as f64 + k as f64 / steps as f64);
            let rows = k * batch..((k + 1) * batch).min(segments);
            self.take_step(problem, rows, rate, steps * self.settings.epochs, &mut means);
            if self.interrupted() {
                return Ok((state, None));
            }
        }
        let cost = self.judge(problem);
        let taken = means.taken.max(1) as f64;
        let epoch = Epoch {
            epoch: self.epoch + 1,
            phase: 1,
            rate: self.rate(self.epoch as f64),
            training_loss: means.loss / taken,
            penalty: means.penalty / taken,
            penalised: means.penalised as f64 / (segments * problem.training.steps()) as f64,
            validation_loss: cost,
            gradient_norm: means.norm / taken,
            left_out: means.left_out,
            skipped: means.skipped,
            seconds: self.clock.seconds(),
        };
        self.epoch += 1;
        let record = kv!(
            "training_loss" => epoch.training_loss;
            "gap" => means.gap / taken;
            "rate" => epoch.rate;
            "penalty" => epoch.penalty;
        );
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Epoch(&epoch));
        }
        self.history.push(epoch);
        Ok((state.param(self.weights.clone()).cost(cost), Some(record)))
    }

    fn terminate(&mut self, _: &TrainingState<S>) -> TerminationStatus {
        if self.interrupted() {
            return TerminationStatus::Terminated(TerminationReason::Interrupt);
        }
        TerminationStatus::NotTerminated
    }
}
