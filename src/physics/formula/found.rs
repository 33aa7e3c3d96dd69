//! A formula that was found, and its output formats.

use super::error::FormulaError;
use super::find::FormulaOptions;
use super::function::Notation;
use super::library::{Library, blocks};
use super::motion::Model;
use super::units::{Dimension, Units, of_coefficient};
use crate::identification::linear::{inverse, part};
use crate::identification::{Between, ResidualPath};
use crate::linalg::dot;
use serde::Serialize;
use std::collections::BTreeMap;

/// Whether the library contains the Lagrangian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// The formula fits the held-out motion within its noise.
    #[serde(rename = "found")]
    Found,
    /// The library does not contain the Lagrangian.
    #[serde(rename = "not in the library")]
    NotInLibrary,
    /// Residuals are small, but may not confirm the formula.
    #[serde(rename = "undecided")]
    Undecided,
}

/// Another formula that was tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rival {
    /// Its terms.
    pub terms: Vec<String>,
    /// Its additional cost: the sum of squares over the noise variance, and 30 for every term.
    pub cost: f64,
}

/// A simple fraction near a coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Near {
    /// The fraction, such as `1/6`.
    pub fraction: String,
    /// By how much the coefficient is larger, over its standard error; 0 where both are equal.
    pub standard_errors: f64,
}

/// A term with its coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundTerm {
    /// The term in the grammar of system files.
    pub term: String,
    /// Its coefficient.
    pub coefficient: f64,
    /// Standard error of the coefficient; 0 for the one that fixes the common factor.
    pub standard_error: f64,
    /// Name of the constant that equals the coefficient or its negative: coefficients that are equal share a name.
    pub constant: String,
    /// Unit of the coefficient; none if the function of the term contains a constant with a unit.
    pub unit: Option<String>,
    /// Share of the bootstrap samples in which it was chosen.
    pub probability: f64,
    /// `true` for a term of Rayleigh's dissipation function, `false` for one of the Lagrangian.
    pub dissipation: bool,
    /// A simple fraction within the error of the coefficient, if there is one.
    pub near: Option<Near>,
    /// Index of the term of its block whose coefficient is fixed, if there is one.
    #[serde(skip)]
    reference: Option<usize>,
    /// Coefficients of bootstrap samples in which terms were chosen again.
    #[serde(skip)]
    drawn: Vec<f64>,
    /// Coordinates that it joins.
    #[serde(skip)]
    joined: Vec<usize>,
    #[serde(skip)]
    dimension: Option<Dimension>,
    #[serde(skip)]
    latex: String,
    #[serde(skip)]
    rust: String,
}

/// Residuals in a part of the range of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Left {
    /// Index of the coordinate.
    pub coordinate: usize,
    /// Lower end of the part.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Root mean square residual over noise.
    pub residual: f64,
    /// Samples in it.
    pub samples: usize,
}

/// A formula of the Lagrangian, and of the dissipation function if there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundFormula {
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// Which of them are angles.
    pub periodic: Vec<bool>,
    /// Whether the formula fits the held-out motion.
    pub verdict: Verdict,
    /// Its terms.
    pub terms: Vec<FoundTerm>,
    /// Root mean square of the held-out residual over the noise: 1 if only noise remains.
    pub residual: f64,
    /// Noise of every coordinate that scales the residual.
    pub noise: Vec<f64>,
    /// `false` if the noise and the motion could not be separated: the noise given is then an upper bound.
    pub noise_resolved: bool,
    /// Residuals by parts of the ranges of coordinates.
    pub left: Vec<Left>,
    /// Terms searched, and how many of them were removed as total derivatives and identities.
    pub searched: (usize, usize),
    /// Families of functions in the library of the formula.
    pub basis: String,
    /// All families that were searched.
    pub tried: Vec<String>,
    /// Groups of decoupled coordinates: without known forces, each has a common factor that is not determined.
    pub blocks: Vec<Vec<String>>,
    /// The next best formula; `several` if it is as good.
    pub rival: Option<Rival>,
    /// `true` if other formulas fit the motion equally well.
    pub several: bool,
    /// Why the verdict is in doubt.
    pub doubts: Vec<String>,
    /// Other notes about the search.
    pub notes: Vec<String>,
    /// Interpolation of known forces between the samples.
    pub between: Option<Between>,
    /// `true` if the formula is that of a model, not of recorded motion.
    pub of_model: bool,
    /// `true` if a dissipation function was searched.
    pub friction: bool,
    /// Seed of the random choices.
    pub seed: u64,
    /// Held-out motion, measured and followed; empty for the formula of a model.
    pub paths: Vec<ResidualPath>,
    /// Coordinates with known forces.
    pub(super) forced: Vec<bool>,
    pub(super) bounds: Vec<[f64; 2]>,
    pub(super) speeds: Vec<f64>,
    covariance: Vec<f64>,
    /// Units of the coordinates, empty if they are not known, and of time.
    units: (Vec<String>, String),
}

/// A formula with the texts made from it, as JSON.
#[derive(Clone, Debug, Serialize)]
pub struct FormulaSummary<'a> {
    verdict: Verdict,
    lagrangian: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    dissipation: Option<String>,
    latex: [String; 2],
    rust: String,
    toml: String,
    coordinates: &'a [String],
    terms: &'a [FoundTerm],
    residual: f64,
    noise: &'a [f64],
    noise_resolved: bool,
    searched: usize,
    removed: usize,
    basis: &'a str,
    tried: &'a [String],
    blocks: &'a [Vec<String>],
    rival: Option<&'a Rival>,
    several: bool,
    doubts: &'a [String],
    notes: &'a [String],
    forces_between_samples: Option<Between>,
    left: &'a [Left],
    seed: u64,
}

impl FoundFormula {
    /// The formula of a model from a library, with the covariance of its coefficients and the probabilities of its terms.
    pub(super) fn new(
        library: &Library,
        periodic: &[bool],
        model: &Model,
        (covariance, probabilities): (&[f64], &[f64]),
        options: &FormulaOptions,
    ) -> Self {
        let units = Units::new(&options.units, &options.time_unit, periodic);
        let m = model.terms.len();
        let terms = model.terms.iter().zip(&model.coefficients).enumerate();
        let mut order: Vec<(usize, FoundTerm)> = terms
            .map(|(at, (&k, &coefficient))| {
                let term = FoundTerm {
                    term: library.written(k, Notation::System),
                    coefficient,
                    standard_error: covariance[at * m + at].max(0.0).sqrt(),
                    probability: probabilities[at].clamp(0.0, 1.0),
                    dissipation: library.is_dissipation(k),
                    constant: String::new(),
                    unit: None,
                    near: None,
                    reference: None,
                    drawn: Vec::new(),
                    joined: library.coordinates(k),
                    dimension: units.of_term(library, k),
                    latex: library.written(k, Notation::Latex),
                    rust: library.written(k, Notation::Rust),
                };
                (at, term)
            })
            .collect();
        // Kinetic terms first, then potential ones, then the dissipation.
        let rank = |at: usize| (library.is_dissipation(model.terms[at]), library.kinetic(model.terms[at]).is_none());
        order.sort_by_key(|(at, term)| (rank(*at), term.term.len(), term.term.clone()));
        let covariance = order
            .iter()
            .flat_map(|(i, _)| order.iter().map(|(j, _)| covariance[i * m + j]).collect::<Vec<_>>())
            .collect();
        Self {
            coordinates: library.names.clone(),
            periodic: periodic.to_vec(),
            verdict: Verdict::NotInLibrary,
            terms: order.iter().map(|(_, term)| term.clone()).collect(),
            residual: f64::NAN,
            noise: Vec::new(),
            noise_resolved: true,
            left: Vec::new(),
            searched: (library.searched, 0),
            basis: String::new(),
            tried: Vec::new(),
            blocks: Vec::new(),
            rival: None,
            several: false,
            doubts: Vec::new(),
            notes: Vec::new(),
            between: None,
            of_model: false,
            friction: options.friction,
            seed: options.seed,
            paths: Vec::new(),
            forced: vec![false; library.n()],
            bounds: Vec::new(),
            speeds: Vec::new(),
            covariance,
            units: (options.units.clone(), options.time_unit.clone()),
        }
    }

    /// Takes over the coefficients of bootstrap samples, by the terms of the library.
    pub(super) fn draw(&mut self, library: &Library, model: &Model, coefficients: &BTreeMap<usize, Vec<f64>>) {
        for &k in &model.terms {
            let text = library.written(k, Notation::System);
            let own = |t: &&mut FoundTerm| t.term == text && t.dissipation == library.is_dissipation(k);
            if let (Some(term), Some(drawn)) = (self.terms.iter_mut().find(own), coefficients.get(&k)) {
                term.drawn.clone_from(drawn);
            }
        }
    }

    /// Standard deviation of a term's coefficient over the bootstrap samples, relative to a reference, which then has the value `value`.
    fn scatter(&self, k: usize, reference: Option<(usize, f64)>) -> f64 {
        let own = &self.terms[k].drawn;
        let values: Vec<f64> = match reference {
            None => own.clone(),
            Some((at, value)) => {
                let pairs = own.iter().zip(&self.terms[at].drawn).filter(|(_, base)| **base != 0.0);
                pairs.map(|(x, base)| x * value / base).collect()
            }
        };
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count.max(1.0);
        (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0)).sqrt()
    }

    /// Fixes the common factor of every block of coordinates without a known force: a term gets the given coefficient, or the first square of a
    /// velocity gets 1/2.
    pub(super) fn rescale(&mut self, scale: Option<&(String, f64)>) -> Result<(), FormulaError> {
        let plain = |text: &str| text.chars().filter(|c| !c.is_whitespace()).collect::<String>();
        let given = match scale {
            Some((term, value)) => {
                let at = self.terms.iter().position(|known| plain(&known.term) == plain(term));
                let known = || self.terms.iter().map(|t| t.term.as_str()).collect::<Vec<_>>().join(", ");
                Some((at.ok_or_else(|| FormulaError::Scale { term: term.clone(), known: known() })?, *value))
            }
            None => None,
        };
        let blocks = blocks(self.coordinates.len(), self.terms.iter().map(|t| t.joined.as_slice()));
        let named = |block: &Vec<usize>| block.iter().map(|&i| self.coordinates[i].clone()).collect();
        self.blocks = blocks.iter().map(named).collect();
        let mut references: Vec<(usize, f64)> = Vec::new();
        for block in &blocks {
            let own = |at: usize| self.terms[at].joined.iter().any(|i| block.contains(i));
            let forced = block.iter().any(|&i| self.forced[i]);
            let reference = match given.filter(|(at, _)| own(*at)) {
                None if forced => continue,
                None => self.first_square(block).or_else(|| {
                    let first = (0..self.terms.len()).find(|&at| !self.terms[at].dissipation && own(at));
                    first.map(|at| (at, 0.5))
                }),
                given => given,
            };
            let Some((reference, value)) = reference else { continue };
            references.push((reference, value));
            (0..self.terms.len()).filter(|&at| own(at)).collect::<Vec<_>>().into_iter().for_each(|at| {
                self.terms[at].reference = Some(reference);
            });
        }
        self.relate(&references);
        Ok(())
    }

    /// The first square of a velocity of a block, and 1/2 or -1/2: the sign that makes most of its squares positive, since a time coordinate has
    /// the opposite sign of the spatial ones.
    fn first_square(&self, block: &[usize]) -> Option<(usize, f64)> {
        let square = |&i: &usize| {
            let text = format!("{}_dot^2", self.coordinates[i]);
            self.terms.iter().position(|t| !t.dissipation && t.term == text)
        };
        let first = block.iter().find_map(square)?;
        let signs: f64 = block.iter().filter_map(square).map(|at| self.terms[at].coefficient.signum()).sum();
        Some((first, if signs * self.terms[first].coefficient < 0.0 { -0.5 } else { 0.5 }))
    }

    /// Expresses coefficients as ratios to the references of their blocks, with their covariance.
    fn relate(&mut self, references: &[(usize, f64)]) {
        let m = self.terms.len();
        let x: Vec<f64> = self.terms.iter().map(|t| t.coefficient).collect();
        let of = |k: usize| {
            let at = self.terms[k].reference?;
            let value = references.iter().find(|(reference, _)| *reference == at)?.1;
            Some((at, value / x[at]))
        };
        // The derivatives of x_k value / x_at.
        let slopes = |k: usize| match of(k) {
            None => vec![(k, 1.0)],
            Some((at, _)) if at == k => vec![],
            Some((at, factor)) => vec![(k, factor), (at, -x[k] * factor / x[at])],
        };
        let slopes: Vec<Vec<(usize, f64)>> = (0..m).map(slopes).collect();
        let old = &self.covariance;
        let element = |k: usize, l: usize| -> f64 {
            slopes[k].iter().flat_map(|(i, a)| slopes[l].iter().map(move |(j, b)| a * old[i * m + j] * b)).sum()
        };
        let mut covariance: Vec<f64> = (0..m * m).map(|e| element(e / m, e % m)).collect();
        // No standard error is smaller than the scatter over bootstrap samples that choose the terms again.
        let wider = |k: usize| {
            let reference = self.terms[k].reference.and_then(|at| references.iter().find(|(known, _)| *known == at));
            let (own, drawn) = (covariance[k * m + k].max(0.0).sqrt(), self.scatter(k, reference.copied()));
            if own > 0.0 { (drawn / own).max(1.0) } else { 1.0 }
        };
        let wider: Vec<f64> = (0..m).map(wider).collect();
        covariance.iter_mut().enumerate().for_each(|(e, x)| *x *= wider[e / m] * wider[e % m]);
        let factors: Vec<f64> = (0..m).map(|k| of(k).map_or(1.0, |(_, factor)| factor)).collect();
        self.covariance = covariance;
        for (k, term) in self.terms.iter_mut().enumerate() {
            term.coefficient *= factors[k];
            term.standard_error = self.covariance[k * m + k].max(0.0).sqrt();
        }
        for &(at, value) in references {
            self.terms[at].coefficient = value;
        }
    }

    /// Sets the units of coefficients, one name for equal coefficients, and fractions near them.
    pub(super) fn name_constants(&mut self) {
        let dimensions: Vec<Option<Dimension>> = self.terms.iter().map(|t| t.dimension.clone()).collect();
        for term in &mut self.terms {
            term.unit = match term.reference.map(|at| &dimensions[at]) {
                Some(None) => None,
                known => of_coefficient(term.dimension.as_ref(), known.and_then(Option::as_ref)),
            };
        }
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for k in 0..self.terms.len() {
            match groups.iter_mut().find(|group| self.equal(group[0], k)) {
                Some(group) => group.push(k),
                None => groups.push(vec![k]),
            }
        }
        // A letter that, followed by a number, is not the name of a coordinate.
        let letter =
            ['c', 'k', 'w'].into_iter().find(|letter| !self.coordinates.iter().any(|q| q.starts_with(*letter)));
        for (number, group) in groups.iter().enumerate() {
            let (value, error) = self.common(group);
            for &k in group {
                let term = &mut self.terms[k];
                term.constant = format!("{}{}", letter.unwrap_or('z'), number + 1);
                (term.coefficient, term.standard_error) = (value.copysign(term.coefficient), error);
                term.near = near(term.coefficient, error);
            }
        }
    }

    /// `true` if two coefficients are the same constant or its negative: in the same block, with the same unit, equal within their errors, and
    /// not by chance.
    fn equal(&self, a: usize, b: usize) -> bool {
        const ACCIDENT: f64 = 5e-3;
        let (m, [x, y]) = (self.terms.len(), [a, b].map(|k| &self.terms[k]));
        let sign = x.coefficient.signum() * y.coefficient.signum();
        let covariance = |i: usize, j: usize| self.covariance[i * m + j];
        let variance = covariance(a, a) + covariance(b, b) - 2.0 * sign * covariance(a, b);
        let (size, error) = (x.coefficient.abs(), variance.max(0.0).sqrt() + 1e-9 * x.coefficient.abs());
        let same = x.unit.is_some() && x.unit == y.unit && x.dissipation == y.dissipation && x.reference == y.reference;
        same && error < ACCIDENT * size && (size - y.coefficient.abs()).abs() <= 2.0 * error
    }

    /// The best estimate of a constant and its standard error, from the coefficients that equal it.
    fn common(&self, group: &[usize]) -> (f64, f64) {
        let own = |k: usize| (self.terms[k].coefficient.abs(), self.terms[k].standard_error);
        if let Some(&fixed) = group.iter().find(|k| group.len() == 1 || own(**k).1 == 0.0) {
            return own(fixed);
        }
        let (count, m) = (group.len(), self.terms.len());
        let sign = |at: usize| self.terms[group[at]].coefficient.signum();
        let mut block = part(m, &self.covariance, group);
        (0..count * count).for_each(|e| block[e] *= sign(e / count) * sign(e % count));
        let Some(weights) = inverse(count, &block) else { return own(group[0]) };
        let sums: Vec<f64> = weights.chunks_exact(count).map(|row| row.iter().sum()).collect();
        let (whole, sizes): (f64, Vec<f64>) = (sums.iter().sum(), group.iter().map(|&k| own(k).0).collect());
        (dot(&sums, &sizes) / whole, whole.recip().max(0.0).sqrt())
    }

    /// The formula as JSON, with the dissipation function if one was searched; `name` is the name of the system in its file.
    pub fn summary(&self, name: &str) -> FormulaSummary<'_> {
        FormulaSummary {
            verdict: self.verdict,
            lagrangian: self.text(false),
            dissipation: self.friction.then(|| self.text(true)),
            latex: [false, true].map(|dissipation| self.latex(dissipation)),
            rust: self.rust(),
            toml: self.system_file(name),
            coordinates: &self.coordinates,
            terms: &self.terms,
            residual: self.residual,
            noise: &self.noise,
            noise_resolved: self.noise_resolved,
            searched: self.searched.0,
            removed: self.searched.1,
            basis: &self.basis,
            tried: &self.tried,
            blocks: &self.blocks,
            rival: self.rival.as_ref(),
            several: self.several,
            doubts: &self.doubts,
            notes: &self.notes,
            forces_between_samples: self.between,
            left: &self.left,
            seed: self.seed,
        }
    }

    /// The Lagrangian, or the dissipation function, as a formula in the grammar of system files.
    pub fn text(&self, dissipation: bool) -> String {
        self.sum(dissipation, |t| (number(t.coefficient), t.term.clone()), "*")
    }

    /// The same in LaTeX.
    pub fn latex(&self, dissipation: bool) -> String {
        self.sum(dissipation, |t| (latex_number(t.coefficient), t.latex.clone()), "\\,")
    }

    fn sum(&self, dissipation: bool, write: impl Fn(&FoundTerm) -> (String, String), product: &str) -> String {
        let mut text = String::new();
        for term in self.terms.iter().filter(|t| t.dissipation == dissipation) {
            let (coefficient, factor) = write(term);
            let (sign, size) = match coefficient.strip_prefix('-') {
                Some(size) => (if text.is_empty() { "-" } else { " - " }, size.to_string()),
                None => (if text.is_empty() { "" } else { " + " }, coefficient),
            };
            text += &format!("{sign}{size}{product}{factor}");
        }
        if text.is_empty() { "0".to_string() } else { text }
    }

    /// A Rust type with this Lagrangian.
    pub fn rust(&self) -> String {
        let n = self.coordinates.len();
        let body: Vec<String> = self
            .terms
            .iter()
            .filter(|t| !t.dissipation)
            .map(|t| format!("R::of({:?}) * {}", t.coefficient, t.rust))
            .collect();
        format!(
            "struct Found; // q = ({})\nimpl lnn::lagrangian::Lagrangian for Found {{\n    fn coordinates(&self) -> usize {{\n        {n}\n    }}\n    fn lagrangian<R: lnn::scalar::Real>(&self, _parameters: &[R], q: &[R], v: &[R]) -> R {{\n        {}\n    }}\n}}\n",
            self.coordinates.join(", "),
            body.join("\n            + ")
        )
    }

    /// A system file, with its constants as parameters that a training may learn.
    pub fn system_file(&self, name: &str) -> String {
        let mut text = format!("name = {name:?}\n");
        let sum = |dissipation: bool| {
            let positive = |constant: &String| self.constants().any(|t| t.constant == *constant && t.coefficient > 0.0);
            let own = self.terms.iter().filter(|t| t.dissipation == dissipation).enumerate();
            let one = |(k, t): (usize, &FoundTerm)| {
                let sign = match (k, (t.coefficient > 0.0) == positive(&t.constant)) {
                    (0, true) => "",
                    (0, false) => "-",
                    (_, true) => " + ",
                    (_, false) => " - ",
                };
                format!("{sign}{}*{}", t.constant, t.term)
            };
            own.map(one).collect::<String>()
        };
        text += &format!("lagrangian = {:?}\n", sum(false));
        if self.units.1 != "s" {
            text += &format!("time_unit = {:?}\n", self.units.1);
        }
        if self.terms.iter().any(|t| t.dissipation) {
            text += &format!("dissipation = {:?}\n", sum(true));
        }
        for (i, name) in self.coordinates.iter().enumerate() {
            text += &format!("\n[[coordinates]]\nname = {name:?}\n");
            match self.units.0.get(i).filter(|unit| !unit.is_empty()) {
                Some(unit) => text += &format!("unit = {unit:?}\n"),
                None if self.periodic[i] => text += "unit = \"rad\"\n",
                None => {}
            }
            if self.periodic[i] {
                text += "periodic = true\n";
            }
            let [low, high] = self.bounds[i];
            if !self.periodic[i] {
                text += &format!("bounds = [{low:?}, {high:?}]\n");
            }
            let speed = 3.0 * self.speeds[i];
            text += &format!("velocity_bounds = [{:?}, {speed:?}]\n", -speed);
        }
        text += "\n[parameters]\n";
        for FoundTerm { constant, coefficient, standard_error, unit, .. } in self.constants() {
            let unit = unit.as_ref().map_or(String::new(), |unit| format!(", unit = {unit:?}"));
            text += &format!(
                "{constant} = {{ default = {coefficient:?}{unit}, learn = true }} # +- {standard_error:.2e}\n"
            );
        }
        text
    }

    /// The first term with each constant.
    fn constants(&self) -> impl Iterator<Item = &FoundTerm> {
        let first = |k: usize| self.terms.iter().position(|t| t.constant == self.terms[k].constant) == Some(k);
        self.terms.iter().enumerate().filter(move |(k, _)| first(*k)).map(|(_, t)| t)
    }
}

/// A number with seven digits.
fn number(x: f64) -> String {
    let size = x.abs();
    if x != 0.0 && !(1e-4..1e7).contains(&size) {
        return format!("{x:.6e}");
    }
    let digits = if size >= 1.0 { 6 - (size.log10().floor() as usize).min(6) } else { 7 };
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

fn latex_number(x: f64) -> String {
    let text = number(x);
    match text.split_once('e') {
        Some((digits, power)) => format!("{digits}\\cdot 10^{{{power}}}"),
        None => text,
    }
}

/// A fraction of small integers within two standard errors, if the number is known well enough that this is not by chance.
fn near(x: f64, error: f64) -> Option<Near> {
    if !(x.is_finite() && error.is_finite()) {
        return None;
    }
    let within = (2.0 * error).max(1e-9 * x.abs());
    for bottom in 1..=12 {
        let top = (x * f64::from(bottom)).round();
        // Fractions with this denominator are 1 / bottom apart: one within the error is rarely there by chance.
        let rare = within * f64::from(bottom * bottom) < 0.02;
        if rare && top != 0.0 && top.abs() <= 24.0 && (x - top / f64::from(bottom)).abs() <= within {
            let fraction = if bottom == 1 { format!("{top}") } else { format!("{top}/{bottom}") };
            let off = x - top / f64::from(bottom);
            return Some(Near { fraction, standard_errors: if error > 0.0 { off / error } else { 0.0 } });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_are_named_where_they_are_no_accident() {
        let found = near(0.2501, 1e-4).unwrap();
        assert!(found.fraction == "1/4" && (found.standard_errors - 1.0).abs() < 1e-9, "{found:?}");
        assert_eq!(near(-1.5, 0.0).map(|found| found.fraction).as_deref(), Some("-3/2"));
        assert_eq!([near(0.2531, 1e-4), near(0.26, 0.2)], [None, None]);
    }

    #[test]
    fn numbers_are_written_without_empty_digits() {
        assert_eq!([number(0.5), number(-9.81), number(12.0), number(100.0)], ["0.5", "-9.81", "12", "100"]);
        assert_eq!(number(1.5e-7), "1.500000e-7");
    }
}
