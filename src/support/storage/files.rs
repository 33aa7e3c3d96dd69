//! The few operations that writing safely is made of, so that each can be made to fail.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::{fs, io};
use thiserror::Error;

/// Operations of a file system. [`Disk`] is the real one; tests put one that fails in its place.
pub trait Files: Send + Sync {
    /// Creates a file for writing; one that exists is refused.
    ///
    /// # Errors
    /// The system's.
    fn create(&self, path: &Path) -> io::Result<File>;
    /// Writes some of the bytes and says how many.
    ///
    /// # Errors
    /// The system's.
    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize>;
    /// Returns when the file's content is on the disk.
    ///
    /// # Errors
    /// The system's.
    fn sync(&self, file: &File) -> io::Result<()>;
    /// Gives a file another name, taking the place of what had that name.
    ///
    /// # Errors
    /// The system's.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Returns when the names in a directory are on the disk.
    ///
    /// # Errors
    /// The system's.
    fn sync_directory(&self, directory: &Path) -> io::Result<()>;
    /// Reads a regular file of at most `limit` bytes.
    ///
    /// # Errors
    /// [`ReadError`].
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, ReadError>;
    /// Removes a file.
    ///
    /// # Errors
    /// The system's.
    fn remove(&self, path: &Path) -> io::Result<()>;
}

/// The file system of the machine.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Files for Disk {
    fn create(&self, path: &Path) -> io::Result<File> {
        OpenOptions::new().write(true).create_new(true).open(path)
    }
    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize> {
        file.write(bytes)
    }
    fn sync(&self, file: &File) -> io::Result<()> {
        file.sync_all()
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }
    fn sync_directory(&self, directory: &Path) -> io::Result<()> {
        match File::open(directory).and_then(|directory| directory.sync_all()) {
            // Some systems cannot open or synchronise a directory; there the rename alone has to do.
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::PermissionDenied | io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported
                ) =>
            {
                Ok(())
            }
            result => result,
        }
    }
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
        read_regular(path, limit)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }
}

/// Repetitions of an operation that a signal interrupts, before it counts as failed.
const INTERRUPTIONS: usize = 64;

/// Repeats an operation that a signal interrupted.
pub(super) fn uninterrupted<T>(mut operation: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    for _ in 0..INTERRUPTIONS {
        match operation() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
    operation()
}

/// Writes all of the bytes, however few the system takes at a time.
pub(super) fn write_all(files: &dyn Files, file: &mut File, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match uninterrupted(|| files.write(file, bytes))? {
            0 => return Err(io::Error::new(io::ErrorKind::WriteZero, "the system takes no more bytes")),
            written => bytes = bytes.get(written..).unwrap_or_default(),
        }
    }
    Ok(())
}

/// Why a file could not be read.
#[derive(Debug, Error)]
#[non_exhaustive]
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

/// Opens a regular file of at most `limit` bytes; its size comes second.
///
/// Links are followed. Kind and size are checked before anything is opened, so that a pipe cannot block and a device
/// cannot fill the memory.
///
/// # Errors
/// [`ReadError`].
pub fn open_regular(path: &Path, limit: u64) -> Result<(File, u64), ReadError> {
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
    Ok((File::open(path)?, data.len()))
}

/// Reads a regular file of at most `limit` bytes, opened like [`open_regular`]; one that grows beyond while it is read
/// is refused.
///
/// # Errors
/// [`ReadError`].
pub fn read_regular(path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
    let (file, _) = open_regular(path, limit)?;
    let mut bytes = Vec::new();
    let read = file.take(limit.saturating_add(1)).read_to_end(&mut bytes)? as u64;
    if read > limit { Err(ReadError::TooLarge { bytes: read, limit }) } else { Ok(bytes) }
}
