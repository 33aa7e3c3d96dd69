//! Files read within limits.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;
use thiserror::Error;

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
