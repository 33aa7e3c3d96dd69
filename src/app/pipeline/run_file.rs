//! `run.json`: records the command that fills a directory.

use crate::pipeline::thresholds::MAX_RUN_BYTES;
use crate::pipeline::{Output, PipelineError, RUN};
use crate::storage::read_regular;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Command that fills a directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Command {
    /// `lnn train`.
    Train,
    /// `lnn fit`.
    Fit,
    /// `lnn evaluate`.
    Evaluate,
    /// `lnn sweep`.
    Sweep,
    /// `lnn-studies experiment`.
    Experiment,
}

/// Contents of `run.json`.
#[derive(Serialize, Deserialize)]
struct RunFile {
    command: Command,
    /// Version of the program that wrote the directory.
    version: String,
}

impl Command {
    /// Name of the command on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Fit => "fit",
            Self::Evaluate => "evaluate",
            Self::Sweep => "sweep",
            Self::Experiment => "experiment",
        }
    }

    /// Text of `run.json`; the same for every run of a command.
    ///
    /// # Errors
    /// [`PipelineError::Format`].
    pub(crate) fn text(self) -> Result<String, PipelineError> {
        let file = RunFile { command: self, version: env!("CARGO_PKG_VERSION").to_string() };
        Ok(serde_json::to_string(&file).map_err(PipelineError::format)? + "\n")
    }

    /// Writes `run.json`.
    ///
    /// # Errors
    /// [`PipelineError::Output`].
    pub(crate) fn write(self, output: &dyn Output) -> Result<(), PipelineError> {
        output.write(RUN, self.text()?.as_bytes())
    }

    /// Reads from `run.json` which command filled a directory.
    ///
    /// # Errors
    /// What is wrong with the file, in words.
    pub fn of(directory: &Path) -> Result<Self, String> {
        let bytes = read_regular(&directory.join(RUN), MAX_RUN_BYTES).map_err(|error| format!("{RUN}: {error}"))?;
        serde_json::from_slice::<RunFile>(&bytes).map(|file| file.command).map_err(|error| format!("{RUN}: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Directory;

    #[test]
    fn a_directory_names_its_command() {
        let temporary = tempfile::tempdir().unwrap();
        assert!(Command::of(temporary.path()).unwrap_err().contains(RUN));
        let output = Directory::create(temporary.path()).unwrap();
        for command in [Command::Train, Command::Fit, Command::Evaluate, Command::Sweep, Command::Experiment] {
            command.write(&output).unwrap();
            assert_eq!(Command::of(temporary.path()), Ok(command));
        }
        output.write(RUN, br#"{"command":"dream","version":"0.1.0"}"#).unwrap();
        assert!(Command::of(temporary.path()).unwrap_err().contains("dream"));
    }
}
