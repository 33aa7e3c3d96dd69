//! `lnn train`: learns, judges, writes.

use crate::cli::folder::Folder;
use crate::cli::learned::model_file;
use crate::cli::number::threads;
use crate::cli::place::{self, Wanted};
use crate::cli::results::Writer;
use crate::cli::resume::{self, Found, Learner, configuration, find, forget, how_to_go_on, require_same, say_finished};
use crate::cli::train_config::Args;
use crate::cli::watch::watch;
use crate::cli::{CliError, interrupt, output};
use crate::configuration::Config;
use crate::data::SamplingError;
use crate::lagrangian::SystemInstance;
use crate::names::counted;
use crate::pipeline::{Begin, Checkpoints, PipelineError, RunOptions, TrainReport, train};
use crate::training::{LATEST, StopReason, TrainingError};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

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
    let checkpoints = Checkpoints::new(folder.path(), args.checkpoint_every).beginning(start);
    let options =
        RunOptions { threads: threads(args.threads), checkpoints: Some(checkpoints), ..RunOptions::default() };
    let trained = match train(&config, &system, &options, &folder, &watch(&stop)) {
        Ok(trained) => trained,
        Err(
            PipelineError::Sampling(SamplingError::Interrupted)
            | PipelineError::Training(TrainingError::NothingLearned(_)),
        ) if stop.load(Ordering::SeqCst) => {
            let problem = "interrupted before the first epoch ended";
            return Err(CliError::interrupted(format_args!("{problem}{}", how_to_go_on(folder.path()))));
        }
        Err(error @ PipelineError::Training(TrainingError::NothingLearned(_))) => {
            forget(folder.path())?;
            return Err(error.into());
        }
        Err(error) => return Err(resume::keeping(folder.path())(error.into())),
    };
    if trained.stop != StopReason::Interrupted {
        forget(folder.path())?;
    }
    if args.json {
        output::print(&trained.json)?;
    } else {
        output::print(&format!("{}report: {}\n", trained.text(), folder.file("report.html").display()))?;
    }
    conclude(&trained, folder.path())
}

/// A training: configuration, system, directory and beginning.
struct Task {
    config: Config,
    system: SystemInstance<f64>,
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
                let saved = configuration(path, LATEST, &text)?;
                require_same(path, &saved, &args.resolve_beside(&saved)?)?;
                let system = args.check(&saved)?;
                Ok(Some(Self { config: *saved, system, folder, start: Begin::Resume }))
            }
        }
    }
}

/// The exit of a training that did not run to its end.
fn conclude(finished: &TrainReport, path: &Path) -> Result<(), CliError> {
    let kept = format!("the best of {} is in {}", counted(finished.history.len(), "epoch", "epochs"), path.display());
    match &finished.stop {
        StopReason::Finished => Ok(()),
        StopReason::Interrupted => {
            Err(CliError::interrupted(format_args!("interrupted, {kept}{}", how_to_go_on(path))))
        }
        StopReason::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}; {kept}"))),
    }
}
