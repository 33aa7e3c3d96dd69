//! Samples that the loop over epochs learns from: states of a dataset here, segments of motion in multiple shooting.

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
    /// The value by which parameters are compared, infinite if it is meaningless.
    pub cost: f64,
}

/// Samples for learning batch by batch, with any unknowns besides the weights.
pub(crate) trait Learner<S: Scalar> {
    /// Evaluates batches.
    type Problem;

    /// Moments of `parameters` weights before the first step of an update rule.
    fn moments(&mut self, problem: &mut Self::Problem, method: Method, parameters: usize) -> Moments<S>;

    /// Number of weights that decay; they come first among the parameters.
    fn decaying(&self, problem: &mut Self::Problem) -> usize;

    /// Threads of the run.
    fn pool(&self, problem: &mut Self::Problem) -> Arc<rayon::ThreadPool>;

    /// Before the first epoch; the cost of the weights given, where the epochs have to beat it.
    fn begin(&mut self, problem: &mut Self::Problem, weights: &[S]) -> Option<f64> {
        let _ = (problem, weights);
        None
    }

    /// Before epoch `epoch` of this phase, counted from 0.
    fn begin_epoch(&mut self, problem: &mut Self::Problem, weights: &[S], epoch: u64) {
        let _ = (problem, weights, epoch);
    }

    /// Loss, penalty and gradient of the samples `rows`; `gradient` is overwritten.
    fn step(&mut self, problem: &mut Self::Problem, weights: &[S], rows: &[u32], gradient: &mut [S]) -> BatchReport<S>;

    /// Called after the gradient of the last step has changed the weights.
    fn follow(&mut self, problem: &mut Self::Problem) {
        let _ = problem;
    }

    /// States of one sample at which the penalty is taken.
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

    /// Unknowns besides the weights, after `seconds` of this phase, in bytes for a checkpoint; `None` if there are none.
    fn stored(&self, seconds: f64) -> Option<Vec<u8>> {
        let _ = seconds;
        None
    }
}

/// States of a [`TrainingProblem`]; only the weights are fitted.
pub(crate) struct States<'a>(PhantomData<&'a ()>);

impl States<'_> {
    /// The states of any problem.
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

    /// A loss that is not finite, or leaves out more than a few of the states, is never the best.
    fn validate(&mut self, problem: &mut Self::Problem, weights: &[S]) -> Validation {
        let report = problem.validation_loss(weights);
        let loss = report.loss.to_f64();
        let counts = loss.is_finite() && STATES_PER_LEFT_OUT * report.left_out <= problem.validation().len();
        Validation { loss, cost: if counts { loss } else { f64::INFINITY } }
    }
}
