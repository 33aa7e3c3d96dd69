//! Files read within limits and written whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use thiserror::Error;

/// Why a file could not be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// Nothing there.
    #[error("no such file")]
    Missing,
    /// A directory, a pipe, a device.
    #[error("expected a regular file, found {0}")]
    NotRegular(&'static str),
    /// More bytes than the reader takes.
    #[error("{bytes} bytes are more than the {limit} this reader takes")]
    TooLarge {
        /// Size of the file.
        bytes: u64,
        /// Largest size.
        limit: u64,
    },
    /// The system refused.
    #[error("cannot read: {0}")]
    Io(#[from] io::Error),
}

/// Reads a regular file of at most `limit` bytes.
///
/// Links are followed. Kind and size are checked before anything is opened or allocated, and a file that grows while it
/// is read is refused, so that a pipe cannot block and a device cannot fill the memory.
///
/// # Errors
/// [`ReadError`].
pub fn read_regular(path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
    let data = match fs::metadata(path) {
        Ok(data) => data,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(ReadError::Missing),
        Err(error) => return Err(error.into()),
    };
    if data.is_dir() {
        return Err(ReadError::NotRegular("a directory"));
    }
    if !data.is_file() {
        return Err(ReadError::NotRegular("a pipe or device"));
    }
    if data.len() > limit {
        return Err(ReadError::TooLarge { bytes: data.len(), limit });
    }
    let mut bytes = Vec::new();
    let read = File::open(path)?.take(limit.saturating_add(1)).read_to_end(&mut bytes)? as u64;
    if read > limit { Err(ReadError::TooLarge { bytes: read, limit }) } else { Ok(bytes) }
}

/// Writes `bytes` to `path` so that a reader sees the old content or the new, never part of either.
///
/// The bytes go to a temporary file in the same directory, reach the disk, and take the name by a rename. A link is
/// followed; what is not a regular file (`/dev/stdout`, a pipe) is written in place. On failure the temporary file is
/// removed and the old content stays.
///
/// # Errors
/// The error of the file system; a directory as target is refused.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let target = match fs::canonicalize(path) {
        Ok(existing) => existing,
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_path_buf(),
        Err(error) => return Err(error),
    };
    match fs::metadata(&target) {
        Ok(data) if data.is_dir() => return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a directory")),
        Ok(data) if !data.is_file() => {
            let mut file = OpenOptions::new().write(true).open(&target)?;
            file.write_all(bytes)?;
            return file.flush();
        }
        _ => {}
    }
    let name = target.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "names no file"))?;
    let directory = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };

    static COUNTER: AtomicUsize = AtomicUsize::new(0);
    let unique = format!(".{}.{}.tmp", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed));
    let mut temporary_name = std::ffi::OsString::from(".");
    temporary_name.push(name);
    temporary_name.push(unique);
    let temporary = directory.join(temporary_name);

    let written = fill(&temporary, &target, bytes).and_then(|()| fs::rename(&temporary, &target));
    if let Err(error) = written {
        // The first error is the one to report; nothing more can be done if the removal fails too.
        let _ = fs::remove_file(&temporary);
        return Err(error);
    }
    // The rename itself reaches the disk with the directory; file systems that cannot sync one are left alone.
    if let Ok(directory) = File::open(&directory) {
        let _ = directory.sync_all();
    }
    Ok(())
}

/// Creates `temporary` with the bytes and the permissions of `target`, if that exists.
fn fill(temporary: &Path, target: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = OpenOptions::new().write(true).create_new(true).open(temporary)?;
    file.write_all(bytes)?;
    if let Ok(old) = fs::metadata(target) {
        file.set_permissions(old.permissions())?;
    }
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(directory: &Path) -> usize {
        fs::read_dir(directory).unwrap().count()
    }

    #[test]
    fn writes_replaces_and_leaves_nothing_behind() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        write_atomically(&path, b"one").unwrap();
        assert_eq!(read_regular(&path, 3).unwrap(), b"one");
        write_atomically(&path, b"two").unwrap();
        assert_eq!(read_regular(&path, 3).unwrap(), b"two");
        assert_eq!(entries(directory.path()), 1);
    }

    #[test]
    fn failures_keep_the_old_content() {
        let directory = tempfile::tempdir().unwrap();
        assert_eq!(write_atomically(directory.path(), b"x").unwrap_err().kind(), io::ErrorKind::IsADirectory);
        assert!(write_atomically(&directory.path().join("missing/a.csv"), b"x").is_err());
        assert!(write_atomically(Path::new(""), b"x").is_err());
        assert_eq!(entries(directory.path()), 0);
    }

    #[test]
    fn reads_are_bounded() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        fs::write(&path, b"four").unwrap();
        assert!(matches!(read_regular(&path, 3), Err(ReadError::TooLarge { bytes: 4, limit: 3 })));
        assert!(matches!(read_regular(directory.path(), 3), Err(ReadError::NotRegular("a directory"))));
        assert!(matches!(read_regular(&directory.path().join("b"), 3), Err(ReadError::Missing)));
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay_what_they_are() {
        let directory = tempfile::tempdir().unwrap();
        let (target, link) = (directory.path().join("real"), directory.path().join("link"));
        fs::write(&target, b"old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_atomically(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().file_type().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"new");
        write_atomically(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
        assert!(matches!(read_regular(Path::new("/dev/zero"), 9), Err(ReadError::NotRegular(_))));
    }
}
