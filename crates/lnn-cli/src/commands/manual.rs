//! `lnn completions` and `lnn man`: shell completions and manual pages.

use crate::CliError;
use crate::directories::files::cannot_write;
use crate::terminal::output;
use clap::Command;
use clap_complete::Shell;
use lnn::storage::write_atomically;
use std::path::{Path, PathBuf};

/// Arguments of `lnn completions`.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Arguments of `lnn man`.
#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// A command; without it the page of the program itself.
    command: Option<String>,
    /// Write the pages of the program and of all commands into this directory, such as lnn-train.1.
    #[arg(long, value_name = "DIR", conflicts_with = "command")]
    out: Option<PathBuf>,
}

/// Prints a script that completes commands, options and their values.
///
/// # Errors
/// Standard output that cannot be written.
pub fn completions(args: &CompletionsArgs, mut program: Command) -> Result<(), CliError> {
    let (name, mut script) = (program.get_name().to_string(), Vec::new());
    clap_complete::generate(args.shell, &mut program, name, &mut script);
    output::print(&String::from_utf8_lossy(&script))
}

/// Prints a manual page, or writes all of them.
///
/// # Errors
/// A usage error for an unknown command, a data error for pages that cannot be written.
pub fn man(args: &ManArgs, program: Command) -> Result<(), CliError> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    let commands = || program.get_subcommands().cloned();
    let pages: Vec<Command> = std::iter::once(program.clone()).chain(commands()).collect();
    if let Some(directory) = &args.out {
        let inner: Vec<Command> = commands().flat_map(|c| c.get_subcommands().cloned().collect::<Vec<_>>()).collect();
        return pages.iter().chain(&inner).try_for_each(|command| write(directory, command));
    }
    let name = args.command.as_deref().unwrap_or(program.get_name());
    let found = pages.iter().find(|command| command.get_name() == name).ok_or_else(|| {
        let known: Vec<&str> = pages.iter().skip(1).map(Command::get_name).collect();
        CliError::usage(lnn::names::unknown("command", name, known))
    })?;
    output::print(&String::from_utf8_lossy(&page(found)?))
}

/// A manual page.
fn page(command: &Command) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    let source = concat!("lnn ", env!("CARGO_PKG_VERSION"));
    clap_mangen::Man::new(command.clone()).source(source).render(&mut bytes).map_err(CliError::data)?;
    Ok(bytes)
}

fn write(directory: &Path, command: &Command) -> Result<(), CliError> {
    std::fs::create_dir_all(directory).map_err(|e| cannot_write(directory, e))?;
    let name = command.get_display_name().unwrap_or(command.get_name());
    let path = directory.join(format!("{name}.1"));
    write_atomically(&path, &page(command)?).map_err(|e| cannot_write(&path, e))
}
