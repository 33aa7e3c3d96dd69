//! Report of a formula.

use super::found::{FoundDrive, FoundFormula, FoundTerm, Rival, Verdict};
use crate::findings::Findings;
use crate::names::rounded;

impl FoundFormula {
    /// The verdict, the formula, and a table of its terms; if the formula does not fit, the residuals by range.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        self.say_verdict(&mut findings);
        findings.gap().code(format!("L = {}", self.text(false)));
        if self.friction {
            findings.code(format!("D = {}", self.text(true)));
        }
        if let Some(FoundDrive { name, frequency, standard_error }) = &self.drive {
            let period = rounded(std::f64::consts::TAU / frequency, 6);
            let [frequency, error] = [rounded(*frequency, 7), rounded(*standard_error, 2)];
            findings.line(format!(
                "a periodic drive: {name} = {frequency} rad/s, standard error {error}, period {period} s"
            ));
        }
        let headers = ["term", "constant", "coefficient", "error", "95 % range", "unit", "probability", "near"];
        findings.gap().table(&headers, self.terms.iter().map(FoundTerm::row));
        if let Some(Rival { terms, cost }) = &self.rival {
            let (terms, cost) = (terms.join(", "), rounded(*cost, 3));
            findings.gap().line(format!(
                "next best: {terms}; its cost is {cost} higher (sum of squares over the noise variance, plus 30 per term)"
            ));
        }
        if self.verdict == Verdict::NotInLibrary && !self.left.is_empty() {
            let rows = self.left.iter().map(|left| {
                let name = self.coordinates[left.coordinate].clone();
                let [low, high, residual] = [left.low, left.high, left.residual].map(|x| rounded(x, 4));
                [name, low, high, residual, left.samples.to_string()]
            });
            let headers = ["coordinate", "from", "to", "residual / noise", "samples"];
            findings.gap().line("residuals by range of coordinate:").table(&headers, rows);
        }
        findings
    }

    fn say_verdict(&self, findings: &mut Findings) {
        let verdict = match self.verdict {
            Verdict::Found if self.several => "found, one of several",
            Verdict::Found => "found",
            Verdict::NotInLibrary => "not in the library",
            Verdict::Undecided => "undecided",
        };
        let residual = rounded(self.residual, 4);
        findings.line(if self.of_model {
            format!("{verdict}: accelerations differ from the model's by {residual} of their size")
        } else {
            let bound = if self.noise_resolved { "" } else { " (the noise is an upper bound)" };
            format!("{verdict}: the residual of held-out motion is {residual} times its noise{bound}")
        });
        findings.lines(self.doubts.iter().map(|doubt| format!("in doubt: {doubt}")));
        let (searched, removed) = self.searched;
        findings.line(format!(
            "{searched} terms searched, {removed} removed as total derivatives or linear combinations of others"
        ));
        if self.tried.len() > 1 {
            findings.line(format!("functions of {}; searched: {}", self.basis, self.tried.join("; ")));
        }
        findings.lines(&self.notes).lines(self.independent());
    }

    /// Groups of coordinates that are decoupled.
    fn independent(&self) -> Vec<String> {
        let Some((first, others)) = self.blocks.split_first() else { return Vec::new() };
        let first = first.join(", ");
        let sentence = |names: &Vec<String>| {
            let (verb, whose) = if names.len() == 1 { ("is decoupled", "its") } else { ("are decoupled", "their") };
            let names = names.join(", ");
            if self.between.is_some() {
                return format!("{names} {verb} from {first}");
            }
            format!("{names} {verb} from {first}: {whose} mass relative to that of {first} is not determined")
        };
        others.iter().map(sentence).collect()
    }
}

impl FoundTerm {
    fn row(&self) -> [String; 8] {
        let range = [-1.96, 1.96].map(|k| rounded(self.coefficient + k * self.standard_error, 6)).join(" .. ");
        let name = if self.dissipation { format!("D: {}", self.term) } else { self.term.clone() };
        let near = self.near.as_ref().map_or(String::new(), |near| match rounded(near.standard_errors, 1) {
            off if near.standard_errors == 0.0 || off == "0" => near.fraction.clone(),
            off => format!("{} ({off} standard errors off)", near.fraction),
        });
        let unit = self.unit.clone().unwrap_or_else(|| "hidden in the function".to_string());
        let [coefficient, error] = [rounded(self.coefficient, 6), rounded(self.standard_error, 2)];
        [name, self.constant.clone(), coefficient, error, range, unit, format!("{:.2}", self.probability), near]
    }
}
