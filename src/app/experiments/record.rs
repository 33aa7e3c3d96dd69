//! Records of runs, and the rows of an experiment's table.

use super::{Reported, Run};
use crate::analysis::REGULAR;
use serde::{Deserialize, Serialize};

/// Figures of a learned model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Learned {
    /// Lowest validation loss, paper convention.
    pub validation_loss: f64,
    /// Training instability, absent if every segment of the schedule has only one epoch.
    pub instability: Option<f64>,
    /// Mean scale of the coordinates: `loss * scale` is in physical units.
    pub scale: f64,
    /// Fraction of fresh states whose mass matrix has a wrong signature.
    pub wrong_signature: f64,
    /// Mean energy error of each start of the trajectory test, absent where there is none.
    pub energy_errors: Vec<Option<f64>>,
    /// Lyapunov exponent of the exact motion of each start times the time span of the test, absent where unknown: the logarithm of the
    /// factor by which nearby motions diverge.
    #[serde(default)]
    pub stretching: Vec<Option<f64>>,
    /// Number of starts whose learned motion reached the end of the time span.
    pub integrated: usize,
}

impl Learned {
    /// Energy errors of the starts whose exact motion is regular or, if `regular` is `false`, chaotic; starts for which this is unknown are
    /// skipped.
    fn energy_of(&self, regular: bool) -> impl Iterator<Item = f64> {
        let pairs = self.energy_errors.iter().zip(&self.stretching);
        pairs.filter_map(move |(error, stretching)| {
            error.filter(|_| stretching.is_some_and(|s| (s < REGULAR) == regular))
        })
    }
}

/// Outcome of a training, stored next to the model as `record.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "outcome")]
pub enum Outcome {
    /// A model was learned.
    Learned(Learned),
    /// No epoch gave a finite loss.
    Nothing {
        /// The reason.
        reason: String,
    },
}

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Checksum of its configuration, so that a record in the directory of another run is detected.
    pub run: String,
    /// Its outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Training and validation loss of every epoch, absent where not finite.
    pub losses: Vec<[Option<f64>; 2]>,
    /// Seconds of training at the end of every epoch.
    #[serde(default)]
    pub times: Vec<f64>,
    /// Seconds of training.
    pub seconds: f64,
}

/// Mean, median and range of a quantity over the runs of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunSpread {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Lowest.
    pub low: f64,
    /// Highest.
    pub high: f64,
}

impl RunSpread {
    /// Statistics of some values; `None` without values.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.sort_by(f64::total_cmp);
        let (low, high) = (*values.first()?, *values.last()?);
        let median = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
        Some(Self { mean, median, low, high })
    }
}

/// A row of an experiment's table: the runs of one label.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Label.
    pub label: String,
    /// Number of finished runs.
    pub runs: usize,
    /// Number of runs that learned nothing.
    pub failed: usize,
    /// Validation loss, paper convention.
    pub loss: Option<RunSpread>,
    /// Training instability, paper convention.
    pub instability: Option<RunSpread>,
    /// Loss in physical units.
    pub normalised_loss: Option<RunSpread>,
    /// Instability in physical units.
    pub normalised_instability: Option<RunSpread>,
    /// Fraction of states with a wrong signature.
    pub wrong_signature: Option<RunSpread>,
    /// Mean energy error over all starts.
    pub energy: Option<RunSpread>,
    /// Energy errors over the starts whose exact motion is regular.
    pub regular_energy: Option<RunSpread>,
    /// Energy errors over the starts whose exact motion is chaotic.
    pub chaotic_energy: Option<RunSpread>,
    /// Number of starts integrated to the end, and number of all starts.
    pub integrated: (usize, usize),
    /// The paper's figures.
    pub reported: Reported,
}

/// Builds the table: one row per label in the order of first appearance, from runs and their records (if finished).
pub fn rows(results: &[(Run, Option<Record>)]) -> Vec<Row> {
    let mut labels: Vec<&str> = Vec::new();
    for (run, _) in results {
        if !labels.contains(&run.label.as_str()) {
            labels.push(&run.label);
        }
    }
    labels.into_iter().map(|label| row(label, results)).collect()
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
    let of = |part: fn(&Learned) -> Option<f64>| RunSpread::of(learned.iter().filter_map(|l| part(l)));
    Row {
        label: label.to_string(),
        runs: records.len(),
        failed: records.len() - learned.len(),
        loss: of(|l| Some(l.validation_loss)),
        instability: of(|l| l.instability),
        normalised_loss: of(|l| Some(l.validation_loss * l.scale)),
        normalised_instability: of(|l| l.instability.map(|i| i * l.scale)),
        wrong_signature: of(|l| Some(l.wrong_signature)),
        energy: RunSpread::of(learned.iter().flat_map(|l| l.energy_errors.iter().copied().flatten())),
        regular_energy: RunSpread::of(learned.iter().flat_map(|l| l.energy_of(true))),
        chaotic_energy: RunSpread::of(learned.iter().flat_map(|l| l.energy_of(false))),
        integrated: (learned.iter().map(|l| l.integrated).sum(), learned.iter().map(|l| l.energy_errors.len()).sum()),
        reported,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::Learned;
    use crate::presets::Preset;

    fn learned(loss: f64, energy_errors: Vec<Option<f64>>) -> Option<Record> {
        let integrated = energy_errors.iter().flatten().count();
        let outcome = Outcome::Learned(Learned {
            validation_loss: loss,
            instability: Some(loss / 10.0),
            scale: 10.0,
            wrong_signature: 0.25,
            // Regular, chaotic, regular, ..
            stretching: (0..energy_errors.len()).map(|k| Some(if k % 2 == 0 { 4.0 } else { 40.0 })).collect(),
            energy_errors,
            integrated,
        });
        Some(Record { run: String::new(), outcome, losses: vec![[Some(1.0), None]], times: vec![2.0], seconds: 2.0 })
    }

    #[test]
    fn rows_gather_runs_of_one_label_and_count_failures() {
        let system = crate::lagrangian::SystemInstance::named("harmonic-oscillator", &[]).unwrap();
        let run = |label: &str| Run {
            name: label.to_string(),
            label: label.to_string(),
            abscissa: None,
            group: String::new(),
            config: Preset::Quick.config(&system).unwrap(),
            reported: Reported { loss: Some(0.00738), ..Reported::NOTHING },
        };
        let runs = ["GELU", "GELU", "x tanh(kx)", "x tanh(kx)", "softplus"].map(run).to_vec();
        let nothing = Some(Record {
            run: String::new(),
            outcome: Outcome::Nothing { reason: "NaN".into() },
            losses: vec![],
            times: vec![],
            seconds: 1.0,
        });
        let mut records =
            vec![learned(0.1, vec![Some(0.5), None]), learned(0.3, vec![Some(0.1), Some(0.6)]), nothing, None];
        records.resize(runs.len(), None);
        let results: Vec<(Run, Option<Record>)> = runs.into_iter().zip(records).collect();
        let rows = rows(&results);
        assert_eq!(rows.iter().map(|r| r.label.as_str()).collect::<Vec<_>>()[..2], ["GELU", "x tanh(kx)"]);
        let gelu = &rows[0];
        assert_eq!((gelu.runs, gelu.failed, gelu.integrated), (2, 0, (3, 4)));
        assert_eq!(gelu.loss, Some(RunSpread { mean: 0.2, median: 0.2, low: 0.1, high: 0.3 }));
        let energy = gelu.energy.unwrap();
        assert!((energy.mean - 0.4).abs() < 1e-15 && (energy.low, energy.high) == (0.1, 0.6));
        assert_eq!(gelu.regular_energy, Some(RunSpread { mean: 0.3, median: 0.3, low: 0.1, high: 0.5 }));
        assert_eq!(gelu.chaotic_energy, Some(RunSpread { mean: 0.6, median: 0.6, low: 0.6, high: 0.6 }));
        assert!((gelu.normalised_instability.unwrap().mean - 0.2).abs() < 1e-15);
        assert_eq!(gelu.reported.loss, Some(0.00738));
        assert_eq!((rows[1].runs, rows[1].failed, rows[1].loss), (1, 1, None));
        assert_eq!((rows[2].runs, rows[2].integrated), (0, (0, 0)));
        // A record can be read back from its file, even an older one without data on chaos.
        let text = serde_json::to_string(&results[0].1).unwrap();
        let field = ",\"stretching\":[4.0,40.0]";
        assert!(text.contains(field), "{text}");
        let Outcome::Learned(old) = serde_json::from_str::<Record>(&text.replace(field, "")).unwrap().outcome else {
            panic!("{text}")
        };
        assert_eq!((old.energy_of(true).count(), old.energy_of(false).count()), (0, 0));
        for (_, record) in results {
            let text = serde_json::to_string(&record).unwrap();
            assert_eq!(serde_json::from_str::<Option<Record>>(&text).unwrap(), record);
        }
    }
}
