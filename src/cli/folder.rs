//! A directory that a command fills, held by one run at a time.

use crate::cli::{CliError, output, results};
use crate::pipeline::{MODEL, Output, PipelineError};
use crate::storage::{Disk, LockOwner, remove_leftovers, write_atomically};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Name of the file whose lock says that a run is writing here, and whose text says which; the system frees the lock with
/// the process.
const LOCK: &str = ".lnn.lock";

/// Longest text of a lock file that is read, in bytes.
const LOCK_TEXT: u64 = 1024;

/// Attempts to lock a file that others remove meanwhile.
const ATTEMPTS: usize = 100;

/// An output directory, created and found writable before any work starts.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    _lock: File,
}

/// Result of an attempt to open a directory.
#[derive(Debug)]
pub enum Attempt {
    /// It is ours.
    Open(Folder),
    /// Another run holds it; ` (process ..)`, as far as that is known.
    Held(String),
}

/// Result of an attempt to lock a directory.
#[derive(Debug)]
pub enum Locked {
    /// It is ours; taken over from a process that is gone, if there is one.
    Ours(Folder, Option<LockOwner>),
    /// Another process holds it; which, as far as that is known.
    Held(Option<LockOwner>),
}

impl Folder {
    /// Creates the directory if need be, takes its lock, and removes what writers killed in the middle left.
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

    /// [`open`](Self::open) to whom it is no error that another run holds the directory.
    ///
    /// # Errors
    /// A data error if it cannot be created or written.
    pub fn attempt(path: &Path) -> Result<Attempt, CliError> {
        Ok(match Self::lock(path)? {
            Locked::Ours(folder, before) => {
                remove_leftovers(&Disk, path);
                if let Some(holder) = before {
                    output::note(&format!("{}: taken over from {holder}, which is gone", path.display()));
                }
                Attempt::Open(folder)
            }
            Locked::Held(holder) => Attempt::Held(holder.map(|holder| format!(" ({holder})")).unwrap_or_default()),
        })
    }

    /// Creates the directory if need be and takes its lock; what writers killed in the middle left stays.
    ///
    /// # Errors
    /// A data error if it cannot be created or written.
    pub fn lock(path: &Path) -> Result<Locked, CliError> {
        fs::create_dir_all(path).map_err(|e| CliError::file(path, format_args!("cannot create the directory: {e}")))?;
        for _ in 0..ATTEMPTS {
            match lock(path)? {
                Lock::Ours(lock, before) => {
                    return Ok(Locked::Ours(Self { path: path.to_path_buf(), _lock: lock }, before));
                }
                Lock::Held(holder) => return Ok(Locked::Held(holder)),
                Lock::Gone => {}
            }
        }
        Err(CliError::file(
            path,
            format_args!(
                "cannot lock the directory: other processes took it in each of {ATTEMPTS} attempts; try again"
            ),
        ))
    }

    /// The process that holds the lock of a directory, if one does; inside, which, as far as that is known.
    pub fn holder(path: &Path) -> Option<Option<LockOwner>> {
        let mut file = File::open(path.join(LOCK)).ok()?;
        let owner = LockOwner::parse(&text(&mut file));
        matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)).then_some(owner)
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
    /// Writes a file whole or not at all. What an earlier run left goes when the new model has taken its place, what an earlier
    /// evaluation left before the new one is written.
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        if name == "evaluation.json" {
            results::remove_stale_evaluation(&self.path)?;
        }
        let path = self.file(name);
        write_atomically(&path, bytes).map_err(|e| PipelineError::output(&path, format_args!("cannot write: {e}")))?;
        if name == MODEL { results::remove_stale(&self.path) } else { Ok(()) }
    }
}

/// The lock file of a directory.
enum Lock {
    /// Locked by us; left by a process that is gone, if there is one.
    Ours(File, Option<LockOwner>),
    /// Locked by another process.
    Held(Option<LockOwner>),
    /// Removed by its holder meanwhile.
    Gone,
}

/// Tries to lock a directory.
fn lock(directory: &Path) -> Result<Lock, CliError> {
    let path = directory.join(LOCK);
    let mut file = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .map_err(|e| CliError::file(directory, format_args!("cannot write into the directory: {e}")))?;
    let before = text(&mut file);
    let cannot = |e: io::Error| CliError::file(directory, format_args!("cannot lock the directory: {e}"));
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Ok(Lock::Held(LockOwner::parse(&before))),
        Err(TryLockError::Error(e)) => return Err(cannot(e)),
    }
    let own = LockOwner::this().text();
    file.set_len(0).and_then(|()| io::Seek::rewind(&mut file)).map_err(cannot)?;
    file.write_all(own.as_bytes()).and_then(|()| file.flush()).map_err(cannot)?;
    // A holder that removed the file between opening and locking left a lock on a file without a name.
    match File::open(&path).map(|mut named| text(&mut named)) {
        Ok(named) if named == own => {}
        Ok(_) => return Ok(Lock::Gone),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Lock::Gone),
        Err(error) => return Err(cannot(error)),
    }
    Ok(Lock::Ours(file, LockOwner::parse(&before)))
}

/// The beginning of a file, as far as it is text.
fn text(file: &mut File) -> String {
    let mut text = String::new();
    // What cannot be read tells nothing about the holder; the lock itself is what counts.
    let _ = file.take(LOCK_TEXT).read_to_string(&mut text);
    text
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
        // What a killed run left is taken over.
        fs::write(path.join(LOCK), "process 1\nhost elsewhere\nsince 0\n").unwrap();
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
