//! `lnn fit`: learns from recorded motion, judges by motion that was held out, writes.

use crate::cli::fit_config::{Args, Plan};
use crate::cli::fit_resume::Order;
use crate::cli::folder::Folder;
use crate::cli::learned::model_file;
use crate::cli::number::threads;
use crate::cli::place::{self, Wanted};
use crate::cli::print_config::{PrintFormat, commented, fit_reference, training_reference};
use crate::cli::recording_args::read;
use crate::cli::results::Writer;
use crate::cli::resume::{self, forget, how_to_go_on};
use crate::cli::said::Said;
use crate::cli::watch::watch;
use crate::cli::{CliError, interrupt, output};
use crate::pipeline::{Begin, Checkpoints, FitConfig, PipelineError, PreparedFit, RunOptions, fit};
use crate::recording::Targets;
use crate::training::StopReason;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Learns and writes everything into the output directory.
///
/// # Errors
/// A usage error for arguments, a data error for files and data that cannot be learned from, an interruption; after the
/// last the best model so far is written, if there is one.
pub fn run(args: &Args, words: &[OsString]) -> Result<(), CliError> {
    let started = Instant::now();
    if args.run.print_config == Some(PrintFormat::Markdown) {
        return output::print(&(fit_reference() + &training_reference()));
    }
    let Some(Order { args, said, resumed }) = Order::of(args, words)? else { return Ok(()) };
    let plan = Plan::new(&args)?;
    let reading = read(&plan.files(), &plan.config.recording.meaning())?;
    plan.require_time(&reading.recording.coordinates)?;
    let prepared = PreparedFit::new(&reading, &plan.options()).map_err(|error| match error {
        PipelineError::NoAccelerations => {
            CliError::usage(format_args!("--targets measured: {error}, see --acceleration"))
        }
        _ => error.into(),
    })?;
    prepared.check_horizon(plan.config.horizon).map_err(|fault| CliError::usage(format_args!("--{fault}")))?;
    let prepared = PreparedFit { started, ..prepared };
    prepared.survey()?.warnings.iter().for_each(|warning| output::note(warning));
    let forced = reading.recording.tracks.iter().any(|track| !track.force.is_empty());
    if plan.config.training.network.dissipation.is_some() && reading.recording.n() == 1 && !forced {
        let motion = "every motion of one coordinate has a Lagrangian";
        output::note(&format!("{motion}: without known forces (--force) L and the friction are not told apart"));
    }
    let config = plan.configure(&prepared)?;
    if args.run.print_config.is_some() {
        let table = toml::Table::try_from(&config).map_err(CliError::data)?;
        return output::print(&commented(FitConfig::KEYS, &table, &|_| None));
    }
    let config = FitConfig { shooting: config.shooting.filter(|_| prepared.targets() == Targets::Motion), ..config };
    let begin = if resumed.is_some() { Begin::Resume } else { Begin::Anew };
    let folder = match resumed {
        Some(folder) => folder,
        None => {
            let usual = PathBuf::from("runs").join(&config.training.system);
            let start = config.training.from.as_deref().map(|from| model_file(Path::new(from))).transpose()?;
            let inputs: Vec<&Path> = args.inputs().chain(start.as_deref()).collect();
            let (out, writer) = (args.run.out.as_deref(), Writer::Learner);
            place::open(&Wanted { out, usual: &usual, overwrite: args.run.overwrite, inputs: &inputs, writer })?
        }
    };
    perform(&args, &config, &said, &prepared, begin, &folder).map_err(resume::keeping(folder.path()))
}

/// Fits, prints the result, and says how it ended.
fn perform(
    args: &Args,
    config: &FitConfig,
    said: &Said,
    prepared: &PreparedFit<'_>,
    begin: Begin,
    folder: &Folder,
) -> Result<(), CliError> {
    let stop = interrupt::flag().map_err(CliError::signals)?;
    let checkpoints = Checkpoints::new(folder.path(), args.run.checkpoint_every)
        .beginning(begin)
        .identified_by(said.text(&config.without_files())?);
    let options =
        RunOptions { threads: threads(args.run.threads), checkpoints: Some(checkpoints), ..RunOptions::default() };
    let fitted = match fit(prepared, config, &options, folder, &watch(&stop)) {
        Ok(fitted) => fitted,
        // There is no model: after an error nothing is left to go on from.
        Err(error @ (PipelineError::Training(_) | PipelineError::Shooting(_))) => {
            if stop.load(Ordering::SeqCst) {
                let on = how_to_go_on(folder.path());
                return Err(CliError::interrupted(format_args!("interrupted before the first epoch ended{on}")));
            }
            return Err(forget(folder.path()).err().unwrap_or_else(|| error.into()));
        }
        Err(error) => return Err(error.into()),
    };
    if fitted.stop != StopReason::Interrupted {
        forget(folder.path())?;
    }
    if args.run.json {
        output::print(&fitted.json)?;
    } else {
        output::print(&format!("{}\nreport: {}\n", fitted.text(), folder.file("report.html").display()))?;
    }
    match &fitted.stop {
        StopReason::Finished => Ok(()),
        StopReason::Interrupted => {
            let (place, on) = (folder.path().display(), how_to_go_on(folder.path()));
            Err(CliError::interrupted(format_args!("interrupted, the best model so far is in {place}{on}")))
        }
        StopReason::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}"))),
    }
}
