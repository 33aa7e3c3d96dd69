//! Writes to standard output; handles closed pipes and full disks.

use crate::CliError;
use lnn::findings::Findings;
use serde::Serialize;
use std::io::Write;

/// Writes `text` to standard output.
///
/// # Errors
/// A closed pipe or any other failure to write.
pub fn print(text: &str) -> Result<(), CliError> {
    print_bytes(text.as_bytes())
}

/// Writes bytes to standard output.
///
/// # Errors
/// Those of [`print`].
pub fn print_bytes(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|e| CliError::output(&e))
}

/// Formats a result as one JSON object or as text.
///
/// # Errors
/// A data error for numbers that JSON cannot represent.
pub fn shown<T: Serialize>(result: &T, json: bool, findings: impl FnOnce(&T) -> Findings) -> Result<String, CliError> {
    if json { self::json(result) } else { Ok(findings(result).to_string()) }
}

/// Formats a result as a line of JSON.
///
/// # Errors
/// A data error for numbers that JSON cannot represent.
pub fn json(result: &impl Serialize) -> Result<String, CliError> {
    Ok(serde_json::to_string(result).map_err(CliError::data)? + "\n")
}

/// Writes the progress of long work to standard error, on one line; if that is closed, nothing more can be done.
pub fn progress(text: &str) {
    let _ = writeln!(std::io::stderr(), "progress: {}", lnn::names::one_line(text));
}

/// Writes a remark to standard error, one line; if that is closed, nothing more can be done.
pub fn note(text: &str) {
    let _ = writeln!(std::io::stderr(), "note: {}", lnn::names::one_line(text));
}
