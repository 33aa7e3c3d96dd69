//! Results in the directories of runs: detects them, and removes them when another run replaces them.

use crate::CliError;
use crate::directories::files::{holds_something, same_file};
use crate::directories::resume::{command, has_checkpoint};
use crate::thresholds::SHOWN_NAMES;
use lnn::names::first_few;
use lnn::pipeline::{CAPTIONS, Command, LEARNED, MAX_RESULT_BYTES, PLAY, PipelineError, RUN};
use lnn::storage::{Disk, Files, read_regular};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Files that evaluations write; trainings and fits also write the last three.
const EVALUATED: [&str; 4] = ["evaluation.json", "report.html", CAPTIONS, PLAY];

/// Kind of the command that writes into a directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writer {
    /// A training or a fit.
    Learner,
    /// An evaluation, which never replaces a model.
    Evaluator,
}

/// Contents of a directory, in words; `None` if a run can be written there without losing anything.
pub fn found(directory: &Path) -> Option<String> {
    if has_checkpoint(directory) {
        return Some(format!("an unfinished run (continue it by: {})", command(directory)));
    }
    let names: Vec<String> = LEARNED
        .into_iter()
        .chain(EVALUATED)
        .map(String::from)
        .filter(|name| holds_something(&directory.join(name)))
        .chain(pictures(directory))
        .collect();
    if names.is_empty() {
        None
    } else {
        Some(described(directory).unwrap_or_else(|| first_few(&names, SHOWN_NAMES, ", ")))
    }
}

/// `true` if a file name is that of a picture.
fn is_picture(name: &str) -> bool {
    name.ends_with(".svg") || name.ends_with(".png")
}

/// Names of the pictures in a directory, in order.
fn pictures(directory: &Path) -> Vec<String> {
    let names = fs::read_dir(directory).into_iter().flatten().flatten();
    let names = names.filter_map(|entry| entry.file_name().into_string().ok()).filter(|name| is_picture(name));
    let mut names: Vec<String> = names.filter(|name| holds_something(&directory.join(name))).collect();
    names.sort();
    names
}

/// The description of a run from its summary.
fn described(directory: &Path) -> Option<String> {
    /// The part of a summary that describes a run.
    #[derive(Deserialize)]
    struct Summary {
        system: String,
        seed: u64,
        #[serde(default)]
        epochs: Option<u64>,
        #[serde(default)]
        ended: Option<String>,
    }
    let read = |name: &str| {
        serde_json::from_slice::<Summary>(&read_regular(&directory.join(name), MAX_RESULT_BYTES).ok()?).ok()
    };
    if let Some(Summary { system, seed, epochs: Some(epochs), ended }) = read("summary.json") {
        let what = if Command::of(directory) == Ok(Command::Fit) { "fit" } else { "training" };
        let ended = if ended.as_deref() == Some("finished") { "a finished" } else { "an ended" };
        return Some(format!("{ended} {what} of {system} (seed {seed}, {epochs} epochs)"));
    }
    read("evaluation.json").map(|Summary { system, seed, .. }| format!("an evaluation of {system} (seed {seed})"))
}

/// Rejects a directory in which writing would overwrite an input of the command.
///
/// # Errors
/// A data error naming the file.
pub fn require_no_input(directory: &Path, inputs: &[&Path]) -> Result<(), CliError> {
    for name in LEARNED.into_iter().chain(EVALUATED) {
        let path = directory.join(name);
        if inputs.iter().any(|input| same_file(&path, input)) {
            let problem = format!(
                "this command reads it and must not overwrite it: choose a directory (--out) other than {}",
                directory.display()
            );
            return Err(CliError::file(&path, problem));
        }
    }
    Ok(())
}

/// Rejects a directory that contains a run, unless it may be replaced; an evaluation never replaces a model.
///
/// # Errors
/// A data error that names the contents.
pub fn require_room(directory: &Path, writer: Writer, overwrite: bool) -> Result<(), CliError> {
    let Some(what) = found(directory) else { return Ok(()) };
    let other = "choose another directory (--out)";
    let learned = has_checkpoint(directory) || LEARNED.iter().any(|name| holds_something(&directory.join(name)));
    match (writer, overwrite) {
        (Writer::Evaluator, _) if learned => Err(CliError::file(
            directory,
            format_args!("there is {what}, where an evaluation would replace the report of the model: {other}"),
        )),
        (_, true) => Ok(()),
        (_, false) => {
            Err(CliError::file(directory, format_args!("there is {what}; --overwrite replaces it, or {other}")))
        }
    }
}

/// Removes all files of an earlier run except the model; called once the new run's model has replaced it.
///
/// # Errors
/// [`PipelineError::Output`] naming what cannot be removed.
pub fn remove_stale(directory: &Path) -> Result<(), PipelineError> {
    remove(directory, &LEARNED[1..])?;
    remove(directory, &EVALUATED)?;
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix("evaluation"));
        let numbered =
            number.is_some_and(|n| n.is_empty() || n.strip_prefix('-').is_some_and(|n| n.parse::<u32>().is_ok()));
        let path = entry.path();
        if numbered && entry.file_type().is_ok_and(|kind| kind.is_dir()) && path.join(EVALUATED[0]).is_file() {
            remove(&path, &[&EVALUATED[..], &[RUN]].concat())?;
            // A directory with other contents is kept.
            let _ = fs::remove_dir(&path);
        }
    }
    Ok(())
}

/// Removes the files of an earlier evaluation.
///
/// # Errors
/// [`PipelineError::Output`] naming what cannot be removed.
pub fn remove_stale_evaluation(directory: &Path) -> Result<(), PipelineError> {
    remove(directory, &EVALUATED)
}

/// Removes the pictures that the captions name, then the files.
fn remove(directory: &Path, names: &[&str]) -> Result<(), PipelineError> {
    let captions = if names.contains(&CAPTIONS) { captioned(directory) } else { Vec::new() };
    for path in captions.into_iter().chain(names.iter().map(|name| directory.join(name))) {
        // A link to a device does not contain an earlier run.
        if path.is_file() || path.is_symlink() && !path.exists() {
            let cannot = |e| PipelineError::output(&path, format_args!("cannot remove the previous results: {e}"));
            Disk.remove(&path).map_err(cannot)?;
        }
    }
    Ok(())
}

/// Pictures named by the captions in a directory, if the names are valid for pictures in it.
fn captioned(directory: &Path) -> Vec<PathBuf> {
    let bytes = read_regular(&directory.join(CAPTIONS), MAX_RESULT_BYTES).unwrap_or_default();
    let names: BTreeMap<String, serde_json::Value> = serde_json::from_slice(&bytes).unwrap_or_default();
    let plain = |name: &String| is_picture(name) && Path::new(name).file_name() == Some(name.as_ref());
    names.into_keys().filter(plain).map(|name| directory.join(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::directories::folder::Folder;
    use lnn::pipeline::MODEL;

    #[test]
    fn captions_name_pictures_of_their_directory_alone() {
        let directory = tempfile::tempdir().unwrap();
        let inside = directory.path().join("run");
        fs::create_dir(&inside).unwrap();
        let names =
            r#"{"a.png": "x", "b.svg": "x", "../b.svg": "x", "/tmp/c.png": "x", "d.csv": "x", "..png/e.png": "x"}"#;
        fs::write(inside.join(CAPTIONS), names).unwrap();
        assert_eq!(captioned(&inside), [inside.join("a.png"), inside.join("b.svg")]);
    }

    #[test]
    fn stale_files_go_and_others_stay() {
        let directory = tempfile::tempdir().unwrap();
        let folder = Folder::open(directory.path()).unwrap();
        let run = [MODEL, "config.toml", "history.csv", "summary.json", "report.html", PLAY, "old.svg", "notes.txt"];
        run.iter().for_each(|name| fs::write(folder.file(name), "{}").unwrap());
        fs::write(folder.file(CAPTIONS), r#"{"old.svg": "x"}"#).unwrap();
        for name in ["evaluation", "evaluation-2", "evaluation-x"] {
            fs::create_dir(folder.file(name)).unwrap();
            fs::write(folder.file(name).join("evaluation.json"), "{}").unwrap();
        }
        fs::write(folder.file("evaluation-2/mine.txt"), "x").unwrap();
        assert!(found(folder.path()).unwrap().contains("model.safetensors, config.toml"));
        remove_stale(folder.path()).unwrap();
        let mut left: Vec<String> =
            fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        left.sort();
        assert_eq!(left, [".lnn.lock", "evaluation-2", "evaluation-x", MODEL, "notes.txt"]);
        assert!(folder.file("evaluation-2/mine.txt").exists() && folder.file("evaluation-x/evaluation.json").exists());
        assert_eq!(found(folder.path()), Some(MODEL.to_string()));
    }
}
