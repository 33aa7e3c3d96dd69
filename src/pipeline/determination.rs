//! Tables of the ranges in which the data determine mass matrix, friction and energy of the model of `lnn fit`.

use crate::analysis::{Determination, EnergyLoss, Estimate, Observed, determination, energy_loss, places};
use crate::data::RecordingSplit;
use crate::lagrangian::EulerLagrange;
use crate::names::number;
use crate::pipeline::PipelineError;
use crate::recording::Targets;
use crate::report::{Report, text_table};
use serde::Serialize;

/// One quantity and its range.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    name: String,
    learned: f64,
    low: f64,
    high: f64,
    determined: &'static str,
}

/// Everything there is to say.
#[derive(Clone, Debug, Serialize)]
pub struct Determined {
    /// Mass matrix, friction and energy with their ranges; empty if nothing can be said.
    determination: Vec<Quantity>,
    /// The unit of mass matrix, friction and energy: `SI` with known forces, else over the mean mass of a coordinate.
    unit: String,
    /// Loss of energy along recorded motion, for a model without friction.
    #[serde(skip_serializing_if = "Option::is_none")]
    energy_loss: Option<EnergyLoss>,
}

/// Half of the range over the size: up to which a quantity is said to be determined.
const WORDS: [(f64, &str); 3] = [(0.1, "well"), (0.5, "roughly"), (1.0, "poorly")];

impl Quantity {
    /// A quantity that is compared with a `size` and is not negative, if `positive`.
    fn new(name: String, estimate: &Estimate, size: f64, positive: bool) -> Self {
        let [low, high] = estimate.range();
        let relative = 0.5 * (high - low) / size;
        let determined = WORDS.iter().find(|(most, _)| relative <= *most).map_or("not", |(_, word)| word);
        let low = if positive { low.max(0.0) } else { low };
        Self { name, learned: estimate.value, low, high, determined }
    }
}

impl Determined {
    /// Looks at a model of recorded motion.
    ///
    /// # Errors
    /// [`PipelineError::Recording`] if the states that were learned from cannot be had again.
    pub fn new(
        model: &dyn EulerLagrange<f64>,
        measured: &RecordingSplit,
        targets: Targets,
    ) -> Result<Self, PipelineError> {
        let recording = &measured.training.recording;
        let names = &recording.coordinates;
        let observed = Observed::new(measured, targets)?;
        let (q, v) = places(measured);
        let found = determination(model, &recording.periodic, &observed, (&q, &v));
        let unit = match &found {
            Some(found) if found.absolute => "SI".to_string(),
            _ => format!("mean mass of {}", names[0]),
        };
        let energy_loss = if model.conserves_energy() { energy_loss(model, &measured.training) } else { None };
        Ok(Self { determination: found.map(|found| quantities(&found, names)).unwrap_or_default(), unit, energy_loss })
    }

    /// A remark on standard error, if the data ask for friction.
    pub fn suggestion(&self) -> Option<String> {
        let loss = self.energy_loss.filter(EnergyLoss::is_steady)?;
        Some(format!(
            "the recorded motion loses energy steadily, {:.2} of its mean kinetic energy per second, in {:.0} % of {} \
             stretches: friction? --friction learns it",
            loss.per_second,
            100.0 * loss.losing,
            loss.stretches
        ))
    }

    fn headers(&self) -> [String; 5] {
        let unit = if self.unit == "SI" { "SI" } else { "relative" };
        let [learned, from, to] = ["learned", "from", "to"].map(|name| format!("{name} [{unit}]"));
        ["quantity".to_string(), learned, from, to, "determined".to_string()]
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let row = |q: &Quantity| {
            let numbers = [q.learned, q.low, q.high].map(number);
            [vec![q.name.clone()], numbers.to_vec(), vec![q.determined.to_string()]].concat()
        };
        self.determination.iter().map(row).collect()
    }

    fn about(&self) -> String {
        let unit = match self.unit.as_str() {
            "SI" => "In SI units, which the known forces fix.".to_string(),
            unit => format!("Relative to the {unit}: without known forces (--force) L has no unit."),
        };
        format!("How well the data determine the model: ranges hold the truth in 19 cases of 20.\n{unit}")
    }

    /// For a terminal.
    pub fn text(&self) -> String {
        if self.determination.is_empty() {
            return "how well the data determine mass matrix, friction and energy cannot be said here\n".to_string();
        }
        format!("\n{}\n{}", self.about(), text_table(&self.headers(), &self.rows()))
    }

    /// Adds the table to a report.
    pub fn report(&self, report: Report) -> Report {
        let report = report.heading("What the data determine");
        let report = if self.determination.is_empty() {
            report.paragraph(&self.text())
        } else {
            report.paragraph(&self.about()).table(&self.headers(), &self.rows())
        };
        match self.suggestion() {
            Some(text) => report.paragraph(&text),
            None => report,
        }
    }
}

fn quantities(found: &Determination, names: &[String]) -> Vec<Quantity> {
    let n = names.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect();
    let diagonal: Vec<f64> =
        pairs.iter().zip(&found.mass_matrix).filter(|((i, j), _)| i == j).map(|(_, estimate)| estimate.value).collect();
    let mass = pairs.iter().zip(&found.mass_matrix).map(|(&(i, j), estimate)| {
        let name = format!("mean M[{},{}]", names[i], names[j]);
        let size = (diagonal[i] * diagonal[j]).abs().sqrt();
        Quantity::new(name, estimate, size, i == j && estimate.value > 0.0)
    });
    let friction = names
        .iter()
        .zip(&found.friction)
        .map(|(name, estimate)| Quantity::new(format!("friction of {name}"), estimate, estimate.value.abs(), true));
    let mut mass: Vec<Quantity> = mass.collect();
    if let Some(unit) = mass.first_mut().filter(|_| !found.absolute) {
        unit.determined = "the unit";
    }
    let energy = Quantity::new("rms E about its mean".to_string(), &found.energy, found.energy.value, true);
    mass.into_iter().chain(friction).chain([energy]).collect()
}
