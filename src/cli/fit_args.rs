//! Arguments of `lnn fit`.

use crate::cli::number::{count, positive};
use crate::cli::recording_args::RecordingArgs;
use crate::cli::train_config::PrecisionName;
use crate::recording::Targets;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub recording: RecordingArgs,
    /// What to learn from: measured accelerations, smoothed ones, or the motion itself by multiple shooting
    /// [default: measured if there are any, smoothed if they are good to a tenth, the motion if not].
    #[arg(long, value_enum)]
    pub targets: Option<TargetsName>,
    /// Learn a friction beside L: a Rayleigh dissipation of so many units.
    #[arg(long, value_name = "UNITS", num_args = 0..=1, default_missing_value = "16", value_parser = count)]
    pub friction: Option<usize>,
    /// The coordinate that is a time: its diagonal element of the mass matrix is negative.
    #[arg(long, value_name = "COORDINATE")]
    pub timelike: Option<String>,
    /// Length of the smoothing windows in samples, odd [default: chosen per coordinate].
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true, value_parser = count)]
    pub window: Option<usize>,
    /// Standard deviation of the noise of every coordinate, in SI units [default: estimated].
    #[arg(long, value_name = "S1,S2,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = positive)]
    pub noise: Option<Vec<f64>>,
    /// Share of the samples, by whole trajectories, that is held out to judge the model.
    #[arg(long, value_name = "SHARE", default_value = "0.2", allow_hyphen_values = true, value_parser = share)]
    pub hold_out: f64,
    /// How far ahead held-out motion is predicted, in seconds [default: 200 samples, at most a quarter of the shortest
    /// held-out trajectory].
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, value_parser = positive)]
    pub horizon: Option<f64>,
    /// Widths of the hidden layers.
    #[arg(long, value_name = "W1,W2,..", value_delimiter = ',', default_value = "128,128,128", allow_hyphen_values = true, value_parser = count)]
    pub hidden: Vec<usize>,
    /// Epochs of the supervised training [default: about 30,000 steps, a third of them before multiple shooting].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = count)]
    pub epochs: Option<usize>,
    /// Epochs of multiple shooting.
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = count)]
    pub shooting_epochs: Option<usize>,
    /// Samples predicted from one start by multiple shooting.
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true, value_parser = count)]
    pub segment: Option<usize>,
    /// Seed of held-out trajectories, weights and the order of the data.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = count)]
    pub threads: Option<usize>,
    /// Precision of weights and arithmetic.
    #[arg(long, value_enum, default_value = "f32")]
    pub precision: PrecisionName,
    /// Name of the system, for the model file.
    #[arg(long, value_name = "NAME", default_value = "measured")]
    pub name: String,
    /// Directory for everything the run writes [default: runs/NAME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print summary.json instead of tables.
    #[arg(long)]
    pub json: bool,
}

/// [`Targets`] by name.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum TargetsName {
    Measured,
    Smoothed,
    Motion,
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

/// A number between 0 and 1.
fn share(text: &str) -> Result<f64, String> {
    positive(text).ok().filter(|x| *x < 1.0).ok_or_else(|| "expected a number between 0 and 1".to_string())
}
