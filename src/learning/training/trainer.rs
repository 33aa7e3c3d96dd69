//! Runs the phases of a training and collects the results.

use crate::configuration::Penalty;
use crate::configuration::{Config, ConfigError};
use crate::data::{Dataset, Datasets};
use crate::network::Architecture;
use crate::random::RngStream;
use crate::scalar::Scalar;
use crate::training::checkpoint::{CheckpointManager, Clock, Outcome, PhaseState, Snapshot};
use crate::training::epoch::Epoch;
use crate::training::lbfgs::{Start, lbfgs};
use crate::training::learner::States;
use crate::training::objective::{self, BatchReport, Objective, ThreadsError};
use crate::training::phase::{StopReason, run_epochs};
use crate::training::problem::TrainingProblem;
use crate::training::solver::{CheckpointWriter, EpochSolver, Hooks, Run, StepError};
use std::any::Any;
use std::borrow::Cow;
use std::sync::Arc;
use thiserror::Error;

/// Result of a training.
#[derive(Clone, Debug)]
pub struct Trained<S> {
    /// Parameters of the best validation epoch.
    pub weights: Vec<S>,
    /// One row per epoch.
    pub history: Vec<Epoch>,
    /// Best validation loss, paper convention.
    pub validation_loss: f64,
    /// Test loss, on fresh states, paper convention.
    pub test: BatchReport<S>,
    /// Why training ended.
    pub stop: StopReason,
    /// Steps taken.
    pub steps: usize,
    /// Number of training states processed.
    pub states: usize,
    /// Seconds spent in training alone.
    pub seconds: f64,
}

impl<S: Scalar> Trained<S> {
    /// Converts the end of this training to a checkpoint that can be continued, for example with
    /// [`shooting::resume`](crate::shooting::resume).
    #[doc(hidden)]
    pub fn snapshot(&self, config: &Config) -> Snapshot<S> {
        let outcome = Outcome {
            phases: config.phases.len(),
            refined: config.lbfgs.is_some(),
            weights: self.weights.clone(),
            validation_loss: self.validation_loss,
            history: self.history.clone(),
            steps: self.steps,
            states: self.states,
        };
        Snapshot { seconds: self.seconds, outcome, in_progress: None }
    }
}

/// Why training could not run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainingError {
    /// The configuration is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The number of phases differs from the number of training sets.
    #[error("expected a set of training states for each of {phases} phases, found {found}")]
    Datasets {
        /// Phases of the configuration.
        phases: usize,
        /// Number of training sets.
        found: usize,
    },
    /// Threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// The solver of argmin failed.
    #[error("the optimiser failed: {0}")]
    Optimizer(String),
    /// No epoch had a finite validation loss.
    #[error("no epoch gave a finite validation loss{}", .0.map(|e| format!(": {e}")).unwrap_or_default())]
    NothingLearned(Option<StepError>),
}

/// Checkpoints of a training, and the checkpoint from which it continues.
pub struct ResumeOptions<S> {
    /// Checkpoint writer, if enabled.
    pub checkpoints: Option<Arc<CheckpointManager>>,
    /// The checkpoint that [`CheckpointManager::restore`] found; `None` for a new training.
    pub start: Option<Snapshot<S>>,
}

/// Trains a network of this shape with the configuration's penalty, resolved by [`Config::penalty`].
///
/// The same configuration, data and seed give the same bytes on any number of `threads`.
///
/// # Errors
/// [`TrainingError`] if the configuration is out of range, a phase has no training states or nothing was learned; a run that was interrupted or failed after its first epoch returns its best.
pub fn train<S: Scalar>(
    config: &Config,
    architecture: &Architecture,
    penalty: Penalty,
    data: Datasets<S>,
    threads: usize,
    hooks: &Hooks,
) -> Result<Trained<S>, TrainingError> {
    resume(config, architecture, penalty, data, threads, hooks, ResumeOptions { checkpoints: None, start: None })
}

/// [`train`] with checkpoints and resuming: the result equals that of a training that was never stopped, except for the times.
///
/// A checkpoint must be of the same configuration and data, which [`CheckpointManager::restore`] ensures.
///
/// # Errors
/// Those of [`train`].
pub fn resume<S: Scalar>(
    config: &Config,
    architecture: &Architecture,
    penalty: Penalty,
    data: Datasets<S>,
    threads: usize,
    hooks: &Hooks,
    session: ResumeOptions<S>,
) -> Result<Trained<S>, TrainingError> {
    config.validate(architecture.coordinates)?;
    let (phases, found) = (config.phases.len(), data.training.len());
    if phases != found {
        return Err(TrainingError::Datasets { phases, found });
    }
    let ResumeOptions { checkpoints, start } = session;
    let Snapshot { seconds, mut outcome, in_progress } = start.unwrap_or_else(|| {
        let mut rng = RngStream::Weights.generator(config.seed);
        let weights = architecture.initial_weights(config.network.initialization, &mut rng);
        Snapshot { seconds: 0.0, outcome: Outcome::none(weights), in_progress: None }
    });
    let (pool, clock) = (objective::threads(threads)?, Clock::after(seconds));
    let training = Training { config, architecture, penalty, data: &data, pool, hooks, checkpoints, clock };
    // If the training has ended, its checkpoint belongs to the next stage.
    let shooting = in_progress.as_ref().is_some_and(|in_progress| in_progress.learner.is_some());
    let mut stop = training.run_phases(&mut outcome, in_progress)?;
    if stop == StopReason::Finished && training.refine(&mut outcome)? {
        stop = StopReason::Interrupted;
    }
    if outcome.validation_loss.is_infinite() {
        let error = if let StopReason::Failed(error) = stop { Some(error) } else { None };
        return Err(TrainingError::NothingLearned(error));
    }
    if stop == StopReason::Finished && !shooting {
        training.save(&outcome);
    }
    let seconds = clock.seconds();
    let test = training.objective().loss(&outcome.weights, &data.test);
    let Outcome { weights, history, validation_loss, steps, states, .. } = outcome;
    Ok(Trained { weights, history, validation_loss, test, stop, steps, states, seconds })
}

/// Data that remain the same during a training.
struct Training<'a, S> {
    config: &'a Config,
    architecture: &'a Architecture,
    penalty: Penalty,
    data: &'a Datasets<S>,
    pool: Arc<rayon::ThreadPool>,
    hooks: &'a Hooks,
    checkpoints: Option<Arc<CheckpointManager>>,
    clock: Clock,
}

impl<S: Scalar> Training<'_, S> {
    /// A new objective, in any precision.
    fn objective<T: Scalar>(&self) -> Objective<T> {
        Objective::on(Arc::clone(&self.pool), self.architecture.model(), self.penalty)
    }

    /// Saves a checkpoint between two phases, if checkpoints are enabled.
    fn save(&self, outcome: &Outcome<S>) {
        if let Some(checkpoints) = &self.checkpoints {
            checkpoints.save(self.clock.seconds(), outcome, None);
        }
    }

    /// Runs the remaining phases, the first from its checkpoint if there is one; adds their results and returns why the last one ended.
    fn run_phases(
        &self,
        outcome: &mut Outcome<S>,
        mut in_progress: Option<PhaseState<S>>,
    ) -> Result<StopReason, TrainingError> {
        let config = self.config;
        let batches = |states: usize| states.div_ceil(config.optimizer.batch.min(states));
        let pairs = || config.phases.iter().zip(&self.data.training);
        let steps = pairs().map(|(phase, data)| phase.epochs * batches(data.len())).sum();
        for (number, (phase, training)) in pairs().enumerate().skip(outcome.phases) {
            let weight_decay = config.optimizer.weight_decay;
            let problem = TrainingProblem::new(self.objective(), training, &self.data.validation, weight_decay);
            let rng = RngStream::Order(number).generator(config.seed);
            let run = Run {
                phase_number: number + 1,
                epoch: outcome.history.len(),
                epochs_before: 0,
                step: outcome.steps,
                steps: Some(steps),
                clock: self.clock,
                hooks: self.hooks.clone(),
                writer: self.checkpoints.clone().map(|checkpoints| CheckpointWriter {
                    checkpoints,
                    outcome: outcome.clone(),
                    seconds: None,
                }),
            };
            let (states, optimizer) = (States::new(), config.optimizer.clone());
            let solver = EpochSolver::new(states, optimizer, phase.into(), rng, training.len()).within(run);
            let stop = run_phase(problem, solver, config.optimizer.batch, outcome, in_progress.take())?;
            if stop != StopReason::Finished {
                return Ok(stop);
            }
        }
        Ok(StopReason::Finished)
    }

    /// Refines the result of finished phases by L-BFGS in double precision, if the configuration requests it and it is not done yet;
    /// returns `true` if it was interrupted.
    fn refine(&self, outcome: &mut Outcome<S>) -> Result<bool, TrainingError> {
        let (Some(settings), Some(training)) = (&self.config.lbfgs, self.data.training.last()) else {
            return Ok(false);
        };
        if !outcome.validation_loss.is_finite() || outcome.refined {
            return Ok(false);
        }
        self.save(outcome);
        let start = Start {
            weights: outcome.weights.iter().map(|w| w.to_f64()).collect(),
            validation_loss: outcome.validation_loss,
            last: (outcome.history.len(), self.config.phases.len()),
            clock: self.clock,
            hooks: self.hooks.clone(),
        };
        let (learned, validation) = (in_double(training), in_double(&self.data.validation));
        let weight_decay = self.config.optimizer.weight_decay;
        let problem = TrainingProblem::new(self.objective(), &learned, &validation, weight_decay);
        let refined = lbfgs(settings, &problem, start).map_err(TrainingError::Optimizer)?;
        if let Some(best) = refined.weights {
            outcome.weights = best.iter().map(|&w| S::of_f64(w)).collect();
        }
        outcome.validation_loss = refined.validation_loss;
        outcome.states += problem.evaluations().saturating_mul(training.len());
        outcome.history.extend(refined.history);
        outcome.refined = true;
        Ok(self.hooks.interrupt.load(std::sync::atomic::Ordering::Relaxed))
    }
}

/// Converts states to double precision; copies them only if they have another precision.
fn in_double<S: Scalar>(data: &Dataset<S>) -> Cow<'_, Dataset<f64>> {
    (data as &dyn Any).downcast_ref().map_or_else(|| Cow::Owned(data.cast()), Cow::Borrowed)
}

/// Runs one phase, from its start or from its checkpoint; adds its results and returns why it ended.
///
/// Its best parameters are kept if they beat those of earlier phases.
fn run_phase<'a, S: Scalar>(
    problem: TrainingProblem<'a, S>,
    solver: EpochSolver<S, States<'a>>,
    batch: usize,
    outcome: &mut Outcome<S>,
    in_progress: Option<PhaseState<S>>,
) -> Result<StopReason, TrainingError> {
    let batch = batch.min(problem.training().len());
    let epochs = run_epochs(solver, problem, outcome.weights.clone(), in_progress).map_err(TrainingError::Optimizer)?;
    outcome.phases += 1;
    outcome.states += epochs.steps.saturating_sub(outcome.steps).saturating_mul(batch);
    outcome.steps = epochs.steps;
    outcome.history.extend(epochs.history);
    if let Some(best) = epochs.best
        && epochs.cost < outcome.validation_loss
    {
        (outcome.validation_loss, outcome.weights) = (epochs.cost, best);
    }
    Ok(epochs.stop)
}
