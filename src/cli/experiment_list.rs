//! The runs of an experiment with their states: finished, claimed by which process, open.

use crate::cli::CliError;
use crate::cli::folder::Folder;
use crate::cli::resume::has_checkpoint;
use crate::experiments::Run;
use crate::pipeline::{Directory, KeptRecord, kept_record};
use crate::storage::{Claimant, Holder, LockOwner, Standing};
use serde_json::{Value, json};
use std::io;
use std::path::Path;

/// A run with its state.
#[derive(Debug)]
pub struct Listed {
    number: usize,
    experiment: &'static str,
    run: Run,
    state: State,
}

/// State of a run.
#[derive(Debug)]
enum State {
    /// It has a record of its configuration.
    Finished,
    /// It has a record of another configuration.
    OtherConfiguration,
    /// It has a file that cannot be read, and why.
    Damaged(&'static str, String),
    /// A process works on it; which, as far as that is known.
    Claimed(Option<LockOwner>, Option<Holder>),
    /// Nobody works on it; `true` if it goes on from a checkpoint.
    Open(bool),
}

/// The numbered runs of the experiment in a directory with their states, as they are while one looks.
///
/// # Errors
/// A configuration that TOML cannot hold, a directory that cannot be read.
pub fn list(
    directory: &Path,
    experiment: &'static str,
    runs: Vec<(usize, Run)>,
    claimant: &Claimant,
) -> Result<Vec<Listed>, CliError> {
    let listed = |(number, run): (usize, Run)| {
        let state = state(directory, &run, claimant)?;
        Ok(Listed { number, experiment, run, state })
    };
    runs.into_iter().map(listed).collect()
}

fn state(directory: &Path, run: &Run, claimant: &Claimant) -> Result<State, CliError> {
    let kept = match kept_record(&Directory::at(directory), run)? {
        KeptRecord::Finished(_) => return Ok(State::Finished),
        KeptRecord::OtherConfiguration => Some(State::OtherConfiguration),
        KeptRecord::Damaged(file, problem) => Some(State::Damaged(file, problem)),
        KeptRecord::Nothing => None,
    };
    let path = directory.join(&run.name);
    let locked = Folder::holder(&path);
    // Without the lock, a claim of this machine is that of a dead process.
    let standing = match claimant.standing(&path, locked.is_none(), 0) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Standing::Free(1, None)),
        other => other.map_err(|e| CliError::file(&path, format_args!("cannot read: {e}"))),
    }?;
    Ok(match (standing, locked) {
        (Standing::Held(holder), locked) => {
            let owner = holder.as_ref().map(|holder| holder.owner.clone());
            State::Claimed(owner.or(locked.flatten()), holder)
        }
        (Standing::Free(..), Some(owner)) => State::Claimed(owner, None),
        (Standing::Free(..), None) => kept.unwrap_or_else(|| State::Open(has_checkpoint(&path))),
    })
}

impl Listed {
    /// Cells of a table.
    pub fn row(&self) -> Vec<String> {
        let state = match &self.state {
            State::Finished => "finished".to_string(),
            State::OtherConfiguration => "finished, of another configuration".to_string(),
            State::Damaged(file, problem) => format!("damaged, {file}: {problem}"),
            State::Claimed(_, Some(holder)) => format!("claimed by {holder}"),
            State::Claimed(Some(owner), None) => format!("claimed by {owner}"),
            State::Claimed(None, None) => "claimed".to_string(),
            State::Open(false) => "open".to_string(),
            State::Open(true) => "open, with a checkpoint".to_string(),
        };
        vec![self.number.to_string(), self.experiment.to_string(), self.run.name.clone(), state]
    }

    /// The same as an object.
    pub fn json(&self, scale: &str) -> Value {
        let state = match &self.state {
            State::Finished => "finished",
            State::OtherConfiguration => "other-configuration",
            State::Damaged(..) => "damaged",
            State::Claimed(..) => "claimed",
            State::Open(_) => "open",
        };
        let claimed_by = match &self.state {
            State::Claimed(Some(owner), holder) => json!({
                "process": owner.process(),
                "host": owner.host(),
                "since": owner.since(),
                "silent_seconds": holder.as_ref().map(|holder| holder.silent.as_secs_f64()),
                "lease_seconds": holder.as_ref().map(|holder| holder.lease.as_secs_f64()),
            }),
            _ => Value::Null,
        };
        json!({
            "number": self.number,
            "experiment": self.experiment,
            "scale": scale,
            "run": self.run.name,
            "row": self.run.label,
            "state": state,
            "checkpoint": matches!(self.state, State::Open(true)),
            "claimed_by": claimed_by,
        })
    }
}
