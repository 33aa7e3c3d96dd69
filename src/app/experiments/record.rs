//! Records of runs, the rows of an experiment's table, and remarks for its comparison with the paper's: conventions, and
//! the reductions that the paper states.

use super::{Experiment, Reported, Run};
use crate::analysis::REGULAR;
use crate::configuration::Regularizer;
use crate::optimizers::Method;
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
    /// Lyapunov exponent of the exact motion of each start times the time span of the test, absent where unknown: the
    /// logarithm of the factor by which neighbours part.
    #[serde(default)]
    pub stretching: Vec<Option<f64>>,
    /// Starts whose learned motion reached the end of the time span.
    pub integrated: usize,
}

impl Learned {
    /// Energy errors of the starts whose exact motion is regular, or of the others; without those of which it is not known.
    fn energy_of(&self, regular: bool) -> impl Iterator<Item = f64> {
        let pairs = self.energy_errors.iter().zip(&self.stretching);
        pairs.filter_map(move |(error, stretching)| {
            error.filter(|_| stretching.is_some_and(|s| (s < REGULAR) == regular))
        })
    }
}

/// Outcome of a training; kept beside the model as `record.json`.
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
    /// Checksum of its configuration, so that a record in the place of another run is found out.
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
    /// Of some values; `None` of none.
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
    /// Runs that are finished.
    pub runs: usize,
    /// Runs that learned nothing.
    pub failed: usize,
    /// Validation loss, paper convention.
    pub loss: Option<RunSpread>,
    /// Training instability, paper convention.
    pub instability: Option<RunSpread>,
    /// Loss in physical units.
    pub normalised_loss: Option<RunSpread>,
    /// Instability in physical units.
    pub normalised_instability: Option<RunSpread>,
    /// Fraction of states of wrong signature.
    pub wrong_signature: Option<RunSpread>,
    /// Mean energy error over all starts.
    pub energy: Option<RunSpread>,
    /// That over the starts whose exact motion is regular.
    pub regular_energy: Option<RunSpread>,
    /// That over the starts whose exact motion is chaotic.
    pub chaotic_energy: Option<RunSpread>,
    /// Starts integrated to the end, of all.
    pub integrated: (usize, usize),
    /// The paper's figures.
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

/// A quantity of which the paper states by how much it is lower in one group of runs than in another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Validation loss, paper convention.
    Loss,
    /// Training instability, paper convention.
    Instability,
    /// Loss in physical units.
    PhysicalLoss,
    /// Instability in physical units.
    PhysicalInstability,
}

impl Quantity {
    /// Name in a table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::Instability => "instability",
            Self::PhysicalLoss => "physical loss",
            Self::PhysicalInstability => "physical instability",
        }
    }
}

/// A reduction that the paper states: the mean of a group of runs below that of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduction {
    /// Of what.
    pub quantity: Quantity,
    /// Group of the runs that are better.
    pub group: &'static str,
    /// Group they are compared with.
    pub against: &'static str,
    /// The paper's figure, a fraction.
    pub paper: f64,
}

impl Experiment {
    /// The reductions of the paper beside those of these runs, `1 - mean / mean`; `None` where a group has no finished run.
    pub fn reductions(&self, results: &[(Run, Option<Record>)]) -> Vec<(Reduction, Option<f64>)> {
        self.reductions.iter().map(|reduction| (*reduction, reduction.found(results))).collect()
    }

    /// Differences between these runs and the paper, or its authors' code where that is not its text, in sentences.
    pub fn remarks(&self, runs: &[&Run]) -> Vec<String> {
        let any = |test: fn(&Run) -> bool| runs.iter().any(|run| test(run));
        let mut remarks = Vec::new();
        if any(|run| run.config.optimizer.method == Method::Radam) {
            remarks.push("Optimiser: RAdam, which the authors' code runs; the paper's text calls it Adam.".to_string());
        }
        if self.paper != "-" && any(|run| run.config.penalty == Regularizer::Eigenvalue { lambda: 5.0 }) {
            let text = "Penalty: eigenvalues with lambda = 5 where a row says nothing else; for its network experiments the \
                        paper names none.";
            remarks.push(text.to_string());
        }
        let seeds: std::collections::BTreeSet<u64> = runs.iter().map(|run| run.config.seed).collect();
        if seeds.len() > 1 {
            let text = "Seeds: each draws states, weights and order of its own; repeated runs of the paper differ in their \
                        weights alone.";
            remarks.push(text.to_string());
        }
        remarks.push("Instability: of the training loss without the penalty.".to_string());
        if any(|run| run.reported.regular_energy.is_some()) {
            let text = "Energy errors: a start is regular if the Lyapunov time of its exact motion is above a fifth of the \
                        test's time span, chaotic if not; the paper's figures are of one motion each.";
            remarks.push(text.to_string());
        }
        remarks
    }
}

impl Reduction {
    fn found(&self, results: &[(Run, Option<Record>)]) -> Option<f64> {
        let value = |record: &Record| match &record.outcome {
            Outcome::Learned(learned) => match self.quantity {
                Quantity::Loss => Some(learned.validation_loss),
                Quantity::Instability => learned.instability,
                Quantity::PhysicalLoss => Some(learned.validation_loss * learned.scale),
                Quantity::PhysicalInstability => learned.instability.map(|i| i * learned.scale),
            },
            Outcome::Nothing { .. } => None,
        };
        let mean = |group: &str| {
            let of_group = results.iter().filter(|(run, _)| run.group == group);
            let values: Vec<f64> = of_group.filter_map(|(_, record)| value(record.as_ref()?)).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        Some(1.0 - mean(self.group)? / mean(self.against)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::{Learned, Scale, find};

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
        let experiment = find("activations").unwrap();
        let runs = experiment.runs(Scale::Smoke, 1);
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
        let rows = experiment.rows(&results);
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
        // A record reads back from its file, also one that knows nothing of chaos.
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

    #[test]
    fn reductions_are_recomputed_from_the_means_of_the_groups() {
        let experiment = find("regularization").unwrap();
        let runs = experiment.runs(Scale::Paper, 1);
        let record = |run: &Run| {
            let learned = Learned {
                validation_loss: match run.group.as_str() {
                    "none" => 0.5,
                    "eigenvalue" => 0.1,
                    _ => 0.2,
                },
                instability: (run.group != "Sylvester").then_some(if run.group == "none" { 0.4 } else { 0.3 }),
                scale: 10.0,
                wrong_signature: 0.0,
                energy_errors: vec![],
                stretching: vec![],
                integrated: 0,
            };
            Record {
                run: String::new(),
                outcome: Outcome::Learned(learned),
                losses: vec![],
                times: vec![],
                seconds: 1.0,
            }
        };
        let mut results: Vec<(Run, Option<Record>)> = runs
            .into_iter()
            .map(|run| {
                let record = record(&run);
                (run, Some(record))
            })
            .collect();
        // One of the runs learned nothing, one has not run yet.
        let nothing = Outcome::Nothing { reason: String::new() };
        results[0].1 =
            Some(Record { run: String::new(), outcome: nothing, losses: vec![], times: vec![], seconds: 1.0 });
        results[4].1 = None;
        let found = experiment.reductions(&results);
        let of = |quantity, group| {
            let (reduction, found) =
                found.iter().find(|(r, _)| r.quantity == quantity && r.group == group).copied().unwrap();
            (reduction.paper, found)
        };
        let close = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-12;
        let (paper, own) = of(Quantity::Loss, "eigenvalue");
        assert!(paper == 0.966 && close(own, 0.8));
        let (paper, own) = of(Quantity::Instability, "eigenvalue");
        assert!(paper == 0.9068 && close(own, 0.25));
        let (paper, own) = of(Quantity::Loss, "Sylvester");
        assert!(paper == 0.964 && close(own, 0.6));
        assert_eq!(of(Quantity::Instability, "Sylvester"), (0.7162, None));
    }

    #[test]
    fn every_group_of_a_reduction_exists() {
        let mut seen = 0;
        for experiment in crate::experiments::experiments() {
            let runs = experiment.runs(Scale::Paper, 1);
            for reduction in experiment.reductions {
                assert!([reduction.group, reduction.against].iter().all(|g| runs.iter().any(|r| r.group == *g)));
                seen += 1;
            }
        }
        assert_eq!(seen, 6);
    }

    #[test]
    fn remarks_say_what_differs_from_the_papers_text() {
        let remarks = |name: &str, seeds| {
            let experiment = find(name).unwrap();
            let runs = experiment.runs(Scale::Paper, seeds);
            experiment.remarks(&runs.iter().collect::<Vec<_>>()).join(" ")
        };
        let scaling = remarks("scaling", 1);
        assert!(scaling.contains("RAdam") && scaling.contains("lambda = 5") && scaling.contains("without the penalty"));
        assert!(!scaling.contains("Seeds") && remarks("scaling", 2).contains("Seeds"));
        assert!(!remarks("regularization", 1).contains("lambda = 5") && remarks("regularization", 1).contains("Seeds"));
        assert!(remarks("triple-pendulum", 1).contains("Lyapunov time"));
        let quick = remarks("quick", 1);
        assert!(!quick.contains("RAdam") && !quick.contains("lambda = 5") && quick.contains("Lyapunov time"));
    }
}
