//! Stochastic training as an argmin solver: one iteration is one epoch, the cost is the validation loss.
//!
//! The parameters argmin sees are those that are validated (averaged, if averaging is on); the solver keeps the weights
//! that move, their moments, the order of the data and the random state: its course, which a checkpoint can hold between
//! any two steps.

use crate::configuration::{OnFailure, Optimizer, Phase};
use crate::lagrangian::MechanicsError;
use crate::optimizers::Schedule;
use crate::optimizers::Update;
use crate::random::RandomGenerator;
use crate::scalar::{Real, Scalar};
use crate::training::checkpoint::{CheckpointManager, Clock, Ended, OptimizerState, PhaseState};
use crate::training::epoch::{Epoch, Means};
use crate::training::problem::TrainingProblem;
use argmin::core::{Error, IterState, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use argmin::kv;
use rand::seq::SliceRandom;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// At most one in this many validation states may be left out of a loss that counts.
const LEFT_OUT: usize = 100;

/// State of an argmin run: parameters and validation loss.
pub type TrainingState<S> = IterState<Vec<S>, (), (), (), (), f64>;

/// News of a training that runs.
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
#[non_exhaustive]
pub enum StepError {
    /// A state of the batch failed.
    #[error("step {step}: {failure}")]
    State {
        /// Counted from 1 over all phases.
        step: usize,
        /// Which row and why.
        failure: MechanicsError,
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
        /// Failure of the last step.
        failure: MechanicsError,
    },
}

/// Adam, RAdam or SOAP over mini-batches of a [`TrainingProblem`].
pub struct EpochSolver<S> {
    optimizer: Optimizer,
    phase: Phase,
    phase_number: usize,
    course: OptimizerState<S>,
    /// `true` if the course began in an earlier sitting.
    restored: bool,
    gradient: Vec<S>,
    steps: usize,
    clock: Clock,
    history: Vec<Epoch>,
    stopped: Option<StepError>,
    hooks: Hooks,
    saver: Option<Saver<S>>,
}

/// Who keeps the checkpoints, and what went before this phase.
pub(crate) struct Saver<S> {
    pub(crate) keeper: Arc<CheckpointManager>,
    pub(crate) ended: Ended<S>,
    /// Seconds of what went before, where that has a clock of its own.
    pub(crate) seconds: f64,
}

/// The run that a phase is part of.
pub(crate) struct Run<S> {
    /// Counted from 1.
    pub phase_number: usize,
    /// Epochs before this phase.
    pub epoch: usize,
    /// Steps before this phase.
    pub step: usize,
    /// Steps of all phases.
    pub steps: usize,
    /// Time since training began.
    pub clock: Clock,
    /// Who watches.
    pub hooks: Hooks,
    /// Who keeps the checkpoints, if anybody does.
    pub saver: Option<Saver<S>>,
}

/// States of a step: no more than there are, at least one.
fn batch(optimizer: &Optimizer, states: usize) -> usize {
    optimizer.batch.min(states).max(1)
}

impl<S: Scalar> EpochSolver<S> {
    /// A solver for one phase over `states` training states, shuffled by `rng`; host it in an argmin `Executor` whose
    /// state starts with the initial weights and runs for `phase.epochs` iterations.
    pub fn new(optimizer: Optimizer, phase: Phase, rng: RandomGenerator, states: usize) -> Self {
        let steps = phase.epochs * states.div_ceil(batch(&optimizer, states));
        Self {
            optimizer,
            phase,
            phase_number: 1,
            course: OptimizerState::new(rng, states),
            restored: false,
            gradient: Vec::new(),
            steps,
            clock: Clock::after(0.0),
            history: Vec::new(),
            stopped: None,
            hooks: Hooks::default(),
            saver: None,
        }
    }

    /// Makes this phase a part of a longer run.
    pub(crate) fn within(self, run: Run<S>) -> Self {
        let Run { phase_number, epoch, step, steps, clock, hooks, saver } = run;
        let course = OptimizerState { epoch, step, ..self.course };
        Self { phase_number, steps, clock, hooks, saver, course, ..self }
    }

    /// Goes on from where an earlier sitting was.
    pub(crate) fn restored(self, course: OptimizerState<S>, history: Vec<Epoch>) -> Self {
        Self { course, history, restored: true, ..self }
    }

    /// Epochs of this phase that are over.
    pub(crate) fn iteration(&self) -> u64 {
        self.course.iteration
    }

    /// Steps of the whole run so far.
    pub(crate) fn step(&self) -> usize {
        self.course.step
    }

    /// Its rows, and why it stopped, if a step failed.
    pub(crate) fn finish(self) -> (Vec<Epoch>, Option<StepError>) {
        (self.history, self.stopped)
    }

    fn rate(&self, epoch_of_phase: f64) -> f64 {
        let p = &self.phase;
        p.schedule.rate(p.rate, p.eta_min, p.t_max, epoch_of_phase, p.epochs as f64)
    }

    /// Takes one step; an error means that the weights were not changed and training stops.
    fn take_step(
        &mut self,
        problem: &mut TrainingProblem<'_, S>,
        rows: std::ops::Range<usize>,
        rate: f64,
    ) -> Result<(), StepError> {
        let OptimizerState { order, weights, moments, means, step, .. } = &mut self.course;
        *step += 1;
        let step = *step;
        let rows = &order[rows];
        let report = problem.step(weights, rows, &mut self.gradient);
        if let Some(failure) = report.failure {
            means.last_failure = Some(failure);
            means.left_out += report.left_out;
            if self.optimizer.on_failure == OnFailure::Stop {
                return Err(StepError::State { step, failure });
            }
            tracing::debug!(step, %failure, "state left out");
            if matches!(failure, MechanicsError::NotFinite { .. }) || report.left_out == rows.len() {
                means.skipped += 1;
                return Ok(());
            }
        }
        let update = Update {
            method: self.optimizer.method,
            rate,
            weight_decay: self.optimizer.weight_decay,
            decaying: problem.objective().model().weights(),
            clip: self.optimizer.clip,
        };
        let gradient = &mut self.gradient;
        let norm = moments.update_on(Some(problem.objective().pool()), weights, gradient, &update);
        if !norm.is_finite() {
            if self.optimizer.on_failure == OnFailure::Stop {
                return Err(StepError::Gradient { step, norm });
            }
            means.skipped += 1;
            return Ok(());
        }
        let loss = report.loss.to_f64();
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

    /// Exponential average, started as a plain mean so that the first weights are forgotten at once.
    fn add_to_average(&mut self) {
        if self.optimizer.averaging == 0.0 {
            return;
        }
        let OptimizerState { weights, average, averaged_steps, .. } = &mut self.course;
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

    /// The weights that are validated and kept.
    fn validated(&self) -> &[S] {
        if self.optimizer.averaging == 0.0 { &self.course.weights } else { &self.course.average }
    }

    /// Writes a checkpoint, if somebody keeps them and one is due.
    fn save_if(&self, state: &TrainingState<S>, is_due: impl Fn(&CheckpointManager) -> bool) {
        let Some(Saver { keeper, ended, .. }) = self.saver.as_ref().filter(|saver| is_due(&saver.keeper)) else {
            return;
        };
        let best = state.get_best_param().or(state.get_param());
        let underway = PhaseState {
            course: self.course.clone(),
            history: self.history.clone(),
            best: best.unwrap_or(&ended.weights).clone(),
            best_loss: state.get_best_cost(),
            best_epoch: state.get_last_best_iter(),
            shooting: None,
        };
        keeper.save(self.clock.seconds(), ended, Some(&underway));
    }
}

impl<'a, S: Scalar> Solver<TrainingProblem<'a, S>, TrainingState<S>> for EpochSolver<S> {
    fn name(&self) -> &str {
        self.optimizer.method.name()
    }

    fn init(
        &mut self,
        problem: &mut Problem<TrainingProblem<'a, S>>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        if !self.restored {
            let course = &mut self.course;
            if let Some(param) = state.get_param() {
                course.weights.clone_from(param);
            }
            course.average.clone_from(&course.weights);
            course.averaged_steps = 0;
            let problem = problem.problem.as_mut().ok_or_else(|| Error::msg("the training problem is missing"))?;
            course.moments = problem.moments(self.optimizer.method);
        }
        Ok((state, None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<TrainingProblem<'a, S>>,
        state: TrainingState<S>,
    ) -> Result<(TrainingState<S>, Option<KV>), Error> {
        let problem = problem.problem.as_mut().ok_or_else(|| Error::msg("the training problem is missing"))?;
        self.gradient.resize(self.course.weights.len(), <S as Real>::zero());
        let begun: f64 = self.course.iteration as f64;
        if self.course.batch == 0 {
            let OptimizerState { order, rng, means, .. } = &mut self.course;
            order.shuffle(rng);
            *means = Means::default();
        }
        let states = self.course.order.len();
        let batch = batch(&self.optimizer, states);
        let steps = states.div_ceil(batch);
        while self.course.batch < steps {
            let k = self.course.batch;
            let within = match self.phase.schedule {
                Schedule::Cosine => k as f64 / steps as f64,
                _ => 0.0,
            };
            let rows = k * batch..((k + 1) * batch).min(states);
            let rate = self.rate(begun + within);
            if let Err(error) = self.take_step(problem, rows, rate) {
                self.stopped = Some(error);
                return Ok((state, None));
            }
            self.course.batch += 1;
            if self.hooks.interrupt.load(Ordering::Relaxed) {
                return Ok((state, None));
            }
            self.save_if(&state, CheckpointManager::is_due);
        }
        let means = std::mem::take(&mut self.course.means);
        self.course.batch = 0;
        self.course.iteration += 1;
        self.course.epoch += 1;
        if let (0, Some(failure)) = (means.taken, means.last_failure) {
            self.stopped = Some(StepError::NoProgress { epoch: self.course.epoch, failure });
            return Ok((state, None));
        }
        let validation = problem.validation_loss(self.validated());
        let cost = validation.loss.to_f64();
        let taken = means.taken.max(1) as f64;
        let epoch = Epoch {
            epoch: self.course.epoch,
            phase: self.phase_number,
            rate: self.rate(begun),
            training_loss: means.loss / taken,
            penalty: means.penalty / taken,
            penalised: means.penalised as f64 / states as f64,
            validation_loss: cost,
            gradient_norm: means.norm / taken,
            left_out: means.left_out,
            skipped: means.skipped,
            seconds: self.clock.seconds(),
        };
        let record = kv!("training_loss" => epoch.training_loss; "rate" => epoch.rate; "penalty" => epoch.penalty;);
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Epoch(&epoch));
        }
        self.history.push(epoch);
        // A loss that is not finite, or that passes over more than a few of the states, must never be the best.
        let judged = LEFT_OUT * validation.left_out <= problem.validation().len();
        let cost = if cost.is_finite() && judged { cost } else { f64::INFINITY };
        let param = self.validated().to_vec();
        Ok((state.param(param).cost(cost), Some(record)))
    }

    fn terminate(&mut self, state: &TrainingState<S>) -> TerminationStatus {
        if let Some(error) = &self.stopped {
            return TerminationStatus::Terminated(TerminationReason::SolverExit(error.to_string()));
        }
        let interrupted = self.hooks.interrupt.load(Ordering::Relaxed);
        self.save_if(state, |keeper| interrupted || keeper.is_due_after(self.course.epoch));
        if interrupted {
            return TerminationStatus::Terminated(TerminationReason::Interrupt);
        }
        TerminationStatus::NotTerminated
    }
}
