//! A found formula as text, LaTeX, Rust and a system file.

use super::found::{FoundDrive, FoundFormula, FoundTerm, RangeResidual, Rival, Verdict};
use crate::identification::Between;
use serde::Serialize;

/// A formula in all its notations, for JSON.
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
    drive: Option<&'a FoundDrive>,
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
    left: &'a [RangeResidual],
    seed: u64,
}

impl FoundFormula {
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
            drive: self.drive.as_ref(),
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

    /// The formula in LaTeX, with the frequency of the drive if the Lagrangian has one.
    pub fn latex(&self, dissipation: bool) -> String {
        let sum = self.sum(dissipation, |t| (latex_number(t.coefficient), t.latex.clone()), "\\,");
        match &self.drive {
            Some(drive) if !dissipation => {
                format!("{sum}, \\quad \\omega = {}", latex_number(drive.frequency))
            }
            _ => sum,
        }
    }

    /// The equation of the Lagrangian in LaTeX, and below it that of the dissipation function if one was searched.
    pub fn latex_equations(&self) -> String {
        let dissipation = if self.friction { format!("D = {}\n", self.latex(true)) } else { String::new() };
        format!("L = {}\n{dissipation}", self.latex(false))
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

    /// A Rust type with this Lagrangian; with a drive the time is its last coordinate, as [`InTime`](crate::lagrangian::InTime) expects it.
    pub fn rust(&self) -> String {
        let n = self.coordinates.len() + usize::from(self.drive.is_some());
        let names: Vec<&str> =
            self.coordinates.iter().map(String::as_str).chain(self.drive.as_ref().map(|_| "t")).collect();
        let frequency = self
            .drive
            .iter()
            .map(|FoundDrive { name, frequency, .. }| format!("let {name} = R::of({frequency:?});\n        "));
        let frequency: String = frequency.collect();
        let body: Vec<String> = self
            .terms
            .iter()
            .filter(|t| !t.dissipation)
            .map(|t| format!("R::of({:?}) * {}", t.coefficient, t.rust))
            .collect();
        format!(
            "struct Found; // q = ({})\nimpl lnn::lagrangian::Lagrangian for Found {{\n    fn coordinates(&self) -> usize {{\n        {n}\n    }}\n    fn lagrangian<R: lnn::scalar::Real>(&self, _parameters: &[R], q: &[R], v: &[R]) -> R {{\n        {frequency}{}\n    }}\n}}\n",
            names.join(", "),
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
        if let Some(FoundDrive { name, frequency, standard_error }) = &self.drive {
            let unit = &self.units.1;
            text += &format!(
                "{name} = {{ default = {frequency:?}, unit = \"rad/{unit}\", learn = true, range = \"positive\" }} # +- {standard_error:.2e}\n"
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_without_empty_digits() {
        assert_eq!([number(0.5), number(-9.81), number(12.0), number(100.0)], ["0.5", "-9.81", "12", "100"]);
        assert_eq!(number(1.5e-7), "1.500000e-7");
    }
}
