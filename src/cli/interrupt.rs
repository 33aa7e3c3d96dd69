//! Ctrl-C and SIGTERM, which batch systems send: training finishes its step first, everything else ends at once.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::{register, register_conditional_shutdown, register_usize};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Signals that end the program, with the exit code of each, 128 and its number.
const SIGNALS: [(i32, u8); 2] = [(SIGINT, 130), (SIGTERM, 143)];

/// Exit code of the signal that came last; a signal is the process's, and so is this.
static CODE: AtomicUsize = AtomicUsize::new(SIGNALS[0].1 as usize);

/// A flag that Ctrl-C or SIGTERM raises; a second one ends the program at once, with the exit code of that signal.
///
/// # Errors
/// If the handler cannot be installed.
pub fn flag() -> io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for (signal, code) in SIGNALS {
        // In this order: the first signal finds the flag down.
        register_conditional_shutdown(signal, i32::from(code), Arc::clone(&flag))?;
        register_usize(signal, &CODE, usize::from(code))?;
        register(signal, Arc::clone(&flag))?;
    }
    Ok(flag)
}

/// Ctrl-C and SIGTERM end the program at once with their exit codes; files being written are whole or not there.
///
/// # Errors
/// If the handler cannot be installed.
pub fn end_at_once() -> io::Result<()> {
    for (signal, code) in SIGNALS {
        register_conditional_shutdown(signal, i32::from(code), Arc::new(AtomicBool::new(true)))?;
    }
    Ok(())
}

/// Exit code of the signal that came last, 130 if none came.
pub fn exit_code() -> u8 {
    CODE.load(Ordering::SeqCst) as u8
}
