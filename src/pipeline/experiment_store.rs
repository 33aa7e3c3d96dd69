//! Stores of experiments: where the files of their runs go, and where finished runs are found again.

use crate::pipeline::{Checkpoints, Directory, Output, PipelineError};
use crate::storage::read_regular;
use crate::training::Every;

/// Longest file that is read back, in bytes.
const MAX_BYTES: u64 = 1 << 26;
/// Seconds between two checkpoints of a run.
const CHECKPOINT_SECONDS: f64 = 60.0;

/// Output of an experiment, with a place for each of its runs.
pub trait ExperimentStore: Output {
    /// The bytes of a file of a run, if it is there.
    fn read(&self, run: &str, name: &str) -> Option<Vec<u8>>;
    /// Names of the files of a run.
    fn names(&self, run: &str) -> Vec<String>;
    /// The output of a run that is about to begin or to go on.
    ///
    /// # Errors
    /// [`PipelineError::Output`] if there is none.
    fn open_run(&self, run: &str) -> Result<Box<dyn RunOutput + '_>, PipelineError>;
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
}

impl ExperimentStore for Directory {
    fn read(&self, run: &str, name: &str) -> Option<Vec<u8>> {
        read_regular(&self.path().join(run).join(name), MAX_BYTES).ok()
    }

    fn names(&self, run: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path().join(run)).into_iter().flatten();
        entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect()
    }

    fn open_run(&self, run: &str) -> Result<Box<dyn RunOutput + '_>, PipelineError> {
        Ok(Box::new(Self::create(&self.path().join(run))?))
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
        Some(Checkpoints::new(self.path(), Every::Seconds(CHECKPOINT_SECONDS)))
    }
}
