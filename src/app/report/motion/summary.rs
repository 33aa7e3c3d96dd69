//! The summary of a roll-out: steps, energies, charges, events.

use super::events::EventTable;
use super::record::{Leaving, MotionRecord};
use crate::analysis::MotionTube;
use crate::findings::Findings;
use crate::lagrangian::EulerLagrange;
use crate::names::{pluralize, rounded};
use crate::rollout::{Ending, EnergyBalance, Event, RolloutOptions};
use crate::symmetry::{ChargeDrift, Invariant};
use serde::Serialize;

/// What a roll-out has done, and what its motion conserved.
#[derive(Debug, Serialize)]
pub struct MotionSummary {
    /// Name of the system.
    pub system: String,
    /// Samples written.
    pub samples: usize,
    /// Time of the last sample.
    pub t_end: f64,
    /// Unit of times, if the system is known.
    pub time_unit: Option<String>,
    /// Name of the parameter of the motion: `t`, or `tau` if a coordinate is called `t`.
    #[serde(skip)]
    pub parameter: &'static str,
    /// Steps taken.
    pub steps: usize,
    /// States whose terms were evaluated.
    pub evaluations: usize,
    /// Iterations of an implicit method.
    pub iterations: Option<usize>,
    /// Energy at the end minus energy at the start, for a model with friction or under forces.
    pub energy_change: Option<f64>,
    /// Work of the known forces.
    pub work: Option<f64>,
    /// Energy dissipated by friction.
    pub dissipated: Option<f64>,
    /// What took the energy, in words.
    #[serde(skip)]
    pub taken_by: &'static str,
    /// Energy lost in impacts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impacts: Option<f64>,
    /// Energy that friction and forces do not explain.
    pub energy_defect: Option<f64>,
    /// The quantity that the motion conserves without friction and forces, and its drift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conserved: Option<Conserved>,
    /// The events of the motion, if the system defines any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events: Option<EventTable>,
    /// Where the motion left the training range.
    pub left_training_range: Option<Leaving>,
    /// Charges of the symmetries along the motion, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub charges: Option<Vec<ChargeDrift>>,
    /// The tube around the coordinates, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tube: Option<MotionTube>,
    /// The file of the samples.
    pub out: String,
}

/// A conserved quantity along a motion.
#[derive(Debug, Serialize)]
pub struct Conserved {
    /// `energy`, `g(v, v)` of geodesics of a metric with a time, or `p.v - L`.
    pub quantity: Invariant,
    /// Value at the start.
    pub start: f64,
    /// Largest distance from it.
    pub largest_change: f64,
}

impl Conserved {
    /// Creates it from `p.v - L`, which is half of `g(v, v)`, at the start, and from its largest change.
    pub fn new(quantity: Invariant, (start, change): (f64, f64)) -> Self {
        let factor = if quantity == Invariant::Square { 2.0 } else { 1.0 };
        Self { quantity, start: factor * start, largest_change: factor * change }
    }

    fn text(&self) -> String {
        let name = match self.quantity {
            Invariant::Square => "g(v, v)",
            other => other.charge(),
        };
        let [start, change] = [rounded(self.start, 10), rounded(self.largest_change, 2)];
        format!("the equations conserve {name}: {start} at the start, largest change {change}")
    }
}

impl MotionSummary {
    /// The summary of a motion of a model that ended as `ending` says; `is_driven` says whether an external force acted on it.
    pub fn of(
        (system, model): (&str, &dyn EulerLagrange<f64>),
        record: &MotionRecord,
        (options, ending): (&RolloutOptions<f64>, &Ending<f64>),
        is_driven: bool,
    ) -> Self {
        let (statistics, balance) = (&ending.statistics, ending.balance.as_ref());
        // A free motion conserves the energy; moving constraints and forces change it.
        let is_free = !is_driven && balance.is_none() && model.manifold().is_none();
        let invariant = if is_free { record.invariant(model) } else { None };
        Self {
            system: system.to_string(),
            samples: ending.samples,
            t_end: record.end,
            time_unit: None,
            parameter: record.parameter(),
            steps: statistics.accepted,
            evaluations: statistics.evaluations,
            iterations: options.method.is_structure_preserving().then_some(statistics.iterations),
            energy_change: balance.map(|balance| balance.change),
            work: balance.filter(|_| is_driven).map(|balance| balance.work),
            dissipated: balance.map(|balance| balance.dissipated),
            taken_by: if model.is_timed() { "friction, own forces and time" } else { "friction" },
            impacts: balance.filter(|_| options.events.iter().any(Event::is_impact)).map(|balance| balance.impacts),
            energy_defect: balance.map(EnergyBalance::defect),
            conserved: invariant.map(|invariant| Conserved::new(invariant, record.energy)),
            events: None,
            left_training_range: record.leaving.clone(),
            charges: None,
            tube: None,
            out: String::new(),
        }
    }

    /// Describes the motion and its energy in one line each, then charges, tube and events.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        let unit =
            self.time_unit.as_deref().filter(|unit| *unit != "1").map_or(String::new(), |unit| format!(" {unit}"));
        let iterations = self
            .iterations
            .map_or(String::new(), |count| format!(" in {}", pluralize(count, "iteration", "iterations")));
        findings.line(format!(
            "{} to {} = {}{unit}, {}, {}{iterations}, in {}",
            pluralize(self.samples, "sample", "samples"),
            self.parameter,
            self.t_end,
            pluralize(self.steps, "step", "steps"),
            pluralize(self.evaluations, "evaluation", "evaluations"),
            self.out
        ));
        self.add_energies(&mut findings);
        // The charges already include the energy.
        match (&self.charges, &self.conserved) {
            (Some(charges), _) => {
                findings.table(&ChargeDrift::HEADERS, charges.iter().map(ChargeDrift::row));
            }
            (None, Some(conserved)) => {
                findings.line(conserved.text());
            }
            (None, None) => {}
        }
        findings.lines(self.tube.iter().map(MotionTube::text));
        if let Some(events) = &self.events {
            findings.append(events.findings());
        }
        findings
    }

    /// Adds the energies that friction, impacts and forces have exchanged.
    fn add_energies(&self, findings: &mut Findings) {
        let (Some(change), Some(dissipated), Some(defect)) = (self.energy_change, self.dissipated, self.energy_defect)
        else {
            return;
        };
        let work = self.work.map_or(String::new(), |work| format!("forces added {}, ", rounded(work, 10)));
        let impacts = self.impacts.map_or(String::new(), |lost| format!("impacts removed {}, ", rounded(lost, 10)));
        let (change, taken, defect) = (rounded(change, 10), rounded(dissipated, 10), rounded(defect, 2));
        let by = self.taken_by;
        findings.line(format!("energy changed by {change}, {work}{impacts}{by} removed {taken}, defect {defect}"));
    }
}
