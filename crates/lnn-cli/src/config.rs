//! Text of configuration files.

use crate::{CliError, input};
pub use lnn::pipeline::text::{Lines, line_of, lines, parse, table};
use std::path::Path;

/// Largest configuration that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// The name of a file in messages, and its text; standard input if it is `-`.
///
/// # Errors
/// A data error for a file that cannot be read, a usage error for one that is not text.
pub fn read_text(path: &Path) -> Result<(String, String), CliError> {
    read_text_within(path, MAX_BYTES)
}

/// As [`read_text`], for a file of at most `limit` bytes.
///
/// # Errors
/// Those of [`read_text`].
pub fn read_text_within(path: &Path, limit: u64) -> Result<(String, String), CliError> {
    let name = input::name(path);
    let bytes = input::read(path, limit).map_err(|e| CliError::data(format_args!("{name}: {e}")))?;
    let text = String::from_utf8(bytes).map_err(|_| CliError::usage(format_args!("{name}: not UTF-8 text")))?;
    Ok((name, text))
}
