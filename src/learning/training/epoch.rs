//! Rows of a history, and the sums they come from.

use crate::lagrangian::MechanicsError;
use serde::Serialize;

/// One row of the history.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Epoch {
    /// Counted from 1 over all phases.
    pub epoch: usize,
    /// Counted from 1.
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
    /// States left out because they gave no finite acceleration.
    pub left_out: usize,
    /// Steps skipped because they were not finite.
    pub skipped: usize,
    /// Seconds since the start of training.
    pub seconds: f64,
}

/// Running means over the steps of an epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Means {
    pub(crate) loss: f64,
    pub(crate) penalty: f64,
    pub(crate) norm: f64,
    pub(crate) penalised: usize,
    pub(crate) left_out: usize,
    pub(crate) skipped: usize,
    pub(crate) taken: usize,
    pub(crate) last_failure: Option<MechanicsError>,
}
