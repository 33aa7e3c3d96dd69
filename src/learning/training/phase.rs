//! One run of epochs through argmin, from its beginning or from a checkpoint.

use crate::scalar::Scalar;
use crate::training::checkpoint::PhaseState;
use crate::training::epoch::Epoch;
use crate::training::learner::Learner;
use crate::training::solver::{EpochSolver, StepError, TrainingState};
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{Error, Executor, KV, State, TerminationReason, TerminationStatus};

/// Why training ended.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum StopReason {
    /// All epochs were run.
    Finished,
    /// The interrupt flag was raised; the best model so far is kept.
    Interrupted,
    /// A step failed; the best model so far is kept.
    Failed(StepError),
}

/// Result of a run of epochs.
pub(crate) struct Epochs<S: Scalar, L: Learner<S>> {
    /// The problem; `None` if argmin lost it.
    pub problem: Option<L::Problem>,
    /// The learner with its unknowns.
    pub learner: L,
    /// One row per epoch.
    pub history: Vec<Epoch>,
    /// Parameters with the lowest cost, and that cost.
    pub best: Option<Vec<S>>,
    pub cost: f64,
    /// Steps of the whole training so far.
    pub steps: usize,
    /// Duration so far, by the clock of the run.
    pub seconds: f64,
    pub stop: StopReason,
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

/// Runs all epochs of a solver from `weights`, or the remaining ones of the run `in_progress`, on a thread of its pool, from which work can
/// be passed to the pool without waking another thread.
///
/// # Errors
/// The message of argmin.
pub(crate) fn run_epochs<S: Scalar, L: Learner<S, Problem: Send> + Send>(
    mut solver: EpochSolver<S, L>,
    mut problem: L::Problem,
    weights: Vec<S>,
    in_progress: Option<PhaseState<S>>,
) -> Result<Epochs<S, L>, String> {
    let mut state = TrainingState::<S>::new().param(weights);
    if let Some(PhaseState { optimizer_state, history, best, best_loss, best_epoch, .. }) = in_progress {
        (state.iter, state.last_best_iter) = (optimizer_state.iteration, best_epoch);
        (state.cost, state.best_cost) = (best_loss, best_loss);
        (state.param, state.best_param) = (Some(best.clone()), Some(best));
        solver = solver.restored(optimizer_state, history);
    }
    let epochs = solver.epochs() as u64;
    let pool = solver.pool(&mut problem);
    let run = || {
        Executor::new(problem, solver)
            .add_observer(Log, ObserverMode::Always)
            .configure(|_| state.max_iters(epochs))
            .timer(false)
            .run()
            .map_err(|error| error.to_string())
    };
    let result = pool.install(run)?;
    let (steps, seconds) = (result.solver.step(), result.solver.seconds());
    let (history, stopped, learner) = result.solver.finish();
    let stop = match (stopped, result.state.get_termination_status()) {
        (Some(error), _) => StopReason::Failed(error),
        (None, TerminationStatus::Terminated(TerminationReason::Interrupt)) => StopReason::Interrupted,
        _ => StopReason::Finished,
    };
    let (best, cost) = (result.state.get_best_param().cloned(), result.state.get_best_cost());
    Ok(Epochs { problem: result.problem.problem, learner, history, best, cost, steps, seconds, stop })
}
