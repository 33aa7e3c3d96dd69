//! Ctrl-C, SIGTERM, which batch systems send, and SIGHUP of a closed terminal: work that can be kept finishes its step first, everything
//! else ends at once.

use crate::CliError;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::{register, register_conditional_shutdown, register_usize};
use std::io;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// A closed terminal, by its number: `signal_hook` has no name for it on Windows, where it does not exist.
const SIGHUP: i32 = 1;

/// Signals that end the program, with the exit code of each, 128 and its number.
const SIGNALS: [(i32, u8); 3] = [(SIGINT, 130), (SIGTERM, 143), (SIGHUP, 129)];

/// Exit code of the signal that came last; a signal is the process's, and so is this.
static CODE: AtomicUsize = AtomicUsize::new(SIGNALS[0].1 as usize);

/// While it is up, a signal ends the program at once; while it is down, a signal raises it.
static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Signals end the program at once with their exit codes, until [`flag`] catches them; files being written are then whole or absent.
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
        // Signals that are ignored from the start, as SIGHUP under nohup, stay ignored.
        let status = || std::fs::read_to_string("/proc/self/status").ok();
        if signal == SIGHUP && (cfg!(windows) || !ends(signal, status().as_deref())) {
            continue;
        }
        // In this order, the first signal finds the flag lowered.
        register_conditional_shutdown(signal, i32::from(code), Arc::clone(flag))?;
        register_usize(signal, &CODE, usize::from(code))?;
        register(signal, Arc::clone(flag))?;
    }
    Ok(())
}

/// The flag that a signal raises from now on; a second one ends the program at once, with the exit code of that signal.
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

/// `true` if a signal is known not to be ignored: the mask `SigIgn` in the status of the process has a bit for each ignored one.
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
