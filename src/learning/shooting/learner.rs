//! Segments of motion as data of the epoch loop: their starts are fitted together with the weights.

use super::thresholds::{FIRST_STEPS, SEGMENTS_PER_LEFT_OUT};
use crate::learning::state::{self, numbers};
use crate::optimizers::{Method, Moments};
use crate::scalar::{Real, Scalar};
use crate::shooting::objective::{ShootingObjective, ShootingReport};
use crate::shooting::segments::Segments;
use crate::shooting::starts::Curvature;
use crate::training::BatchReport;
use crate::training::learner::{Learner, Validation};
use argmin::core::KV;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Problem of an argmin run.
pub(super) struct ShootingProblem<S> {
    pub shots: ShootingObjective<S>,
    pub training: Segments<S>,
    pub validation: Segments<S>,
}

/// Starts of segments with their curvature.
struct Starts<S> {
    at: Vec<S>,
    curvature: Curvature<S>,
}

impl<S: Scalar> Starts<S> {
    fn of(segments: &Segments<S>) -> Self {
        Self { at: segments.starts().to_vec(), curvature: Curvature::default() }
    }

    fn refine(&mut self, shots: &mut ShootingObjective<S>, weights: &[S], segments: &Segments<S>) {
        shots.refine(weights, segments, &mut self.at, &mut self.curvature, 1.0);
    }
}

/// Starts of all segments, updated by Gauss-Newton steps while the weights follow their gradient.
pub(super) struct ShootingLearner<S> {
    /// Share of a Gauss-Newton step by which a start is moved at each visit.
    share: f64,
    /// Epochs between two linearisations with respect to the starts.
    curvature_every: u64,
    starts: Starts<S>,
    start_gradient: Vec<S>,
    validation_starts: Starts<S>,
    /// Number of residuals, and gap, of the last step.
    last: (usize, f64),
    /// Sum of the gaps over the batches of the epoch.
    gap: f64,
    /// Validation loss of the initial weights.
    pub start_loss: f64,
}

impl<S: Scalar> ShootingLearner<S> {
    pub fn new(problem: &ShootingProblem<S>, share: f64, curvature_every: usize) -> Self {
        Self {
            share,
            curvature_every: curvature_every as u64,
            starts: Starts::of(&problem.training),
            start_gradient: vec![<S as Real>::zero(); problem.training.starts().len()],
            validation_starts: Starts::of(&problem.validation),
            last: (0, 0.0),
            gap: 0.0,
            start_loss: f64::INFINITY,
        }
    }

    /// Resumes from the output of [`stored`](Learner::stored); also returns its seconds, and `None` if it belongs to other segments.
    pub fn restored(mut self, problem: &ShootingProblem<S>, bytes: &[u8]) -> Option<(Self, f64)> {
        let state: ShootingState<S> = state::from_bytes(bytes).ok()?;
        let lengths = [self.starts.at.len(), self.validation_starts.at.len()];
        if [state.starts.len(), state.validation_starts.len()] != lengths {
            return None;
        }
        self.starts.curvature = Curvature::restore(&problem.training, &state.matrices, &state.jacobian)?;
        (self.starts.at, self.validation_starts.at) = (state.starts, state.validation_starts);
        (self.gap, self.start_loss) = (state.gap, state.start_loss);
        Some((self, state.seconds.max(0.0)))
    }
}

/// State that changes between steps, except the weights, as stored in a checkpoint.
#[derive(Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
struct ShootingState<S> {
    /// Seconds of multiple shooting.
    seconds: f64,
    /// Validation loss of the initial weights.
    start_loss: f64,
    /// Sum of the gaps over the batches of the epoch.
    gap: f64,
    /// Starts of the training segments and of the validation segments, `(segments, 2, n)`.
    #[serde(with = "numbers")]
    starts: Vec<S>,
    #[serde(with = "numbers")]
    validation_starts: Vec<S>,
    /// Curvature and derivatives of the last linearisation, as [`Curvature`] keeps them.
    #[serde(with = "numbers")]
    matrices: Vec<S>,
    #[serde(with = "numbers")]
    jacobian: Vec<S>,
}

impl<S: Scalar> Learner<S> for ShootingLearner<S> {
    type Problem = ShootingProblem<S>;

    fn moments(&mut self, problem: &mut Self::Problem, method: Method, parameters: usize) -> Moments<S> {
        Moments::for_method(method, parameters, problem.shots.model().matrices())
    }

    fn decaying(&self, problem: &mut Self::Problem) -> usize {
        problem.shots.model().weights()
    }

    fn pool(&self, problem: &mut Self::Problem) -> Arc<rayon::ThreadPool> {
        Arc::clone(problem.shots.pool())
    }

    fn begin(&mut self, problem: &mut Self::Problem, weights: &[S]) -> Option<f64> {
        for _ in 1..FIRST_STEPS {
            self.starts.refine(&mut problem.shots, weights, &problem.training);
            self.validation_starts.refine(&mut problem.shots, weights, &problem.validation);
        }
        self.start_loss = self.validate(problem, weights).cost;
        Some(self.start_loss)
    }

    fn begin_epoch(&mut self, problem: &mut Self::Problem, weights: &[S], epoch: u64) {
        if epoch.is_multiple_of(self.curvature_every) {
            self.starts.refine(&mut problem.shots, weights, &problem.training);
        }
        self.gap = 0.0;
    }

    fn step(&mut self, problem: &mut Self::Problem, weights: &[S], rows: &[u32], gradient: &mut [S]) -> BatchReport<S> {
        let ShootingProblem { shots, training, .. } = problem;
        let Starts { at, curvature } = &mut self.starts;
        shots.move_starts(weights, training, (at, rows), (curvature, &mut self.start_gradient), self.share);
        let report = shots.step(weights, training, at, rows, (gradient, &mut self.start_gradient));
        let ShootingReport { loss, gap, penalty, penalised, left_out, residuals } = report;
        self.last = (residuals, gap.to_f64());
        BatchReport { loss, penalty, penalised, left_out, failure: None }
    }

    fn follow(&mut self, problem: &mut Self::Problem) {
        let (residuals, gap) = self.last;
        // The gradient is that of a mean, but the curvature is that of a sum.
        let sum = S::of_f64(residuals as f64);
        self.start_gradient.iter_mut().for_each(|g| *g *= sum);
        self.starts.curvature.correct(&problem.training, &mut self.starts.at, &self.start_gradient, self.share);
        self.gap += gap;
    }

    fn penalty_states(&self, problem: &Self::Problem) -> usize {
        problem.training.steps()
    }

    fn record(&self, batches: f64, record: &mut KV) {
        record.kv.insert("gap".into(), (self.gap / batches).into());
    }

    /// Fits the starts to the weights before computing the loss; infinite if too many segments are left out.
    fn validate(&mut self, problem: &mut Self::Problem, weights: &[S]) -> Validation {
        let ShootingProblem { shots, validation, .. } = problem;
        self.validation_starts.refine(shots, weights, validation);
        let rows: Vec<u32> = (0..validation.len() as u32).collect();
        let report = shots.loss(weights, validation, &self.validation_starts.at, &rows);
        let loss = report.loss.to_f64();
        let counts = loss.is_finite() && SEGMENTS_PER_LEFT_OUT * report.left_out <= validation.len();
        let loss = if counts { loss } else { f64::INFINITY };
        Validation { loss, cost: loss }
    }

    fn stored(&self, seconds: f64) -> Option<Vec<u8>> {
        let (matrices, jacobian) = self.starts.curvature.stored();
        let state = ShootingState {
            seconds,
            start_loss: self.start_loss,
            gap: self.gap,
            starts: self.starts.at.clone(),
            validation_starts: self.validation_starts.at.clone(),
            matrices: matrices.to_vec(),
            jacobian: jacobian.to_vec(),
        };
        // Numbers that a file cannot store are also rejected in the weights, which have the same type.
        state::to_bytes(&state).ok()
    }
}
