//! Standard output, closed pipes and full disks included.

use crate::cli::CliError;
use std::io::Write;

/// Writes `text` to standard output.
///
/// # Errors
/// A closed pipe or any other failure to write.
pub fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| CliError::output(&e))
}

/// Writes a remark to standard error, one line; if that is closed, nothing more can be done.
pub fn note(text: &str) {
    let _ = writeln!(std::io::stderr(), "note: {}", crate::names::one_line(text));
}
