//! Mistakes in the arguments, in one line that names the option.

use crate::cli::{Cli, CliError};
use crate::names::{plain, unknown};
use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::error::Error as _;
use std::ffi::OsString;

/// The usage error of arguments that clap refuses; the first of them is the program's name.
pub fn misunderstood(error: &clap::Error, arguments: &[OsString]) -> CliError {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    // `--state <q1,..>` without its value.
    let option = text(ContextKind::InvalidArg).map(|arg| arg.split([' ', '=']).next().unwrap_or_default().to_string());
    let value = text(ContextKind::InvalidValue).filter(|value| !value.is_empty());
    let problem = match (error.kind(), option, value) {
        (ErrorKind::InvalidSubcommand, ..) => {
            let name = text(ContextKind::InvalidSubcommand).unwrap_or_default();
            let commands = Cli::command();
            let known: Vec<&str> = commands.get_subcommands().map(clap::Command::get_name).collect();
            unknown("command", &name, known)
        }
        (ErrorKind::UnknownArgument, Some(option), _) if !option.starts_with("--") && option.starts_with('-') => {
            dashed(&option, arguments)
        }
        (ErrorKind::UnknownArgument, Some(option), _) if option.starts_with('-') => {
            let known = options(arguments);
            unknown("option", &option, known.iter().map(String::as_str).collect::<Vec<_>>())
        }
        (ErrorKind::UnknownArgument, Some(found), _) => format!("expected no further argument, found {found:?}"),
        (ErrorKind::InvalidValue, Some(option), Some(value)) => {
            let known = match error.get(ContextKind::ValidValue) {
                Some(ContextValue::Strings(known)) => known.clone(),
                _ => Vec::new(),
            };
            format!("{option}: {}", unknown("value", &value, known.iter().map(String::as_str).collect::<Vec<_>>()))
        }
        (ErrorKind::InvalidValue, Some(option), None) => format!("{option}: expected a value"),
        (ErrorKind::ValueValidation, Some(option), value) => {
            let problem = error.source().map_or_else(|| "is not understood".to_string(), |e| plain(&e.to_string()));
            format!("{option}: {problem}, found {:?}", value.unwrap_or_default())
        }
        (ErrorKind::MissingRequiredArgument, ..) => match error.get(ContextKind::InvalidArg) {
            Some(ContextValue::Strings(missing)) => format!("missing {}", missing.join(" and ")),
            _ => first_paragraph(error),
        },
        (ErrorKind::InvalidUtf8, ..) => "an argument is not UTF-8 text".to_string(),
        _ => first_paragraph(error),
    };
    CliError::usage(problem)
}

/// The problem of an argument with one dash, of which clap names the first letter: a value that looks like an option, or a mistyped one.
fn dashed(option: &str, arguments: &[OsString]) -> String {
    let typed = arguments.iter().filter_map(|argument| argument.to_str()).enumerate().skip(1);
    let found = typed.clone().find(|(_, argument)| argument.starts_with(option) && !argument.starts_with("--"));
    let (place, found) = found.unwrap_or((0, option));
    let before = typed.take_while(|(k, _)| *k < place).last().map_or("", |(_, argument)| argument);
    let takes_a_value = command(arguments).get_arguments().any(|argument| {
        argument.get_action().takes_values()
            && before.strip_prefix("--").is_some_and(|name| argument.get_long() == Some(name))
    });
    if takes_a_value {
        return format!("{before}: expected a value, found {found:?}");
    }
    if found[1..].starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return format!("expected no further argument, found {found:?}");
    }
    let known = options(arguments);
    unknown("option", found, known.iter().map(String::as_str).collect::<Vec<_>>())
}

/// clap's own words, without usage and hints.
fn first_paragraph(error: &clap::Error) -> String {
    let text = error.to_string();
    let ends = ["\n\nUsage:", "\n\nFor more", "\n\n  tip:"];
    let problem = ends.iter().fold(text.as_str(), |t, end| t.split(end).next().unwrap_or(t));
    problem.strip_prefix("error: ").unwrap_or(problem).to_string()
}

/// The command that the arguments name.
fn command(arguments: &[OsString]) -> clap::Command {
    let mut program = Cli::command();
    program.build();
    let named = arguments.iter().skip(1).filter_map(|argument| argument.to_str());
    named.fold(&program, |command, name| command.find_subcommand(name).unwrap_or(command)).clone()
}

/// The options of the command that the arguments name.
fn options(arguments: &[OsString]) -> Vec<String> {
    let command = command(arguments);
    let mut known: Vec<String> =
        command.get_arguments().filter_map(|a| a.get_long()).map(|l| format!("--{l}")).collect();
    known.sort();
    known
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    fn refusal(line: &str) -> String {
        let arguments: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        misunderstood(&Cli::try_parse_from(&arguments).unwrap_err(), &arguments).to_string()
    }

    #[test]
    fn options_are_named_and_only_near_names_are_offered() {
        for (line, expected) in [
            ("lnn rolout", "unknown command \"rolout\", did you mean \"rollout\"?"),
            ("lnn systems --jsn", "unknown option \"--jsn\", did you mean \"--json\"?"),
            ("lnn systems --zebra", "unknown option \"--zebra\", expected one of --"),
            ("lnn inspect -5", "expected no further argument, found \"-5\""),
            ("lnn check d --coords -theta", "--coords: expected a value, found \"-theta\""),
            ("lnn check d --coords x --rate -5", "--rate: expected a value, found \"-5\""),
            ("lnn systems --json -jsn", "unknown option \"-jsn\", did you mean \"--json\"?"),
            ("lnn systems more", "expected no further argument, found \"more\""),
            ("lnn train x --preset qick", "--preset: unknown value \"qick\", did you mean \"quick\"?"),
            ("lnn train x --preset gone", "--preset: unknown value \"gone\", expected one of quick, best, paper"),
            ("lnn train x --seed -1", "--seed: expected a whole number from 0 to 18446744073709551615, found \"-1\""),
            ("lnn train x --seed", "--seed: expected a value"),
            ("lnn evaluate m --rtol 1e-30", "--rtol: expected a number from 2e-15 to 1, found \"1e-30\""),
            ("lnn check data.csv", "missing --coords <q1,q2>"),
            ("lnn experiment merge quick --seds 3", "unknown option \"--seds\", did you mean \"--seeds\"?"),
            ("lnn experiment merge quick --shard 1/2", "unknown option \"--shard\", expected one of --"),
            (
                "lnn experiment quick --shard 0/2",
                "--shard: expected I/N, two whole numbers, I from 1 to N, found \"0/2\"",
            ),
            (
                "lnn check d --coords x --rate 5 --time t",
                "the argument '--rate <HZ>' cannot be used with '--time <COLUMN>'",
            ),
        ] {
            let found = refusal(line);
            assert!(found.starts_with(expected), "{line}: {found}");
        }
    }
}
