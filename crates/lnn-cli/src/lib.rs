//! The command-line program: arguments to library calls.
//!
//! Results go to standard output, messages and progress to standard error. Exit codes: 0 done, 1 data or files, 2
//! arguments or configuration, 130 Ctrl-C, 143 SIGTERM, 129 SIGHUP. A failure is one line, `error: FILE: row 3, column theta1: ...`;
//! of a configuration all mistakes are found, a line for each.
//!
//! `commands` has a file for each command. `arguments` holds what several of them take, `directories` what they write into, `terminal` what
//! they print.

mod arguments;
mod commands;
mod directories;
mod terminal;
mod thresholds;

pub use arguments::config::parse as parse_config;
use arguments::{fit_config, train_config};
use commands::{
    certify, check, compare, constraints, evaluate, fit, formula, geometry, identify, inspect, manual, page, rollout,
    shadow, sweep, symmetries, systems, train,
};
pub use directories::runs::{Orders, Work, merge, perform, print_list};
pub use directories::shard::Shard;
use terminal::error::argument_error;
pub use terminal::error::{CliError, Kind};
pub use terminal::output::print;
use terminal::{interrupt, output};

use clap::{CommandFactory, Parser, Subcommand};
use lnn::names::{WIDTH, one_line, wrap_text};
use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;
use tracing_subscriber::fmt::FmtContext;
use tracing_subscriber::fmt::format::{FormatEvent, FormatFields, Writer};
use tracing_subscriber::registry::LookupSpan;

/// The three most common tasks, each with a command to copy.
const EXAMPLES: &str = "\
To learn a listed system and see in report.html how good the model is:
  lnn train double-pendulum
To look at your own recording, then to learn from it:
  lnn check motion.csv --coords q1,q2 && lnn fit motion.csv --coords q1,q2 --name mine
To predict motion with the learned model:
  lnn rollout runs/double-pendulum --state 0.6,0.9,0,0 --t-end 10 --dt 0.05 --out motion.csv";

/// Order of the sections of the help.
const TEMPLATE: &str = "{about}\n\n{before-help}{usage-heading} {usage}\n\n{all-args}{after-help}";

/// Learn a Lagrangian from motion, predict motion that conserves its energy, and read physics off the learned function.
#[derive(Debug, Parser)]
#[command(name = "lnn", version, arg_required_else_help = true, before_help = EXAMPLES, help_template = TEMPLATE)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// List the systems that can be learned.
    Systems(systems::Args),
    /// Survey recorded motion before learning from it.
    Check(check::Args),
    /// Learn the Lagrangian of a system and write the model, its history, plots and a report.
    Train(train_config::Args),
    /// Learn the Lagrangian of recorded motion and test it on held-out motion.
    Fit(Box<fit_config::Args>),
    /// Integrate the motion of a model.
    Rollout(rollout::Args),
    /// Compare a model with the system it learned.
    Evaluate(evaluate::Args),
    /// Train with several values of some keys of a configuration and collect the runs in tables.
    Sweep(sweep::Args),
    /// Print the Euler-Lagrange terms of states in full precision.
    Inspect(inspect::Args),
    /// Print the metric, the Christoffel symbols and the curvature at points in full precision.
    Geometry(geometry::Args),
    /// Follow light through a metric, learned or exact: the shadow of a black hole and the sky around it.
    Shadow(shadow::Args),
    /// Find the constraints that recorded motion obeys, or the directions in which a Lagrangian is degenerate.
    Constraints(Box<constraints::Args>),
    /// Write a model as an interactive page: one HTML file that computes its motion.
    Page(page::Args),
    /// Find the symmetries of a Lagrangian and what its motion conserves.
    Symmetries(symmetries::Args),
    /// Print the Lagrangian of recorded motion, or of a model, as a formula.
    Formula(Box<formula::Args>),
    /// Find the constants of a Lagrangian whose form is known, from recorded motion.
    Identify(Box<identify::Args>),
    /// Compare two Lagrangians up to factor and gauge.
    Compare(compare::Args),
    /// Prove where the mass matrix has its signature, and a bound of its condition number.
    Certify(certify::Args),
    /// Print a script that completes commands and options in a shell.
    Completions(manual::CompletionsArgs),
    /// Print the manual page of the program or of a command.
    Man(manual::ManArgs),
}

/// Runs the program with its arguments, the first being its own name.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => return answer(&error),
    };
    ended(|| run(cli.command))
}

/// Runs a program with signal handling and warnings: a failure becomes one line on standard error and an exit code.
pub fn ended(work: impl FnOnce() -> Result<(), CliError>) -> ExitCode {
    // A command with results to keep requests the interrupt flag before it starts working.
    let ready = watch_log().and_then(|()| interrupt::watch());
    match ready.and_then(|()| work()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if error.kind() != Kind::ClosedPipe {
                report(&error);
            }
            error.exit_code()
        }
    }
}

/// Checks the arguments, the first being the program's own name, without running them.
///
/// # Errors
/// The usage error that the program ends with. Asking for help or for the version is not an error.
pub fn check_arguments(arguments: impl IntoIterator<Item = OsString>) -> Result<(), CliError> {
    match Cli::try_parse_from(arguments) {
        Err(error) if error.exit_code() != 0 => Err(argument_error(&error)),
        _ => Ok(()),
    }
}

/// Runs a command.
fn run(command: Command) -> Result<(), CliError> {
    match command {
        Command::Systems(args) => systems::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Train(args) => train::run(&args),
        Command::Fit(args) => fit::run(&args),
        Command::Rollout(args) => rollout::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Sweep(args) => sweep::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Constraints(args) => constraints::run(&args),
        Command::Geometry(args) => geometry::run(&args),
        Command::Shadow(args) => shadow::run(&args),
        Command::Page(args) => page::run(&args),
        Command::Symmetries(args) => symmetries::run(&args),
        Command::Formula(args) => formula::run(&args),
        Command::Identify(args) => identify::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Certify(args) => certify::run(&args),
        Command::Completions(args) => manual::completions(&args, Cli::command()),
        Command::Man(args) => manual::man(&args, Cli::command()),
    }
}

/// Prints help or version on request; a wrong argument is reported on one line, like any other error.
pub fn answer(error: &clap::Error) -> ExitCode {
    use clap::error::ErrorKind::{DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion};
    match error.kind() {
        DisplayHelp | DisplayVersion => match output::print(&wrap_text(&error.to_string(), WIDTH)) {
            Err(failed) if failed.kind() != Kind::ClosedPipe => {
                report(&failed);
                failed.exit_code()
            }
            _ => ExitCode::SUCCESS,
        },
        DisplayHelpOnMissingArgumentOrSubcommand => {
            // If this cannot be printed either, nothing more can be done.
            let _ = write!(std::io::stderr(), "{}", wrap_text(&error.to_string(), WIDTH));
            ExitCode::from(2)
        }
        _ => {
            let failed = argument_error(error);
            report(&failed);
            failed.exit_code()
        }
    }
}

/// Writes one line to standard error; if that is closed too, nothing more can be done.
fn report(error: &CliError) {
    let _ = writeln!(std::io::stderr(), "error: {error}");
}

/// Prints warnings to standard error in the same form as errors; the environment variable `LNN_LOG` (such as `debug`) selects more, with
/// times and modules.
fn watch_log() -> Result<(), CliError> {
    use tracing_subscriber::Layer as _;
    use tracing_subscriber::filter::{LevelFilter, Targets};
    use tracing_subscriber::layer::SubscriberExt as _;
    use tracing_subscriber::util::SubscriberInitExt as _;
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let lines = match std::env::var("LNN_LOG") {
        Ok(text) => {
            let filter = text.parse::<Targets>().map_err(|e| CliError::usage(format_args!("LNN_LOG: {e}")))?;
            lines.with_filter(filter).boxed()
        }
        Err(std::env::VarError::NotPresent) => {
            let own = Targets::new().with_target(env!("CARGO_CRATE_NAME"), LevelFilter::WARN);
            lines.event_format(PlainWarning).with_filter(own).boxed()
        }
        Err(error) => return Err(CliError::usage(format_args!("LNN_LOG: {error}"))),
    };
    // Already installed when several commands run in one process (tests): keep the first.
    let _ = tracing_subscriber::registry().with(lines).try_init();
    Ok(())
}

/// Formats a warning as one line: `warning: ...`.
struct PlainWarning;

impl<S, N> FormatEvent<S, N> for PlainWarning
where
    S: tracing::Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &tracing::Event<'_>,
    ) -> std::fmt::Result {
        let mut text = String::new();
        context.field_format().format_fields(Writer::new(&mut text), event)?;
        writeln!(writer, "warning: {}", one_line(&text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_documented() {
        let mut program = Cli::command();
        program.build();
        assert!(program.get_about().is_some());
        for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
            let name = command.get_name();
            assert!(command.get_about().is_some_and(|about| !about.to_string().is_empty()), "{name}");
            for argument in command.get_arguments() {
                let place = format!("{name} {}", argument.get_id());
                assert!(argument.get_help().is_some_and(|help| !help.to_string().is_empty()), "{place}");
                for value in argument.get_possible_values() {
                    let documented =
                        value.get_help().is_some() || name == "completions" || argument.is_hide_possible_values_set();
                    let flag = !argument.get_action().takes_values();
                    assert!(documented || flag, "{place}: {}", value.get_name());
                }
            }
        }
        program.debug_assert();
    }
}
