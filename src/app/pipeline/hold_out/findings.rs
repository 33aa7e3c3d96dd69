//! Sentences and tables about predictions of held-out motion.

use super::measures::short;
use super::result::{CoordinatePredictions, HoldOut};
use crate::analysis::PredictionError;
use crate::findings::Findings;
use crate::names::number;
use crate::pipeline::energy::Balance;
use crate::pipeline::force_errors::ForceError;

impl HoldOut {
    fn headers(&self) -> [String; 7] {
        let unit = short(self.error_unit);
        [
            "time ahead [s]".to_string(),
            format!("median error [{unit}]"),
            format!("9 of 10 below [{unit}]"),
            format!("rms error [{unit}]"),
            format!("constant velocity, median [{unit}]"),
            "windows".to_string(),
            "given up".to_string(),
        ]
    }

    /// Builds the table of errors by coordinate, if there are several.
    fn table_by_coordinate(&self) -> Option<(Vec<String>, Vec<Vec<String>>)> {
        if self.by_coordinate.len() < 2 || self.model.is_empty() {
            return None;
        }
        let header = |c: &CoordinatePredictions| {
            [format!("{} [{}]", c.name, c.unit), format!("{}, constant velocity [{}]", c.name, c.unit)]
        };
        let headers = self.by_coordinate.iter().flat_map(header);
        let headers = ["median error, time ahead [s]".to_string()].into_iter().chain(headers).collect();
        let row = |(k, error): (usize, &PredictionError)| {
            let numbers = self.by_coordinate.iter().flat_map(|c| [c.model[k], c.constant_velocity[k]]);
            [error.seconds].into_iter().chain(numbers).map(number).collect()
        };
        Some((headers, self.model.iter().enumerate().map(row).collect()))
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let pairs = self.model.iter().zip(&self.constant_velocity);
        pairs
            .map(|(model, straight)| {
                let numbers = [model.median, model.p90, model.rms, straight.median].map(number);
                let counts = [model.windows, model.missing].map(|count| count.to_string());
                [vec![number(model.seconds)], numbers.to_vec(), counts.to_vec()].concat()
            })
            .collect()
    }

    /// Reports errors of forces and predictions, and the energy balance.
    pub(crate) fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        if !self.force_errors.is_empty() {
            findings.heading("Errors of the forces of held-out motion");
            findings.table(&ForceError::HEADERS, self.force_errors.iter().map(ForceError::row));
        }
        findings.heading("Errors of the predictions of held-out motion");
        if self.is_of_nothing() {
            findings.line("Nothing was held out (--hold-out 0): this model was not tested.");
            return findings;
        }
        if self.model.is_empty() {
            findings.line("No window of the held-out motion is as long as the horizon: nothing was predicted.");
        }
        findings.table(&self.headers(), self.rows());
        if let Some((headers, rows)) = self.table_by_coordinate() {
            findings.gap().table(&headers, rows);
        }
        findings.lines(self.given_up.lines()).lines(self.energy.iter().flat_map(Balance::lines));
        findings
    }
}
