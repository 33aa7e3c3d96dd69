//! Stochastic training as an argmin solver: one iteration is one epoch, the cost is the validation loss.
//!
//! The parameters argmin sees are those that are validated (averaged, if averaging is on); the solver keeps the weights
//! that move, their moments, the order of the data and the random state.

use crate::scalar::{Real, Scalar};
use crate::training::config::{OnFailure, Optimizer, Phase};
use crate::training::dataset::Dataset;
use crate::training::objective::{Failure, Objective};
use crate::training::optimizer::{Moments, Update};
use crate::training::schedule::Schedule;
use argmin::core::{Error, IterState, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use argmin::kv;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// At most one in this many validation states may be left out of a loss that counts.
const LEFT_OUT: usize = 100;

/// State of an argmin run: parameters and validation loss.
pub type TrainingState<S> = IterState<Vec<S>, (), (), (), (), f64>;

/// One row of the history.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Epoch {
    /// Counted from 1 over all phases.
    pub epoch: usize,
    /// Counted from 1.
    pub phase: usize,
    /// Learning rate at the start of the epoch.
    pub rate: f64,
    /// Mean loss of the epoch's batches, paper convention, without penalty.
    pub training_loss: f64,
    /// Mean penalty of the epoch's batches, with its weight.
    pub penalty: f64,
    /// Fraction of states whose penalty was active.
    pub penalised: f64,
    /// Validation loss, paper convention.
    pub validation_loss: f64,
    /// Mean norm of the gradients before clipping.
    pub gradient_norm: f64,
    /// States left out because they gave no finite acceleration.
    pub left_out: usize,
    /// Steps skipped because they were not finite.
    pub skipped: usize,
    /// Seconds since the start of training.
    pub seconds: f64,
}

/// What a watcher is told while training runs.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// A step was taken: `(step, steps)` of all phases and the mean loss of the epoch so far.
    Step {
        /// Steps taken so far.
        step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// Learning rate.
        rate: f64,
        /// Loss of the step's batch, paper convention.
        loss: f64,
    },
    /// An epoch ended.
    Epoch(&'a Epoch),
}

/// Called while training runs.
pub type Watcher = Arc<dyn Fn(Progress<'_>) + Send + Sync>;

/// Who watches a run and who may end it.
#[derive(Clone, Default)]
pub struct Hooks {
    /// Called after every step and epoch.
    pub watcher: Option<Watcher>,
    /// Raise it to end training after the current step.
    pub interrupt: Arc<AtomicBool>,
}

/// Why a step stopped the training.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StepError {
    /// A state of the batch failed.
    #[error("step {step}: {failure}")]
    State {
        /// Counted from 1 over all phases.
        step: usize,
        /// Which row and why.
        failure: Failure,
    },
    /// The gradient is not finite.
    #[error("step {step}: the gradient is not finite (norm {norm})")]
    Gradient {
        /// Counted from 1 over all phases.
        step: usize,
        /// Its norm.
        norm: f64,
    },
    /// No step of an epoch could be taken.
    #[error("epoch {epoch}: every step had to be skipped, the last because {failure}")]
    NoProgress {
        /// Counted from 1 over all phases.
        epoch: usize,
        /// What the last step failed for.
        failure: Failure,
    },
}

/// What argmin solves: the training and validation states and the objective that evaluates them.
pub struct TrainingProblem<S> {
    /// Loss and gradient of batches.
    pub objective: Objective<S>,
    /// States to learn from.
    pub training: Dataset<S>,
    /// States that choose the best epoch.
    pub validation: Dataset<S>,
}

/// Adam or RAdam over mini-batches of a [`TrainingProblem`].
pub struct EpochSolver<S> {
    pub(super) optimizer: Optimizer,
    pub(super) phase: Phase,
    pub(super) phase_number: usize,
    pub(super) rng: ChaCha8Rng,
    pub(super) order: Vec<u32>,
    pub(super) weights: Vec<S>,
    pub(super) moments: Moments<S>,
    pub(super) average: Vec<S>,
    pub(super) averaged_steps: usize,
    pub(super) gradient: Vec<S>,
    pub(super) epoch: usize,
    pub(super) step: usize,
    pub(super) steps: usize,
    pub(super) started: std::time::Instant,
    pub(super) history: Vec<Epoch>,
    pub(super) stopped: Option<StepError>,
    pub(super) hooks: Hooks,
}

/// Running means over the steps of an epoch.
#[derive(Default)]
struct Means {
    loss: f64,
    penalty: f64,
    norm: f64,
    penalised: usize,
    left_out: usize,
    skipped: usize,
    taken: usize,
    last_failure: Option<Failure>,
}

impl<S: Scalar> EpochSolver<S> {
    /// A solver for one phase over `states` training states, shuffled by `rng`; host it in an argmin `Executor` whose
    /// state starts with the initial weights and runs for `phase.epochs` iterations.
    pub fn new(optimizer: Optimizer, phase: Phase, rng: ChaCha8Rng, states: usize) -> Self {
        let steps = phase.epochs * states.div_ceil(optimizer.batch.min(states).max(1));
        Self {
            optimizer,
            phase,
            phase_number: 1,
            rng,
            order: (0..states as u32).collect(),
            weights: Vec::new(),
            moments: Moments::new(0),
            average: Vec::new(),
            averaged_steps: 0,
            gradient: Vec::new(),
            epoch: 0,
            step: 0,
            steps,
            started: std::time::Instant::now(),
            history: Vec::new(),
            stopped: None,
            hooks: Hooks::default(),
        }
    }

    /// One row per epoch so far.
    pub fn history(&self) -> &[Epoch] {
        &self.history
    }

    fn rate(&self, epoch_of_phase: f64) -> f64 {
        let p = &self.phase;
        p.schedule.rate(p.rate, p.eta_min, p.t_max, epoch_of_phase, p.epochs as f64)
    }

    /// Takes one step; an error means that the weights were not changed and training stops.
    fn take_step(
        &mut self,
        problem: &mut TrainingProblem<S>,
        rows: std::ops::Range<usize>,
        rate: f64,
        means: &mut Means,
    ) -> Result<(), StepError> {
        self.step += 1;
        let step = self.step;
        let rows = &self.order[rows];
        let report = problem.objective.step(&self.weights, &problem.training, rows, &mut self.gradient);
        if let Some(failure) = report.failure {
            means.last_failure = Some(failure);
            means.left_out += report.left_out;
            if self.optimizer.on_failure == OnFailure::Stop {
                return Err(StepError::State { step, failure });
            }
            tracing::debug!(step, %failure, "state left out");
            if matches!(failure, Failure::NotFinite { .. }) || report.left_out == rows.len() {
                means.skipped += 1;
                return Ok(());
            }
        }
        let update = Update {
            method: self.optimizer.method,
            rate,
            weight_decay: self.optimizer.weight_decay,
            clip: self.optimizer.clip,
        };
        let norm = self.moments.update(&mut self.weights, &self.gradient, &update);
        if !norm.is_finite() {
            if self.optimizer.on_failure == OnFailure::Stop {
                return Err(StepError::Gradient { step, norm });
            }
            means.skipped += 1;
            return Ok(());
        }
        self.add_to_average();
        let loss = report.loss.to_f64();
        means.taken += 1;
        means.loss += loss;
        means.penalty += report.penalty.to_f64();
        means.penalised += report.penalised;
        means.norm += norm;
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Step { step, steps: self.steps, rate, loss });
        }
        Ok(())
    }

    /// Exponential average, started as a plain mean so that the first weights are forgotten at once.
    fn add_to_average(&mut self) {
        if self.optimizer.averaging == 0.0 {
            return;
        }
        self.averaged_steps += 1;
        let keep = self.optimizer.averaging.min(1.0 - 1.0 / self.averaged_steps as f64);
        let take = S::of_f64(1.0 - keep);
        crate::scalar::vectorized(
            #[inline(always)]
            || {
                for (average, &w) in self.average.iter_mut().zip(&self.weights) {
                    *average += take * (w - *average);
                }
            },
        );
    }

    /// The weights that are validated and kept.
    fn validated(&self) -> &[S] {
        if self.optimizer.averaging == 0.0 { &self.weights } else { &self.average }
    }
}

impl<S: Scalar> Solver<TrainingProblem<S>, TrainingState<S>> for EpochSolver<S> {
    fn name(&self) -> &str {
        match self.optimizer.method {
            crate::training::optimizer::Method::Adam => "Adam",
            crate::training::optimizer::Method::Radam => "RAdam",
        }
    }

    fn init(
        &mut self,
        _problem: &mut Problem<TrainingProblem<S>>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        if let Some(param) = state.get_param() {
            self.weights.clone_from(param);
        }
        self.average.clone_from(&self.weights);
        self.averaged_steps = 0;
        self.moments = Moments::new(self.weights.len());
        self.gradient.resize(self.weights.len(), <S as Real>::zero());
        Ok((state, None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<TrainingProblem<S>>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        let problem = problem.problem.as_mut().ok_or_else(|| Error::msg("the training problem is missing"))?;
        let begun: f64 = state.get_iter() as f64;
        self.order.shuffle(&mut self.rng);
        let batch = self.optimizer.batch.min(self.order.len());
        let steps = self.order.len().div_ceil(batch);
        let mut means = Means::default();
        for k in 0..steps {
            let within = match self.phase.schedule {
                Schedule::Cosine => k as f64 / steps as f64,
                _ => 0.0,
            };
            let rows = k * batch..((k + 1) * batch).min(self.order.len());
            let rate = self.rate(begun + within);
            if let Err(error) = self.take_step(problem, rows, rate, &mut means) {
                self.stopped = Some(error);
                return Ok((state, None));
            }
            if self.hooks.interrupt.load(Ordering::Relaxed) {
                return Ok((state, None));
            }
        }
        self.epoch += 1;
        if let (0, Some(failure)) = (means.taken, means.last_failure) {
            self.stopped = Some(StepError::NoProgress { epoch: self.epoch, failure });
            return Ok((state, None));
        }
        let validation = problem.objective.loss(self.validated(), &problem.validation);
        let cost = validation.loss.to_f64();
        let taken = means.taken.max(1) as f64;
        let epoch = Epoch {
            epoch: self.epoch,
            phase: self.phase_number,
            rate: self.rate(begun),
            training_loss: means.loss / taken,
            penalty: means.penalty / taken,
            penalised: means.penalised as f64 / self.order.len() as f64,
            validation_loss: cost,
            gradient_norm: means.norm / taken,
            left_out: means.left_out,
            skipped: means.skipped,
            seconds: self.started.elapsed().as_secs_f64(),
        };
        let record = kv!("training_loss" => epoch.training_loss; "rate" => epoch.rate; "penalty" => epoch.penalty;);
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Epoch(&epoch));
        }
        self.history.push(epoch);
        // A loss that is not finite, or that passes over more than a few of the states, must never be the best.
        let judged = LEFT_OUT * validation.left_out <= problem.validation.len();
        let cost = if cost.is_finite() && judged { cost } else { f64::INFINITY };
        let param = self.validated().to_vec();
        Ok((state.param(param).cost(cost), Some(record)))
    }

    fn terminate(&mut self, _state: &TrainingState<S>) -> TerminationStatus {
        match &self.stopped {
            Some(error) => TerminationStatus::Terminated(TerminationReason::SolverExit(error.to_string())),
            None if self.hooks.interrupt.load(Ordering::Relaxed) => {
                TerminationStatus::Terminated(TerminationReason::Interrupt)
            }
            None => TerminationStatus::NotTerminated,
        }
    }
}
