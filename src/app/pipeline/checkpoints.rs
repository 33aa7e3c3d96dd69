//! Checkpoints of a pipeline: where they are kept, and whether a training continues from one.

use crate::pipeline::{Command, Event, PipelineError, RUN, Watch};
use crate::scalar::Scalar;
use crate::storage::{Disk, Files, write_whole};
use crate::training::{
    CheckpointInterval, CheckpointManager, Fingerprint, LATEST, PREVIOUS, Restored, Snapshot, remove_checkpoints,
};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a training begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Begin {
    /// From its beginning; old checkpoints are removed.
    #[default]
    Anew,
    /// From its checkpoint, which must exist.
    Resume,
    /// From a matching checkpoint if there is one, otherwise from its beginning.
    Either,
}

/// Checkpoints of a training. They remain until they are removed.
#[derive(Clone)]
pub struct Checkpoints {
    files: Arc<dyn Files>,
    directory: PathBuf,
    every: CheckpointInterval,
    begin: Begin,
    /// Text that is kept in a checkpoint and must match when the training continues; by default the configuration.
    identity: Option<String>,
}

impl fmt::Debug for Checkpoints {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Checkpoints")
            .field("directory", &self.directory)
            .field("every", &self.every)
            .finish_non_exhaustive()
    }
}

impl Checkpoints {
    /// Keeps checkpoints in a directory; the training starts anew.
    pub fn new(directory: &Path, every: CheckpointInterval) -> Self {
        let (files, directory) = (Arc::new(Disk), directory.to_path_buf());
        Self { files, directory, every, begin: Begin::Anew, identity: None }
    }

    /// Sets how the training begins.
    pub fn beginning(self, begin: Begin) -> Self {
        Self { begin, ..self }
    }

    /// Stores this text in every checkpoint instead of the configuration; it must match when the training is resumed.
    pub fn identified_by(self, text: String) -> Self {
        Self { identity: Some(text), ..self }
    }

    /// The directory.
    pub(crate) fn directory(&self) -> &Path {
        &self.directory
    }

    /// Removes the checkpoints after the training has ended.
    ///
    /// # Errors
    /// [`PipelineError::Output`] naming the directory.
    pub(crate) fn remove(&self) -> Result<(), PipelineError> {
        let cannot = |e| PipelineError::output(&self.directory, format_args!("cannot remove checkpoints: {e}"));
        remove_checkpoints(self.files.as_ref(), &self.directory).map_err(cannot)
    }

    /// Returns the writer of checkpoints and the checkpoint to resume from, if any; removes old checkpoints if the training starts anew.
    ///
    /// # Errors
    /// [`PipelineError::Output`] if the directory cannot be written, [`PipelineError::Checkpoint`] if a required one is missing or belongs
    /// to another run.
    pub(crate) fn open<S: Scalar>(
        &self,
        (command, config): (Command, &str),
        data: Vec<(String, u32)>,
        (parameters, states): (usize, usize),
        watch: &Watch,
    ) -> Result<(Arc<CheckpointManager>, Option<Snapshot<S>>), PipelineError> {
        let config = self.identity.clone().unwrap_or_else(|| config.to_string());
        let identity = Fingerprint { config, data };
        let manager = Arc::new(CheckpointManager::new(Arc::clone(&self.files), &self.directory, self.every, identity));
        if self.begin != Begin::Anew {
            match manager.restore(parameters, states) {
                Ok(Restored { content, fallback }) => {
                    if let Some(problem) = fallback {
                        let (newest, previous) = (self.directory.join(LATEST), self.directory.join(PREVIOUS));
                        let place = newest.display();
                        watch.say(Event::Note(&format!("{place}: {problem}; going on from {}", previous.display())));
                    }
                    return Ok((manager, Some(content)));
                }
                Err(source) if self.begin == Begin::Resume => {
                    return Err(PipelineError::Checkpoint { directory: self.directory.clone(), source });
                }
                Err(_) => {}
            }
        }
        self.remove()?;
        let path = self.directory.join(RUN);
        let cannot = |e| PipelineError::output(&path, format_args!("cannot write: {e}"));
        write_whole(self.files.as_ref(), &path, command.text()?.as_bytes()).map_err(cannot)?;
        Ok((manager, None))
    }
}
