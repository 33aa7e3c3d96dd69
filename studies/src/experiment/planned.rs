//! An experiment at a scale, as the library performs it.

use super::experiments::{Experiment, Scale};
use super::figures::{Curve, curves_csv, curves_of, figures};
use super::readings::{self, READING_HEADER, RowOfHoles, read_hole, rows_of_holes};
use super::reductions::{REDUCTION_HEADER, reduction_table};
use super::run_figures::{pictures_of_runs, within};
use lnn::experiments::Run;
use lnn::findings::Findings;
use lnn::network::NetworkLagrangian;
use lnn::pipeline::{Additions, ExperimentDirectory, Output, PipelineError, Results, Watch};
use lnn::report::Report;

/// An experiment at a scale, with curves of other programs beside its own.
pub struct Planned {
    pub experiment: &'static Experiment,
    pub scale: Scale,
    /// Curves of loss against time from elsewhere.
    pub beside: Vec<Curve>,
}

impl lnn::pipeline::Experiment for Planned {
    fn name(&self) -> &str {
        self.experiment.name
    }

    fn title(&self) -> &str {
        self.experiment.title
    }

    fn scale(&self) -> Option<&str> {
        Some(self.scale.name())
    }

    fn is_timed(&self) -> bool {
        self.experiment.is_timed()
    }

    fn trajectories(&self) -> (usize, f64) {
        self.scale.trajectories()
    }

    fn tables(&self) -> &[&str] {
        &[CURVES, readings::TABLE]
    }

    fn files(&self) -> &[&str] {
        &readings::FILES
    }

    fn look_at(
        &self,
        run: &Run,
        learned: &NetworkLagrangian<f64>,
        threads: usize,
        output: &dyn Output,
        watch: &Watch,
    ) -> Result<(), PipelineError> {
        if !self.experiment.reads_holes() {
            return Ok(());
        }
        let pixels = if self.scale == Scale::Smoke { 12 } else { readings::PIXELS };
        read_hole(run, learned, (pixels, threads), output, watch)
    }

    fn remarks(&self, runs: &[&Run]) -> Vec<String> {
        self.experiment.remarks(runs)
    }

    fn additions(
        &self,
        results: &Results,
        store: &ExperimentDirectory,
        output: &dyn Output,
        watch: &Watch,
    ) -> Result<Additions, PipelineError> {
        let experiment = self.experiment;
        let mut curves = curves_of(results);
        curves.extend_from_slice(&self.beside);
        if experiment.is_timed() {
            output.write(CURVES, curves_csv(&curves).as_bytes())?;
        }
        let taken = pictures_of_runs(experiment, results, store);
        let reads = experiment.reads_holes();
        let holes = if reads { rows_of_holes(results, store, output, watch)? } else { Vec::new() };
        let reductions = reduction_table(&experiment.reductions(results));
        let mut tables = Findings::default();
        tables.gap().table(&REDUCTION_HEADER, reductions.iter().cloned());
        for RowOfHoles { label, table, .. } in &holes {
            tables.heading(label).table(&READING_HEADER, table.iter().cloned());
        }
        let above = move |report: Report| holes.iter().fold(within(taken, report), |report, row| row.add_to(report));
        let below = move |report: Report| match reductions.is_empty() {
            true => report,
            false => report.table(&REDUCTION_HEADER, &reductions),
        };
        let paper = experiment.paper;
        Ok(Additions {
            subtitle: if paper == "-" { String::new() } else { format!(" (of the paper: {paper})") },
            introduction: vec![format!("Regenerates: {paper}."), format!("The paper: {}", experiment.finding)],
            figures: figures(experiment, results, &curves),
            above: Some(Box::new(above)),
            below: Some(Box::new(below)),
            tables,
        })
    }
}

/// Name of the table of loss against time.
const CURVES: &str = "curves.csv";
