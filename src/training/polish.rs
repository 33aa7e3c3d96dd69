//! Full-batch polishing by limited-memory BFGS (Liu and Nocedal 1989) in double precision, hosted by argmin.
//!
//! Minimises loss plus penalty plus `weight_decay |w|^2 / 2` over all training states of the last phase. The loss is an
//! absolute value, whose kinks end the line search sooner or later; what stands then is the iterate of the lowest
//! validation loss, which may be the start.

use crate::training::checkpoint::Clock;
use crate::training::config::Polish;
use crate::training::dataset::Dataset;
use crate::training::objective::{BatchReport, Objective};
use crate::training::solver::{Epoch, Hooks, Progress};
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{CostFunction, Error, Executor, Gradient, IterState, KV, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

/// Evaluations an iteration may take on average; argmin's line searches know no limit.
const EVALUATIONS: usize = 20;

/// What polishing starts from, the same for every iteration.
pub(super) struct Start {
    /// Loss and penalty.
    pub objective: Objective<f64>,
    /// States to learn from.
    pub training: Dataset<f64>,
    /// States to choose by.
    pub validation: Dataset<f64>,
    /// L2 weight decay.
    pub weight_decay: f64,
    /// Parameters to begin with.
    pub weights: Vec<f64>,
    /// Their validation loss.
    pub validation_loss: f64,
    /// Last epoch and phase of the history so far.
    pub last: (usize, usize),
    /// Time since training began.
    pub clock: Clock,
    /// Who watches.
    pub hooks: Hooks,
}

/// What polishing came to.
pub(super) struct Polished {
    /// Parameters of the lowest validation loss, if lower than at the start.
    pub weights: Option<Vec<f64>>,
    /// Lowest validation loss.
    pub validation_loss: f64,
    /// One row per iteration.
    pub history: Vec<Epoch>,
    /// Evaluations of the whole training set.
    pub evaluations: usize,
}

/// Loss and gradient at the last point asked for: argmin asks for them one after the other.
struct FullBatch {
    objective: Objective<f64>,
    training: Dataset<f64>,
    validation: Dataset<f64>,
    rows: Vec<u32>,
    weight_decay: f64,
    at: Vec<f64>,
    cost: f64,
    gradient: Vec<f64>,
    report: Option<BatchReport<f64>>,
    evaluations: usize,
    budget: usize,
    hooks: Hooks,
    best: Option<Vec<f64>>,
    best_loss: f64,
    history: Vec<Epoch>,
    last: (usize, usize),
    clock: Clock,
}

impl FullBatch {
    /// Evaluates unless the point is the last one.
    fn evaluate(&mut self, weights: &[f64]) -> Result<(), Error> {
        if self.report.is_some() && self.at == weights {
            return Ok(());
        }
        if self.hooks.interrupt.load(Ordering::Relaxed) {
            return Err(Error::msg("interrupted"));
        }
        if self.evaluations >= self.budget {
            return Err(Error::msg("the line search found no further descent"));
        }
        self.evaluations += 1;
        self.at.clear();
        self.at.extend_from_slice(weights);
        let report = self.objective.step(weights, &self.training, &self.rows, &mut self.gradient);
        let square: f64 = weights.iter().map(|w| w * w).sum();
        self.cost = report.loss + report.penalty + 0.5 * self.weight_decay * square;
        for (g, w) in self.gradient.iter_mut().zip(weights) {
            *g += self.weight_decay * w;
        }
        self.report = Some(report);
        if self.cost.is_finite() && self.gradient.iter().all(|g| g.is_finite()) {
            Ok(())
        } else {
            self.report = None;
            Err(Error::msg("the loss is not finite"))
        }
    }

    /// Judges an iterate on the validation states and writes its row.
    fn note(&mut self, weights: &[f64]) {
        let validation_loss = self.objective.loss(weights, &self.validation).loss;
        if validation_loss < self.best_loss {
            self.best_loss = validation_loss;
            self.best = Some(weights.to_vec());
        }
        let Some(report) = self.report else { return };
        let row = Epoch {
            epoch: self.last.0 + self.history.len() + 1,
            phase: self.last.1 + 1,
            rate: 0.0,
            training_loss: report.loss,
            penalty: report.penalty,
            penalised: report.penalised as f64 / self.rows.len() as f64,
            validation_loss,
            gradient_norm: self.gradient.iter().map(|g| g * g).sum::<f64>().sqrt(),
            left_out: report.left_out,
            skipped: 0,
            seconds: self.clock.seconds(),
        };
        if let Some(watcher) = &self.hooks.watcher {
            watcher(Progress::Epoch(&row));
        }
        self.history.push(row);
    }
}

/// The problem as argmin and its observer share it.
#[derive(Clone)]
struct Shared(Arc<Mutex<FullBatch>>);

impl Shared {
    fn lock(&self) -> std::sync::MutexGuard<'_, FullBatch> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl CostFunction for Shared {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, weights: &Vec<f64>) -> Result<f64, Error> {
        let mut batch = self.lock();
        batch.evaluate(weights)?;
        Ok(batch.cost)
    }
}

impl Gradient for Shared {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, weights: &Vec<f64>) -> Result<Vec<f64>, Error> {
        let mut batch = self.lock();
        batch.evaluate(weights)?;
        Ok(batch.gradient.clone())
    }
}

type Iteration = IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;

impl Observe<Iteration> for Shared {
    fn observe_iter(&mut self, state: &Iteration, _: &KV) -> Result<(), Error> {
        let (iteration, cost) = (state.get_iter(), state.get_cost());
        tracing::info!(iteration, %cost, "polish");
        if let Some(weights) = state.get_param() {
            self.lock().note(weights);
        }
        Ok(())
    }
}

/// Polishes; a line search that fails ends it and what was reached stands.
///
/// # Errors
/// The words of argmin if not even the start could be evaluated.
pub(super) fn polish(settings: &Polish, start: Start) -> Result<Polished, String> {
    let parameters = start.weights.len();
    let rows = (0..start.training.len() as u32).collect();
    let shared = Shared(Arc::new(Mutex::new(FullBatch {
        objective: start.objective,
        training: start.training,
        validation: start.validation,
        rows,
        weight_decay: start.weight_decay,
        at: Vec::new(),
        cost: f64::INFINITY,
        gradient: vec![0.0; parameters],
        report: None,
        evaluations: 0,
        budget: settings.iterations.saturating_mul(EVALUATIONS),
        hooks: start.hooks,
        best: None,
        best_loss: start.validation_loss,
        history: Vec::new(),
        last: start.last,
        clock: start.clock,
    })));
    let search = MoreThuenteLineSearch::new().with_bounds(1e-10, 10.0).map_err(|e| e.to_string())?;
    let solver = LBFGS::new(search, settings.memory);
    let outcome = Executor::new(shared.clone(), solver)
        .add_observer(shared.clone(), ObserverMode::Always)
        .configure(|state: Iteration| state.param(start.weights).max_iters(settings.iterations as u64))
        .timer(false)
        .run();
    let mut batch = shared.lock();
    match outcome {
        Err(error) if batch.history.is_empty() => return Err(error.to_string()),
        Err(error) => tracing::info!(%error, "polishing ended"),
        Ok(result) => tracing::info!(status = %result.state.get_termination_status(), "polishing ended"),
    }
    Ok(Polished {
        weights: batch.best.take(),
        validation_loss: batch.best_loss,
        history: std::mem::take(&mut batch.history),
        evaluations: batch.evaluations,
    })
}
