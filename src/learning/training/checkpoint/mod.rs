//! Checkpoints: everything a training needs to continue as if it had never stopped.
//!
//! A checkpoint is a safetensors file like a model file ([`container`](crate::storage::container)), metadata key `lnn-checkpoint`. Its
//! description contains the configuration as text, checksums of the data, and the completed epochs and steps. Its only tensor `state` is
//! the [`Snapshot`] as serde writes it, with exact numbers in the precision of the training: the same state gives the same bytes.
//!
//! A phase is stored to the step: the next batch of the epoch, the sums over its batches so far and the random generator are part of the
//! state. A learner that fits more than the weights, as [multiple shooting](crate::shooting) fits the starts of its segments, writes and
//! reads that itself. L-BFGS after the phases has no state of its own: it restarts from their end.

mod fingerprint;
mod format;
mod manager;

pub use fingerprint::Fingerprint;
pub use manager::{
    CheckpointError, CheckpointInterval, CheckpointManager, LATEST, PREVIOUS, Restored, remove_checkpoints, saved,
};

use crate::learning::state::numbers;
use crate::network::file::ModelFileError;
use crate::optimizers::Moments;
use crate::random::RandomGenerator;
use crate::scalar::Scalar;
use crate::training::epoch::{Epoch, Means};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A training at some step.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot<S> {
    pub(crate) seconds: f64,
    pub(crate) outcome: Outcome<S>,
    pub(crate) in_progress: Option<PhaseState<S>>,
}

impl<S: Scalar> Snapshot<S> {
    /// Serializes this training as a checkpoint.
    ///
    /// # Errors
    /// A number type that files do not know.
    pub fn to_bytes(&self, identity: &Fingerprint) -> Result<Vec<u8>, ModelFileError> {
        format::encode(identity, self.seconds, &self.outcome, self.in_progress.as_ref())
    }

    /// Reads any bytes as a checkpoint; its numbers are converted to the precision of `S`.
    ///
    /// # Errors
    /// [`ModelFileError`] for anything but a whole checkpoint.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Fingerprint, Self), ModelFileError> {
        format::decode(bytes).map(|(header, snapshot)| (header.identity, snapshot))
    }
}

impl<S> Snapshot<S> {
    /// Creates the start of a training from these weights, such as those of a model that is trained further.
    pub fn beginning_with(weights: Vec<S>) -> Self {
        Self { seconds: 0.0, outcome: Outcome::none(weights), in_progress: None }
    }
    /// Number of steps so far; during multiple shooting, its own steps.
    pub fn steps(&self) -> usize {
        self.in_progress.as_ref().map_or(self.outcome.steps, |in_progress| in_progress.optimizer_state.step)
    }
    /// `true` during multiple shooting, after the supervised training has ended.
    pub fn is_shooting(&self) -> bool {
        self.in_progress.as_ref().is_some_and(|in_progress| in_progress.learner.is_some())
    }
    /// Epochs completed so far, those of L-BFGS included.
    pub fn epochs(&self) -> usize {
        self.outcome.history.len() + self.in_progress.as_ref().map_or(0, |in_progress| in_progress.history.len())
    }
}

/// Result of the phases that have ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
pub(crate) struct Outcome<S> {
    /// Number of phases that have ended.
    pub phases: usize,
    /// `true` if L-BFGS has ended too.
    pub refined: bool,
    /// Parameters of the best epoch; the initial ones before the first epoch.
    #[serde(with = "numbers")]
    pub weights: Vec<S>,
    /// Validation loss of the best epoch; infinite before the first epoch.
    pub validation_loss: f64,
    /// One row per epoch.
    pub history: Vec<Epoch>,
    /// Steps taken.
    pub steps: usize,
    /// Number of training states processed.
    pub states: usize,
}

impl<S> Outcome<S> {
    /// Creates the outcome before the first phase.
    pub fn none(weights: Vec<S>) -> Self {
        let (phases, steps, states) = (0, 0, 0);
        let (validation_loss, history) = (f64::INFINITY, Vec::new());
        Self { phases, refined: false, weights, validation_loss, history, steps, states }
    }
}

/// Progress of a phase, or of multiple shooting, between two of its steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
pub(crate) struct PhaseState<S> {
    pub optimizer_state: OptimizerState<S>,
    /// One row per epoch of the phase.
    pub history: Vec<Epoch>,
    /// Parameters of the phase's best epoch; the initial ones before its first epoch.
    #[serde(with = "numbers")]
    pub best: Vec<S>,
    /// Validation loss of those parameters; infinite before the first epoch.
    pub best_loss: f64,
    /// The best epoch of the phase, counted from 0.
    pub best_epoch: u64,
    /// Serialized state of the learner except the weights; `None` if it has none, as in a phase.
    pub learner: Option<Vec<u8>>,
}

/// State that changes with every step of a phase; in multiple shooting, its states are segments.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
pub(crate) struct OptimizerState<S> {
    /// Generator that shuffles the data in every epoch.
    pub rng: RandomGenerator,
    /// Order of the states in this epoch.
    pub order: Vec<u32>,
    /// The current weights.
    #[serde(with = "numbers")]
    pub weights: Vec<S>,
    /// Moments of their gradients.
    pub moments: Moments<S>,
    /// Running average of the weights.
    #[serde(with = "numbers")]
    pub average: Vec<S>,
    /// Number of steps in the average.
    pub averaged_steps: usize,
    /// Epochs completed in this phase.
    pub iteration: u64,
    /// Epochs completed in all phases.
    pub epoch: usize,
    /// Steps taken in all phases.
    pub step: usize,
    /// Number of finished batches of the epoch; 0 before the data are shuffled.
    pub batch: usize,
    /// Sums over those batches.
    pub means: Means,
}

impl<S: Scalar> OptimizerState<S> {
    /// Creates the state before the first step of a phase over `states` states.
    pub fn new(rng: RandomGenerator, states: usize) -> Self {
        Self {
            rng,
            order: (0..states as u32).collect(),
            weights: Vec::new(),
            moments: Moments::new(0),
            average: Vec::new(),
            averaged_steps: 0,
            iteration: 0,
            epoch: 0,
            step: 0,
            batch: 0,
            means: Means::default(),
        }
    }
}

/// Seconds of training, including those before it was resumed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    since: Instant,
    before: f64,
}

impl Clock {
    /// Starts the clock with `before` seconds from earlier runs.
    pub fn after(before: f64) -> Self {
        Self { since: Instant::now(), before }
    }
    pub fn seconds(&self) -> f64 {
        self.before + self.since.elapsed().as_secs_f64()
    }
}
