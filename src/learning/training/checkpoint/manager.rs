//! Keeps the newest and the previous checkpoint in a directory, and decides when to write one.

use super::fingerprint::{Fingerprint, Saved};
use super::format::{Header, decode, decode_header, encode};
use super::{Outcome, PhaseState, Snapshot};
use crate::network::file::ModelFileError;
use crate::scalar::Scalar;
use crate::storage::{Files, ReadError, replace};
use crate::training::thresholds::{LARGEST_CHECKPOINT, TRAINING_PER_WRITING};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Name of the newest checkpoint.
pub const LATEST: &str = "checkpoint.safetensors";
/// Name of the one before it.
pub const PREVIOUS: &str = "checkpoint.previous.safetensors";

/// Time between two checkpoints.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CheckpointInterval {
    /// A checkpoint is due after this many epochs.
    Epochs(usize),
    /// A checkpoint is due after this many seconds; later if writing takes more than a hundredth of the time.
    Seconds(f64),
}

/// Why no checkpoint can be resumed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The directory contains no checkpoint.
    #[error("there is no checkpoint")]
    Missing,
    /// Neither the newest checkpoint nor the previous one can be read.
    #[error("{LATEST}: {newest}; {PREVIOUS}: {previous}")]
    Damaged {
        /// Problem of the newest.
        newest: Box<ModelFileError>,
        /// Problem of the previous one.
        previous: Box<ModelFileError>,
    },
    /// Another version wrote the checkpoint.
    #[error("{0}")]
    Version(Box<ModelFileError>),
    /// The checkpoint has another configuration.
    #[error("the checkpoint is of another configuration")]
    Config {
        /// The configuration of the checkpoint.
        saved: String,
    },
    /// The states differ from those of the checkpoint.
    #[error("the checkpoint is of other data: {0}")]
    Data(String),
}

/// The checkpoint to continue from.
#[derive(Clone, Debug)]
pub struct Restored<T> {
    /// Content of the checkpoint.
    pub content: T,
    /// Problem of the newest checkpoint, if the previous one was used.
    pub fallback: Option<String>,
}

/// Writes and reads the checkpoints of one training in one directory.
pub struct CheckpointManager {
    files: Arc<dyn Files>,
    directory: PathBuf,
    every: CheckpointInterval,
    identity: Fingerprint,
    state: Mutex<State>,
}

struct State {
    /// When the last checkpoint was written or read, and the epochs completed then.
    last: Option<(Instant, usize)>,
    /// Time that the last writing took.
    cost: Duration,
    /// `true` if the newest checkpoint is intact and may become the previous one.
    keep: bool,
}

impl CheckpointManager {
    /// Manages the checkpoints of this training in `directory`.
    pub fn new(files: Arc<dyn Files>, directory: &Path, every: CheckpointInterval, identity: Fingerprint) -> Self {
        let state = State { last: None, cost: Duration::ZERO, keep: true };
        Self { files, directory: directory.to_path_buf(), every, identity, state: Mutex::new(state) }
    }

    /// `true` if a checkpoint is due between two steps of an epoch.
    pub(crate) fn is_due(&self) -> bool {
        let state = self.state();
        match (self.every, state.last) {
            (CheckpointInterval::Seconds(seconds), Some((last, _))) => {
                let elapsed = last.elapsed();
                elapsed.as_secs_f64() >= seconds && elapsed >= state.cost.saturating_mul(TRAINING_PER_WRITING)
            }
            (_, None) => true,
            (CheckpointInterval::Epochs(_), Some(_)) => false,
        }
    }

    /// `true` if a checkpoint is due after this many completed epochs.
    pub(crate) fn is_due_after(&self, epochs: usize) -> bool {
        let last = self.state().last;
        match (self.every, last) {
            (CheckpointInterval::Epochs(every), Some((_, last))) => epochs.saturating_sub(last) >= every,
            _ => self.is_due(),
        }
    }

    /// Writes a checkpoint. If that fails, the previous one is kept, training continues, and a warning is logged.
    pub(crate) fn save<S: Scalar>(&self, seconds: f64, outcome: &Outcome<S>, in_progress: Option<&PhaseState<S>>) {
        let began = Instant::now();
        let mut state = self.state();
        let (newest, previous) = (self.directory.join(LATEST), self.directory.join(PREVIOUS));
        let written = encode(&self.identity, seconds, outcome, in_progress).and_then(|bytes| {
            replace(self.files.as_ref(), &newest, &previous, &bytes, state.keep).map_err(ModelFileError::Write)
        });
        match written {
            Ok(()) => state.keep = true,
            Err(problem) => tracing::warn!("{}: the checkpoint is not written: {problem}", newest.display()),
        }
        let epochs = in_progress.map_or(outcome.history.len(), |in_progress| in_progress.optimizer_state.epoch);
        (state.last, state.cost) = (Some((Instant::now(), epochs)), began.elapsed());
        tracing::info!(epochs, cost = state.cost.as_secs_f64(), "checkpoint");
    }

    /// Reads the newest intact checkpoint of the same configuration and data, for a network of `parameters` weights and phases over
    /// `states` states.
    ///
    /// # Errors
    /// [`CheckpointError`].
    pub fn restore<S: Scalar>(
        &self,
        parameters: usize,
        states: usize,
    ) -> Result<Restored<Snapshot<S>>, CheckpointError> {
        let found = newest_whole(self.files.as_ref(), &self.directory, decode::<S>)?;
        let (header, snapshot): (Header, Snapshot<S>) = found.content;
        let other = self.identity.data.iter().filter(|set| !header.identity.data.contains(set));
        let names: Vec<&str> = other.map(|(name, _)| name.as_str()).collect();
        if !names.is_empty() || header.identity.data.len() != self.identity.data.len() {
            return Err(CheckpointError::Data(names.join(", ")));
        }
        // Checked after the data, because a configuration may have been derived from them.
        if header.identity.config != self.identity.config {
            return Err(CheckpointError::Config { saved: header.identity.config });
        }
        if snapshot.outcome.weights.len() != parameters {
            let problem = format!("{} weights, the network has {parameters}", snapshot.outcome.weights.len());
            return Err(CheckpointError::Data(problem));
        }
        // The number of segments is only known after multiple shooting has cut the trajectories.
        if let Some(order) = snapshot.in_progress.as_ref().map(|in_progress| in_progress.optimizer_state.order.len())
            && order != states
            && !snapshot.is_shooting()
        {
            return Err(CheckpointError::Data(format!("{order} states in an epoch, the phase has {states}")));
        }
        let mut state = self.state();
        state.keep = found.fallback.is_none();
        state.last = Some((Instant::now(), snapshot.epochs()));
        Ok(Restored { content: snapshot, fallback: found.fallback })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Removes the checkpoints in a directory, because the training has ended or starts again.
///
/// # Errors
/// An error of the file system.
pub fn remove_checkpoints(files: &dyn Files, directory: &Path) -> std::io::Result<()> {
    // The newest comes last, so that a remaining checkpoint is always the newest.
    for name in [PREVIOUS, LATEST] {
        match files.remove(&directory.join(name)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    Ok(())
}

/// Reads the training whose checkpoint is in a directory.
///
/// # Errors
/// [`CheckpointError`] if none is intact.
pub fn saved(files: &dyn Files, directory: &Path) -> Result<Restored<Saved>, CheckpointError> {
    newest_whole(files, directory, |bytes| decode_header(bytes).map(Header::into_saved))
}

/// Reads the newest checkpoint, or the previous one if the newest is damaged or missing.
fn newest_whole<T>(
    files: &dyn Files,
    directory: &Path,
    decode: impl Fn(&[u8]) -> Result<T, ModelFileError>,
) -> Result<Restored<T>, CheckpointError> {
    let read = |name: &str| decode(&files.read(&directory.join(name), LARGEST_CHECKPOINT)?);
    let newest = match read(LATEST) {
        Ok(content) => return Ok(Restored { content, fallback: None }),
        Err(error @ ModelFileError::Version { .. }) => return Err(CheckpointError::Version(Box::new(error))),
        Err(error) => error,
    };
    match read(PREVIOUS) {
        Ok(content) => Ok(Restored { content, fallback: Some(newest.to_string()) }),
        Err(ModelFileError::Read(ReadError::Missing)) if matches!(newest, ModelFileError::Read(ReadError::Missing)) => {
            Err(CheckpointError::Missing)
        }
        Err(previous) => Err(CheckpointError::Damaged { newest: Box::new(newest), previous: Box::new(previous) }),
    }
}
