//! Experiments as data: their runs, each a training with its own configuration; their records and table rows; and sweeps, whose runs the
//! user chooses.

mod record;
mod sweep;

pub use record::{Learned, Outcome, Record, Row, RunSpread, rows};
pub use sweep::{Choice, Variation, combinations, sweep_runs};

use crate::configuration::Config;

/// Published numbers for a row, in the paper's convention.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reported {
    /// Validation loss.
    pub loss: Option<f64>,
    /// Training instability.
    pub instability: Option<f64>,
    /// Mean energy error of the trajectory test, over all of its starts.
    pub energy: Option<f64>,
    /// Mean energy error of a regular motion.
    pub regular_energy: Option<f64>,
    /// Mean energy error of a chaotic motion.
    pub chaotic_energy: Option<f64>,
}

impl Reported {
    /// No published numbers.
    pub const NOTHING: Self =
        Self { loss: None, instability: None, energy: None, regular_energy: None, chaotic_energy: None };
}

/// One training of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name of its directory.
    pub name: String,
    /// Row of the table it belongs to.
    pub label: String,
    /// Position on the horizontal axis of a scan.
    pub abscissa: Option<f64>,
    /// Group it belongs to in comparisons (method of regularization, activation).
    pub group: String,
    /// The configuration, which determines the run completely.
    pub config: Config,
    /// Published figures for its row.
    pub reported: Reported,
}

/// Turns words into a directory name: lower-case letters, digits and single dashes.
pub fn slug(text: &str) -> String {
    let kept = text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' });
    let words: String = kept.collect();
    words.split('-').filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-")
}
