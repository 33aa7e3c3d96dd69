//! Names of files that pipelines write.

/// Name of the model's file.
pub const MODEL: &str = "model.safetensors";
/// Name of the file with the captions of a run's pictures, by file name; written before them, so that each is known.
pub const CAPTIONS: &str = "captions.json";
/// Name of the interactive page of a model.
pub const PLAY: &str = "play.html";
/// Name of the file that marks a finished run of an experiment.
pub const RECORD: &str = "record.json";
/// Name of the file with the figures of a run.
pub const SUMMARY: &str = "summary.json";
/// Name of the file that names the command of a directory.
pub const RUN: &str = "run.json";
/// Files that only trainings and fits write.
pub const LEARNED: [&str; 5] = [MODEL, "config.toml", "history.csv", "shooting.csv", SUMMARY];
