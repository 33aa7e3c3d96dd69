//! Report of identified constants.

use super::found::{Bodies, Combination, Constant, Identified, Outlier, Residual, SensorConstant, Undetermined};
use super::thresholds::{MOST_REPORTED, REPORTED_CORRELATION};
use crate::findings::Findings;
use crate::names::{number, pluralize, rounded};

impl Identified {
    /// The report: constants, undetermined combinations, residuals and the verdict, as tables and sentences.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        findings.lines(&self.obstacles);
        self.add_constants(&mut findings);
        for Undetermined { text, advice, .. } in &self.undetermined {
            findings.gap().line(text).line(format!("  advice: {advice}"));
        }
        if let Some(text) = self.bodies.as_ref().and_then(Bodies::text) {
            findings.gap().line(text);
        }
        self.add_correlations(&mut findings);
        let what = if self.segments == 0 { "force on" } else { "coordinate" };
        let headers = [what, "residual", "noise", "spread", "autocorrelation", ""];
        findings.gap().table(&headers, self.residuals.iter().map(Residual::row)).line(self.verdict.to_string());
        if !self.converged {
            findings.line(format!(
                "the next step would still reduce the sum of squares by {} times the variance of the noise",
                number(self.decrement)
            ));
        }
        findings.line(self.extent());
        self.add_outliers(&mut findings);
        if let Some(by_trajectory) = &self.by_trajectory {
            by_trajectory.report(&mut findings);
        }
        findings
    }

    /// Tables of the constants and of the determined combinations.
    fn add_constants(&self, findings: &mut Findings) {
        // If sums are determined, constants that are known only within sums have no row of their own.
        let alone = |c: &&Constant| self.combinations.is_empty() || c.standard_error.is_some();
        let constants = self.constants.iter().filter(alone).map(Constant::row);
        let headers = ["constant", "value", "standard error", "unit", "start"];
        findings.table(&headers, constants.chain(self.sensors.iter().map(SensorConstant::row)));
        let sums = self.combinations.iter().filter(|sum| sum.terms.len() > 1);
        let known = sums.chain(self.undetermined.iter().flat_map(|open| &open.known)).map(|known| {
            let Combination { name, value, standard_error, unit, .. } = known;
            let [value, error] = with_error(*value, Some(*standard_error));
            [name.clone(), value, error, unit.clone()]
        });
        let known: Vec<_> = known.collect();
        if !known.is_empty() {
            findings.gap().table(&["combination", "value", "standard error", "unit"], known);
        }
    }

    /// The strongest correlations of errors.
    fn add_correlations(&self, findings: &mut Findings) {
        let (names, matrix) = (&self.correlations.names, &self.correlations.matrix);
        let below = (0..names.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let mut pairs: Vec<(usize, usize, f64)> =
            below.map(|(i, j)| (i, j, matrix[i][j])).filter(|(_, _, c)| c.abs() > REPORTED_CORRELATION).collect();
        pairs.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        if !pairs.is_empty() {
            let listed =
                pairs.iter().take(MOST_REPORTED).map(|(i, j, c)| format!("{} and {} {c:.3}", names[*j], names[*i]));
            let listed = listed.collect::<Vec<_>>().join(", ");
            findings.gap().line(format!("correlations of errors beyond {REPORTED_CORRELATION}: {listed}"));
        }
    }

    /// The amount of motion that was used, the interpolation of forces, and their noise.
    fn extent(&self) -> String {
        let mut text = pluralize(self.samples, "sample", "samples");
        if self.segments > 0 {
            let segments = pluralize(self.segments, "segment", "segments");
            text += &format!(" in {segments} of {} s", number(self.segment_seconds));
        }
        if let Some(between) = self.between {
            let name = between.name();
            text += &format!(", forces {name} between the samples (for roll-outs: --between {name})");
        }
        if !self.force_noise.is_empty() {
            let sizes: Vec<String> = self.force_noise.iter().map(|size| rounded(*size, 2)).collect();
            text += &format!(", force noise {}", sizes.join(", "));
        }
        text
    }

    /// The largest outliers.
    fn add_outliers(&self, findings: &mut Findings) {
        if self.outlier_count == 0 {
            return;
        }
        let advice = if self.robust || self.segments == 0 { "" } else { "; --robust limits their influence" };
        let samples = pluralize(self.outlier_count, "sample", "samples");
        let headers = ["trajectory", "row", "t", "coordinate", "residual / typical"];
        let rows = self.outliers.iter().take(MOST_REPORTED).map(Outlier::line);
        findings.gap().line(format!("{samples} far from the fitted motion{advice}")).table(&headers, rows);
    }
}

/// A value with the digits that its standard error justifies, and the error.
pub(super) fn with_error(value: f64, error: Option<f64>) -> [String; 2] {
    let Some(error) = error.filter(|error| error.is_finite() && *error > 0.0) else {
        return [rounded(value, 4), "-".to_string()];
    };
    let exponent = |x: f64| x.abs().log10().floor() as i32;
    let digits = if value == 0.0 { 2 } else { exponent(value) - exponent(error) + 2 };
    [rounded(value, digits.clamp(1, 17) as usize), rounded(error, 2)]
}

impl Constant {
    fn row(&self) -> [String; 5] {
        let [value, error] = with_error(self.value, self.standard_error);
        let error = if self.at_bound { "at its bound".to_string() } else { error };
        [self.symbol.clone(), value, error, self.unit.clone(), rounded(self.start, 4)]
    }
}

impl SensorConstant {
    fn row(&self) -> [String; 5] {
        let [value, error] = with_error(self.value, self.standard_error);
        let perfect = if self.kind == "gain" { 1.0 } else { 0.0 };
        let unit = if self.kind == "delay" { "s" } else { "" };
        [self.name(), value, error, unit.to_string(), rounded(perfect, 4)]
    }
}

impl Residual {
    fn row(&self) -> [String; 6] {
        let white = if self.white { "independent" } else { "correlated" };
        let [rms, noise, spread] = [self.rms, self.noise, self.spread].map(number);
        [self.coordinate.clone(), rms, noise, spread, format!("{:.2}", self.autocorrelation), white.to_string()]
    }
}

impl Outlier {
    fn line(&self) -> [String; 5] {
        let [time, size] = [rounded(self.time, 6), rounded(self.size, 3)];
        [self.trajectory.clone(), self.row.to_string(), time, self.coordinate.clone(), size]
    }
}

impl Bodies {
    /// Whether the inertias of links were changed to physical ones; `None` if they already were physical.
    fn text(&self) -> Option<String> {
        let Self { moved, largest_change, exist } = self;
        let links = moved.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let change = rounded(*largest_change, 2);
        match (moved.is_empty(), exist) {
            (true, true) => None,
            (true, false) => Some("no rigid bodies can have the given constants".to_string()),
            (false, false) => Some(format!(
                "no rigid bodies match these combinations within their errors: the closest ones differ by {change} standard errors; check that the model is complete"
            )),
            (false, true) => Some(format!(
                "the constants of links {links} were moved to the closest ones that rigid bodies can have; this changes determined combinations by at most {change} standard errors"
            )),
        }
    }
}
