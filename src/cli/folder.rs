//! A directory that a command fills, held by one run at a time.

use crate::cli::CliError;
use crate::storage::write_atomically;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

/// Name of the file whose lock says that a run is writing here; the system frees it with the process.
const LOCK: &str = ".lnn.lock";

/// An output directory, created and found writable before any work starts.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    _lock: File,
}

impl Folder {
    /// Creates the directory if need be and takes its lock.
    ///
    /// # Errors
    /// A data error if it cannot be created or written, or if another run holds it.
    pub fn open(path: &Path) -> Result<Self, CliError> {
        fs::create_dir_all(path).map_err(|e| CliError::file(path, format_args!("cannot create the directory: {e}")))?;
        let lock = File::create(path.join(LOCK))
            .map_err(|e| CliError::file(path, format_args!("cannot write into the directory: {e}")))?;
        match lock.try_lock() {
            Ok(()) => Ok(Self { path: path.to_path_buf(), _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(CliError::file(path, "another run is writing into this directory")),
            Err(TryLockError::Error(e)) => Err(CliError::file(path, format_args!("cannot lock the directory: {e}"))),
        }
    }

    /// Path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file whole or not at all.
    ///
    /// # Errors
    /// A data error naming the file.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        let path = self.file(name);
        write_atomically(&path, bytes).map_err(|e| CliError::file(&path, format_args!("cannot write: {e}")))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A lock file left behind does no harm: the lock is what counts.
        let _ = fs::remove_file(self.path.join(LOCK));
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
        assert!(Folder::open(&path).unwrap_err().to_string().ends_with("another run is writing into this directory"));
        first.write("x", b"1").unwrap();
        assert!(first.write("missing/x", b"1").is_err());
        drop(first);
        let again = Folder::open(&path).unwrap();
        assert_eq!(fs::read(again.file("x")).unwrap(), b"1");
        assert!(Folder::open(&path.join("x")).is_err());
        drop(again);
        assert_eq!(fs::read_dir(&path).unwrap().count(), 1);
    }
}
