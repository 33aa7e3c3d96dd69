//! Text of configuration files.

use crate::CliError;
use crate::arguments::input;
use crate::thresholds::MAX_CONFIG_BYTES;
pub use lnn::pipeline::text::{Lines, constraints, line_of, lines, parse, table};
use std::path::Path;

/// The name of a file in messages, and its text; standard input if it is `-`.
///
/// # Errors
/// A data error for a file that cannot be read, a usage error for one that is not text.
pub fn read_text(path: &Path) -> Result<(String, String), CliError> {
    read_text_within(path, MAX_CONFIG_BYTES)
}

/// Like [`read_text`], for a file of at most `limit` bytes.
///
/// # Errors
/// Those of [`read_text`].
pub fn read_text_within(path: &Path, limit: u64) -> Result<(String, String), CliError> {
    let name = input::name(path);
    let text = String::from_utf8(input::read(path, limit)?)
        .map_err(|_| CliError::usage(format_args!("{name}: not UTF-8 text")))?;
    Ok((name, text))
}
