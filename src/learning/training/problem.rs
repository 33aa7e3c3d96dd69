//! Training as an argmin problem: loss and gradient of a network over a training set.

use crate::data::Dataset;
use crate::optimizers::{Method, Moments};
use crate::scalar::{Real, Scalar};
use crate::training::objective::{BatchReport, Objective};
use argmin::core::{CostFunction, Error, Gradient};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Problem of an argmin run: a network's parameters, its training states and its validation states.
///
/// The cost of parameters is loss plus penalty plus `weight_decay |w|^2 / 2` over all training states, `w` the weights among them, and the
/// gradient is its derivative; a line search that needs both at one point costs one evaluation. It works with every solver of argmin and
/// with your own; a batch method calls [`TrainingProblem::step`], and [`Moments::update`] with its gradients.
pub struct TrainingProblem<'a, S> {
    evaluator: Mutex<Evaluator<S>>,
    training: &'a Dataset<S>,
    validation: &'a Dataset<S>,
    weight_decay: f64,
}

/// The objective, and its result at the last evaluated parameters.
struct Evaluator<S> {
    objective: Objective<S>,
    rows: Vec<u32>,
    evaluations: usize,
    last: Evaluated<S>,
}

/// Cost and gradient of the full training set.
#[derive(Clone)]
pub(crate) struct Evaluated<S> {
    pub at: Vec<S>,
    pub cost: S,
    pub gradient: Vec<S>,
    /// `None` before the first evaluation, or if the cost is not finite.
    pub report: Option<BatchReport<S>>,
}

impl<'a, S: Scalar> TrainingProblem<'a, S> {
    /// Creates the problem of learning from `training`, with the validation set `validation`; `weight_decay` enters cost and gradient of
    /// the full set.
    pub fn new(
        objective: Objective<S>,
        training: &'a Dataset<S>,
        validation: &'a Dataset<S>,
        weight_decay: f64,
    ) -> Self {
        let last = Evaluated { at: Vec::new(), cost: S::infinity(), gradient: Vec::new(), report: None };
        let evaluator = Evaluator { objective, rows: (0..training.len() as u32).collect(), evaluations: 0, last };
        Self { evaluator: Mutex::new(evaluator), training, validation, weight_decay }
    }

    /// Training states.
    pub(crate) fn training(&self) -> &'a Dataset<S> {
        self.training
    }

    /// Validation states.
    pub(crate) fn validation(&self) -> &'a Dataset<S> {
        self.validation
    }

    /// Creates the moments before the first step of an update rule, with eigenbases of the weight matrices for SOAP.
    pub fn moments(&mut self, method: Method) -> Moments<S> {
        let model = self.objective().model();
        Moments::for_method(method, model.parameters(), model.matrices())
    }

    /// Computes loss, penalty and gradient of a batch, the training states `rows`, without weight decay; overwrites `gradient`.
    pub fn step(&mut self, weights: &[S], rows: &[u32], gradient: &mut [S]) -> BatchReport<S> {
        let training = self.training;
        self.objective().step(weights, training, rows, gradient)
    }

    /// Loss of the validation states.
    pub fn validation_loss(&self, weights: &[S]) -> BatchReport<S> {
        self.lock().objective.loss(weights, self.validation)
    }

    /// Number of evaluations of the full training set so far.
    pub(crate) fn evaluations(&self) -> usize {
        self.lock().evaluations
    }

    /// The objective that evaluates batches.
    pub(crate) fn objective(&mut self) -> &mut Objective<S> {
        &mut self.evaluator.get_mut().unwrap_or_else(PoisonError::into_inner).objective
    }

    /// `true` if these parameters were the last to be evaluated.
    pub(crate) fn is_known(&self, weights: &[S]) -> bool {
        self.lock().last.is_of(weights)
    }

    /// The result of the last evaluation.
    pub(crate) fn last<T>(&self, read: impl FnOnce(&Evaluated<S>) -> T) -> T {
        read(&self.lock().last)
    }

    fn lock(&self) -> MutexGuard<'_, Evaluator<S>> {
        self.evaluator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Evaluates the parameters unless they were the last to be evaluated.
    fn evaluated(&self, weights: &[S]) -> Result<MutexGuard<'_, Evaluator<S>>, Error> {
        let mut guard = self.lock();
        let Evaluator { objective, rows, evaluations, last } = &mut *guard;
        if last.is_of(weights) {
            return Ok(guard);
        }
        *evaluations += 1;
        last.at.clear();
        last.at.extend_from_slice(weights);
        last.gradient.resize(weights.len(), <S as Real>::zero());
        let report = objective.step(weights, self.training, rows, &mut last.gradient);
        let decay = S::of_f64(self.weight_decay);
        let weights = &weights[..objective.model().weights()];
        let square = weights.iter().fold(<S as Real>::zero(), |sum, &w| sum + w * w);
        last.cost = report.loss + report.penalty + S::half() * decay * square;
        for (g, &w) in last.gradient.iter_mut().zip(weights) {
            *g += decay * w;
        }
        let is_finite = last.cost.is_finite() && last.gradient.iter().all(|g| g.is_finite());
        last.report = is_finite.then_some(report);
        if is_finite { Ok(guard) } else { Err(Error::msg("the loss is not finite")) }
    }
}

impl<S: Scalar> Evaluated<S> {
    fn is_of(&self, weights: &[S]) -> bool {
        self.report.is_some() && self.at == weights
    }
}

impl<S: Scalar> CostFunction for TrainingProblem<'_, S> {
    type Param = Vec<S>;
    type Output = S;

    fn cost(&self, weights: &Vec<S>) -> Result<S, Error> {
        Ok(self.evaluated(weights)?.last.cost)
    }
}

impl<S: Scalar> Gradient for TrainingProblem<'_, S> {
    type Param = Vec<S>;
    type Gradient = Vec<S>;

    fn gradient(&self, weights: &Vec<S>) -> Result<Vec<S>, Error> {
        Ok(self.evaluated(weights)?.last.gradient.clone())
    }
}
