//! `lnn train`: learns, judges, writes.

use crate::cli::folder::Folder;
use crate::cli::learning::{Begin, Effort, Finished, Keeping, Learning, forget, learn};
use crate::cli::number::threads;
use crate::cli::progress::Progress as Bar;
use crate::cli::resume::{Found, command, find, has_checkpoint, require_same, say_finished};
use crate::cli::train_config::Args;
use crate::cli::{CliError, interrupt, output};
use crate::lagrangian::Configured;
use crate::names::counted;
use crate::training::{Config, Hooks, NEWEST, PREVIOUS, Progress, Stop};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Starts of the trajectory test, as in the paper.
const STARTS: usize = 4;

/// Trains and writes everything into the output directory; goes on with a training that was stopped, if asked to.
///
/// # Errors
/// A usage error for arguments and configuration, a data error for files and a training that fails, an interruption;
/// after the last two the best model so far is written, if there is one.
pub fn run(args: &Args) -> Result<(), CliError> {
    if let Some(format) = args.print_config {
        return args.print(format);
    }
    let Some(Task { config, system, folder, start }) = Task::of(args)? else { return Ok(()) };
    let stop = interrupt::flag()?;
    let effort = Effort { threads: threads(args.threads), starts: STARTS, horizon: 1.0 };
    let keeping = Keeping { every: args.checkpoint_every, start };
    let finished = match learn(&folder, &config, &system, effort, &hooks(&stop), keeping)? {
        Learning::Finished(finished) => finished,
        Learning::Nothing(_) if stop.load(Ordering::SeqCst) => {
            let problem = "interrupted before the first epoch ended";
            return Err(CliError::interrupted(format_args!("{problem}{}", how_to_go_on(folder.path()))));
        }
        Learning::Nothing(reason) => {
            forget(&folder)?;
            return Err(CliError::data(reason));
        }
    };
    if finished.stop != Stop::Interrupted {
        forget(&folder)?;
    }
    output::print(if args.json { &finished.json } else { &finished.text })?;
    conclude(&finished, folder.path())
}

/// What is to be trained, where, and from where on.
struct Task {
    config: Config,
    system: Configured<f64>,
    folder: Folder,
    start: Begin,
}

impl Task {
    /// The task that the arguments set; `None` if it has been done before.
    fn of(args: &Args) -> Result<Option<Self>, CliError> {
        let Some(path) = &args.resume else {
            let (config, system) = args.resolve()?;
            let path = args.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(&config.system));
            let folder = Folder::open(&path)?;
            if has_checkpoint(&path) {
                let problem = "an unfinished training is in this directory; go on with it by";
                let way_out = format!("remove {NEWEST} and {PREVIOUS}, or choose another --out");
                return Err(CliError::file(&path, format_args!("{problem} {}, {way_out}", command(&path))));
            }
            return Ok(Some(Self { config, system, folder, start: Begin::Anew }));
        };
        // Looked for before anything is created, and again when nobody else can write.
        find(path)?;
        let folder = Folder::open(path)?;
        match find(path)? {
            Found::Finished(saved, json) => {
                require_same(path, &saved, &args.resolve_beside(&saved)?)?;
                say_finished(path, args.json.then_some(&json))?;
                Ok(None)
            }
            Found::Unfinished(saved) => {
                require_same(path, &saved, &args.resolve_beside(&saved)?)?;
                let system = args.check(&saved)?;
                Ok(Some(Self { config: *saved, system, folder, start: Begin::Resume }))
            }
        }
    }
}

/// The exit of a training that did not run to its end.
fn conclude(finished: &Finished, path: &Path) -> Result<(), CliError> {
    let kept = format!("the best of {} is in {}", counted(finished.epochs, "epoch", "epochs"), path.display());
    match &finished.stop {
        Stop::Finished => Ok(()),
        Stop::Interrupted => Err(CliError::interrupted(format_args!("interrupted, {kept}{}", how_to_go_on(path)))),
        Stop::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}; {kept}"))),
    }
}

/// The end of a message about a training that was stopped.
fn how_to_go_on(path: &Path) -> String {
    if has_checkpoint(path) {
        format!("; go on with: {}", command(path))
    } else {
        "; there is no checkpoint".to_string()
    }
}

/// Progress on standard error, Ctrl-C.
pub(super) fn hooks(stop: &Arc<AtomicBool>) -> Hooks {
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
