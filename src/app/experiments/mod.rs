//! Experiments as data: runs, each a training by a configuration of its own, their records, the rows of their table; and sweeps, whose runs
//! the user chooses.

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
    /// Nothing.
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
    /// Line it belongs to in comparisons of several groups (method of regularization, activation).
    pub group: String,
    /// Everything that determines it.
    pub config: Config,
    /// Figures that others report for its row.
    pub reported: Reported,
}

/// A directory name from words: lower case letters, digits and single dashes.
pub fn slug(text: &str) -> String {
    let kept = text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' });
    let words: String = kept.collect();
    words.split('-').filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-")
}
