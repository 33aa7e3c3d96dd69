//! Tables of the ranges in which the data determine mass matrix, friction and energy of the model of `lnn fit`.

use crate::analysis::{
    Decay, Determination, EnergyLoss, Estimate, MOST_MISFIT, Observed, constants, decay, determination, energy_loss,
    misfit,
};
use crate::data::RecordingSplit;
use crate::findings::Findings;
use crate::lagrangian::EulerLagrange;
use crate::names::{number, percent};
use crate::network::NetworkLagrangian;
use crate::pipeline::PipelineError;
use crate::pipeline::hold_out::HoldOut;
use crate::pipeline::thresholds::{DETERMINED, MISFIT_OF_ENERGY, MOST_OUTSIDE, MOSTLY_OUTSIDE};
use crate::recording::Targets;
use serde::Serialize;
use std::collections::BTreeMap;

/// One quantity and its range.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    name: String,
    /// `true` for a mass, that is, a diagonal element.
    #[serde(skip)]
    mass: bool,
    learned: f64,
    /// Bounds of the range; not finite if the data do not determine the quantity.
    low: f64,
    high: f64,
    determined: &'static str,
}

/// A group of coordinates that interact with each other and with no others.
#[derive(Clone, Debug, Serialize)]
pub struct Group {
    coordinates: Vec<String>,
    /// `true` if the unit of its masses is known: from the first coordinate, or from a force.
    unit_known: bool,
}

/// The full report.
#[derive(Clone, Debug, Serialize)]
pub struct Determined {
    /// Mass matrix, friction and energy with their ranges; empty if no range is known.
    determination: Vec<Quantity>,
    /// The unit of mass matrix, friction and energy: `SI` with known forces, otherwise relative to the mean mass of a coordinate.
    unit: String,
    /// Groups of coordinates that do not interact with each other, if there are several: each has its own factor.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    groups: Vec<Group>,
    /// For every coordinate, the part of the acceleration residuals that exceeds the expected error, relative to the size of the
    /// acceleration: on held-out motion, or on training motion if nothing was held out. Empty if the model is not finite.
    misfit: BTreeMap<String, f64>,
    /// Share of the held-out states that lie outside the training states.
    #[serde(skip_serializing_if = "Option::is_none")]
    outside: Option<f64>,
    /// Why no ranges are reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    withheld: Option<String>,
    /// Learned constants of the known part of a grey box with their ranges.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    constant_ranges: BTreeMap<String, Estimate>,
    /// Loss of energy along recorded motion of several coordinates, for a model without friction.
    #[serde(skip_serializing_if = "Option::is_none")]
    energy_loss: Option<EnergyLoss>,
    /// Decay of recorded motion of one coordinate, for a model without friction.
    #[serde(skip_serializing_if = "Option::is_none")]
    decay: Option<Decay>,
}

/// Names of quantities and of statements about them.
const ENERGY: &str = "rms E about its mean";
const UNIT: &str = "the unit";
const NOT: &str = "not";

impl Quantity {
    /// Creates a quantity whose range is compared with `size`; `positive` excludes negative values.
    fn new(name: String, estimate: &Estimate, size: f64, positive: bool) -> Self {
        let Estimate { value: learned, low, high } = *estimate;
        let relative = 0.5 * (high - low) / size;
        let determined = DETERMINED.iter().find(|(most, _)| relative <= *most).map_or(NOT, |(_, word)| word);
        let low = if positive && low.is_finite() { low.max(0.0) } else { low };
        Self { name, mass: false, learned, low, high, determined }
    }
}

impl Determined {
    /// Analyses a model of recorded motion that was tested by `hold_out`.
    ///
    /// # Errors
    /// [`PipelineError::Recording`] if the training states cannot be obtained again.
    pub(crate) fn new(
        model: &NetworkLagrangian<f64>,
        (measured, targets): (&RecordingSplit, Targets),
        hold_out: &HoldOut,
        threads: usize,
    ) -> Result<Self, PipelineError> {
        let recording = &measured.training.recording;
        let (names, periodic) = (&recording.coordinates, &recording.periodic);
        let mut observed = Observed::new(measured, targets)?;
        let held_out = Observed::held_out(measured, targets)?;
        let missed = misfit(model, held_out.as_ref().unwrap_or(&observed));
        if held_out.is_some() {
            observed.missed = missed.clone().unwrap_or_default();
        }
        let outside = held_out.as_ref().map(|held_out| observed.share_outside(held_out, periodic));
        let misfit: BTreeMap<_, _> = names.iter().cloned().zip(missed.into_iter().flatten()).collect();
        let withheld = withheld(&misfit, hold_out, held_out.is_some());
        let found = if withheld.is_none() { determination(model, periodic, &observed) } else { None };
        let named = |(group, unit_known): &(Vec<usize>, bool)| Group {
            coordinates: group.iter().map(|&i| names[i].clone()).collect(),
            unit_known: *unit_known,
        };
        let groups =
            found.iter().filter(|found| found.groups.len() > 1).flat_map(|found| found.groups.iter().map(named));
        let groups = groups.collect();
        let unit = match observed.force.is_empty() {
            false => "SI".to_string(),
            true => format!("mean mass of {}", names[0]),
        };
        let conserves = model.conserves_energy();
        let constants = if withheld.is_none() { constants(model, measured, threads) } else { None };
        Ok(Self {
            determination: found.map(|found| quantities(&found, names)).unwrap_or_default(),
            unit,
            groups,
            misfit,
            outside,
            withheld,
            constant_ranges: constants.unwrap_or_default(),
            energy_loss: if conserves && names.len() > 1 { energy_loss(model, &measured.training) } else { None },
            decay: if conserves { decay(periodic, &observed) } else { None },
        })
    }

    /// Result for a model under constraints: parts of its mass matrix across the constraints do not affect the motion, so they do not count
    /// as errors.
    pub(crate) fn under_constraints() -> Self {
        Self {
            determination: Vec::new(),
            unit: String::new(),
            groups: Vec::new(),
            misfit: BTreeMap::new(),
            outside: None,
            withheld: Some("across the constraints no motion determines the mass matrix".to_string()),
            constant_ranges: BTreeMap::new(),
            energy_loss: None,
            decay: None,
        }
    }

    /// Explains why no mass is determined; `None` if one is. For one coordinate without known forces the mass is the unit, and the energy
    /// takes its place.
    pub(crate) fn no_mass(&self) -> Option<String> {
        if let Some(reason) = &self.withheld {
            return Some(format!("whether the data determine a mass is unknown: {reason}"));
        }
        let several = self.determination.iter().filter(|q| q.mass).count() > 1;
        let judged = |q: &&Quantity| {
            let looked_at = if several || self.unit == "SI" { q.mass } else { q.name == ENERGY };
            looked_at && ![UNIT, NOT].contains(&q.determined)
        };
        let found = self.determination.iter().find(judged);
        found.is_none().then(|| "the data determine no mass".to_string())
    }

    /// Explains why the motion does not determine an element of the mass matrix; `None` if it does.
    pub(crate) fn open_mass(&self, [a, b]: [&str; 2]) -> Option<String> {
        let free = |group: &Group| !group.unit_known && group.coordinates.iter().any(|name| name == a || name == b);
        let apart = if self.groups.iter().any(free) { self.apart() } else { None };
        apart.or_else(|| self.open(&mass_name(a, b)))
    }

    /// Explains why the motion does not determine the potential; `None` if it determines the energy.
    pub(crate) fn open_potential(&self) -> Option<String> {
        self.apart().or_else(|| self.open(ENERGY))
    }

    /// Explains why the motion does not determine the friction of a coordinate; `None` if it does.
    pub(crate) fn open_friction(&self, coordinate: &str) -> Option<String> {
        self.open(&friction_name(coordinate))
    }

    /// Explains why no ranges are known; `None` if they are.
    pub(crate) fn unknown(&self) -> Option<String> {
        self.withheld.as_ref().map(|reason| format!("whether the motion determines it is unknown: {reason}."))
    }

    /// Explains why a quantity is not determined.
    fn open(&self, name: &str) -> Option<String> {
        let wide = || {
            let quantity = self.determination.iter().find(|q| q.name == name && q.determined == NOT)?;
            let range = match [quantity.low, quantity.high] {
                ends if ends.iter().all(|end| end.is_finite()) => {
                    format!("the range of {name} is {}", ends.map(number).join(" to "))
                }
                _ => format!("{name} has no bounds"),
            };
            Some(format!("the motion does not determine it: {range}."))
        };
        self.unknown().or_else(wide)
    }

    /// Share of the held-out states that lie outside the training states, if it is most of them.
    pub(crate) fn mostly_outside(&self) -> Option<f64> {
        self.outside.filter(|share| *share > MOSTLY_OUTSIDE)
    }

    /// A remark for standard error if the data indicate friction.
    pub fn suggestion(&self) -> Option<String> {
        if let Some(decay) = self.decay.filter(Decay::is_certain) {
            return Some(format!(
                "the recorded motion decays, by {} per second of its velocity (standard error {}), which no force of the \
                 coordinate explains: friction? --friction learns it",
                number(decay.rate),
                number(decay.error)
            ));
        }
        // The energy of a model that does not explain the motion gives no information about it.
        let explained = !self.misfit.is_empty() && self.misfit.values().all(|misfit| *misfit <= MISFIT_OF_ENERGY);
        let loss = self.energy_loss.filter(EnergyLoss::is_steady).filter(|_| explained)?;
        Some(format!(
            "the recorded motion loses energy steadily, {:.2} of its mean kinetic energy per second, in {:.0} % of {} \
             stretches: friction? --friction learns it",
            loss.per_second,
            100.0 * loss.losing,
            loss.stretches
        ))
    }

    /// Range of a constant of the known part, if it is learned and the range is valid.
    pub(crate) fn constant(&self, name: &str) -> Option<&Estimate> {
        self.constant_ranges.get(name)
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

    fn about(&self) -> [String; 2] {
        let unit = match self.unit.as_str() {
            "SI" => "In SI units, which the known forces fix.".to_string(),
            unit => format!("Relative to the {unit}: without known forces (--force) L has no unit."),
        };
        let meaning = "How well the data determine the model, averaged over the learned states: ranges contain the true value \
                       in about 9 cases of 10.";
        [meaning.to_string(), unit]
    }

    /// Explains in a sentence why there is no table.
    fn nothing(&self) -> String {
        match &self.withheld {
            Some(reason) => format!("How well the data determine the model is not stated: {reason}."),
            None => "How well the data determine mass matrix, friction and energy could not be estimated.".to_string(),
        }
    }

    /// A remark on groups of coordinates whose masses have a common factor that the motion does not determine.
    fn apart(&self) -> Option<String> {
        let free = self.groups.iter().filter(|group| !group.unit_known);
        let free: Vec<String> = free.map(|group| group.coordinates.join(", ")).collect();
        let move_by = |one: &str| if one.contains(", ") { "are decoupled" } else { "is decoupled" };
        let parts: Vec<String> = free.iter().map(|one| format!("{one} {}", move_by(one))).collect();
        (!parts.is_empty()).then(|| {
            format!(
                "{}: no motion determines the factor of that part of L, so that its learned masses, friction and energy have an arbitrary factor \
                 relative to those of the other coordinates.",
                parts.join("; ")
            )
        })
    }

    /// A remark on held-out states outside the training states.
    fn beyond(&self) -> Option<String> {
        let share = self.outside.filter(|share| *share > MOST_OUTSIDE)?;
        Some(format!(
            "{} of the held-out states lie outside the learned ones; these figures do not hold there.",
            percent(share)
        ))
    }

    /// The ranges with remarks, or the reason why there are none.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        findings.heading("What the data determine");
        if self.determination.is_empty() {
            findings.line(self.nothing());
        } else {
            findings.lines(self.about()).table(&self.headers(), self.rows());
        }
        findings.lines(self.apart().into_iter().chain(self.beyond()).chain(self.suggestion()));
        findings
    }
}

/// Explains why ranges would be invalid, namely if the residuals are not noise.
fn withheld(misfit: &BTreeMap<String, f64>, hold_out: &HoldOut, held_out: bool) -> Option<String> {
    let motion = if held_out { "held-out motion" } else { "the motion" };
    let Some((name, worst)) = misfit.iter().max_by(|a, b| a.1.total_cmp(b.1)) else {
        return Some(format!("the model is not finite on {motion}"));
    };
    if *worst > MOST_MISFIT || worst.is_nan() {
        let missed = percent(*worst);
        return Some(format!(
            "on {motion} the model misses {missed} of the acceleration of {name} beyond the error of the data, and ranges are valid \
             only where the residual is noise"
        ));
    }
    let lost: Vec<&str> = hold_out.force_errors.iter().filter(|e| e.is_lost()).map(|e| e.name.as_str()).collect();
    if !lost.is_empty() {
        return Some(format!("on {motion} the model does not give the force of {}", lost.join(", ")));
    }
    let fails = hold_out.is_better() == Some(false);
    fails.then(|| format!("the model predicts {motion} no better than constant velocity"))
}

/// Name of an element of the mass matrix in the table.
fn mass_name(a: &str, b: &str) -> String {
    format!("mean M[{a},{b}]")
}

/// Name of the friction of a coordinate in the table.
fn friction_name(coordinate: &str) -> String {
    format!("friction of {coordinate}")
}

fn quantities(found: &Determination, names: &[String]) -> Vec<Quantity> {
    let n = names.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect();
    let diagonal: Vec<f64> =
        pairs.iter().zip(&found.mass_matrix).filter(|((i, j), _)| i == j).map(|(_, estimate)| estimate.value).collect();
    let mass = pairs.iter().zip(&found.mass_matrix).map(|(&(i, j), estimate)| {
        let name = mass_name(&names[i], &names[j]);
        let size = (diagonal[i] * diagonal[j]).abs().sqrt();
        Quantity { mass: i == j, ..Quantity::new(name, estimate, size, i == j && estimate.value > 0.0) }
    });
    let friction = names
        .iter()
        .zip(&found.friction)
        .map(|(name, estimate)| Quantity::new(friction_name(name), estimate, estimate.value.abs(), true));
    let mut mass: Vec<Quantity> = mass.collect();
    if let Some(unit) = mass.first_mut().filter(|_| !found.absolute) {
        unit.determined = UNIT;
    }
    let energy = Quantity::new(ENERGY.to_string(), &found.energy, found.energy.value, true);
    mass.into_iter().chain(friction).chain([energy]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_open_is_said_with_its_reason() {
        let estimate = |value: f64, half: f64| Estimate { value, low: value - half, high: value + half };
        let quantity = |name: &str, half: f64| Quantity::new(name.to_string(), &estimate(1.0, half), 1.0, false);
        let group = |name: &str, unit_known: bool| Group { coordinates: vec![name.to_string()], unit_known };
        let found = Determined {
            determination: vec![quantity(&mass_name("x", "x"), 0.1), quantity(&mass_name("x", "y"), 9.0)],
            withheld: None,
            ..Determined::under_constraints()
        };
        assert_eq!(found.open_mass(["x", "x"]), None);
        assert!(found.open_mass(["x", "y"]).is_some_and(|why| why.contains("-8.00 to 10.0")));
        assert_eq!((found.open_mass(["y", "y"]), found.open_potential()), (None, None));
        // A part with a factor of its own.
        let apart = Determined { groups: vec![group("x", true), group("y", false)], ..found.clone() };
        assert_eq!(apart.open_mass(["x", "x"]), None);
        assert!(apart.open_mass(["y", "y"]).is_some() && apart.open_potential().is_some());
        // An energy that is open, and a model about which nothing is known.
        let energy = Determined { determination: vec![quantity(ENERGY, 2.0)], ..found };
        assert!(energy.open_potential().is_some());
        let nothing = Determined::under_constraints();
        assert!(nothing.open_mass(["x", "x"]).is_some() && nothing.open_potential().is_some());
        assert!(nothing.open_friction("x").is_some() && nothing.unknown().is_some());
    }
}
