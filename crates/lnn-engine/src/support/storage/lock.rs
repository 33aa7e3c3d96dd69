//! Locks of directories: only one process at a time works in a directory, and the system releases the lock when the process ends.

use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// Name of the lock file, whose text names the process.
const LOCK: &str = ".lnn.lock";

/// Longest text of a lock file that is read, in bytes.
const MAX_BYTES: u64 = 1024;

/// Number of attempts to lock a file that other processes remove meanwhile.
const ATTEMPTS: usize = 100;

/// Opens and locks the file; returns `None` if another process has the lock.
#[cfg(not(windows))]
fn lock(path: &Path) -> io::Result<Option<File>> {
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(fs::TryLockError::WouldBlock) => Ok(None),
        Err(fs::TryLockError::Error(error)) => Err(error),
    }
}

/// Returns `true` if another process has the lock.
#[cfg(not(windows))]
fn is_held(path: &Path) -> bool {
    File::open(path).is_ok_and(|file| matches!(file.try_lock_shared(), Err(fs::TryLockError::WouldBlock)))
}

/// Error of Windows if another process has opened the file without sharing it in this mode.
#[cfg(windows)]
const SHARING_VIOLATION: i32 = 32;

/// Does the same on Windows, where opening the file is the lock: others may read it, but neither write nor remove it. A Windows file lock
/// would hide the text from processes that want to know the holder.
#[cfg(windows)]
fn lock(path: &Path) -> io::Result<Option<File>> {
    use std::os::windows::fs::OpenOptionsExt;
    const SHARE_READ: u32 = 1;
    let mut options = OpenOptions::new();
    match options.read(true).write(true).create(true).truncate(false).share_mode(SHARE_READ).open(path) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.raw_os_error() == Some(SHARING_VIOLATION) => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(windows)]
fn is_held(path: &Path) -> bool {
    let opened = OpenOptions::new().write(true).open(path);
    opened.is_err_and(|error| error.raw_os_error() == Some(SHARING_VIOLATION))
}

/// The lock of a directory, held until it is dropped or the process ends.
#[derive(Debug)]
pub struct DirectoryLock {
    path: PathBuf,
    file: Option<File>,
}

/// Outcome of [`DirectoryLock::acquire`].
#[derive(Debug)]
pub enum Acquired {
    /// The lock was acquired; if a process ended without releasing it, that process is named.
    Lock(DirectoryLock, Option<LockOwner>),
    /// Another process has the lock; it is named if its file contains the name.
    Held(Option<LockOwner>),
}

impl DirectoryLock {
    /// Acquires the lock of an existing directory, if no other process has it.
    ///
    /// # Errors
    /// The error of the file system; [`ErrorKind::ResourceBusy`] if in every attempt other processes acquired and released the lock.
    pub fn acquire(directory: &Path) -> io::Result<Acquired> {
        let path = directory.join(LOCK);
        for _ in 0..ATTEMPTS {
            let Some(mut file) = lock(&path)? else { return Ok(Acquired::Held(LockOwner::of(&path))) };
            let before = LockOwner::parse(&text(&mut file));
            let own = LockOwner::this().text();
            file.set_len(0)?;
            io::Seek::rewind(&mut file)?;
            file.write_all(own.as_bytes())?;
            file.flush()?;
            // If the holder removed the file between opening and locking, this lock is on a file without a name.
            match File::open(&path).map(|mut named| text(&mut named)) {
                Ok(named) if named == own => {
                    return Ok(Acquired::Lock(Self { path, file: Some(file) }, before));
                }
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Err(ErrorKind::ResourceBusy.into())
    }

    /// Returns the process that has the lock of a directory, if there is one; the inner value is `None` if the lock file does not name it.
    pub fn holder(directory: &Path) -> Option<Option<LockOwner>> {
        let path = directory.join(LOCK);
        let owner = LockOwner::of(&path);
        is_held(&path).then_some(owner)
    }
}

impl Drop for DirectoryLock {
    fn drop(&mut self) {
        // Windows does not remove a file that is opened in this way; elsewhere another process could lock the file before it is removed.
        if cfg!(windows) {
            drop(self.file.take());
        }
        // A remaining file is harmless, because only the lock counts.
        let _ = fs::remove_file(&self.path);
    }
}

/// Reads the beginning of a file, if it is text.
fn text(file: &mut File) -> String {
    let mut text = String::new();
    // An unreadable file does not identify the holder; only the lock itself counts.
    let _ = file.take(MAX_BYTES).read_to_string(&mut text);
    text
}

/// The process that holds a lock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LockOwner {
    /// Its process number.
    pub process: u32,
    /// Name of its machine.
    pub host: String,
}

impl LockOwner {
    /// Returns the current process.
    fn this() -> Self {
        let kernel = fs::read_to_string("/proc/sys/kernel/hostname").ok();
        let variable = || ["HOSTNAME", "COMPUTERNAME"].iter().find_map(|name| std::env::var(name).ok());
        let name = kernel.or_else(variable).unwrap_or_default();
        let name: String = name.trim().chars().filter(|c| !c.is_control()).take(64).collect();
        let host = if name.is_empty() { "unknown".to_string() } else { name };
        Self { process: std::process::id(), host }
    }

    /// Reads which process a lock file names.
    fn of(path: &Path) -> Option<Self> {
        Self::parse(&text(&mut File::open(path).ok()?))
    }

    /// Returns the text of the lock file.
    fn text(&self) -> String {
        format!("process {}\nhost {}\n", self.process, self.host)
    }

    /// Parses the text of a lock file.
    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let mut value = |key: &str| lines.next()?.strip_prefix(key)?.strip_prefix(' ');
        let (process, host) = (value("process")?, value("host")?);
        Some(Self { process: process.parse().ok()?, host: host.to_string() })
    }
}

impl fmt::Display for LockOwner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "process {} on {}", self.process, self.host)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_comes_back() {
        let owner = LockOwner::this();
        assert_eq!(LockOwner::parse(&owner.text()), Some(owner));
        for bad in ["", "process x\nhost a\n", "process 1\n", "host a\nprocess 1\n"] {
            assert_eq!(LockOwner::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn one_holder_at_a_time_is_named() {
        let directory = tempfile::tempdir().unwrap();
        let Acquired::Lock(lock, None) = DirectoryLock::acquire(directory.path()).unwrap() else { panic!("held") };
        let Acquired::Held(Some(owner)) = DirectoryLock::acquire(directory.path()).unwrap() else { panic!("free") };
        assert_eq!(owner.process, std::process::id());
        assert_eq!(DirectoryLock::holder(directory.path()), Some(Some(owner)));
        drop(lock);
        assert_eq!(DirectoryLock::holder(directory.path()), None);
        // A dead process has left its file without a lock.
        fs::write(directory.path().join(LOCK), "process 1\nhost far\n").unwrap();
        let Acquired::Lock(_lock, Some(before)) = DirectoryLock::acquire(directory.path()).unwrap() else { panic!() };
        assert_eq!(before.to_string(), "process 1 on far");
    }
}
