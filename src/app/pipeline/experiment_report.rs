//! The report of an experiment: table, pictures, page, words.

use crate::experiments::{Experiment, Record, Run, Scale};
use crate::findings::text_table;
use crate::names::{WIDTH, pluralize, wrap_text};
use crate::pipeline::experiment_directory::ExperimentDirectory;
use crate::pipeline::readings::{RowOfHoles, rows_of_holes};
use crate::pipeline::run_figures::{pictures_of_runs, within};
use crate::pipeline::run_table::run_table;
use crate::pipeline::{Output, PipelineError, Watch, headline};
use crate::report::{
    Curve, DataTable, READING_HEADER, REDUCTION_HEADER, Report, experiment_curves, experiment_figures,
    experiment_table, experiment_view, reduction_table,
};
use std::fmt::Write as _;
use std::time::Instant;

/// Runs with their records, as far as they are finished.
pub type Results = Vec<(Run, Option<Record>)>;

/// An experiment after its files were written.
#[derive(Debug)]
pub struct ExperimentReport {
    /// Runs with their records.
    pub results: Results,
    /// The table of `table.csv`.
    pub table: DataTable,
    /// Runs that are finished.
    pub finished: usize,
    /// Seconds of training of all runs.
    pub training_seconds: f64,
    text: String,
}

impl ExperimentReport {
    /// Headline and tables for a terminal.
    pub fn text(&self) -> &str {
        &self.text
    }
}

/// Conventions of the table.
const CONVENTIONS: &str = "Losses are the paper's: half the mean absolute error of scaled accelerations; times the mean scale \
                           they are physical. Several runs: mean [lowest, highest]. Wrong signature: share of the fresh \
                           states. Integrated: starts of the trajectory test whose learned motion reached its end.";

/// Writes table, pictures and report. They depend on the records alone. Times, but for the curves of loss against time, stand only
/// in the text for a terminal, where `started` is the beginning of this process's work.
pub(crate) fn conclude(
    (experiment, scale): (&Experiment, Scale),
    results: Results,
    beside: &[Curve],
    store: &ExperimentDirectory,
    watch: &Watch,
    started: Option<Instant>,
) -> Result<ExperimentReport, PipelineError> {
    let rows = experiment.rows(&results);
    let (table, (header, view)) = (experiment_table(&rows), experiment_view(&rows));
    let mut curves = experiment_curves(&results);
    curves.extend_from_slice(beside);
    let output = store.open_tables()?;
    output.write("table.csv", table.to_csv().as_bytes())?;
    output.write("runs.csv", run_table(&results, store)?.to_csv().as_bytes())?;
    if experiment.is_timed() {
        output.write("curves.csv", curves_csv(&curves).as_bytes())?;
    }
    let figures = experiment_figures(experiment, &results, &curves);
    let taken = pictures_of_runs(experiment, &results, store);
    let training: f64 = results.iter().filter_map(|(_, record)| record.as_ref()).map(|record| record.seconds).sum();
    let finished = results.iter().filter(|(_, record)| record.is_some()).count();
    let of_all = if finished == results.len() { String::new() } else { format!(", {finished} of them finished") };
    let runs = pluralize(results.len(), "run", "runs");
    let budget = if experiment.is_sweep() {
        format!("{runs}{of_all}")
    } else {
        format!("Scale {}, {runs}{of_all}", scale.name())
    };
    let headline = headline::of_experiment(&rows);
    let report = headline.begin(Report::new(experiment.title));
    let report = if experiment.is_sweep() {
        report
    } else {
        let report = report.paragraph(&format!("Regenerates: {}.", experiment.paper));
        report.paragraph(&format!("The paper: {}", experiment.finding))
    };
    let report = report.paragraph(&format!("{budget}.")).section("Pictures of all runs", &figures);
    let holes = rows_of_holes(experiment, &results, store, &output, watch)?;
    let report = holes.iter().fold(within(taken, report), |report, row| row.add_to(report));
    let report = report.heading("Losses and errors").table(&header, &view).paragraph(CONVENTIONS);
    let remarks = experiment.remarks(&results.iter().map(|(run, _)| run).collect::<Vec<_>>());
    let reductions = reduction_table(&experiment.reductions(&results));
    let report = remarks.iter().fold(report, |report, remark| report.paragraph(remark));
    let report = if reductions.is_empty() { report } else { report.table(&REDUCTION_HEADER, &reductions) };
    output.write("report.html", report.to_html().as_bytes())?;
    figures.iter().try_for_each(|figure| output.write(&figure.file, figure.picture.to_svg().as_bytes()))?;
    drop(output);

    let (energies, others): (Vec<usize>, Vec<usize>) =
        (1..header.len()).partition(|&k| ["energy", "motions"].iter().any(|word| header[k].contains(word)));
    let table_of = |columns: &[usize]| {
        let columns: Vec<usize> = [0].iter().chain(columns).copied().collect();
        let rows: Vec<Vec<&str>> = view.iter().map(|row| columns.iter().map(|&k| row[k].as_str()).collect()).collect();
        text_table(&columns.iter().map(|&k| header[k]).collect::<Vec<_>>(), &rows)
    };
    let tables =
        [others, energies].iter().filter(|columns| !columns.is_empty()).map(|c| table_of(c)).collect::<Vec<_>>();
    let mut text = format!("{}\n{}\n", headline.text(), tables.join("\n"));
    remarks.iter().for_each(|remark| text += &format!("{remark}\n"));
    if !reductions.is_empty() {
        text += &format!("\n{}", text_table(&REDUCTION_HEADER, &reductions));
    }
    for RowOfHoles { label, table, .. } in &holes {
        text += &format!("\n{label}\n{}", text_table(&READING_HEADER, table));
    }
    let clock = started.map(|began| format!(", {:.0} s on the clock this time", began.elapsed().as_secs_f64()));
    let note = format!("{budget}, {training:.0} s of training{}.", clock.unwrap_or_default());
    let (title, paper) = (experiment.title, experiment.paper);
    let place = if paper == "-" { String::new() } else { format!(" (of the paper: {paper})") };
    let text = wrap_text(&format!("{title}{place}\n{text}\n{note}\n"), WIDTH);
    Ok(ExperimentReport { results, table, finished, training_seconds: training, text })
}

/// Loss against time of every curve, as far as they are known.
fn curves_csv(curves: &[Curve]) -> String {
    let mut csv = String::from("run,seconds,validation_loss\n");
    for Curve { label, points } in curves {
        let label = label.replace('"', "\"\"");
        for (seconds, loss) in points {
            let _ = writeln!(csv, "\"{label}\",{seconds},{loss}");
        }
    }
    csv
}
