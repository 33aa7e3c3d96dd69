//! `lnn check`: examines recorded motion, says whether a simple law explains it, and which command to run next.

use crate::CliError;
use crate::arguments::recording_args::{RecordingArgs, first_look};
use crate::terminal::output;
use lnn::pipeline::{FirstLook, NextStep};
use lnn::recording::{Columns, Guess};

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
    let (reading, Guess { columns, table }) = args.recording.load(true)?;
    let look = first_look(&reading, table)?;
    if args.json {
        return output::print(&output::json(&look)?);
    }
    let mut findings = look.findings();
    for (when, next) in commands(&args.recording, &columns, &look) {
        findings.heading(when).code(format!("  {next}"));
    }
    output::print(&findings.to_string())
}

/// The commands to run next in order of priority, each with a condition.
fn commands(recording: &RecordingArgs, columns: &Columns, look: &FirstLook) -> Vec<(&'static str, String)> {
    let command = |verb: &str, options: &str| format!("lnn {verb}{}{options}", recording.command(columns));
    let friction = if look.has_friction() { " --friction" } else { "" };
    let mut commands = match look.next {
        NextStep::Mend | NextStep::Record | NextStep::FirstOrder => return Vec::new(),
        NextStep::Formula => vec![("next:", command("formula", friction))],
        NextStep::FitConstrained => vec![("next:", command("fit", " --constraints find"))],
        NextStep::Fit => vec![("next:", command("fit", ""))],
    };
    if look.unfinished {
        commands.push(("if that finds no formula:", command("fit", "")));
    }
    if !columns.force.is_empty() {
        commands.push(("if you know the form of L, in a file FORM.toml:", command("identify", " --system FORM.toml")));
    }
    commands
}
