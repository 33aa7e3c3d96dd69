//! `lnn train`: learns, judges, writes.

use crate::cli::folder::Folder;
use crate::cli::learned::model_file;
use crate::cli::learning::{Begin, Effort, Finished, Keeping, Learning, forget, learn};
use crate::cli::number::threads;
use crate::cli::place::{self, Wanted};
use crate::cli::progress::Progress as Bar;
use crate::cli::results::Writer;
use crate::cli::resume::{self, Found, Learner, configuration, find, how_to_go_on, require_same, say_finished};
use crate::cli::train_config::Args;
use crate::cli::{CliError, interrupt, output};
use crate::lagrangian::Configured;
use crate::names::counted;
use crate::training::{Config, Hooks, NEWEST, Progress, Stop};
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
    let stop = interrupt::flag().map_err(CliError::signals)?;
    let effort = Effort { threads: threads(args.threads), starts: STARTS, horizon: 1.0 };
    let keeping = Keeping { every: args.checkpoint_every, start };
    let learned = learn(&folder, &config, &system, effort, &hooks(&stop), keeping);
    let finished = match learned.map_err(resume::keeping(folder.path()))? {
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

/// A training: configuration, system, directory and beginning.
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
            let usual = PathBuf::from("runs").join(&config.system);
            let start = config.from.as_deref().map(|from| model_file(Path::new(from))).transpose()?;
            let inputs: Vec<&Path> = args.inputs().chain(start.as_deref()).collect();
            let wanted = Wanted {
                out: args.out.as_deref(),
                usual: &usual,
                overwrite: args.overwrite,
                inputs: &inputs,
                writer: Writer::Learner,
            };
            return Ok(Some(Self { config, system, folder: place::open(&wanted)?, start: Begin::Anew }));
        };
        // Looked for before anything is created, and again when nobody else can write.
        find(path, Learner::Train)?;
        let folder = Folder::open(path)?;
        match find(path, Learner::Train)? {
            Found::Finished(text, json) => {
                let saved = configuration(path, "config.toml", &text)?;
                require_same(path, &saved, &args.resolve_beside(&saved)?)?;
                say_finished(path, args.json.then_some(&json))?;
                Ok(None)
            }
            Found::Unfinished(text) => {
                let saved = configuration(path, NEWEST, &text)?;
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
