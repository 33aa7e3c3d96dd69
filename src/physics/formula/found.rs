//! A formula that was found, and its output formats.

use super::error::FormulaError;
use super::find::FormulaOptions;
use super::function::Notation;
use super::library::{Library, blocks};
use super::motion::Model;
use super::units::{Dimension, Units};
use crate::identification::{Between, ResidualPath};
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

/// An alternative formula that the search tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rival {
    /// Its terms.
    pub terms: Vec<String>,
    /// Its additional cost: the sum of squares over the noise variance, and 30 for every term.
    pub cost: f64,
}

/// A simple fraction near a coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NearFraction {
    /// The fraction, such as `1/6`.
    pub fraction: String,
    /// Difference between coefficient and fraction in standard errors; 0 if both are equal.
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
    /// Fraction of the bootstrap samples in which the search chose the term.
    pub probability: f64,
    /// `true` for a term of Rayleigh's dissipation function, `false` for one of the Lagrangian.
    pub dissipation: bool,
    /// A simple fraction within the error of the coefficient, if there is one.
    pub near: Option<NearFraction>,
    /// Index of the term of its block with the fixed coefficient, if there is one.
    #[serde(skip)]
    pub(super) reference: Option<usize>,
    /// Coefficients of bootstrap samples in which terms were chosen again.
    #[serde(skip)]
    bootstraps: Vec<f64>,
    /// Coordinates that it couples.
    #[serde(skip)]
    joined: Vec<usize>,
    #[serde(skip)]
    pub(super) dimension: Option<Dimension>,
    #[serde(skip)]
    pub(super) latex: String,
    #[serde(skip)]
    pub(super) rust: String,
}

/// Residuals in a part of the range of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RangeResidual {
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

/// A periodic drive: terms of the Lagrangian contain the cosine and the sine of `om t`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundDrive {
    /// Name of its angular frequency in the terms.
    pub name: String,
    /// The angular frequency, in rad by unit of time.
    pub frequency: f64,
    /// Its standard error.
    pub standard_error: f64,
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
    /// The periodic drive, if there is one.
    pub drive: Option<FoundDrive>,
    /// Root mean square of the held-out residual over the noise: 1 if only noise remains.
    pub residual: f64,
    /// Noise of every coordinate that scales the residual.
    pub noise: Vec<f64>,
    /// `false` if the noise and the motion could not be separated: the noise given is then an upper bound.
    pub noise_resolved: bool,
    /// Residuals by parts of the ranges of coordinates.
    pub left: Vec<RangeResidual>,
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
    /// `true` if the formula describes a model, not recorded motion.
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
    pub(super) covariance: Vec<f64>,
    /// Units of the coordinates, empty if they are not known, and of time.
    pub(super) units: (Vec<String>, String),
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
                    bootstraps: Vec::new(),
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
            drive: None,
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

    /// Stores the coefficients of bootstrap samples for the terms of the library.
    pub(super) fn set_bootstraps(
        &mut self,
        library: &Library,
        model: &Model,
        coefficients: &BTreeMap<usize, Vec<f64>>,
    ) {
        for &k in &model.terms {
            let text = library.written(k, Notation::System);
            let own = |t: &&mut FoundTerm| t.term == text && t.dissipation == library.is_dissipation(k);
            if let (Some(term), Some(drawn)) = (self.terms.iter_mut().find(own), coefficients.get(&k)) {
                term.bootstraps.clone_from(drawn);
            }
        }
    }

    /// Standard deviation of a term's coefficient over the bootstrap samples, relative to a reference, which then has the value `value`.
    fn scatter(&self, k: usize, reference: Option<(usize, f64)>) -> f64 {
        let own = &self.terms[k].bootstraps;
        let values: Vec<f64> = match reference {
            None => own.clone(),
            Some((at, value)) => {
                let pairs = own.iter().zip(&self.terms[at].bootstraps).filter(|(_, base)| **base != 0.0);
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
        self.apply_references(&references);
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
    fn apply_references(&mut self, references: &[(usize, f64)]) {
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
}
