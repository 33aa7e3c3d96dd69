//! Ctrl-C: the first asks the running command to finish its step, the second ends the program.

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
