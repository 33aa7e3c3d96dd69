//! Outputs: where the files of a pipeline go.

use crate::pipeline::PipelineError;
use crate::storage::write_atomically;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Sink for the files of a pipeline. The model is written first, then small files, and pictures last, so that a full disk loses none of the
/// others.
pub trait Output: Sync {
    /// Writes a file atomically, replacing one of the same name. Names have no directories.
    ///
    /// # Errors
    /// [`PipelineError::Output`] naming the file.
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError>;
}

/// Directory into which files are written atomically.
#[derive(Clone, Debug)]
pub struct Directory {
    path: PathBuf,
}

impl Directory {
    /// Opens a directory, which is created if needed.
    ///
    /// # Errors
    /// [`PipelineError::Output`] if it cannot be created.
    pub fn create(path: &Path) -> Result<Self, PipelineError> {
        let cannot = |e| PipelineError::output(path, format_args!("cannot create the directory: {e}"));
        std::fs::create_dir_all(path).map_err(cannot)?;
        Ok(Self { path: path.to_path_buf() })
    }

    /// The path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Output for Directory {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        let path = self.path.join(name);
        write_atomically(&path, bytes).map_err(|e| PipelineError::output(&path, format_args!("cannot write: {e}")))
    }
}

/// Files in memory, by name.
#[derive(Debug, Default)]
pub struct InMemory {
    files: Mutex<BTreeMap<String, Vec<u8>>>,
}

impl InMemory {
    /// The bytes of a file, if it was written.
    pub fn get(&self, name: &str) -> Option<Vec<u8>> {
        self.files().get(name).cloned()
    }

    /// Names of the files, in order.
    pub fn names(&self) -> Vec<String> {
        self.files().keys().cloned().collect()
    }

    fn files(&self) -> MutexGuard<'_, BTreeMap<String, Vec<u8>>> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Output for InMemory {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        self.files().insert(name.to_string(), bytes.to_vec());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_come_back_and_what_cannot_be_written_is_named() {
        let temporary = tempfile::tempdir().unwrap();
        let directory = Directory::create(&temporary.path().join("a/b")).unwrap();
        directory.write("x", b"1").unwrap();
        assert_eq!(std::fs::read(directory.path().join("x")).unwrap(), b"1");
        let refusal = directory.write("none/x", b"1").unwrap_err();
        assert!(refusal.to_string().contains("none") && !refusal.is_configuration(), "{refusal}");
        assert!(Directory::create(&directory.path().join("x")).is_err());
        let memory = InMemory::default();
        memory.write("y", b"2").unwrap();
        memory.write("y", b"3").unwrap();
        assert_eq!(
            (memory.get("y").unwrap(), memory.get("x"), memory.names()),
            (b"3".to_vec(), None, vec!["y".into()])
        );
    }
}
