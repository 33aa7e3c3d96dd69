//! `lnn check`: what recorded motion is, whether a simple law explains it, and which command to run next.

use crate::cancellation::Cancellation;
use crate::cli::recording_args::RecordingArgs;
use crate::cli::{CliError, interrupt, output};
use crate::pipeline::{FirstLook, NextStep, PipelineError};
use crate::recording::{ColumnGuess, Columns, Guess, LoadedRecording};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Reads the data, examines them and prints a report.
///
/// # Errors
/// A usage error for contradicting arguments, a data error for files that cannot be used.
pub fn run(args: &Args) -> Result<(), CliError> {
    let (reading, Guess { columns, table }) = args.recording.load()?;
    let look = first_look(&reading, table)?;
    if args.json {
        return output::print(&output::json(&look)?);
    }
    let mut findings = look.findings();
    if let Some(next) = command(&args.recording, &columns, &look) {
        findings.heading("next:").code(format!("  {next}"));
    }
    output::print(&findings.to_string())
}

/// A first look at recorded motion.
///
/// # Errors
/// A data error for motion that cannot be smoothed, an interruption.
pub fn first_look(reading: &LoadedRecording, guessed: Vec<ColumnGuess>) -> Result<FirstLook, CliError> {
    let stop = Cancellation::by(&interrupt::flag().map_err(CliError::signals)?);
    FirstLook::new(reading, guessed, &stop).map_err(|error| match error {
        PipelineError::Interrupted => CliError::nothing_written(),
        error => error.into(),
    })
}

/// The command to run next, if there is one.
fn command(recording: &RecordingArgs, columns: &Columns, look: &FirstLook) -> Option<String> {
    let (verb, options) = match look.next {
        NextStep::Mend | NextStep::Record => return None,
        NextStep::Formula if look.has_friction() => ("formula", " --friction"),
        NextStep::Formula => ("formula", ""),
        NextStep::FitConstrained => ("fit", " --constraints find"),
        NextStep::Fit => ("fit", ""),
    };
    Some(format!("lnn {verb}{}{options}", recording.command(columns)))
}
