//! Runs with their states: finished, in progress, open.

use crate::CliError;
use crate::directories::resume::has_checkpoint;
use lnn::experiments::Run;
use lnn::pipeline::{ExperimentDirectory, KeptRecord, kept_record};
use lnn::storage::{DirectoryLock, LockOwner};
use serde_json::{Value, json};
use std::path::Path;

/// A run with its state.
#[derive(Debug)]
pub struct Listed {
    number: usize,
    run: Run,
    state: State,
}

/// State of a run.
#[derive(Debug)]
enum State {
    /// It has a record of the same configuration.
    Finished,
    /// It has a record of another configuration.
    OtherConfiguration,
    /// It has a file that cannot be read, with the reason.
    Damaged(&'static str, String),
    /// A process works on it; contains the process, if known.
    InProgress(Option<LockOwner>),
    /// No process works on it; contains `true` if it can resume from a checkpoint.
    Open(bool),
}

/// The numbered runs in a directory with their present states.
///
/// # Errors
/// A configuration that TOML cannot hold.
pub fn list(directory: &Path, runs: Vec<(usize, Run)>) -> Result<Vec<Listed>, CliError> {
    let listed = |(number, run): (usize, Run)| {
        let state = state(directory, &run)?;
        Ok(Listed { number, run, state })
    };
    runs.into_iter().map(listed).collect()
}

fn state(directory: &Path, run: &Run) -> Result<State, CliError> {
    let kept = match kept_record(&ExperimentDirectory::new(directory), run)? {
        KeptRecord::Finished(_) => return Ok(State::Finished),
        KeptRecord::OtherConfiguration => Some(State::OtherConfiguration),
        KeptRecord::Damaged(file, problem) => Some(State::Damaged(file, problem)),
        KeptRecord::Nothing => None,
    };
    let path = directory.join(&run.name);
    Ok(match DirectoryLock::holder(&path) {
        Some(owner) => State::InProgress(owner),
        None => kept.unwrap_or_else(|| State::Open(has_checkpoint(&path))),
    })
}

impl Listed {
    /// Formats a table row, with the name of the experiment.
    pub fn row(&self, experiment: &str) -> Vec<String> {
        let state = match &self.state {
            State::Finished => "finished".to_string(),
            State::OtherConfiguration => "finished, of another configuration".to_string(),
            State::Damaged(file, problem) => format!("damaged, {file}: {problem}"),
            State::InProgress(Some(owner)) => format!("in progress, {owner}"),
            State::InProgress(None) => "in progress".to_string(),
            State::Open(false) => "open".to_string(),
            State::Open(true) => "open, with a checkpoint".to_string(),
        };
        vec![self.number.to_string(), experiment.to_string(), self.run.name.clone(), state]
    }

    /// Formats the run as a JSON object.
    pub fn json(&self, experiment: &str, scale: Option<&str>) -> Value {
        let (state, owner) = match &self.state {
            State::Finished => ("finished", None),
            State::OtherConfiguration => ("other-configuration", None),
            State::Damaged(..) => ("damaged", None),
            State::InProgress(owner) => ("in-progress", owner.as_ref()),
            State::Open(_) => ("open", None),
        };
        json!({
            "number": self.number,
            "experiment": experiment,
            "scale": scale,
            "run": self.run.name,
            "row": self.run.label,
            "state": state,
            "checkpoint": matches!(self.state, State::Open(true)),
            "owner": owner.map(|owner| json!({ "process": owner.process, "host": owner.host })),
        })
    }
}
