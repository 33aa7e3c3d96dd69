//! Rows of a training history, and the sums from which they are computed.

use crate::lagrangian::MechanicsError;
use crate::linalg::Failure;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// One row of the history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// Number of the epoch, counted from 1 over all phases.
    pub epoch: usize,
    /// Number of the phase, counted from 1.
    pub phase: usize,
    /// Learning rate at the start of the epoch.
    pub rate: f64,
    /// Mean loss of the epoch's batches, paper convention, without penalty.
    pub training_loss: f64,
    /// Mean penalty of the epoch's batches, with its weight.
    pub penalty: f64,
    /// Fraction of states whose penalty was active.
    pub penalised: f64,
    /// Validation loss, paper convention.
    pub validation_loss: f64,
    /// Mean norm of the gradients before clipping.
    pub gradient_norm: f64,
    /// States left out because they have no finite acceleration.
    pub left_out: usize,
    /// Steps skipped because they were not finite.
    pub skipped: usize,
    /// Seconds since the start of training.
    pub seconds: f64,
}

/// Running means over the steps of an epoch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Means {
    pub(crate) loss: f64,
    pub(crate) penalty: f64,
    pub(crate) norm: f64,
    pub(crate) penalised: usize,
    pub(crate) left_out: usize,
    pub(crate) skipped: usize,
    pub(crate) taken: usize,
    #[serde(with = "failure")]
    pub(crate) last_failure: Option<MechanicsError>,
}

impl Means {
    /// Returns all counts.
    pub(crate) fn counts(&self) -> [usize; 4] {
        [self.penalised, self.left_out, self.skipped, self.taken]
    }
}

/// Serializes the failure of a state as its row and the reason.
mod failure {
    use super::*;

    pub(super) fn serialize<W: Serializer>(failure: &Option<MechanicsError>, serializer: W) -> Result<W::Ok, W::Error> {
        let parts = failure.and_then(|failure| match failure {
            MechanicsError::Singular { row, condition } => Some((row, Failure::Singular { condition })),
            other => other.row().map(|row| (row, Failure::NotFinite)),
        });
        parts.serialize(serializer)
    }

    pub(super) fn deserialize<'de, R: Deserializer<'de>>(deserializer: R) -> Result<Option<MechanicsError>, R::Error> {
        let parts: Option<(usize, Failure)> = Option::deserialize(deserializer)?;
        Ok(parts.map(|(row, failure)| MechanicsError::unsolved(row, failure)))
    }
}
