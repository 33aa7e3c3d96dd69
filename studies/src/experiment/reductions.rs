//! The reductions that the paper states, and remarks for the comparison with it.

use super::experiments::Experiment;
use lnn::configuration::Regularizer;
use lnn::experiments::{Outcome, Record, Run};
use lnn::optimizers::Method;

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

/// Header of [`reduction_table`].
pub const REDUCTION_HEADER: [&str; 5] = ["reduction of", "by", "against", "here [%]", "paper [%]"];

/// The reductions that the paper states beside those of these runs, below [`REDUCTION_HEADER`].
pub fn reduction_table(reductions: &[(Reduction, Option<f64>)]) -> Vec<Vec<String>> {
    // Adding 0 turns -0 into 0.
    let percent = |x: f64| format!("{:.1}", (1e3 * x).round() / 10.0 + 0.0);
    let row = |(reduction, found): &(Reduction, Option<f64>)| {
        let Reduction { quantity, group, against, paper } = reduction;
        let found = found.map_or_else(|| "-".to_string(), percent);
        vec![quantity.name().to_string(), group.to_string(), against.to_string(), found, percent(*paper)]
    };
    reductions.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::experiments::{Scale, experiments, find};
    use super::*;
    use lnn::experiments::Learned;

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
        for experiment in experiments() {
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
