//! `lnn systems`: the systems that can be learned.

use crate::CliError;
use crate::arguments::system_arg;
use crate::terminal::output;
use lnn::lagrangian::constrained_systems;
use lnn::lagrangian::system::System;
use lnn::report::SystemEntry;
use std::borrow::Cow;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// List only this system, by name or by its file.
    #[arg(long, value_name = "NAME|FILE")]
    system: Option<String>,
    /// One JSON object per line instead of a table.
    #[arg(long)]
    json: bool,
}

/// Prints the catalogue.
pub fn run(args: &Args) -> Result<(), CliError> {
    let one = args.system.as_deref().map(system_arg::system).transpose()?;
    let all: Vec<Cow<'static, System>> = match one {
        Some(system) => vec![system],
        None => {
            let constrained = constrained_systems().into_iter().map(Cow::Owned);
            System::unconstrained().iter().map(Cow::Borrowed).chain(constrained).collect()
        }
    };
    let entries: Vec<SystemEntry<'_>> = all.iter().map(|system| SystemEntry::of(system)).collect();
    if args.json {
        return output::print(&entries.iter().map(output::json).collect::<Result<String, CliError>>()?);
    }
    output::print(&entries.iter().map(SystemEntry::text).collect::<Vec<_>>().join("\n"))
}
