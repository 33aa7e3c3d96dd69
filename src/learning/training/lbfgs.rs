//! Full-batch refinement by limited-memory BFGS (Liu and Nocedal 1989) in double precision, hosted by argmin.
//!
//! Minimises loss plus penalty plus `weight_decay |w|^2 / 2` over all training states of the last phase. The loss is an absolute value,
//! whose kinks end the line search sooner or later; the result is the iterate with the lowest validation loss, which may be the start.

use super::thresholds::EVALUATIONS_PER_ITERATION;
use crate::configuration::Lbfgs;
use crate::training::checkpoint::Clock;
use crate::training::epoch::Epoch;
use crate::training::problem::TrainingProblem;
use crate::training::solver::{Hooks, Progress};
use argmin::core::{CostFunction, Error, Executor, Gradient, IterState, KV, Problem, Solver, State, TerminationStatus};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use std::sync::atomic::Ordering;

/// Initial values of a refinement, the same for all iterations.
pub(crate) struct Start {
    /// Initial parameters.
    pub weights: Vec<f64>,
    /// Validation loss of the initial parameters.
    pub validation_loss: f64,
    /// Last epoch and phase of the history so far.
    pub last: (usize, usize),
    /// Time since training began.
    pub clock: Clock,
    /// Observer and interrupt flag.
    pub hooks: Hooks,
}

/// Result of a refinement.
pub(crate) struct Refined {
    /// Parameters with the lowest validation loss, if it is lower than at the start.
    pub weights: Option<Vec<f64>>,
    /// Lowest validation loss.
    pub validation_loss: f64,
    /// One row per iteration.
    pub history: Vec<Epoch>,
}

/// The problem with a limited number of evaluations.
#[derive(Clone, Copy)]
struct Bounded<'p, 'a> {
    problem: &'p TrainingProblem<'a, f64>,
    hooks: &'p Hooks,
    budget: usize,
}

impl Bounded<'_, '_> {
    /// Fails after an interruption, or if a new point would exceed the limit of evaluations.
    fn admit(&self, weights: &[f64]) -> Result<(), Error> {
        if self.problem.is_known(weights) {
            Ok(())
        } else if self.hooks.interrupt.load(Ordering::Relaxed) {
            Err(Error::msg("interrupted"))
        } else if self.problem.evaluations() >= self.budget {
            Err(Error::msg("the line search found no further descent"))
        } else {
            Ok(())
        }
    }
}

impl CostFunction for Bounded<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, weights: &Vec<f64>) -> Result<f64, Error> {
        self.admit(weights)?;
        self.problem.cost(weights)
    }
}

impl Gradient for Bounded<'_, '_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, weights: &Vec<f64>) -> Result<Vec<f64>, Error> {
        self.admit(weights)?;
        self.problem.gradient(weights)
    }
}

/// The iterates so far, kept outside argmin, because argmin drops problem and solver if a line search fails.
struct Record<'p, 'a> {
    problem: &'p TrainingProblem<'a, f64>,
    hooks: &'p Hooks,
    last: (usize, usize),
    clock: Clock,
    refined: Refined,
}

impl Record<'_, '_> {
    /// Evaluates an iterate on the validation states and adds a row to the history.
    fn note(&mut self, weights: &[f64]) {
        let validation_loss = self.problem.validation_loss(weights).loss;
        let refined = &mut self.refined;
        if validation_loss < refined.validation_loss {
            refined.validation_loss = validation_loss;
            refined.weights = Some(weights.to_vec());
        }
        let found = |last: &crate::training::problem::Evaluated<f64>| {
            Some((last.report?, last.gradient.iter().map(|g| g * g).sum::<f64>().sqrt()))
        };
        let Some((report, gradient_norm)) = self.problem.last(found) else { return };
        let row = Epoch {
            epoch: self.last.0 + refined.history.len() + 1,
            phase: self.last.1 + 1,
            rate: 0.0,
            training_loss: report.loss,
            penalty: report.penalty,
            penalised: report.penalised as f64 / self.problem.training().len() as f64,
            validation_loss,
            gradient_norm,
            left_out: report.left_out,
            skipped: 0,
            seconds: self.clock.seconds(),
        };
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Epoch(&row));
        }
        refined.history.push(row);
    }
}

type Iteration = IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;

/// Wraps a solver of argmin and records its iterates.
struct Recorded<'r, 'p, 'a, L> {
    solver: L,
    record: &'r mut Record<'p, 'a>,
}

impl<'p, 'a, L: Solver<Bounded<'p, 'a>, Iteration>> Solver<Bounded<'p, 'a>, Iteration> for Recorded<'_, 'p, 'a, L> {
    fn name(&self) -> &str {
        self.solver.name()
    }

    fn init(
        &mut self,
        problem: &mut Problem<Bounded<'p, 'a>>,
        state: Iteration,
    ) -> Result<(Iteration, Option<KV>), Error> {
        self.solver.init(problem, state)
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<Bounded<'p, 'a>>,
        state: Iteration,
    ) -> Result<(Iteration, Option<KV>), Error> {
        let (state, record) = self.solver.next_iter(problem, state)?;
        let (iteration, cost) = (state.get_iter(), state.get_cost());
        tracing::info!(iteration, %cost, "lbfgs");
        if let Some(weights) = state.get_param() {
            self.record.note(weights);
        }
        Ok((state, record))
    }

    fn terminate(&mut self, state: &Iteration) -> TerminationStatus {
        self.solver.terminate(state)
    }
}

/// Refines the weights; a failed line search ends the refinement, which keeps the best iterate.
///
/// # Errors
/// The message of argmin if not even the start could be evaluated.
pub(crate) fn lbfgs(settings: &Lbfgs, problem: &TrainingProblem<'_, f64>, start: Start) -> Result<Refined, String> {
    let Start { weights, validation_loss, last, clock, hooks } = start;
    let bounded =
        Bounded { problem, hooks: &hooks, budget: settings.iterations.saturating_mul(EVALUATIONS_PER_ITERATION) };
    let refined = Refined { weights: None, validation_loss, history: Vec::new() };
    let mut record = Record { problem, hooks: &hooks, last, clock, refined };
    let search = MoreThuenteLineSearch::new().with_bounds(1e-10, 10.0).map_err(|e| e.to_string())?;
    let solver = Recorded { solver: LBFGS::new(search, settings.memory), record: &mut record };
    let outcome = Executor::new(bounded, solver)
        .configure(|state: Iteration| state.param(weights).max_iters(settings.iterations as u64))
        .timer(false)
        .run()
        .map(|result| result.state.get_termination_status().to_string());
    match outcome {
        Err(error) if record.refined.history.is_empty() => return Err(error.to_string()),
        Err(error) => tracing::info!(%error, "refinement ended"),
        Ok(status) => tracing::info!(%status, "refinement ended"),
    }
    Ok(record.refined)
}
