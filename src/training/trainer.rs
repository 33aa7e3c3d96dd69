//! Runs the phases of a training and gathers what came out.

use crate::network::{Architecture, initial_weights};
use crate::scalar::Scalar;
use crate::training::config::{Config, Phase};
use crate::training::dataset::Dataset;
use crate::training::objective::{BatchReport, Objective};
use crate::training::penalty::Penalty;
use crate::training::polish::{Start, polish};
use crate::training::solver::{Epoch, EpochSolver, Hooks, StepError, TrainingProblem, TrainingState};
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{Error, Executor, KV, State, TerminationReason, TerminationStatus};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::time::Instant;
use thiserror::Error;

/// Streams of the random generator: one seed, independent draws for each purpose.
#[derive(Clone, Copy, Debug)]
pub enum Stream {
    /// Initial weights.
    Weights,
    /// Order of the data in a phase.
    Order(usize),
    /// Training states of a phase.
    Training(usize),
    /// Validation states.
    Validation,
    /// Test states.
    Test,
    /// Starts of the trajectory test.
    Trajectories,
}

impl Stream {
    /// The generator of this purpose.
    pub fn generator(self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(match self {
            Self::Weights => 0,
            Self::Validation => 1,
            Self::Test => 2,
            Self::Trajectories => 3,
            Self::Order(phase) => 16 + 2 * phase as u64,
            Self::Training(phase) => 17 + 2 * phase as u64,
        });
        rng
    }
}

/// Why training ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Stop {
    /// All epochs were run.
    Finished,
    /// The interrupt flag was raised; the best model so far stands.
    Interrupted,
    /// A step failed; the best model so far stands.
    Failed(StepError),
}

/// What training made.
#[derive(Clone, Debug)]
pub struct Trained<S> {
    /// Parameters of the best validation epoch.
    pub weights: Vec<S>,
    /// One row per epoch.
    pub history: Vec<Epoch>,
    /// Best validation loss, paper convention.
    pub validation_loss: f64,
    /// Loss on fresh states that chose nothing, paper convention.
    pub test: BatchReport<S>,
    /// Why training ended.
    pub stop: Stop,
    /// States that went through a step.
    pub states: usize,
    /// Seconds spent in training alone.
    pub seconds: f64,
}

/// Why training could not run.
#[derive(Debug, Error)]
pub enum TrainingError {
    /// Threads could not be started.
    #[error("cannot start {threads} threads: {source}")]
    Threads {
        /// Number asked for.
        threads: usize,
        /// What the system said.
        source: rayon::ThreadPoolBuildError,
    },
    /// The host of the optimiser failed.
    #[error("the optimiser failed: {0}")]
    Optimizer(String),
    /// No epoch gave a finite validation loss.
    #[error("no epoch gave a finite validation loss{}", .0.map(|e| format!(": {e}")).unwrap_or_default())]
    NothingLearned(Option<StepError>),
}

/// Datasets of a run, in the precision of training.
#[derive(Clone, Debug)]
pub struct Datasets<S> {
    /// Training states of each phase.
    pub training: Vec<Dataset<S>>,
    /// Validation states.
    pub validation: Dataset<S>,
    /// Fresh states for the final figure.
    pub test: Dataset<S>,
}

/// Trains a network of this shape with the configuration's penalty, resolved by [`Config::penalty`]; the configuration
/// must have been validated.
///
/// The same configuration, data and seed give the same bytes on any number of `threads`.
///
/// # Errors
/// [`TrainingError`] if nothing was learned; a run that was interrupted or failed after its first epoch returns its best.
pub fn train<S: Scalar>(
    config: &Config,
    architecture: &Architecture,
    penalty: Penalty,
    data: Datasets<S>,
    threads: usize,
    hooks: &Hooks,
) -> Result<Trained<S>, TrainingError> {
    let started = Instant::now();
    let objective =
        || Objective::new(architecture, penalty, threads).map_err(|source| TrainingError::Threads { threads, source });
    let mut weights =
        initial_weights(architecture, config.network.initialization, &mut Stream::Weights.generator(config.seed));
    let batches = |states: usize| states.div_ceil(config.optimizer.batch.min(states));
    let pairs = || config.phases.iter().zip(&data.training);
    let steps = pairs().map(|(phase, data)| phase.epochs * batches(data.len())).sum();
    let mut progress = Run { history: Vec::new(), step: 0, states: 0, stop: Stop::Finished, best: f64::INFINITY };
    for (number, (phase, training)) in config.phases.iter().zip(&data.training).enumerate() {
        let (training, validation) = (training.clone(), data.validation.clone());
        let problem = TrainingProblem { objective: objective()?, training, validation };
        let mut solver = EpochSolver::new(
            config.optimizer.clone(),
            phase.clone(),
            Stream::Order(number).generator(config.seed),
            problem.training.len(),
        );
        solver.phase_number = number + 1;
        solver.epoch = progress.history.len();
        solver.step = progress.step;
        solver.steps = steps;
        solver.started = started;
        solver.hooks = hooks.clone();
        if let Some(best) = progress.run_phase(problem, solver, phase, weights.clone())? {
            weights = best;
        }
        if progress.stop != Stop::Finished {
            break;
        }
    }
    if let (Some(settings), Some(training), Stop::Finished) = (&config.polish, data.training.last(), &progress.stop)
        && progress.best.is_finite()
    {
        let objective = Objective::new(architecture, penalty, threads)
            .map_err(|source| TrainingError::Threads { threads, source })?;
        let start = Start {
            objective,
            training: training.cast(),
            validation: data.validation.cast(),
            weight_decay: config.optimizer.weight_decay,
            weights: weights.iter().map(|w| w.to_f64()).collect(),
            validation_loss: progress.best,
            last: (progress.history.len(), config.phases.len()),
            started,
            hooks: hooks.clone(),
        };
        let polished = polish(settings, start).map_err(TrainingError::Optimizer)?;
        if let Some(best) = polished.weights {
            weights = best.iter().map(|&w| S::of_f64(w)).collect();
        }
        progress.best = polished.validation_loss;
        progress.states += polished.evaluations.saturating_mul(training.len());
        progress.history.extend(polished.history);
        if hooks.interrupt.load(std::sync::atomic::Ordering::Relaxed) {
            progress.stop = Stop::Interrupted;
        }
    }
    if progress.best.is_infinite() {
        let error = if let Stop::Failed(error) = progress.stop { Some(error) } else { None };
        return Err(TrainingError::NothingLearned(error));
    }
    let seconds = started.elapsed().as_secs_f64();
    let test = objective()?.loss(&weights, &data.test);
    Ok(Trained {
        weights,
        history: progress.history,
        validation_loss: progress.best,
        test,
        stop: progress.stop,
        states: progress.states,
        seconds,
    })
}

/// Writes every epoch to the log.
struct Log;

impl<I: State> Observe<I> for Log {
    fn observe_iter(&mut self, state: &I, kv: &KV) -> Result<(), Error> {
        let (epoch, cost, best) = (state.get_iter(), state.get_cost(), state.get_best_cost());
        tracing::info!(epoch, %cost, %best, record = ?kv.kv, "epoch");
        Ok(())
    }
}

/// What the phases have come to so far.
struct Run {
    history: Vec<Epoch>,
    step: usize,
    states: usize,
    stop: Stop,
    best: f64,
}

impl Run {
    /// Runs one phase through argmin; returns its best parameters if they beat those of the phases before.
    fn run_phase<S: Scalar>(
        &mut self,
        problem: TrainingProblem<S>,
        solver: EpochSolver<S>,
        phase: &Phase,
        start: Vec<S>,
    ) -> Result<Option<Vec<S>>, TrainingError> {
        let states = problem.training.len();
        let result = Executor::new(problem, solver)
            .add_observer(Log, ObserverMode::Always)
            .configure(|state: TrainingState<S>| state.param(start).max_iters(phase.epochs as u64))
            .timer(false)
            .run()
            .map_err(|error| TrainingError::Optimizer(error.to_string()))?;
        let solver = result.solver;
        self.states += (solver.step - self.step).saturating_mul(solver.optimizer.batch.min(states));
        self.step = solver.step;
        self.history.extend(solver.history);
        self.stop = match (solver.stopped, result.state.get_termination_status()) {
            (Some(error), _) => Stop::Failed(error),
            (None, TerminationStatus::Terminated(TerminationReason::Interrupt)) => Stop::Interrupted,
            _ => Stop::Finished,
        };
        let cost = result.state.get_best_cost();
        if cost >= self.best {
            return Ok(None);
        }
        self.best = cost;
        Ok(result.state.get_best_param().cloned())
    }
}
