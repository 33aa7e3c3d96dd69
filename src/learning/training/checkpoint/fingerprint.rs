//! Identity of the training that a checkpoint belongs to.

use serde::{Deserialize, Serialize};

/// Identity of a training, written into its checkpoints: a run resumes only from a checkpoint with the same identity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fingerprint {
    /// The configuration as text.
    pub config: String,
    /// Name and checksum of each set of states.
    pub data: Vec<(String, u32)>,
}

/// Header of a checkpoint, without its numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Saved {
    /// Configuration of the training.
    pub config: String,
    /// Epochs completed, those of L-BFGS included.
    pub epochs: usize,
    /// Steps taken.
    pub steps: usize,
}
