//! `lnn train`: learns, judges, writes.

use crate::cli::folder::Folder;
use crate::cli::learning::{Effort, Finished, Learning, learn};
use crate::cli::number::threads;
use crate::cli::progress::Progress as Bar;
use crate::cli::train_config::Args;
use crate::cli::{CliError, interrupt, output};
use crate::training::{Hooks, Progress, Stop};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Starts of the trajectory test, as in the paper.
const STARTS: usize = 4;

/// Trains and writes everything into the output directory.
///
/// # Errors
/// A usage error for arguments and configuration, a data error for files and a training that fails, an interruption;
/// after the last two the best model so far is written, if there is one.
pub fn run(args: &Args) -> Result<(), CliError> {
    let (config, system) = args.resolve()?;
    let path = args.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(&config.system));
    let folder = Folder::open(&path)?;
    let stop = interrupt::flag()?;
    let effort = Effort { threads: threads(args.threads), starts: STARTS, horizon: 1.0 };
    let finished = match learn(&folder, &config, &system, effort, &hooks(&stop))? {
        Learning::Finished(finished) => finished,
        Learning::Nothing(_) if stop.load(Ordering::SeqCst) => {
            return Err(CliError::interrupted("interrupted before the first epoch ended"));
        }
        Learning::Nothing(reason) => return Err(CliError::data(reason)),
    };
    output::print(if args.json { &finished.json } else { &finished.text })?;
    conclude(&finished, &path)
}

/// The exit of a training that did not run to its end.
fn conclude(finished: &Finished, path: &Path) -> Result<(), CliError> {
    let kept = format!("the best of {} epochs is in {}", finished.epochs, path.display());
    match &finished.stop {
        Stop::Finished => Ok(()),
        Stop::Interrupted => Err(CliError::interrupted(format_args!("interrupted, {kept}"))),
        Stop::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}; {kept}"))),
    }
}

/// Progress on standard error, Ctrl-C.
fn hooks(stop: &Arc<AtomicBool>) -> Hooks {
    let bar: std::sync::OnceLock<Bar> = std::sync::OnceLock::new();
    Hooks {
        watcher: Some(Arc::new(move |progress| match progress {
            Progress::Step { step, steps, .. } => {
                bar.get_or_init(|| Bar::new(steps as u64, "steps")).advance(step as u64);
            }
            Progress::Epoch(epoch) => {
                if let Some(bar) = bar.get() {
                    bar.show(epoch.validation_loss, epoch.rate);
                }
            }
        })),
        interrupt: Arc::clone(stop),
    }
}
