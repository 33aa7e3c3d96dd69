//! Stores of experiments: where the files of their runs go, where finished runs are found again, and who works on which.

use crate::pipeline::{Checkpoints, Directory, Output, PipelineError};
use crate::storage::read_regular;
use crate::training::CheckpointInterval;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Longest file that is read back, in bytes.
const MAX_BYTES: u64 = 1 << 26;
/// Seconds between two checkpoints of a run.
const CHECKPOINT_SECONDS: f64 = 60.0;

/// Files of an experiment and of its runs. Several processes may share it: then a run is claimed by one of them at a time.
pub trait ExperimentStore: Sync {
    /// The bytes of a file of a run, if it is there.
    fn read(&self, run: &str, name: &str) -> Option<Vec<u8>>;
    /// Names of the files of a run.
    fn names(&self, run: &str) -> Vec<String>;
    /// The output of a run that is about to begin or to go on, unless another process works on it. `interrupt` is the flag that
    /// ends all runs.
    ///
    /// # Errors
    /// [`PipelineError::Output`] or [`PipelineError::Place`] if there is none.
    fn claim_run(&self, run: &str, interrupt: &Arc<AtomicBool>) -> Result<RunClaim<'_>, PipelineError>;
    /// The output of table, pictures and report.
    ///
    /// # Errors
    /// [`PipelineError::Place`] if another process holds it, or `interrupt` was raised while it did.
    fn open_tables(&self, interrupt: &Arc<AtomicBool>) -> Result<Box<dyn Output + '_>, PipelineError>;
}

/// Result of an attempt to claim a run.
pub enum RunClaim<'a> {
    /// It is ours while this lives.
    Ours(Box<dyn RunOutput + 'a>),
    /// Another process works on it; which, in words.
    Held(String),
}

/// Output of one run of an experiment.
pub trait RunOutput: Output {
    /// Removes a file, if it is there.
    ///
    /// # Errors
    /// [`PipelineError::Output`] naming the file.
    fn remove(&self, name: &str) -> Result<(), PipelineError>;
    /// Checkpoints of the run, if there are to be any.
    fn checkpoints(&self) -> Option<Checkpoints>;
    /// Flag that ends the run, if it is another than that of all runs: raised with it, and when another process has taken the run
    /// over.
    fn interrupt(&self) -> Option<Arc<AtomicBool>> {
        None
    }
    /// `true` if another process has taken the run over; nothing can be written then.
    fn is_lost(&self) -> bool {
        false
    }
    /// Says that the run has its record and is never claimed again.
    fn finish(&self) {}
}

impl ExperimentStore for Directory {
    fn read(&self, run: &str, name: &str) -> Option<Vec<u8>> {
        read_regular(&self.path().join(run).join(name), MAX_BYTES).ok()
    }

    fn names(&self, run: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path().join(run)).into_iter().flatten();
        entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect()
    }

    fn claim_run(&self, run: &str, _: &Arc<AtomicBool>) -> Result<RunClaim<'_>, PipelineError> {
        Ok(RunClaim::Ours(Box::new(Self::create(&self.path().join(run))?)))
    }

    fn open_tables(&self, _: &Arc<AtomicBool>) -> Result<Box<dyn Output + '_>, PipelineError> {
        Ok(Box::new(Self::create(self.path())?))
    }
}

impl RunOutput for Directory {
    fn remove(&self, name: &str) -> Result<(), PipelineError> {
        let path = self.path().join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(PipelineError::output(&path, error)),
            _ => Ok(()),
        }
    }

    fn checkpoints(&self) -> Option<Checkpoints> {
        Some(Checkpoints::new(self.path(), CheckpointInterval::Seconds(CHECKPOINT_SECONDS)))
    }
}
