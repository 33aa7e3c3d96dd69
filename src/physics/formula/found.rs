//! A formula that was found, and its ways to be written.

use super::error::FormulaError;
use super::function::Notation;
use super::library::Library;
use super::motion::Model;
use serde::Serialize;

/// Whether the library holds the Lagrangian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// The formula explains motion that was held out, up to its noise.
    #[serde(rename = "found")]
    Found,
    /// It does not.
    #[serde(rename = "not in the library")]
    NotInLibrary,
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
    /// Share of the resampled recordings in which it was chosen.
    pub probability: f64,
    /// `true` for a term of Rayleigh's dissipation function, `false` for one of the Lagrangian.
    pub dissipation: bool,
    /// A simple fraction within the error of the coefficient, if there is one.
    pub near: Option<String>,
    #[serde(skip)]
    latex: String,
    #[serde(skip)]
    rust: String,
}

/// What is left over in a part of the range of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Left {
    /// Place of the coordinate.
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
    /// Whether the formula explains what was held out.
    pub verdict: Verdict,
    /// Its terms.
    pub terms: Vec<FoundTerm>,
    /// Root mean square residual over noise of what was held out: 1 where nothing but noise is left.
    pub residual: f64,
    /// Noise of every coordinate that the residual is measured by.
    pub noise: Vec<f64>,
    /// `false` if the noise could not be told from the motion: what it is measured by is an upper bound.
    pub noise_resolved: bool,
    /// Residuals by parts of the ranges of coordinates.
    pub left: Vec<Left>,
    /// Terms searched, and how many of them were removed as total derivatives and identities.
    pub searched: (usize, usize),
    pub(super) bounds: Vec<[f64; 2]>,
    pub(super) speeds: Vec<f64>,
    covariance: Vec<f64>,
}

impl FoundFormula {
    /// The formula of a model of a library, with the covariance of its coefficients and the probabilities of its terms.
    pub(super) fn new(
        library: &Library,
        periodic: &[bool],
        model: &Model,
        (covariance, probabilities): (&[f64], &[f64]),
    ) -> Self {
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
                    near: None,
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
        let mut found = Self {
            coordinates: library.names.clone(),
            periodic: periodic.to_vec(),
            verdict: Verdict::NotInLibrary,
            terms: order.iter().map(|(_, term)| term.clone()).collect(),
            residual: f64::NAN,
            noise: Vec::new(),
            noise_resolved: true,
            left: Vec::new(),
            searched: (library.searched, 0),
            bounds: Vec::new(),
            speeds: Vec::new(),
            covariance,
        };
        found.name_fractions();
        found
    }

    /// Fixes the common factor: a term gets the coefficient that is given, or the first square of a velocity 1/2.
    pub(super) fn rescale(&mut self, scale: Option<&(String, f64)>) -> Result<(), FormulaError> {
        let plain = |text: &str| text.chars().filter(|c| !c.is_whitespace()).collect::<String>();
        let (at, value) = match scale {
            Some((term, value)) => {
                let at = self.terms.iter().position(|known| plain(&known.term) == plain(term));
                let known = || self.terms.iter().map(|t| t.term.as_str()).collect::<Vec<_>>().join(", ");
                (at.ok_or_else(|| FormulaError::Scale { term: term.clone(), known: known() })?, *value)
            }
            None => {
                let square =
                    |name: &String| self.terms.iter().position(|t| !t.dissipation && t.term == format!("{name}_dot^2"));
                let first = self.coordinates.iter().find_map(square);
                (first.or(self.terms.iter().position(|t| !t.dissipation)).unwrap_or(0), 0.5)
            }
        };
        let m = self.terms.len();
        let Some(reference) = self.terms.get(at).map(|t| t.coefficient) else { return Ok(()) };
        let factor = value / reference;
        // Coefficients as ratios to the reference: the derivatives of x_k value / x_at.
        let x: Vec<f64> = self.terms.iter().map(|t| t.coefficient).collect();
        let slope = |k: usize, i: usize| {
            f64::from(u8::from(i == k)) * factor - if i == at { x[k] * factor / reference } else { 0.0 }
        };
        let old = std::mem::take(&mut self.covariance);
        let element = |k: usize, l: usize| -> f64 {
            let pairs = [k, at].into_iter().flat_map(|i| [l, at].map(|j| (i, j)));
            let mut seen: Vec<(usize, usize)> = Vec::new();
            pairs
                .filter(|pair| {
                    let new = !seen.contains(pair);
                    seen.push(*pair);
                    new
                })
                .map(|(i, j)| slope(k, i) * old[i * m + j] * slope(l, j))
                .sum()
        };
        self.covariance = (0..m * m).map(|e| element(e / m, e % m)).collect();
        for (k, term) in self.terms.iter_mut().enumerate() {
            term.coefficient *= factor;
            let variance: f64 = self.covariance[k * m + k];
            term.standard_error = if k == at { 0.0 } else { variance.max(0.0).sqrt() };
        }
        self.terms[at].coefficient = value;
        self.name_fractions();
        Ok(())
    }

    fn name_fractions(&mut self) {
        for term in &mut self.terms {
            term.near = fraction(term.coefficient, term.standard_error);
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

    /// Rust: a type with this Lagrangian.
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

    /// A system file: its constants are parameters that a training may learn.
    pub fn system_file(&self, name: &str) -> String {
        let mut text = format!("name = {name:?}\n");
        let own: Vec<&FoundTerm> = self.terms.iter().filter(|t| !t.dissipation).collect();
        let sum: Vec<String> = own.iter().enumerate().map(|(k, t)| format!("c{}*{}", k + 1, t.term)).collect();
        text += &format!("lagrangian = {:?}\n", sum.join(" + "));
        if self.terms.iter().any(|t| t.dissipation) {
            text += &format!("# With friction (a grey box learns its own): dissipation = \"{}\"\n", self.text(true));
        }
        for (i, name) in self.coordinates.iter().enumerate() {
            text += &format!("\n[[coordinates]]\nname = {name:?}\n");
            if self.periodic[i] {
                text += "unit = \"rad\"\nperiodic = true\n";
            }
            let [low, high] = self.bounds[i];
            if !self.periodic[i] {
                text += &format!("bounds = [{low:?}, {high:?}]\n");
            }
            let speed = 3.0 * self.speeds[i];
            text += &format!("velocity_bounds = [{:?}, {speed:?}]\n", -speed);
        }
        text += "\n[parameters]\n";
        for (k, term) in own.iter().enumerate() {
            let error = term.standard_error;
            text += &format!("c{} = {{ default = {:?}, learn = true }} # +- {error:.2e}\n", k + 1, term.coefficient);
        }
        text
    }
}

/// Seven digits.
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

/// A fraction of small whole numbers within two standard errors, if the number is known well enough that this is no accident.
fn fraction(x: f64, error: f64) -> Option<String> {
    if !(x.is_finite() && error.is_finite()) {
        return None;
    }
    let within = (2.0 * error).max(1e-9 * x.abs());
    for bottom in 1..=12 {
        let top = (x * f64::from(bottom)).round();
        // Fractions of this denominator stand 1 / bottom apart: one within the error by accident is rare.
        let rare = within * f64::from(bottom * bottom) < 0.02;
        if rare && top != 0.0 && top.abs() <= 24.0 && (x - top / f64::from(bottom)).abs() <= within {
            return Some(if bottom == 1 { format!("{top}") } else { format!("{top}/{bottom}") });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_are_named_where_they_are_no_accident() {
        assert_eq!(fraction(0.2501, 1e-4), Some("1/4".to_string()));
        assert_eq!(fraction(-1.5, 0.0), Some("-3/2".to_string()));
        assert_eq!(fraction(0.2531, 1e-4), None);
        assert_eq!(fraction(0.26, 0.2), None);
    }

    #[test]
    fn numbers_are_written_without_empty_digits() {
        assert_eq!([number(0.5), number(-9.81), number(12.0), number(100.0)], ["0.5", "-9.81", "12", "100"]);
        assert_eq!(number(1.5e-7), "1.500000e-7");
    }
}
