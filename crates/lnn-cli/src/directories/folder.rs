//! A directory that a command fills, locked by one run at a time.

use crate::CliError;
use crate::directories::results;
use crate::terminal::output;
use lnn::pipeline::{MODEL, Output, PipelineError};
use lnn::storage::{Acquired, DirectoryLock, Disk, remove_leftovers, write_atomically};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// An output directory that was created and checked to be writable before the work starts.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    _lock: DirectoryLock,
}

/// Outcome of [`Folder::attempt`].
#[derive(Debug)]
pub enum Attempt {
    /// The directory, locked.
    Open(Folder),
    /// Another run has locked it; ` (process ..)`, if known.
    Held(String),
}

impl Folder {
    /// Creates the directory if needed, locks it, and removes temporary files of killed processes.
    ///
    /// # Errors
    /// A data error if it cannot be created or written, or if another run holds it.
    pub fn open(path: &Path) -> Result<Self, CliError> {
        match Self::attempt(path)? {
            Attempt::Open(folder) => Ok(folder),
            Attempt::Held(holder) => {
                Err(CliError::file(path, format_args!("another run is writing into this directory{holder}")))
            }
        }
    }

    /// Like [`open`](Self::open), but a directory locked by another run is not an error.
    ///
    /// # Errors
    /// A data error if it cannot be created or written.
    pub fn attempt(path: &Path) -> Result<Attempt, CliError> {
        fs::create_dir_all(path).map_err(|e| CliError::file(path, format_args!("cannot create the directory: {e}")))?;
        let acquired = DirectoryLock::acquire(path).map_err(|error| match error.kind() {
            ErrorKind::ResourceBusy => CliError::file(path, "other processes keep locking the directory; try again"),
            _ => CliError::file(path, format_args!("cannot write into the directory: {error}")),
        })?;
        Ok(match acquired {
            Acquired::Lock(lock, before) => {
                remove_leftovers(&Disk, path);
                if let Some(owner) = before {
                    output::note(&format!("{}: taken over from {owner}, which has ended", path.display()));
                }
                Attempt::Open(Self { path: path.to_path_buf(), _lock: lock })
            }
            Acquired::Held(owner) => Attempt::Held(owner.map(|owner| format!(" ({owner})")).unwrap_or_default()),
        })
    }

    /// The directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

impl Output for Folder {
    /// Writes a file atomically. Files of an earlier run are removed once the new model has replaced the old one; those of an earlier
    /// evaluation are removed before the new one is written.
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        if name == "evaluation.json" {
            results::remove_stale_evaluation(&self.path)?;
        }
        let path = self.file(name);
        write_atomically(&path, bytes).map_err(|e| PipelineError::output(&path, format_args!("cannot write: {e}")))?;
        if name == MODEL { results::remove_stale(&self.path) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_run_at_a_time() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a/b");
        let first = Folder::open(&path).unwrap();
        let refusal = Folder::open(&path).unwrap_err().to_string();
        let holder = format!("(process {} on ", std::process::id());
        assert!(
            refusal.contains("another run is writing into this directory") && refusal.contains(&holder),
            "{refusal}"
        );
        first.write("x", b"1").unwrap();
        assert!(first.write("missing/x", b"1").is_err());
        drop(first);
        let again = Folder::open(&path).unwrap();
        assert_eq!(fs::read(again.file("x")).unwrap(), b"1");
        assert!(Folder::open(&path.join("x")).is_err());
        drop(again);
        assert_eq!(fs::read_dir(&path).unwrap().count(), 1);
        // The lock of a killed run is taken over.
        fs::write(path.join(".lnn.lock"), "process 1\nhost elsewhere\n").unwrap();
        fs::write(path.join(".x.4194999.0.tmp"), "half").unwrap();
        drop(Folder::open(&path).unwrap());
        assert_eq!(fs::read_dir(&path).unwrap().count(), if Path::new("/proc/self").exists() { 1 } else { 2 });
    }

    #[test]
    fn of_many_at_once_one_gets_it() {
        let directory = tempfile::tempdir().unwrap();
        let inside = std::sync::atomic::AtomicUsize::new(0);
        let ordering = std::sync::atomic::Ordering::SeqCst;
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        if let Ok(folder) = Folder::open(directory.path()) {
                            assert_eq!(inside.fetch_add(1, ordering), 0);
                            assert_eq!(inside.fetch_sub(1, ordering), 1);
                            drop(folder);
                        }
                    }
                });
            }
        });
    }
}
