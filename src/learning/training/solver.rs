//! Mini-batch training as an argmin solver: one iteration is one epoch, and the cost is the validation loss. argmin sees the validated
//! parameters (averaged, if averaging is on); the solver keeps the current weights, their moments, the order of the data and the state of
//! the random generator, which a checkpoint can store between any two steps.

use crate::configuration::{OnFailure, Optimizer, Phase};
use crate::lagrangian::MechanicsError;
use crate::optimizers::Schedule;
use crate::optimizers::Update;
use crate::random::RandomGenerator;
use crate::scalar::{Real, Scalar};
use crate::training::checkpoint::{CheckpointManager, Clock, OptimizerState, Outcome, PhaseState};
use crate::training::epoch::{Epoch, Means};
use crate::training::learner::{Learner, Validation};
use argmin::core::{Error, IterState, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use argmin::kv;
use rand::seq::SliceRandom;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// State of an argmin run: parameters and validation loss.
pub type TrainingState<S> = IterState<Vec<S>, (), (), (), (), f64>;

/// Progress of a training.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
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

/// Observer of a run and the flag that ends it.
#[derive(Clone, Default)]
pub struct Hooks {
    /// Called after every step and epoch.
    pub watcher: Option<Watcher>,
    /// Raise it to end training after the current step.
    pub interrupt: Arc<AtomicBool>,
}

/// Why a step stopped the training.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// A state of the batch failed.
    #[error("step {step}: {failure}")]
    State {
        /// Number of the step, counted from 1 over all phases.
        step: usize,
        /// Row of the state, and the reason.
        failure: MechanicsError,
    },
    /// The gradient is not finite.
    #[error("step {step}: the gradient is not finite (norm {norm})")]
    Gradient {
        /// Number of the step, counted from 1 over all phases.
        step: usize,
        /// Its norm.
        norm: f64,
    },
    /// All steps of an epoch were skipped.
    #[error("epoch {epoch}: every step had to be skipped, the last because {failure}")]
    NoProgress {
        /// Number of the epoch, counted from 1 over all phases.
        epoch: usize,
        /// Failure of the last step.
        failure: MechanicsError,
    },
}

/// Number of epochs and schedule of the learning rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LearningRateSchedule {
    /// Number of passes through the samples.
    pub epochs: usize,
    /// Learning rate at the start.
    pub rate: f64,
    /// Lowest learning rate.
    pub eta_min: f64,
    /// Shape of the schedule.
    pub schedule: Schedule,
    /// For `cosine-annealing`, the number of epochs from the highest to the lowest rate.
    pub t_max: f64,
}

impl From<&Phase> for LearningRateSchedule {
    fn from(phase: &Phase) -> Self {
        let &Phase { epochs, rate, eta_min, schedule, t_max, .. } = phase;
        Self { epochs, rate, eta_min, schedule, t_max }
    }
}

/// An update rule over mini-batches of a [`Learner`]'s samples.
pub(crate) struct EpochSolver<S, L> {
    learner: L,
    optimizer: Optimizer,
    rates: LearningRateSchedule,
    phase_number: usize,
    /// Number of epochs that are not in its history.
    epochs_before: usize,
    optimizer_state: OptimizerState<S>,
    /// `true` if this run was resumed.
    restored: bool,
    gradient: Vec<S>,
    steps: usize,
    clock: Clock,
    history: Vec<Epoch>,
    stopped: Option<StepError>,
    hooks: Hooks,
    writer: Option<CheckpointWriter<S>>,
}

/// The checkpoint writer, and everything before this phase.
pub(crate) struct CheckpointWriter<S> {
    pub(crate) checkpoints: Arc<CheckpointManager>,
    pub(crate) outcome: Outcome<S>,
    /// Seconds before this phase, if this run's clock does not include them.
    pub(crate) seconds: Option<f64>,
}

/// Data of the whole run that contains a phase.
pub(crate) struct Run<S> {
    /// Number of the phase, counted from 1.
    pub phase_number: usize,
    /// Number of epochs before this phase.
    pub epoch: usize,
    /// Number of those epochs that belong to another history.
    pub epochs_before: usize,
    /// Number of steps before this phase.
    pub step: usize,
    /// Number of steps of all phases, if there are several.
    pub steps: Option<usize>,
    /// Time since training began.
    pub clock: Clock,
    /// Observer and interrupt flag.
    pub hooks: Hooks,
    /// Checkpoint writer, if enabled.
    pub writer: Option<CheckpointWriter<S>>,
}

/// Batch size: at least one sample, at most all.
fn batch(optimizer: &Optimizer, samples: usize) -> usize {
    optimizer.batch.min(samples).max(1)
}

impl<S: Scalar, L: Learner<S>> EpochSolver<S, L> {
    /// Creates a solver for one phase over `samples` training samples, shuffled by `rng`; run it in an argmin `Executor` whose state starts
    /// with the initial weights and that runs for `rates.epochs` iterations.
    pub fn new(
        learner: L,
        optimizer: Optimizer,
        rates: LearningRateSchedule,
        rng: RandomGenerator,
        samples: usize,
    ) -> Self {
        let steps = rates.epochs * samples.div_ceil(batch(&optimizer, samples));
        Self {
            learner,
            optimizer,
            rates,
            phase_number: 1,
            epochs_before: 0,
            optimizer_state: OptimizerState::new(rng, samples),
            restored: false,
            gradient: Vec::new(),
            steps,
            clock: Clock::after(0.0),
            history: Vec::new(),
            stopped: None,
            hooks: Hooks::default(),
            writer: None,
        }
    }

    /// Embeds this phase in a longer run.
    pub(crate) fn within(self, run: Run<S>) -> Self {
        let Run { phase_number, epoch, epochs_before, step, steps, clock, hooks, writer } = run;
        let optimizer_state = OptimizerState { epoch, step, ..self.optimizer_state };
        let steps = steps.unwrap_or(self.steps);
        Self { phase_number, epochs_before, steps, clock, hooks, writer, optimizer_state, ..self }
    }

    /// Resumes from a checkpoint.
    pub(crate) fn restored(self, optimizer_state: OptimizerState<S>, history: Vec<Epoch>) -> Self {
        Self { optimizer_state, history, restored: true, ..self }
    }

    /// Threads of the run.
    pub(crate) fn pool(&self, problem: &mut L::Problem) -> Arc<rayon::ThreadPool> {
        self.learner.pool(problem)
    }

    /// Epochs of this phase.
    pub(crate) fn epochs(&self) -> usize {
        self.rates.epochs
    }

    /// Steps of the whole run so far.
    pub(crate) fn step(&self) -> usize {
        self.optimizer_state.step
    }

    /// Seconds by the clock of the run.
    pub(crate) fn seconds(&self) -> f64 {
        self.clock.seconds()
    }

    /// Returns its history, the failed step if there was one, and the learner.
    pub(crate) fn finish(self) -> (Vec<Epoch>, Option<StepError>, L) {
        (self.history, self.stopped, self.learner)
    }

    fn rate(&self, epoch_of_phase: f64) -> f64 {
        let LearningRateSchedule { epochs, rate, eta_min, schedule, t_max } = self.rates;
        schedule.rate(rate, eta_min, t_max, epoch_of_phase, epochs as f64)
    }

    /// Takes one step; an error means that the weights were not changed and training stops.
    fn take_step(
        &mut self,
        problem: &mut L::Problem,
        rows: std::ops::Range<usize>,
        rate: f64,
    ) -> Result<(), StepError> {
        let OptimizerState { order, weights, moments, means, step, .. } = &mut self.optimizer_state;
        *step += 1;
        let step = *step;
        let rows = &order[rows];
        let report = self.learner.step(problem, weights, rows, &mut self.gradient);
        means.left_out += report.left_out;
        if let Some(failure) = report.failure {
            means.last_failure = Some(failure);
            if self.optimizer.on_failure == OnFailure::Stop {
                return Err(StepError::State { step, failure });
            }
            tracing::debug!(step, %failure, "state left out");
        }
        if matches!(report.failure, Some(MechanicsError::NotFinite { .. })) || report.left_out == rows.len() {
            means.skipped += 1;
            return Ok(());
        }
        let update = Update {
            method: self.optimizer.method,
            rate,
            weight_decay: self.optimizer.weight_decay,
            decaying: self.learner.decaying(problem),
            clip: self.optimizer.clip,
        };
        let gradient = &mut self.gradient;
        let pool = self.learner.pool(problem);
        let norm = moments.update_on(Some(&pool), weights, gradient, &update);
        if !norm.is_finite() {
            if self.optimizer.on_failure == OnFailure::Stop {
                return Err(StepError::Gradient { step, norm });
            }
            means.skipped += 1;
            return Ok(());
        }
        self.learner.follow(problem);
        let loss = report.loss.to_f64();
        let means = &mut self.optimizer_state.means;
        means.taken += 1;
        means.loss += loss;
        means.penalty += report.penalty.to_f64();
        means.penalised += report.penalised;
        means.norm += norm;
        self.add_to_average();
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Step { step, steps: self.steps, rate, loss });
        }
        Ok(())
    }

    /// Updates the exponential average, which starts as a plain mean so that the initial weights are forgotten quickly.
    fn add_to_average(&mut self) {
        if self.optimizer.averaging == 0.0 {
            return;
        }
        let OptimizerState { weights, average, averaged_steps, .. } = &mut self.optimizer_state;
        *averaged_steps += 1;
        let keep = self.optimizer.averaging.min(1.0 - 1.0 / *averaged_steps as f64);
        let take = S::of_f64(1.0 - keep);
        crate::scalar::vectorized(
            #[inline(always)]
            || {
                for (average, &w) in average.iter_mut().zip(&*weights) {
                    *average += take * (w - *average);
                }
            },
        );
    }

    /// The weights that are validated and stored.
    fn validated(&self) -> &[S] {
        if self.optimizer.averaging == 0.0 { &self.optimizer_state.weights } else { &self.optimizer_state.average }
    }

    /// Writes a checkpoint, if checkpoints are enabled and one is due.
    fn save_if(&self, state: &TrainingState<S>, is_due: impl Fn(&CheckpointManager) -> bool) {
        let Some(CheckpointWriter { checkpoints, outcome, seconds }) =
            self.writer.as_ref().filter(|writer| is_due(&writer.checkpoints))
        else {
            return;
        };
        let best = state.get_best_param().or(state.get_param());
        let in_progress = PhaseState {
            optimizer_state: self.optimizer_state.clone(),
            history: self.history.clone(),
            best: best.unwrap_or(&outcome.weights).clone(),
            best_loss: state.get_best_cost(),
            best_epoch: state.get_last_best_iter(),
            learner: self.learner.stored(self.seconds()),
        };
        checkpoints.save(seconds.unwrap_or_else(|| self.seconds()), outcome, Some(&in_progress));
    }
}

impl<S: Scalar, L: Learner<S>> Solver<L::Problem, TrainingState<S>> for EpochSolver<S, L> {
    fn name(&self) -> &str {
        self.optimizer.method.name()
    }

    fn init(
        &mut self,
        problem: &mut Problem<L::Problem>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        if self.restored {
            return Ok((state, None));
        }
        let optimizer_state = &mut self.optimizer_state;
        if let Some(param) = state.get_param() {
            optimizer_state.weights.clone_from(param);
        }
        optimizer_state.average.clone_from(&optimizer_state.weights);
        optimizer_state.averaged_steps = 0;
        let problem = problem.problem.as_mut().ok_or_else(|| Error::msg("the training problem is missing"))?;
        optimizer_state.moments = self.learner.moments(problem, self.optimizer.method, optimizer_state.weights.len());
        let cost = self.learner.begin(problem, &optimizer_state.weights);
        Ok((if let Some(cost) = cost { state.cost(cost) } else { state }, None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<L::Problem>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        let problem = problem.problem.as_mut().ok_or_else(|| Error::msg("the training problem is missing"))?;
        self.gradient.resize(self.optimizer_state.weights.len(), <S as Real>::zero());
        let begun: f64 = self.optimizer_state.iteration as f64;
        if self.optimizer_state.batch == 0 {
            let OptimizerState { order, rng, means, weights, iteration, .. } = &mut self.optimizer_state;
            self.learner.begin_epoch(problem, weights, *iteration);
            order.shuffle(rng);
            *means = Means::default();
        }
        let samples = self.optimizer_state.order.len();
        let batch = batch(&self.optimizer, samples);
        let steps = samples.div_ceil(batch);
        while self.optimizer_state.batch < steps {
            let k = self.optimizer_state.batch;
            let within = match self.rates.schedule {
                Schedule::Cosine => k as f64 / steps as f64,
                _ => 0.0,
            };
            let rows = k * batch..((k + 1) * batch).min(samples);
            let rate = self.rate(begun + within);
            if let Err(error) = self.take_step(problem, rows, rate) {
                self.stopped = Some(error);
                return Ok((state, None));
            }
            self.optimizer_state.batch += 1;
            if self.hooks.interrupt.load(Ordering::Relaxed) {
                return Ok((state, None));
            }
            self.save_if(&state, CheckpointManager::is_due);
        }
        let means = std::mem::take(&mut self.optimizer_state.means);
        self.optimizer_state.batch = 0;
        self.optimizer_state.iteration += 1;
        self.optimizer_state.epoch += 1;
        if let (0, Some(failure)) = (means.taken, means.last_failure) {
            self.stopped = Some(StepError::NoProgress { epoch: self.optimizer_state.epoch, failure });
            return Ok((state, None));
        }
        let param = self.validated().to_vec();
        let Validation { loss, cost } = self.learner.validate(problem, &param);
        let taken = means.taken.max(1) as f64;
        let epoch = Epoch {
            epoch: self.optimizer_state.epoch - self.epochs_before,
            phase: self.phase_number,
            rate: self.rate(begun),
            training_loss: means.loss / taken,
            penalty: means.penalty / taken,
            penalised: means.penalised as f64 / (samples * self.learner.penalty_states(problem)) as f64,
            validation_loss: loss,
            gradient_norm: means.norm / taken,
            left_out: means.left_out,
            skipped: means.skipped,
            seconds: self.clock.seconds(),
        };
        let mut record = kv!("training_loss" => epoch.training_loss; "rate" => epoch.rate; "penalty" => epoch.penalty;);
        self.learner.record(taken, &mut record);
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Epoch(&epoch));
        }
        self.history.push(epoch);
        Ok((state.param(param).cost(cost), Some(record)))
    }

    fn terminate(&mut self, state: &TrainingState<S>) -> TerminationStatus {
        if let Some(error) = &self.stopped {
            return TerminationStatus::Terminated(TerminationReason::SolverExit(error.to_string()));
        }
        let interrupted = self.hooks.interrupt.load(Ordering::Relaxed);
        self.save_if(state, |checkpoints| interrupted || checkpoints.is_due_after(self.optimizer_state.epoch));
        if interrupted {
            return TerminationStatus::Terminated(TerminationReason::Interrupt);
        }
        TerminationStatus::NotTerminated
    }
}
