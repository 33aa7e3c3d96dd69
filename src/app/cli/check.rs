//! `lnn check`: what recorded motion is, whether a simple law explains it, and which command to run next.

use crate::cli::recording_args::RecordingArgs;
use crate::cli::watch::search;
use crate::cli::{CliError, output};
use crate::pipeline::{FirstLook, NextStep};
use crate::recording::{Columns, Guess};

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
    let look = FirstLook::new(&reading, table, &search()?)?;
    if args.json {
        return output::print(&output::json(&look)?);
    }
    let mut findings = look.findings();
    if let Some(next) = command(&args.recording, &columns, &look) {
        findings.gap().line("next:").line(format!("  {next}"));
    }
    output::print(&findings.to_string())
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
