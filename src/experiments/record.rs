//! What runs came to, and the rows of an experiment's table.

use super::{Experiment, Reported, Run};
use serde::{Deserialize, Serialize};

/// Figures of a learned model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Learned {
    /// Lowest validation loss, paper convention.
    pub validation_loss: f64,
    /// Training instability, absent if no stretch of the schedule had two epochs.
    pub instability: Option<f64>,
    /// Mean scale of the coordinates: `loss * scale` is in physical units.
    pub scale: f64,
    /// Fraction of fresh states whose mass matrix has not the signature of the exact one.
    pub wrong_signature: f64,
    /// Mean energy error of each start of the trajectory test, absent where there is none.
    pub energy_errors: Vec<Option<f64>>,
    /// Starts whose learned motion reached the end of the time span.
    pub integrated: usize,
}

/// What a training came to; kept beside the model as `record.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "outcome")]
pub enum Outcome {
    /// A model was learned.
    Learned(Learned),
    /// No epoch gave a finite loss.
    Nothing {
        /// Why.
        reason: String,
    },
}

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// What it came to.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Training and validation loss of every epoch, absent where not finite.
    pub losses: Vec<[Option<f64>; 2]>,
    /// Seconds of training.
    pub seconds: f64,
}

/// Mean and range of a quantity over the runs of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Lowest.
    pub low: f64,
    /// Highest.
    pub high: f64,
}

impl Spread {
    /// Of some values; `None` of none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().collect();
        let (first, rest) = values.split_first()?;
        Some(Self {
            mean: values.iter().sum::<f64>() / values.len() as f64,
            low: rest.iter().fold(*first, |m, &x| m.min(x)),
            high: rest.iter().fold(*first, |m, &x| m.max(x)),
        })
    }
}

/// A row of an experiment's table: the runs of one label.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Label.
    pub label: String,
    /// Runs that are finished.
    pub runs: usize,
    /// Runs that learned nothing.
    pub failed: usize,
    /// Validation loss, paper convention.
    pub loss: Option<Spread>,
    /// Training instability, paper convention.
    pub instability: Option<Spread>,
    /// Loss in physical units.
    pub normalised_loss: Option<Spread>,
    /// Instability in physical units.
    pub normalised_instability: Option<Spread>,
    /// Fraction of states of wrong signature.
    pub wrong_signature: Option<Spread>,
    /// Mean energy error over all starts.
    pub energy: Option<Spread>,
    /// Starts integrated to the end, of all.
    pub integrated: (usize, usize),
    /// What the paper reports.
    pub reported: Reported,
}

impl Experiment {
    /// The table: one row per label in the order of first appearance, from runs and their records (if finished).
    pub fn rows(&self, results: &[(Run, Option<Record>)]) -> Vec<Row> {
        let mut labels: Vec<&str> = Vec::new();
        for (run, _) in results {
            if !labels.contains(&run.label.as_str()) {
                labels.push(&run.label);
            }
        }
        labels.into_iter().map(|label| row(label, results)).collect()
    }
}

fn row(label: &str, results: &[(Run, Option<Record>)]) -> Row {
    let mut of_label = results.iter().filter(|(run, _)| run.label == label).peekable();
    let reported = of_label.peek().map_or(Reported::default(), |(run, _)| run.reported);
    let records: Vec<&Record> = of_label.filter_map(|(_, record)| record.as_ref()).collect();
    let learned: Vec<&Learned> = records
        .iter()
        .filter_map(|record| match &record.outcome {
            Outcome::Learned(learned) => Some(learned),
            Outcome::Nothing { .. } => None,
        })
        .collect();
    let of = |part: fn(&Learned) -> Option<f64>| Spread::of(learned.iter().filter_map(|l| part(l)));
    Row {
        label: label.to_string(),
        runs: records.len(),
        failed: records.len() - learned.len(),
        loss: of(|l| Some(l.validation_loss)),
        instability: of(|l| l.instability),
        normalised_loss: of(|l| Some(l.validation_loss * l.scale)),
        normalised_instability: of(|l| l.instability.map(|i| i * l.scale)),
        wrong_signature: of(|l| Some(l.wrong_signature)),
        energy: Spread::of(learned.iter().flat_map(|l| l.energy_errors.iter().copied().flatten())),
        integrated: (learned.iter().map(|l| l.integrated).sum(), learned.iter().map(|l| l.energy_errors.len()).sum()),
        reported,
    }
}
