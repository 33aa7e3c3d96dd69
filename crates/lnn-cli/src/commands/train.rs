//! `lnn train`: trains a model, tests it, writes the results.

use crate::CliError;
use crate::arguments::system_arg::note_impacts;
use crate::arguments::train_config::Args;
use crate::directories::learn::{LearnedRun, Session, open};
use crate::directories::resume::{SavedText, parse, reopen, require_same};
use lnn::configuration::Config;
use lnn::pipeline::{Begin, Command, train};
use lnn::training::LATEST;

/// Trains and writes everything into the output directory; continues a stopped training on request.
///
/// # Errors
/// A usage error for arguments and configuration, a data error for files and a training that fails, an interruption;
/// after the last two the best model so far is written, if there is one.
pub fn run(args: &Args) -> Result<(), CliError> {
    if let Some(format) = args.run.print_config {
        return args.print(format);
    }
    let (config, system, folder, begin) = match &args.run.resume {
        None => {
            let (config, system) = args.resolve(None)?;
            let folder = open(&args.run, &config, &args.inputs())?;
            (config, system, folder, Begin::Anew)
        }
        Some(path) => {
            let read = |text: SavedText<'_>| {
                let saved: Config = match text {
                    SavedText::Checkpoint(text) => parse(path, LATEST, text)?,
                    SavedText::Configuration(text) => parse(path, "config.toml", text)?,
                };
                require_same(path, &saved, &args.resolve(Some(&saved))?.0)?;
                Ok(saved)
            };
            let Some((folder, saved)) = reopen(path, Command::Train, args.run.json, read)? else { return Ok(()) };
            let system = args.check(&saved)?;
            (saved, system, folder, Begin::Resume)
        }
    };
    note_impacts(&system);
    let session = Session::new(&args.run, folder, begin, None)?;
    let report = train(&config, &system, &session.options, &session.folder, &session.watch());
    session.conclude(report.and_then(|report| {
        let (json, findings, epochs) = (report.json()?, report.findings(), report.history.len());
        Ok(LearnedRun { json, findings, stop: report.stop, epochs, unfinished: None })
    }))
}
