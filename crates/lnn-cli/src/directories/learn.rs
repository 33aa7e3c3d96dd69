//! Common parts of `lnn train` and `lnn fit`: directory, checkpoints, results on standard output, end.

use crate::CliError;
use crate::arguments::learned::model_file;
use crate::arguments::number::threads;
use crate::arguments::run_args::RunArgs;
use crate::directories::folder::Folder;
use crate::directories::output_dir::{self, Wanted};
use crate::directories::results::Writer;
use crate::directories::resume::{continuation_hint, remove_checkpoints_of, with_continuation};
use crate::terminal::watch::watch;
use crate::terminal::{interrupt, output};
use lnn::configuration::Config;
use lnn::data::SamplingError;
use lnn::findings::Findings;
use lnn::names::pluralize;
use lnn::pipeline::{Begin, Checkpoints, PipelineError, RunOptions, Watch};
use lnn::shooting::ShootingError;
use lnn::training::{StopReason, TrainingError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A result, as the command prints it.
pub struct LearnedRun {
    /// Text of `summary.json`.
    pub json: String,
    /// Headline and tables.
    pub findings: Findings,
    /// Why learning ended.
    pub stop: StopReason,
    /// Number of epochs that were run.
    pub epochs: usize,
    /// Describes what an interruption after the training left out.
    pub unfinished: Option<String>,
}

/// Opens the directory of a new run; `inputs` are the files that it reads in addition to the model that it starts from.
///
/// # Errors
/// Those of [`output_dir::open`].
pub fn open(args: &RunArgs, config: &Config, inputs: &[&Path]) -> Result<Folder, CliError> {
    let usual = PathBuf::from("runs").join(&config.system);
    let start = config.from.as_deref().map(|from| model_file(Path::new(from))).transpose()?;
    let inputs: Vec<&Path> = inputs.iter().copied().chain(start.as_deref()).collect();
    let (out, overwrite, writer) = (args.out.as_deref(), args.overwrite, Writer::Learner);
    output_dir::open(&Wanted { out, usual: &usual, overwrite, inputs: &inputs, writer })
}

/// A run that learns in a directory.
pub struct Session<'a> {
    args: &'a RunArgs,
    stop: Arc<AtomicBool>,
    /// The directory.
    pub folder: Folder,
    /// Threads and checkpoints.
    pub options: RunOptions,
}

impl<'a> Session<'a> {
    /// Watches for signals and keeps checkpoints, which store `identity` instead of the configuration.
    ///
    /// # Errors
    /// Signals that cannot be watched for.
    pub fn new(args: &'a RunArgs, folder: Folder, begin: Begin, identity: Option<String>) -> Result<Self, CliError> {
        let stop = interrupt::flag()?;
        let checkpoints = Checkpoints::new(folder.path(), args.checkpoint_every).beginning(begin);
        let checkpoints = Some(match identity {
            Some(identity) => checkpoints.identified_by(identity),
            None => checkpoints,
        });
        let mut options = RunOptions::default();
        (options.threads, options.checkpoints) = (threads(args.threads), checkpoints);
        Ok(Self { args, stop, folder, options })
    }

    /// Receiver of progress, with the flag of the signals.
    pub fn watch(&self) -> Watch {
        watch(&self.stop)
    }

    /// Prints the results, removes the checkpoints of a finished run, and reports how it ended.
    ///
    /// # Errors
    /// An interruption, after which the best model so far is written, if there is one; a data error for a training that failed.
    pub fn conclude(self, learned: Result<LearnedRun, PipelineError>) -> Result<(), CliError> {
        let path = self.folder.path();
        let LearnedRun { json, findings, stop, epochs, unfinished } = match learned {
            Ok(learned) => learned,
            Err(error) if is_empty(&error) && self.stop.load(Ordering::SeqCst) => {
                let on = continuation_hint(path);
                return Err(CliError::interrupted(format_args!("interrupted before the first epoch ended{on}")));
            }
            // Without a model, there is nothing to continue from.
            Err(error) if is_empty(&error) => {
                return Err(remove_checkpoints_of(path).err().unwrap_or_else(|| error.into()));
            }
            Err(error) => return Err(with_continuation(path, error.into())),
        };
        if stop != StopReason::Interrupted {
            remove_checkpoints_of(path)?;
        }
        if self.args.json {
            output::print(&json)?;
        } else {
            output::print(&format!("{findings}\nreport: {}\n", self.folder.file("report.html").display()))?;
        }
        let kept = format!("the best of {} is in {}", pluralize(epochs, "epoch", "epochs"), path.display());
        match stop {
            StopReason::Interrupted => {
                let what = unfinished.map_or(String::new(), |what| format!("{what}; "));
                Err(CliError::interrupted(format_args!("interrupted, {what}{kept}{}", continuation_hint(path))))
            }
            StopReason::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}; {kept}"))),
            _ => Ok(()),
        }
    }
}

/// `true` if learning ended before there was a model.
fn is_empty(error: &PipelineError) -> bool {
    matches!(
        error,
        PipelineError::Sampling(SamplingError::Interrupted)
            | PipelineError::Training(TrainingError::NothingLearned(_))
            | PipelineError::Shooting(ShootingError::Training(TrainingError::NothingLearned(_)))
    )
}
