//! Losses of weights that do not result from supervised training.

use crate::configuration::Penalty;
use crate::data::Dataset;
use crate::network::Architecture;
use crate::pipeline::PipelineError;
use crate::scalar::Scalar;
use crate::training::{Objective, Trained, TrainingError};

/// States on which losses are reported: validation states and fresh ones.
pub(crate) struct LossStates<S> {
    /// Validation states.
    pub validation: Dataset<S>,
    /// Fresh states.
    pub test: Dataset<S>,
}

impl<S: Scalar> LossStates<S> {
    /// Replaces the losses in `trained` by those of the present weights.
    ///
    /// # Errors
    /// [`TrainingError::Threads`] if threads cannot be started.
    pub fn judge(
        &self,
        architecture: &Architecture,
        penalty: Penalty,
        threads: usize,
        trained: &mut Trained<S>,
    ) -> Result<(), PipelineError> {
        let mut objective = Objective::new(architecture, penalty, threads).map_err(TrainingError::from)?;
        let loss = objective.loss(&trained.weights, &self.validation).loss.to_f64();
        // A model file needs a finite number, even if no state has an acceleration.
        trained.validation_loss = if loss.is_finite() { loss } else { f64::MAX };
        trained.test = objective.loss(&trained.weights, &self.test);
        Ok(())
    }
}
