//! Results of a roll-out in addition to its samples: where it left the training range, pictures, facts in JSON.

use crate::CliError;
use crate::arguments::input;
use crate::commands::charges::Charges;
use crate::commands::tube::TubeFacts;
use crate::thresholds::{EXAMINED_MOTION_STATES, MOST_CURVE_POINTS};
use lnn::lagrangian::EulerLagrange;
use lnn::names::{pluralize, rounded};
use lnn::rollout::{Domain, Trajectory};
use lnn::symmetry::Invariant;
use serde::Serialize;
use serde_json::{Map, Value};
use std::ops::Range;
use std::path::Path;

pub mod events;
pub mod pictures;
pub mod readings;
pub mod samples;

/// The first sample outside the states that a model was trained on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leaving {
    /// Its time.
    pub t: f64,
    /// The component that left the range.
    pub column: String,
    /// Its value.
    pub value: f64,
    /// The range of the training states.
    pub trained_on: [f64; 2],
}

impl Leaving {
    /// Describes it in words.
    pub fn text(&self) -> String {
        let Self { t, column, value, trained_on: [low, high] } = self;
        format!(
            "left the training range at t = {t}: {column} reached {}, trained on [{low}, {high}]",
            rounded(*value, 6)
        )
    }
}

/// Records a motion whose samples arrive in pieces; stores few of them.
pub struct MotionRecord {
    domain: Domain<f64>,
    columns: Vec<String>,
    /// Where it left the training range.
    pub leaving: Option<Leaving>,
    /// Time of the last sample.
    pub end: f64,
    /// Value of `p.v - L` at the start, and its largest deviation from that.
    pub energy: (f64, f64),
    /// Times, and values of every column and of the energy, of every `stride`-th sample.
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
    stride: usize,
    seen: usize,
}

impl MotionRecord {
    /// Starts recording a motion; `columns` are those of the model, and `domain` contains its training states.
    pub fn new(domain: Domain<f64>, columns: &[String]) -> Self {
        let values = vec![Vec::new(); columns.len() + 1];
        let columns = columns.to_vec();
        let energy = (f64::NAN, 0.0);
        Self { domain, columns, leaving: None, end: f64::NAN, energy, times: Vec::new(), values, stride: 1, seen: 0 }
    }

    /// Records the next samples.
    pub fn add(&mut self, piece: &Trajectory<f64>) {
        for k in 0..piece.len() {
            let (q, v) = piece.state(k);
            let state = [q, v].concat();
            if self.leaving.is_none()
                && let Some((component, low, high)) = self.domain.violation(&state)
            {
                let column = self.columns.get(component).cloned().unwrap_or_default();
                self.leaving =
                    Some(Leaving { t: piece.t[k], column, value: state[component], trained_on: [low, high] });
            }
            self.end = piece.t[k];
            let energy = piece.energy.as_ref().and_then(|energy| energy.get(k)).copied().unwrap_or(f64::NAN);
            match self.seen {
                0 => self.energy.0 = energy,
                _ => self.energy.1 = (energy - self.energy.0).abs().max(self.energy.1),
            }
            if self.seen.is_multiple_of(self.stride) {
                self.times.push(piece.t[k]);
                for (values, x) in self.values.iter_mut().zip(state.into_iter().chain([energy])) {
                    values.push(x);
                }
            }
            self.seen += 1;
            if self.times.len() > MOST_CURVE_POINTS {
                self.stride *= 2;
                thin(&mut self.times);
                self.values.iter_mut().for_each(thin);
            }
        }
    }

    /// The quantity that a model without friction conserves along its motion; `None` if its terms do not show one.
    pub fn invariant(&self, model: &dyn EulerLagrange<f64>) -> Option<Invariant> {
        let n = self.columns.len() / 2;
        let states = (0..self.times.len()).step_by(self.times.len().div_ceil(EXAMINED_MOTION_STATES).max(1));
        let part = |columns: Range<usize>| {
            states.clone().flat_map(move |k| self.values[columns.clone()].iter().map(move |values| values[k]))
        };
        let (q, v): (Vec<f64>, Vec<f64>) = (part(0..n).collect(), part(n..2 * n).collect());
        Invariant::of(model, &q, &v).ok().filter(|found| *found != Invariant::Nothing)
    }
}

fn thin(values: &mut Vec<f64>) {
    let mut k = 0;
    values.retain(|_| {
        k += 1;
        k % 2 == 1
    });
}

/// Facts about a roll-out, as one JSON object.
#[derive(Debug, Serialize)]
pub struct Facts<'a> {
    /// Name of the system.
    pub system: &'a str,
    /// Samples written.
    pub samples: usize,
    /// Time of the last sample.
    pub t_end: f64,
    /// Unit of times, if the system is known.
    pub time_unit: Option<&'a str>,
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
    pub events: Option<Vec<Map<String, Value>>>,
    /// Where the motion left the training range.
    pub left_training_range: Option<&'a Leaving>,
    /// Charges of the symmetries along the motion, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub charges: Option<&'a Charges>,
    /// The tube around the coordinates, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tube: Option<TubeFacts<'a>>,
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
        format!("the equations conserve {name}: {start} at the start, largest change {change}\n")
    }
}

impl Facts<'_> {
    /// Describes motion and energy in one line each.
    pub fn text(&self) -> String {
        let unit = self.time_unit.filter(|unit| *unit != "1").map_or(String::new(), |unit| format!(" {unit}"));
        let iterations = self
            .iterations
            .map_or(String::new(), |count| format!(" in {}", pluralize(count, "iteration", "iterations")));
        let work = self.work.map_or(String::new(), |work| format!("forces added {}, ", rounded(work, 10)));
        let impacts = self.impacts.map_or(String::new(), |lost| format!("impacts removed {}, ", rounded(lost, 10)));
        let balance = match (self.energy_change, self.dissipated, self.energy_defect) {
            (Some(change), Some(dissipated), Some(defect)) => format!(
                "energy changed by {}, {work}{impacts}{} removed {}, defect {}\n",
                rounded(change, 10),
                self.taken_by,
                rounded(dissipated, 10),
                rounded(defect, 2)
            ),
            _ => String::new(),
        };
        // The charges already include the energy.
        let kept = self.conserved.as_ref().filter(|_| self.charges.is_none()).map_or(String::new(), Conserved::text);
        let charges = self.charges.map_or(String::new(), Charges::text);
        format!(
            "{} to {} = {}{unit}, {}, {}{iterations}, in {}\n{balance}{kept}{charges}",
            pluralize(self.samples, "sample", "samples"),
            self.parameter,
            self.t_end,
            pluralize(self.steps, "step", "steps"),
            pluralize(self.evaluations, "evaluation", "evaluations"),
            self.out
        )
    }

    /// Formats the facts as one line of JSON.
    ///
    /// # Errors
    /// Numbers that JSON cannot represent.
    pub fn json(&self) -> Result<String, CliError> {
        serde_json::to_string_pretty(self).map(|text| text + "\n").map_err(CliError::data)
    }
}

/// Describes where the samples were written.
pub fn place(out: &Path) -> String {
    if input::is_standard(out) { "standard output".to_string() } else { out.display().to_string() }
}

#[cfg(test)]
mod tests {
    use super::pictures::Texts;
    use super::*;

    #[test]
    fn long_motions_are_thinned_and_watched() {
        let domain = Domain::new(vec![Some((-1.0, 5000.0)), None]);
        let mut watch = MotionRecord::new(domain, &["x".to_string(), "x_dot".to_string()]);
        let piece = |k: usize| Trajectory {
            coordinates: 1,
            t: vec![k as f64],
            q: vec![k as f64],
            v: vec![1.0],
            energy: Some(vec![0.5]),
        };
        (0..10_001).for_each(|k| watch.add(&piece(k)));
        assert!(watch.times.len() <= MOST_CURVE_POINTS + 1 && watch.times.len() > MOST_CURVE_POINTS / 2);
        assert!(watch.times.windows(2).all(|t| t[1] - t[0] == watch.stride as f64) && watch.times[0] == 0.0);
        let leaving = watch.leaving.as_ref().unwrap();
        assert_eq!((leaving.t, leaving.column.as_str(), leaving.trained_on), (5001.0, "x", [-1.0, 5000.0]));
        let directory = tempfile::tempdir().unwrap();
        let [svg, page] = ["a.svg", "a.html"].map(|name| directory.path().join(name));
        let units = ["m", "m/s"].map(String::from);
        let texts = |parameter, energy| Texts { title: "Motion", parameter, energy, units: &units };
        watch.plot(&svg, &texts("time [s]", "energy"), None).unwrap();
        watch.plot(&page, &texts("affine parameter", "g(v, v)/2"), None).unwrap();
        assert!(std::fs::read(&svg).unwrap().starts_with(b"<svg"));
        let page = std::fs::read_to_string(&page).unwrap();
        assert!(page.contains("g(v, v)/2 of the model against affine parameter") && !page.contains("nergy"), "{page}");
        assert_eq!(watch.energy, (0.5, 0.0));
        assert!(page.matches("<figure").count() == 3 && page.contains("left the training range at t = 5001"));
        assert!(page.contains(">x [m]</text>") && page.contains(">x_dot [m/s]</text>"));
    }
}
