//! Tables, report and `evaluation.json` of an evaluation.

use crate::analysis::{MassMatrixError, Statistics};
use crate::findings::{Finding, Findings};
use crate::lagrangian::SystemInstance;
use crate::names::{number, percentage, rounded};
use crate::network::NetworkLagrangian;
use crate::network::file::Header;
use crate::pipeline::evaluation::{Evaluation, Motion};
use crate::pipeline::report_files::{parameter_table, write_page, write_report_and_figures};
use crate::pipeline::{Command, Output, PipelineError, headline};
use crate::report::{Figure, Report, with_unit};
use serde::Serialize;
use std::fmt::Write as _;

/// Shown if there is no finite number.
const NONE: &str = "-";

/// Contents of `evaluation.json`.
#[derive(Serialize)]
struct Summary<'a> {
    system: &'a str,
    seed: u64,
    validation_loss: f64,
    #[serde(flatten)]
    evaluation: &'a Evaluation,
}

impl Evaluation {
    /// Writes `evaluation.json`, `report.html`, an interactive page and pictures, and returns the first; `name` is that of the model's file,
    /// `seed` that of the starts.
    ///
    /// # Errors
    /// [`PipelineError::Output`].
    pub fn write(
        &self,
        system: &SystemInstance<f64>,
        (name, header, network): (&str, &Header, &NetworkLagrangian<f64>),
        seed: u64,
        output: &dyn Output,
    ) -> Result<String, PipelineError> {
        let summary =
            Summary { system: &system.system.name, seed, validation_loss: header.validation_loss, evaluation: self };
        let json = serde_json::to_string_pretty(&summary).map_err(PipelineError::format)? + "\n";
        Command::Evaluate.write(output)?;
        output.write("evaluation.json", json.as_bytes())?;
        let title = format!("{}: learned against exact", system.system.title);
        let report = Report::new(&title)
            .findings(&self.headline(&system.system.title))
            .paragraph(&format!("Model {name}, starts of seed {seed}."));
        let report = write_page(output, report, (header, network), Some(system))?;
        let report = self.report(parameter_table(self.pictures(report), system));
        write_report_and_figures(output, &report, self.figures.iter().chain(&self.physics.figures))?;
        Ok(json)
    }

    /// The tables.
    pub(crate) fn tables(&self) -> Findings {
        let mut findings = Findings::default();
        self.add_difference(&mut findings);
        self.add_accelerations(&mut findings);
        self.add_mass_matrix(&mut findings);
        self.add_trajectories(&mut findings);
        let none = |part: &Finding| match part {
            Finding::Table { rows, .. } => rows.iter().flatten().any(|cell| cell == NONE),
            _ => false,
        };
        if findings.parts().iter().any(none) {
            findings
                .gap()
                .line("-: no finite number; failed states and remarks say why, no Lyapunov time means no chaos");
        }
        findings
    }

    /// Adds the difference from the exact Lagrangian, if it was computed.
    fn add_difference(&self, findings: &mut Findings) {
        let Some(found) = &self.physics.equivalence else { return };
        let powers: Vec<String> = found.factors.iter().map(|factor| number(*factor)).collect();
        let differences = found.differences().map(|(_, difference)| percentage(difference));
        let names = found.differences().map(|(name, _)| format!("{name} [%]"));
        let header = [vec!["factor [1]".to_string()], names.to_vec(), vec!["states [1]".into()]].concat();
        let row = [vec![powers.join("; ")], differences.to_vec(), vec![found.states.to_string()]].concat();
        findings
            .heading("Difference of the learned Lagrangian from the exact one, after the best factor and gauge term")
            .table(&header, [row]);
    }

    /// Adds the errors of the accelerations; the header shows the unit if all have the same.
    fn add_accelerations(&self, findings: &mut Findings) {
        let units: Vec<&str> = self.coordinates.iter().map(|name| headline::named(name).1).collect();
        let unit = units.first().filter(|unit| units.iter().all(|other| other == *unit));
        let accelerations = self.coordinates.iter().zip(&self.accelerations).map(|(name, e)| {
            let numbers = [e.mean, e.rms, e.median, e.p99, e.max].map(number);
            let name = if unit.is_some() { headline::named(name).0 } else { name };
            [vec![name.to_string()], numbers.to_vec(), vec![e.failed.to_string()]].concat()
        });
        let of_unit = |measure: &str| format!("{measure} [{}]", unit.unwrap_or(&"its unit"));
        let measures = ["mean", "rms", "median", "99 % below", "max"].map(of_unit);
        let header = [vec!["acceleration of".to_string()], measures.to_vec(), vec!["failed".into()]].concat();
        findings.heading("Error of accelerations on fresh states").table(&header, accelerations);
    }

    /// Adds the errors of the mass matrix.
    fn add_mass_matrix(&self, findings: &mut Findings) {
        let MassMatrixError { factor, error: m, .. } = &self.mass_matrix;
        let matrix = [m.mean, m.median, m.p99, m.max].map(percentage);
        let matrix = [vec![number(*factor)], matrix.to_vec(), vec![m.failed.to_string()]].concat();
        findings.heading("Relative error of the mass matrix at rest, up to one factor");
        findings.table(&["factor [1]", "mean [%]", "median [%]", "99 % below [%]", "max [%]", "failed"], [matrix]);
    }

    /// Adds the results of the trajectory test.
    fn add_trajectories(&self, findings: &mut Findings) {
        let unit = &self.time_unit;
        let mut header = vec!["start".to_string(), with_unit("until", unit), with_unit("valid", unit)];
        header.extend(self.units.iter().flat_map(|(coordinate, _)| {
            let [mean, most] = ["mean", "max"].map(|which| format!("coordinates, {which} [{coordinate}]"));
            [mean, most, format!("velocities, max [{coordinate}/{unit}]")]
        }));
        header.extend(["energy, mean [%]", "energy, max [%]"].map(String::from));
        header.extend(self.conserved.map(|_| "conserved, max [%]".to_string()));
        header.extend([with_unit("Lyapunov time", unit), "remarks".to_string()]);
        let mut about = String::from("Trajectories from random starts against exact motion");
        if let Some(name) = self.conserved {
            let _ = write!(about, "; conserved: {name}");
        }
        let t_end = self.trajectories.iter().fold(0.0, |m: f64, motion| m.max(motion.summary.compared_until));
        if t_end > 1.0 {
            let time = t_end / t_end.ln();
            let _ = write!(about, "; motion without chaos has a Lyapunov time of about {time:.0} {unit}");
        }
        let row = |(k, motion)| self.trajectory_row(k, motion);
        findings.heading(about).table(&header, self.trajectories.iter().enumerate().map(row));
    }

    /// The row of start `k` of the trajectory test.
    fn trajectory_row(&self, k: usize, motion: &Motion) -> Vec<String> {
        let t = &motion.summary;
        let valid = format!("{}{}", number(t.valid.time), if t.valid.at_least { "+" } else { "" });
        let mut row = vec![(k + 1).to_string(), format!("{:.1}", t.compared_until), valid];
        // For each unit, shows the coordinate with the largest error.
        for (_, members) in &self.units {
            let worst = |errors: &[Statistics], part: fn(&Statistics) -> f64| {
                members.iter().filter_map(|&i| errors.get(i)).map(part).fold(f64::NAN, f64::max)
            };
            let coordinates =
                [|s: &Statistics| s.mean, |s: &Statistics| s.max].map(|part| worst(&t.coordinate_error, part));
            row.extend(coordinates.into_iter().chain([worst(&t.velocity_error, |s| s.max)]).map(number));
        }
        row.extend([t.energy_error.mean, t.energy_error.max].map(percentage));
        row.extend(motion.conserved_error.map(|conserved| percentage(conserved.max)));
        let time = t.lyapunov_exponent.filter(|exponent| *exponent > 0.0).map(f64::recip);
        row.push(time.map_or(NONE.to_string(), |time| rounded(time, 2)));
        let exact = t.reference_stopped.as_ref().map(|stop| format!("exact motion: {stop}"));
        let remarks = [motion.left_training_range.clone(), t.stopped.clone(), exact];
        row.push(remarks.into_iter().flatten().collect::<Vec<_>>().join("; "));
        row
    }

    /// Headline and tables for a model of the system `title`.
    pub fn findings(&self, title: &str) -> Findings {
        let mut findings = self.headline(title);
        findings.append(self.tables());
        findings
    }

    /// Headline for a model of the system `title`.
    pub(crate) fn headline(&self, title: &str) -> Findings {
        headline::of_evaluation(title, self).findings()
    }

    /// Adds the pictures to a report, those of the motion first.
    pub(crate) fn pictures(&self, report: Report) -> Report {
        let of_motion = |figure: &&Figure| !["lagrangian", "det_"].iter().any(|word| figure.file.starts_with(word));
        let (motion, functions): (Vec<&Figure>, Vec<&Figure>) = self.figures.iter().partition(of_motion);
        let report = report.section("Predicted motion beside the exact one", motion);
        report
            .section("The learned functions beside the exact ones", functions.into_iter().chain(&self.physics.figures))
    }

    /// Adds the tables to a report.
    pub(crate) fn report(&self, report: Report) -> Report {
        self.physics.report(report.findings(&self.tables()))
    }
}
