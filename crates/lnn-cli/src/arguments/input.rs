//! Files that a command reads; `-` is standard input.

use crate::CliError;
use crate::thresholds::MAX_STATES_BYTES;
use lnn::recording::NumberTable;
use lnn::scalar::Scalar;
use lnn::storage::{ReadError, read_regular};
use std::io::Read;
use std::path::Path;

/// `true` if a path means standard input or standard output.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Name of a file in messages.
pub fn name(path: &Path) -> String {
    if is_standard(path) { "standard input".to_string() } else { path.display().to_string() }
}

/// Name of an output in messages.
pub fn place(out: &Path) -> String {
    if is_standard(out) { "standard output".to_string() } else { out.display().to_string() }
}

/// Reads a regular file, or standard input to its end, of at most `limit` bytes.
///
/// # Errors
/// A data error that names the file.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>, CliError> {
    let bytes = if is_standard(path) { bounded(std::io::stdin().lock(), limit) } else { read_regular(path, limit) };
    bytes.map_err(|error| CliError::input(path, error))
}

/// Reads columns of numbers from a file of states or points, or from standard input.
///
/// # Errors
/// A data error that names the file and the first mistake in it.
pub fn table<S: Scalar>(path: &Path, columns: &[String]) -> Result<NumberTable<S>, CliError> {
    NumberTable::read(&read(path, MAX_STATES_BYTES)?, columns).map_err(|error| CliError::input(path, error))
}

/// Reads an input to its end, but at most `limit` bytes.
fn bounded(input: impl Read, limit: u64) -> Result<Vec<u8>, ReadError> {
    let mut bytes = Vec::new();
    let read = input.take(limit.saturating_add(1)).read_to_end(&mut bytes)? as u64;
    if read > limit { Err(ReadError::TooLarge { bytes: read, limit }) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_bounded() {
        assert_eq!(bounded(&b"four"[..], 4).unwrap(), b"four");
        assert!(matches!(bounded(std::io::repeat(0), 1000), Err(ReadError::TooLarge { limit: 1000, .. })));
        assert_eq!((name(Path::new("-")).as_str(), name(Path::new("./-")).as_str()), ("standard input", "./-"));
    }
}
