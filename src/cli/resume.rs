//! What `lnn train --resume DIR` finds in the directory.

use crate::cli::differences::differences;
use crate::cli::{CliError, config, output};
use crate::storage::{Disk, read_regular};
use crate::training::{CheckpointError, Config, NEWEST, PREVIOUS, saved};
use serde::Deserialize;
use std::path::Path;

/// A directory of a training.
pub enum Found {
    /// It can go on; its configuration.
    Unfinished(Box<Config>),
    /// It has finished; its configuration and `summary.json`.
    Finished(Box<Config>, String),
}

/// Whether a directory holds a training that can go on.
pub fn has_checkpoint(directory: &Path) -> bool {
    [NEWEST, PREVIOUS].iter().any(|name| directory.join(name).exists())
}

/// Looks for a training to go on with.
///
/// # Errors
/// A data error if there is none, if it ended with an error, or if what is there is damaged.
pub fn find(directory: &Path) -> Result<Found, CliError> {
    if !directory.is_dir() {
        return Err(CliError::file(directory, "no such directory"));
    }
    match saved(&Disk, directory) {
        Ok(found) => parse(directory, NEWEST, &found.content.config).map(Found::Unfinished),
        Err(CheckpointError::Missing) => finished(directory),
        Err(error) => Err(CliError::file(directory, error)),
    }
}

/// The training that left its summary and no checkpoint.
fn finished(directory: &Path) -> Result<Found, CliError> {
    /// The part of `summary.json` that tells.
    #[derive(Deserialize)]
    struct Summary {
        ended: String,
    }
    let read = |name: &str| String::from_utf8(read_regular(&directory.join(name), 1 << 26).ok()?).ok();
    let summary =
        read("summary.json").and_then(|json| Some((serde_json::from_str::<Summary>(&json).ok()?.ended, json)));
    match (summary, read("config.toml")) {
        (Some((ended, json)), Some(text)) if ended == "finished" => {
            parse(directory, "config.toml", &text).map(|config| Found::Finished(config, json))
        }
        (Some((ended, _)), _) if ended != "interrupted" => {
            Err(CliError::file(directory, format_args!("this training has ended: {ended}")))
        }
        _ => Err(CliError::file(directory, format_args!("there is no checkpoint ({NEWEST}) to go on from"))),
    }
}

fn parse(directory: &Path, name: &str, text: &str) -> Result<Box<Config>, CliError> {
    let config = config::parse(text).map_err(|(line, problem)| {
        CliError::file(&directory.join(name), format_args!("configuration, line {line}: {problem}"))
    })?;
    Ok(Box::new(config))
}

/// Refuses to go on with another configuration than that of the directory.
///
/// # Errors
/// A usage error naming what differs.
pub fn require_same(directory: &Path, saved: &Config, asked: &Config) -> Result<(), CliError> {
    let text = |config| toml::to_string(config).map_err(CliError::data);
    match differences(&text(saved)?, &text(asked)?) {
        none if none.is_empty() => Ok(()),
        found => Err(CliError::usage(format_args!("--resume {}: {found}", directory.display()))),
    }
}

/// The command that goes on with a training.
pub fn command(directory: &Path) -> String {
    let text = directory.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:@%,".contains(c);
    if !text.is_empty() && !text.starts_with('-') && text.chars().all(plain) {
        format!("lnn train --resume {text}")
    } else {
        format!("lnn train --resume='{}'", text.replace('\'', r"'\''"))
    }
}

/// Says that there is nothing left to do.
///
/// # Errors
/// Standard output that cannot be written.
pub fn say_finished(directory: &Path, json: Option<&str>) -> Result<(), CliError> {
    match json {
        Some(json) => output::print(json),
        None => output::print(&format!("{}: this training has finished, nothing is left to do\n", directory.display())),
    }
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
