//! Finds the run that `--resume DIR` of `lnn train` and `lnn fit` continues.

use crate::arguments::config;
use crate::directories::differences::differences;
use crate::directories::folder::Folder;
use crate::terminal::output;
use crate::{CliError, Kind};
use lnn::pipeline::{Command, MAX_RESULT_BYTES};
use lnn::storage::{Disk, read_regular};
use lnn::training::{CheckpointError, LATEST, PREVIOUS, remove_checkpoints, saved};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A directory of a training or a fit.
enum Found {
    /// The run can continue: the contents of its checkpoint.
    Unfinished(String),
    /// The run has finished: the contents of `config.toml` and of `summary.json`.
    Finished(String, String),
}

/// The text of an existing run.
#[derive(Clone, Copy, Debug)]
pub enum SavedText<'a> {
    /// The text of its checkpoint.
    Checkpoint(&'a str),
    /// Its `config.toml`.
    Configuration(&'a str),
}

/// Opens the directory of a run to continue, and passes its text to `read`; `None` if nothing is left to do, which is then reported.
///
/// # Errors
/// A data error if there is no such run, if it ended with an error, if it is of the other kind, or if its files are damaged; errors of
/// `read`.
pub fn reopen<T>(
    directory: &Path,
    command: Command,
    json: bool,
    read: impl FnOnce(SavedText<'_>) -> Result<T, CliError>,
) -> Result<Option<(Folder, T)>, CliError> {
    // The search is repeated under the lock, when no other process can write.
    find(directory, command)?;
    let folder = Folder::open(directory)?;
    match find(directory, command)? {
        Found::Unfinished(text) => Ok(Some((folder, read(SavedText::Checkpoint(&text))?))),
        Found::Finished(text, summary) => {
            read(SavedText::Configuration(&text))?;
            let said = format!("{}: this training has finished\n", directory.display());
            output::print(if json { &summary } else { &said })?;
            Ok(None)
        }
    }
}

/// `true` if a directory contains a training that can be continued.
pub fn has_checkpoint(directory: &Path) -> bool {
    [LATEST, PREVIOUS].iter().any(|name| directory.join(name).exists())
}

/// Looks for a run of this kind to continue.
///
/// # Errors
/// A data error if there is none, if it ended with an error, if it is of the other kind, or if its files are damaged.
fn find(directory: &Path, command: Command) -> Result<Found, CliError> {
    if !directory.is_dir() {
        return Err(CliError::file(directory, "no such directory"));
    }
    let found = match saved(&Disk, directory) {
        Ok(found) => Found::Unfinished(found.content.config),
        Err(CheckpointError::Missing) => finished(directory)?,
        Err(error) => return Err(CliError::file(directory, error)),
    };
    match Command::of(directory).map_err(|problem| CliError::file(directory, problem))? {
        filled if filled == command => Ok(found),
        other => {
            let problem = format!("this is a run of lnn {}, not of lnn {}", other.name(), command.name());
            Err(CliError::file(directory, problem))
        }
    }
}

/// A finished run, which left its summary and no checkpoint.
fn finished(directory: &Path) -> Result<Found, CliError> {
    /// The part of `summary.json` that describes the end.
    #[derive(Deserialize)]
    struct Summary {
        ended: String,
    }
    let read = |name: &str| String::from_utf8(read_regular(&directory.join(name), MAX_RESULT_BYTES).ok()?).ok();
    let summary = read("summary.json").and_then(|json| Some((serde_json::from_str::<Summary>(&json).ok()?, json)));
    match (summary, read("config.toml")) {
        (Some((Summary { ended }, json)), Some(text)) if ended == "finished" => Ok(Found::Finished(text, json)),
        (Some((Summary { ended }, _)), _) if ended != "interrupted" => {
            Err(CliError::file(directory, format_args!("this training has ended: {ended}")))
        }
        _ => Err(CliError::file(directory, format_args!("there is no checkpoint ({LATEST}) to continue from"))),
    }
}

/// Parses the text of a run.
///
/// # Errors
/// A data error naming the file.
pub fn parse<T: DeserializeOwned>(directory: &Path, name: &str, text: &str) -> Result<T, CliError> {
    config::parse(text).map_err(|(line, problem)| {
        CliError::file(&directory.join(name), format_args!("configuration, line {line}: {problem}"))
    })
}

/// Rejects a configuration that differs from that of the directory.
///
/// # Errors
/// A usage error naming what differs.
pub fn require_same<T: Serialize>(directory: &Path, saved: &T, asked: &T) -> Result<(), CliError> {
    let text = |config: &T| toml::to_string(config).map_err(CliError::data);
    match differences(&text(saved)?, &text(asked)?) {
        none if none.is_empty() => Ok(()),
        found => Err(CliError::usage(format_args!("--resume {}: {found}", directory.display()))),
    }
}

/// The command that continues the run whose checkpoint is in a directory.
pub fn command(directory: &Path) -> String {
    let verb = Command::of(directory).unwrap_or(Command::Train).name();
    let text = directory.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:@%,".contains(c);
    if !text.is_empty() && !text.starts_with('-') && text.chars().all(plain) {
        format!("lnn {verb} --resume {text}")
    } else {
        format!("lnn {verb} --resume='{}'", text.replace('\'', r"'\''"))
    }
}

/// The end of a message about a run that was stopped.
pub fn continuation_hint(directory: &Path) -> String {
    if has_checkpoint(directory) {
        format!("; continue with: {}", command(directory))
    } else {
        "; there is no checkpoint".to_string()
    }
}

/// Adds to an error, such as a full disk, that the checkpoint still exists.
pub fn with_continuation(directory: &Path, error: CliError) -> CliError {
    if error.kind() != Kind::Data || !has_checkpoint(directory) {
        return error;
    }
    let learned = "the model so far is kept; when the cause is removed";
    CliError::data(format_args!("{error} ({learned}, continue with: {})", command(directory)))
}

/// Removes the checkpoints of a training that has finished or learned nothing.
///
/// # Errors
/// A data error naming the directory.
pub fn remove_checkpoints_of(directory: &Path) -> Result<(), CliError> {
    let cannot = |e| CliError::file(directory, format_args!("cannot remove checkpoints: {e}"));
    remove_checkpoints(&Disk, directory).map_err(cannot)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_what_a_shell_takes() {
        let of = |text: &str| command(Path::new(text));
        assert_eq!(of("runs/double-pendulum"), "lnn train --resume runs/double-pendulum");
        assert_eq!(of("my runs"), "lnn train --resume='my runs'");
        assert_eq!(of("-x"), "lnn train --resume='-x'");
        assert_eq!(of("it's"), r"lnn train --resume='it'\''s'");
    }
}
