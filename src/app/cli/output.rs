//! Standard output, closed pipes and full disks included.

use crate::cli::CliError;
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
/// As of [`print`].
pub fn print_bytes(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|e| CliError::output(&e))
}

/// Writes how far long work is to standard error, one line; if that is closed, nothing more can be done.
pub fn progress(text: &str) {
    let _ = writeln!(std::io::stderr(), "progress: {}", crate::names::one_line(text));
}

/// Writes a remark to standard error, one line; if that is closed, nothing more can be done.
pub fn note(text: &str) {
    let _ = writeln!(std::io::stderr(), "note: {}", crate::names::one_line(text));
}
