//! Section of a report about the physics of a model.

use crate::names::{number, rounded};
use crate::pipeline::physics::{FoundSymmetries, Physics};
use crate::report::Report;
use crate::symmetry::ChargeDrift;

/// Shown if there is no number.
const NONE: &str = "-";

/// Formats a number with four digits, or returns [`NONE`].
fn shown(x: Option<f64>) -> String {
    x.map_or(NONE.to_string(), |x| rounded(x, 4))
}

impl Physics {
    /// Adds tables, and remarks on missing parts; the pictures come before all tables of a page.
    pub(crate) fn report(&self, report: Report) -> Report {
        let about = "Symmetries, charges and signature, of geodesics metric and curvature, over the middle of the states that the \
                     model was trained on.";
        let report = self.curvature(self.metric(report.heading("Physics").paragraph(about)));
        let report = self.certificate(self.charges(self.symmetries(report)));
        if self.left_out.is_empty() {
            return report;
        }
        report.paragraph(&format!("Left out: {}.", self.left_out.join("; ")))
    }

    fn metric(&self, report: Report) -> Report {
        if self.metric.is_empty() {
            return report;
        }
        let rows: Vec<Vec<String>> = self
            .metric
            .iter()
            .map(|component| {
                let [i, j] = component.indices.map(|i| self.coordinates[i].as_str());
                let numbers = [Some(component.learned), component.exact, component.error].map(shown);
                [vec![format!("g[{i},{j}]")], numbers.to_vec()].concat()
            })
            .collect();
        report.table(&["metric at rest, root mean square", "learned", "exact", "difference"], &rows)
    }

    fn curvature(&self, report: Report) -> Report {
        let Some(curvature) = &self.curvature_scalar else { return report };
        let pair = [("learned", Some(curvature.learned)), ("exact", curvature.exact)];
        let rows: Vec<Vec<String>> = pair
            .into_iter()
            .filter_map(|(name, spread)| Some((name, spread?)))
            .map(|(name, spread)| {
                let numbers = [spread.median, spread.low, spread.high].map(|x| rounded(x, 4));
                let points = [spread.points, spread.failed].map(|x| x.to_string());
                [vec![name.to_string()], numbers.to_vec(), points.to_vec()].concat()
            })
            .collect();
        let report =
            report.table(&["curvature scalar R", "median", "1 % below", "99 % below", "points", "failed"], &rows);
        if curvature.exact.is_none() {
            return report;
        }
        let factor = rounded(curvature.factor, 4);
        report.paragraph(&format!(
            "The learned metric is taken times {factor}, the factor by which it is nearest to the exact one."
        ))
    }

    fn symmetries(&self, report: Report) -> Report {
        let pair = [("learned", &self.symmetries), ("exact", &self.exact_symmetries)];
        let row = |(name, found): (&str, &FoundSymmetries)| {
            let count = found.count.map_or("no gap, no number".to_string(), |count| count.to_string());
            let algebra = found.name.clone().unwrap_or(NONE.to_string());
            let gap = found.gap.map_or(NONE.to_string(), number);
            vec![name.to_string(), count, gap, algebra, found.fields.join("; "), found.basis.clone()]
        };
        let rows: Vec<Vec<String>> =
            pair.iter().filter_map(|(name, found)| Some(row((name, found.as_ref()?)))).collect();
        if rows.is_empty() {
            return report;
        }
        report.table(&["point symmetries", "number", "gap", "algebra", "fields", "functions of degree"], &rows)
    }

    fn charges(&self, report: Report) -> Report {
        if self.charges.is_empty() {
            return report;
        }
        let rows: Vec<Vec<String>> = self.charges.iter().map(ChargeDrift::row).collect();
        let until = number(self.charges_until);
        report
            .paragraph(&format!("Charges of the exact system along the learned motion of start 1, until {until}:"))
            .table(&ChargeDrift::HEADERS, &rows)
    }

    fn certificate(&self, report: Report) -> Report {
        let Some(proven) = &self.signature else { return report };
        let signs = format!("{} positive and {} negative eigenvalues", proven.positive, proven.negative);
        if proven.by_construction {
            return report
                .paragraph(&format!("The structure of the model proves {signs} of the mass matrix at every state."));
        }
        let shares = [proven.certified, proven.refuted, proven.open].map(|share| rounded(100.0 * share, 4)).to_vec();
        report
            .paragraph(&format!(
                "Share of the region where the mass matrix is proven to have {signs}, by {} boxes:",
                proven.boxes
            ))
            .table(&["proven [%]", "proven not [%]", "open [%]"], &[shares])
    }
}
