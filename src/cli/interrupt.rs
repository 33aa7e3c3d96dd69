//! Ctrl-C: training finishes its step first, everything else ends at once.

use crate::cli::CliError;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that Ctrl-C raises; a second Ctrl-C ends the program at once with exit code 130.
///
/// # Errors
/// If the handler cannot be installed.
pub fn flag() -> Result<Arc<AtomicBool>, CliError> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    })
    .map_err(|e| CliError::data(format_args!("cannot watch for Ctrl-C: {e}")))?;
    Ok(flag)
}

/// Ctrl-C ends the program at once with exit code 130; files being written are whole or not there.
///
/// # Errors
/// If the handler cannot be installed.
pub fn end_at_once() -> Result<(), CliError> {
    ctrlc::set_handler(|| std::process::exit(130))
        .map_err(|e| CliError::data(format_args!("cannot watch for Ctrl-C: {e}")))
}
