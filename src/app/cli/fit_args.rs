//! Arguments of `lnn fit`.

use crate::cli::changes::Changes;
use crate::cli::number::{positive, seed, thread_count, weight, whole};
use crate::cli::plain_name::plain_name;
use crate::cli::print_config::PrintFormat;
use crate::cli::recording_args::RecordingArgs;
use crate::cli::train_config::{PrecisionName, every};
use crate::configuration::MOST_EPOCHS;
use crate::network::file::MAX_WIDTH;
use crate::pipeline::HELD_OUT;
use crate::recording::Targets;
use crate::shooting::MOST_STEPS;
use crate::training::CheckpointInterval;
use std::path::{Path, PathBuf};

/// Samples of a smoothing window at most.
const MOST_WINDOW: usize = 1_000_001;

/// Arguments.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args(unless_known))]
pub struct Args {
    #[command(flatten)]
    pub recording: RecordingArgs,
    /// A configuration, such as the config.toml beside a model, or - for standard input: what arguments do not say is taken
    /// from it, DATA and columns included. Keys that are not in it have their usual values.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print the configuration with comments, as it would be used for the data, and learn nothing; markdown prints a table of
    /// all keys.
    #[arg(long, value_enum, value_name = "FORMAT", num_args = 0..=1, require_equals = true, default_missing_value = "toml")]
    pub print_config: Option<PrintFormat>,
    /// Start from the weights of a model, a file or the directory of a run: network and friction are the model's, other ones
    /// are refused.
    #[arg(long, value_name = "MODEL")]
    pub from: Option<String>,
    /// Targets to learn from: measured accelerations, smoothed ones, or the motion itself by multiple shooting
    /// [default: measured if there are any, smoothed if they are good to a tenth, the motion if not].
    #[arg(long, value_enum, value_name = "WAY")]
    pub targets: Option<TargetsName>,
    /// Learn a friction beside L: a Rayleigh dissipation of so many units.
    #[arg(long, value_name = "UNITS", num_args = 0..=1, default_missing_value = "16", value_parser = whole(1, MAX_WIDTH))]
    pub friction: Option<usize>,
    /// The coordinate that is a time: its diagonal element of the mass matrix is negative.
    #[arg(long, value_name = "COORDINATE")]
    pub timelike: Option<String>,
    /// Length of the smoothing windows in samples, odd, a million at most [default: chosen per coordinate].
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true, value_parser = whole(1, MOST_WINDOW))]
    pub window: Option<usize>,
    /// Standard deviation of the noise of every coordinate, in SI units [default: estimated].
    #[arg(long, value_name = "S1,S2,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = positive)]
    pub noise: Option<Vec<f64>>,
    /// Share of the samples, by whole trajectories, that is held out to judge the model; with 0 all data are learned from and
    /// nothing judges the model [default: 0.2].
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true, value_parser = share)]
    pub hold_out: Option<f64>,
    /// Time over which held-out motion is predicted, in seconds [default: 200 samples, at most a quarter of the shortest
    /// held-out trajectory].
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, value_parser = positive)]
    pub horizon: Option<f64>,
    #[command(flatten)]
    pub changes: Changes,
    /// Epochs of multiple shooting [default: 100].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = whole(1, MOST_EPOCHS))]
    pub shooting_epochs: Option<usize>,
    /// Samples predicted from one start by multiple shooting [default: 20].
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true, value_parser = whole(2, MOST_STEPS))]
    pub segment: Option<usize>,
    /// Seed of held-out trajectories, weights and the order of the data [default: 0].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = seed)]
    pub seed: Option<u64>,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    pub threads: Option<usize>,
    /// Precision of weights and arithmetic [default: f32].
    #[arg(long, value_enum, value_name = "TYPE")]
    pub precision: Option<PrecisionName>,
    /// Name of the system, for the model file: letters, digits, - _ . and spaces within [default: measured].
    #[arg(long, value_name = "NAME", allow_hyphen_values = true, value_parser = plain_name)]
    pub name: Option<String>,
    /// Directory for everything the run writes; one that holds a run is refused [default: runs/NAME, or the first free of
    /// runs/NAME-2, runs/NAME-3, ..].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace the run in the directory, pictures and evaluations of its model included, once the new model is there.
    #[arg(long, conflicts_with = "resume")]
    pub overwrite: bool,
    /// Go on with the fit in a directory that was stopped; everything else comes from its checkpoint, DATA as well unless
    /// given anew.
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    pub resume: Option<PathBuf>,
    /// Write a checkpoint every N epochs, or every Ts seconds with an s behind the number.
    #[arg(long, value_name = "N|Ts", default_value = "60s", allow_hyphen_values = true, value_parser = every)]
    pub checkpoint_every: CheckpointInterval,
    /// Print summary.json instead of tables.
    #[arg(long)]
    pub json: bool,
}

/// [`Targets`] by name.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum TargetsName {
    /// Measured accelerations.
    Measured,
    /// Accelerations by local polynomials.
    Smoothed,
    /// The motion itself, by multiple shooting.
    Motion,
}

impl From<Targets> for TargetsName {
    fn from(targets: Targets) -> Self {
        match targets {
            Targets::Measured => Self::Measured,
            Targets::Smoothed => Self::Smoothed,
            Targets::Motion => Self::Motion,
        }
    }
}

impl Args {
    /// Share of the samples that is held out.
    pub fn share(&self) -> f64 {
        self.hold_out.unwrap_or(HELD_OUT)
    }
    /// The seed.
    pub fn seed(&self) -> u64 {
        self.seed.unwrap_or(0)
    }
    /// Name of the system.
    pub fn name(&self) -> &str {
        self.name.as_deref().unwrap_or("measured")
    }
    /// Files that are read.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.recording.data.iter().chain(&self.config).map(PathBuf::as_path)
    }
    /// Precision of weights and arithmetic.
    pub fn precision(&self) -> PrecisionName {
        self.precision.unwrap_or(PrecisionName::F32)
    }
}

/// An argument that a configuration or a checkpoint may give instead.
fn unless_known(argument: clap::Arg) -> clap::Arg {
    match argument.get_id().as_str() {
        "data" | "coords" => argument.required(false).required_unless_present_any(["config", "resume"]),
        _ => argument,
    }
}

impl From<TargetsName> for Targets {
    fn from(name: TargetsName) -> Self {
        match name {
            TargetsName::Measured => Self::Measured,
            TargetsName::Smoothed => Self::Smoothed,
            TargetsName::Motion => Self::Motion,
        }
    }
}

/// 0, or a number between 0 and 1.
fn share(text: &str) -> Result<f64, String> {
    weight(text).ok().filter(|x| *x < 1.0).ok_or_else(|| "expected 0, or a number between 0 and 1".to_string())
}
