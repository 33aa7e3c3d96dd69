//! Failures of a command: one line, or one for each mistake of a configuration, and an exit code.

use crate::arguments::input;
use crate::terminal::interrupt;
use lnn::names::one_line;
use lnn::pipeline::PipelineError;
use std::fmt;
use std::io;
use std::path::Path;
use std::process::ExitCode;

/// Kind of a failure, for calling scripts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Arguments or configuration: exit code 2.
    Usage,
    /// Data or files: exit code 1.
    Data,
    /// Ctrl-C, exit code 130, SIGTERM, exit code 143, or SIGHUP, exit code 129.
    Interrupted,
    /// Broken pipe: the program ends silently with code 0.
    ClosedPipe,
}

/// A failed command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CliError {
    kind: Kind,
    message: String,
}

impl CliError {
    /// Creates an error for wrong arguments or a wrong configuration.
    pub fn usage(message: impl fmt::Display) -> Self {
        Self { kind: Kind::Usage, message: one_line(&message.to_string()) }
    }
    /// Creates an error for the value of an option, given without its dashes. The problem may begin with the name of the value in the
    /// library, such as `offsets:`, which the option replaces.
    pub fn option(option: &str, name: &str, problem: impl fmt::Display) -> Self {
        let text = problem.to_string();
        match text.strip_prefix(name).filter(|rest| rest.starts_with(':')) {
            Some(rest) => Self::usage(format_args!("--{option}{rest}")),
            None => Self::usage(format_args!("--{option}: {text}")),
        }
    }
    /// Several mistakes in arguments or configuration, one line each.
    ///
    /// # Errors
    /// Always, if there are messages.
    pub fn all_usage(messages: impl IntoIterator<Item = String>) -> Result<(), Self> {
        let lines: Vec<String> = messages.into_iter().map(|message| one_line(&message)).collect();
        if lines.is_empty() { Ok(()) } else { Err(Self { kind: Kind::Usage, message: lines.join("\nerror: ") }) }
    }
    /// Creates an error for wrong data, or for a file that cannot be read or written.
    pub fn data(message: impl fmt::Display) -> Self {
        Self { kind: Kind::Data, message: one_line(&message.to_string()) }
    }
    /// Creates an error for a file: wrong data, or a failure to read or write.
    pub fn file(path: &Path, problem: impl fmt::Display) -> Self {
        Self::data(format_args!("{}: {problem}", path.display()))
    }
    /// Creates an error for a file that may be standard input: wrong data, or a failure to read.
    pub fn input(path: &Path, problem: impl fmt::Display) -> Self {
        Self::data(format_args!("{}: {problem}", input::name(path)))
    }
    /// Creates an error for a signal; the message states which results were kept.
    pub fn interrupted(message: impl fmt::Display) -> Self {
        Self { kind: Kind::Interrupted, message: one_line(&message.to_string()) }
    }
    /// Creates an error for a signal during a search that has no useful partial results.
    pub fn nothing_written() -> Self {
        Self::interrupted("interrupted: nothing was found and nothing was written")
    }
    /// Creates an error for a failed write to standard output.
    pub fn output(error: &io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            return Self { kind: Kind::ClosedPipe, message: "standard output was closed".to_string() };
        }
        Self::data(format_args!("standard output: cannot write: {error}"))
    }
    /// The kind of the failure.
    pub fn kind(&self) -> Kind {
        self.kind
    }
    /// The exit code of the program.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self.kind {
            Kind::Usage => 2,
            Kind::Data => 1,
            Kind::Interrupted => interrupt::exit_code(),
            Kind::ClosedPipe => 0,
        })
    }
}

impl From<PipelineError> for CliError {
    fn from(error: PipelineError) -> Self {
        match &error {
            PipelineError::Config(faults) if faults.len() > 1 => {
                Self::all_usage(faults.iter().map(ToString::to_string)).err().unwrap_or_else(|| Self::usage(error))
            }
            PipelineError::Interrupted | PipelineError::Unjudged(_) => Self::interrupted(error),
            PipelineError::InterruptedRuns { .. } => {
                Self::interrupted(format_args!("{error}; the same command continues from there"))
            }
            _ if error.is_configuration() => Self::usage(error),
            _ => Self::data(error),
        }
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for CliError {}

/// Converts an error of clap to a usage error with its message and hint, without the usage.
pub fn argument_error(error: &clap::Error) -> CliError {
    let text = error.to_string();
    let mut parts = text.trim().split("\n\n");
    let problem = parts.next().unwrap_or_default().trim_start_matches("error: ").to_string();
    let hints = parts.filter_map(|part| part.trim().strip_prefix("tip: "));
    CliError::usage(hints.fold(problem, |text, hint| format!("{text}; {hint}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cli;
    use clap::Parser;

    #[test]
    fn messages_are_one_line() {
        assert_eq!(CliError::usage("a\n\n  b\u{7}").to_string(), "a b\\u{7}");
        let two = CliError::all_usage(["a\nb", "c"].map(String::from)).unwrap_err();
        assert_eq!(format!("error: {two}"), "error: a b\nerror: c");
        assert_eq!(CliError::all_usage([]), Ok(()));
    }

    #[test]
    fn options_replace_the_names_of_their_values() {
        let refused = |problem: &str| CliError::option("offset", "offsets", problem).to_string();
        assert_eq!(refused("offsets: q is given twice"), "--offset: q is given twice");
        assert_eq!(refused("offsets of q"), "--offset: offsets of q");
    }

    #[test]
    fn a_closed_pipe_is_no_failure() {
        let closed = CliError::output(&io::ErrorKind::BrokenPipe.into());
        assert_eq!(closed.kind(), Kind::ClosedPipe);
        assert_eq!(CliError::output(&io::ErrorKind::StorageFull.into()).kind(), Kind::Data);
    }

    #[test]
    fn options_are_named() {
        for (line, parts) in [
            ("lnn rolout", &["rolout", "rollout"][..]),
            ("lnn systems --jsn", &["--jsn", "--json"]),
            ("lnn systems more", &["more"]),
            ("lnn train x --preset qick", &["--preset", "qick", "quick"]),
            ("lnn train x --epochs -1", &["--epochs", "-1", "1 to 16777216"]),
            ("lnn train x --seed", &["--seed", "value"]),
            ("lnn evaluate m --rtol 1e-30", &["--rtol", "1e-30", "2e-15"]),
            ("lnn check", &["DATA"]),
            ("lnn sweep small.toml --seds 3", &["--seds", "--seeds"]),
            ("lnn check d --coords x --rate 5 --time t", &["--rate", "--time"]),
        ] {
            let found = argument_error(&Cli::try_parse_from(line.split(' ')).unwrap_err()).to_string();
            assert!(!found.contains('\n') && !found.contains("Usage"), "{line}: {found}");
            assert!(parts.iter().all(|part| found.contains(part)), "{line}: {found}");
        }
    }
}
