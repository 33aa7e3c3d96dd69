//! Interface between the epoch loop and its samples: states of a dataset, or segments of motion in multiple shooting.

use super::thresholds::STATES_PER_LEFT_OUT;
use crate::optimizers::{Method, Moments};
use crate::scalar::Scalar;
use crate::training::objective::BatchReport;
use crate::training::problem::TrainingProblem;
use argmin::core::KV;
use std::marker::PhantomData;
use std::sync::Arc;

/// Loss of the validation samples.
pub(crate) struct Validation {
    /// The value shown in the history.
    pub loss: f64,
    /// The value for comparing parameters; infinite if it is meaningless.
    pub cost: f64,
}

/// Samples to learn from in batches, possibly with unknowns in addition to the weights.
pub(crate) trait Learner<S: Scalar> {
    /// Problem that evaluates batches.
    type Problem;

    /// Moments of `parameters` weights before the first step of an update rule.
    fn moments(&mut self, problem: &mut Self::Problem, method: Method, parameters: usize) -> Moments<S>;

    /// Number of weights that decay; they are the first parameters.
    fn decaying(&self, problem: &mut Self::Problem) -> usize;

    /// Threads of the run.
    fn pool(&self, problem: &mut Self::Problem) -> Arc<rayon::ThreadPool>;

    /// Called before the first epoch; returns the cost of the initial weights if the epochs have to improve on it.
    fn begin(&mut self, problem: &mut Self::Problem, weights: &[S]) -> Option<f64> {
        let _ = (problem, weights);
        None
    }

    /// Called before epoch `epoch` of this phase, counted from 0.
    fn begin_epoch(&mut self, problem: &mut Self::Problem, weights: &[S], epoch: u64) {
        let _ = (problem, weights, epoch);
    }

    /// Computes loss, penalty and gradient of the samples `rows`; overwrites `gradient`.
    fn step(&mut self, problem: &mut Self::Problem, weights: &[S], rows: &[u32], gradient: &mut [S]) -> BatchReport<S>;

    /// Called after the weights have been updated with the gradient of the last step.
    fn follow(&mut self, problem: &mut Self::Problem) {
        let _ = problem;
    }

    /// Number of states of one sample at which the penalty is evaluated.
    fn penalty_states(&self, problem: &Self::Problem) -> usize {
        let _ = problem;
        1
    }

    /// Adds the learner's values for the log of an epoch of `batches` batches.
    fn record(&self, batches: f64, record: &mut KV) {
        let _ = (batches, record);
    }

    /// Loss of the validation samples.
    fn validate(&mut self, problem: &mut Self::Problem, weights: &[S]) -> Validation;

    /// Serializes the unknowns other than the weights for a checkpoint, after `seconds` of this phase; `None` if there are none.
    fn stored(&self, seconds: f64) -> Option<Vec<u8>> {
        let _ = seconds;
        None
    }
}

/// States of a [`TrainingProblem`]; only the weights are fitted.
pub(crate) struct States<'a>(PhantomData<&'a ()>);

impl States<'_> {
    /// Creates a learner for the states of any problem.
    pub(crate) fn new() -> Self {
        Self(PhantomData)
    }
}

impl<'a, S: Scalar> Learner<S> for States<'a> {
    type Problem = TrainingProblem<'a, S>;

    fn moments(&mut self, problem: &mut Self::Problem, method: Method, _: usize) -> Moments<S> {
        problem.moments(method)
    }

    fn decaying(&self, problem: &mut Self::Problem) -> usize {
        problem.objective().model().weights()
    }

    fn pool(&self, problem: &mut Self::Problem) -> Arc<rayon::ThreadPool> {
        Arc::clone(problem.objective().pool())
    }

    fn step(&mut self, problem: &mut Self::Problem, weights: &[S], rows: &[u32], gradient: &mut [S]) -> BatchReport<S> {
        problem.step(weights, rows, gradient)
    }

    /// A loss that is not finite, or that leaves out more than a few states, never counts as the best.
    fn validate(&mut self, problem: &mut Self::Problem, weights: &[S]) -> Validation {
        let report = problem.validation_loss(weights);
        let loss = report.loss.to_f64();
        let counts = loss.is_finite() && STATES_PER_LEFT_OUT * report.left_out <= problem.validation().len();
        Validation { loss, cost: if counts { loss } else { f64::INFINITY } }
    }
}
