//! Handles Ctrl-C, SIGTERM, which batch systems send, and SIGHUP of a closed terminal: work with results to keep finishes its step first,
//! everything else ends at once.

use crate::CliError;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::{register, register_conditional_shutdown, register_usize};
use std::io;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Number of the signal for a closed terminal; `signal_hook` has no name for it on Windows, where it does not exist.
const SIGHUP: i32 = 1;

/// Signals that end the program, with their exit codes: 128 plus the number of the signal.
const SIGNALS: [(i32, u8); 3] = [(SIGINT, 130), (SIGTERM, 143), (SIGHUP, 129)];

/// Exit code of the last signal; it is global because signals belong to the process.
static CODE: AtomicUsize = AtomicUsize::new(SIGNALS[0].1 as usize);

/// If the flag is raised, a signal ends the program at once; otherwise, a signal raises it.
static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Lets signals end the program at once with their exit codes, until [`flag`] catches them; files being written are then complete or
/// absent.
///
/// # Errors
/// A data error if a handler cannot be installed.
pub fn watch() -> Result<(), CliError> {
    install().map_err(|error| CliError::data(format_args!("cannot watch for Ctrl-C: {error}")))
}

fn install() -> io::Result<()> {
    if FLAG.get().is_some() {
        return Ok(());
    }
    let flag = FLAG.get_or_init(|| Arc::new(AtomicBool::new(true)));
    for (signal, code) in SIGNALS {
        // Signals that are ignored from the start, such as SIGHUP under nohup, remain ignored.
        let status = || std::fs::read_to_string("/proc/self/status").ok();
        if signal == SIGHUP && (cfg!(windows) || !ends(signal, status().as_deref())) {
            continue;
        }
        // With this order of handlers, the first signal finds the flag lowered.
        register_conditional_shutdown(signal, i32::from(code), Arc::clone(flag))?;
        register_usize(signal, &CODE, usize::from(code))?;
        register(signal, Arc::clone(flag))?;
    }
    Ok(())
}

/// Returns the flag that a signal raises from now on; a second signal ends the program at once, with its exit code.
///
/// # Errors
/// As [`watch`].
pub fn flag() -> Result<Arc<AtomicBool>, CliError> {
    watch()?;
    let flag = FLAG.get_or_init(Arc::default);
    flag.store(false, Ordering::SeqCst);
    Ok(Arc::clone(flag))
}

/// Exit code of the last signal, 130 if none came.
pub fn exit_code() -> u8 {
    CODE.load(Ordering::SeqCst) as u8
}

/// `true` unless a signal is known to be ignored: the mask `SigIgn` in the process status has a bit for each ignored signal.
fn ends(signal: i32, status: Option<&str>) -> bool {
    let mask = status.and_then(|status| status.lines().find_map(|line| line.strip_prefix("SigIgn:")));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ignored_signal_stays_ignored() {
        let status = |mask: &str| format!("Name:\tlnn\nSigIgn:\t{mask}\nSigCgt:\t0000000000000001\n");
        assert!(ends(SIGHUP, Some(&status("0000000000001000"))));
        assert!(!ends(SIGHUP, Some(&status("0000000000000001"))));
        assert!(!ends(SIGHUP, Some(&status("x"))) && !ends(SIGHUP, None));
    }
}
