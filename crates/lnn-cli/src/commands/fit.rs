//! `lnn fit`: learns from recorded motion, tests the model on held-out motion, writes the results.

use crate::CliError;
use crate::arguments::fit_config::{Args, Plan, Saved};
use crate::arguments::print_config::{PrintFormat, commented, fit_reference, training_reference};
use crate::arguments::recording_args::{first_look, read};
use crate::directories::learn::{LearnedRun, Session, open};
use crate::directories::resume::{SavedText, reopen};
use crate::terminal::output;
use lnn::pipeline::{Begin, Command, FitConfig, PipelineError, PreparedFit, fit};
use lnn::recording::LoadedRecording;
use std::time::Instant;

/// Learns and writes everything into the output directory.
///
/// # Errors
/// A usage error for arguments, a data error for files and data that cannot be learned from, an interruption, after which the best model so
/// far is written, if there is one.
pub fn run(args: &Args) -> Result<(), CliError> {
    let started = Instant::now();
    if args.run.print_config == Some(PrintFormat::Markdown) {
        return output::print(&(fit_reference() + &training_reference()));
    }
    let completed = args.complete()?;
    let first = args.recording.coords != completed.recording.coords;
    let args = &completed;
    let (plan, resumed) = match &args.run.resume {
        None => (Plan::new(args, None)?, None),
        Some(path) => {
            let read = |text: SavedText<'_>| Plan::new(args, Some(Saved::read(path, text)?));
            let Some((folder, plan)) = reopen(path, Command::Fit, args.run.json, read)? else { return Ok(()) };
            (plan, Some(folder))
        }
    };
    let reading = read(&plan.files(), &plan.config.recording.meaning())?;
    plan.require_time(&reading.recording.coordinates)?;
    let mut prepared = PreparedFit::new(&reading, &plan.options()).map_err(|error| match error {
        PipelineError::NoAccelerations => {
            CliError::usage(format_args!("--targets measured: {error}, see --acceleration"))
        }
        PipelineError::NoForces => CliError::usage(format_args!("--targets forces: {error}, see --force")),
        _ => error.into(),
    })?;
    prepared.check_horizon(plan.config.horizon).map_err(|fault| CliError::usage(format_args!("--{fault}")))?;
    prepared.started = started;
    prepared.survey()?.warnings.iter().for_each(|warning| output::note(warning));
    let forced = reading.recording.tracks.iter().any(|track| !track.force.is_empty());
    if plan.config.training.network.dissipation.is_some() && reading.recording.n() == 1 && !forced {
        let motion = "every motion of a single coordinate has a Lagrangian";
        output::note(&format!("{motion}: without known forces (--force) L and the friction cannot be separated"));
    }
    let config = plan.configure(&prepared)?;
    if args.run.print_config.is_some() {
        let table = toml::Table::try_from(&config).map_err(CliError::data)?;
        return output::print(&commented(FitConfig::KEYS, &table, &|_| None));
    }
    if first {
        advise(&reading)?;
    }
    let (folder, begin) = match resumed {
        Some(folder) => (folder, Begin::Resume),
        None => (open(&args.run, &config.training, &args.inputs())?, Begin::Anew),
    };
    let identity = plan.identity(&config)?;
    let session = Session::new(&args.run, folder, begin, Some(identity))?;
    let report = fit(&prepared, &config, &session.options, &session.folder, &session.watch());
    session.conclude(report.map(|report| {
        let (json, findings, epochs) = (report.json().to_string(), report.findings().clone(), report.history.len());
        LearnedRun { json, findings, stop: report.stop, epochs, unfinished: report.unfinished }
    }))
}

/// Points out laws that would explain the motion better than a network.
fn advise(reading: &LoadedRecording) -> Result<(), CliError> {
    let look = first_look(reading, Vec::new())?;
    look.laws().iter().for_each(|law| output::note(law));
    if look.formula.is_some() {
        output::note(
            "lnn formula states its constants with their errors; lnn identify fits those of a form that you know",
        );
    }
    Ok(())
}
