//! Directory of an experiment: the files of its tables, and one directory per run, in which one process works at a time.

use crate::pipeline::thresholds::{CHECKPOINT_SECONDS, MAX_RESULT_BYTES};
use crate::pipeline::{Checkpoints, Directory, LEARNED, Output, PipelineError};
use crate::storage::{Acquired, DirectoryLock, Disk, LockOwner, read_regular, remove_leftovers};
use crate::training::CheckpointInterval;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Directory of an experiment, created when a file is first written.
#[derive(Clone, Debug)]
pub struct ExperimentDirectory {
    path: PathBuf,
}

impl ExperimentDirectory {
    /// The directory of a path.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_path_buf() }
    }

    /// Directory of a run.
    pub(crate) fn run(&self, run: &str) -> PathBuf {
        self.path.join(run)
    }

    /// The bytes of a file of a run, if it is there.
    pub fn read(&self, run: &str, name: &str) -> Option<Vec<u8>> {
        read_regular(&self.run(run).join(name), MAX_RESULT_BYTES).ok()
    }

    /// Names of the files of a run.
    pub fn names(&self, run: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.run(run)).into_iter().flatten();
        entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect()
    }

    /// Locks the directory of a run that begins or continues.
    ///
    /// # Errors
    /// [`PipelineError::Held`] if another process works in it; [`PipelineError::Output`] if it cannot be written.
    pub(crate) fn open_run(&self, run: &str) -> Result<LockedDirectory, PipelineError> {
        LockedDirectory::open(&self.run(run))
    }

    /// Locks the directory itself for tables, pictures and report.
    ///
    /// # Errors
    /// Those of [`open_run`](Self::open_run).
    pub(crate) fn open_tables(&self) -> Result<LockedDirectory, PipelineError> {
        LockedDirectory::open(&self.path)
    }
}

/// A locked directory, in which no other process works.
#[derive(Debug)]
pub struct LockedDirectory {
    directory: Directory,
    _lock: DirectoryLock,
}

impl LockedDirectory {
    /// The directory of a new training or fit.
    ///
    /// # Errors
    /// [`PipelineError::Taken`] if it contains a run that must not be replaced, [`PipelineError::Held`] if another process works in it,
    /// [`PipelineError::Output`] if it cannot be written.
    pub fn claim(path: &Path, overwrite: bool) -> Result<Self, PipelineError> {
        let locked = Self::open(path)?;
        let full = |name: &&&str| std::fs::metadata(path.join(name)).is_ok_and(|data| data.is_file() && data.len() > 0);
        match LEARNED.iter().find(full) {
            Some(name) if !overwrite => Err(PipelineError::Taken { path: path.to_path_buf(), name: name.to_string() }),
            _ => Ok(locked),
        }
    }

    /// Creates the directory if needed, locks it, and removes temporary files of killed processes.
    fn open(path: &Path) -> Result<Self, PipelineError> {
        let directory = Directory::create(path)?;
        let held = |owner: Option<LockOwner>| {
            let owner = owner.map_or_else(|| "another process".to_string(), |owner| owner.to_string());
            PipelineError::Held { path: path.to_path_buf(), owner }
        };
        match DirectoryLock::acquire(path) {
            Ok(Acquired::Lock(lock, _)) => {
                remove_leftovers(&Disk, path);
                Ok(Self { directory, _lock: lock })
            }
            Ok(Acquired::Held(owner)) => Err(held(owner)),
            Err(error) if error.kind() == ErrorKind::ResourceBusy => Err(held(None)),
            Err(error) => Err(PipelineError::output(path, format_args!("cannot lock the directory: {error}"))),
        }
    }

    /// Removes a file, if it is there.
    pub(crate) fn remove(&self, name: &str) -> Result<(), PipelineError> {
        let path = self.directory.path().join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(PipelineError::output(&path, format_args!("cannot remove: {error}")))
            }
            _ => Ok(()),
        }
    }

    /// Checkpoints of a run in the directory.
    pub(crate) fn checkpoints(&self) -> Checkpoints {
        Checkpoints::new(self.directory.path(), CheckpointInterval::Seconds(CHECKPOINT_SECONDS))
    }
}

impl Output for LockedDirectory {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        self.directory.write(name, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_process_works_on_a_run_at_a_time() {
        let temporary = tempfile::tempdir().unwrap();
        let experiment = ExperimentDirectory::new(&temporary.path().join("experiment"));
        assert!(experiment.names("run").is_empty() && experiment.read("run", "a").is_none());
        let run = experiment.open_run("run").unwrap();
        let refusal = experiment.open_run("run").unwrap_err();
        let own = format!("process {} on ", std::process::id());
        assert!(matches!(&refusal, PipelineError::Held { owner, .. } if owner.starts_with(&own)), "{refusal}");
        run.write("a", b"1").unwrap();
        let _tables = experiment.open_tables().unwrap();
        drop(run);
        let run = experiment.open_run("run").unwrap();
        assert_eq!(experiment.read("run", "a").as_deref(), Some(&b"1"[..]));
        run.remove("a").unwrap();
        run.remove("a").unwrap();
        assert_eq!(experiment.names("run"), [".lnn.lock"]);
    }
}
