//! The report of an experiment: table, pictures, page, words.

use crate::experiments::{Record, Run, rows};
use crate::findings::Findings;
use crate::names::pluralize;
use crate::pipeline::experiment::Experiment;
use crate::pipeline::experiment_directory::ExperimentDirectory;
use crate::pipeline::run_table::run_table;
use crate::pipeline::{Output, PipelineError, Watch, headline};
use crate::report::{DataTable, Figure, Report, experiment_table, experiment_view, loss_figures};
use std::time::Instant;

/// Runs with their records; unfinished runs have none.
pub type Results = Vec<(Run, Option<Record>)>;

/// An experiment after its files were written.
#[derive(Debug)]
pub struct ExperimentReport {
    /// Runs with their records.
    pub results: Results,
    /// The table of `table.csv`.
    pub table: DataTable,
    /// Number of finished runs.
    pub finished: usize,
    /// Seconds of training of all runs.
    pub training_seconds: f64,
    /// Headline and tables.
    pub findings: Findings,
}

/// Extends a report.
pub type Part = Box<dyn FnOnce(Report) -> Report>;

/// What an experiment adds to its report.
#[derive(Default)]
pub struct Additions {
    /// Text after the title on a terminal.
    pub subtitle: String,
    /// Paragraphs below the headline.
    pub introduction: Vec<String>,
    /// Pictures of all runs, after the loss curves.
    pub figures: Vec<Figure>,
    /// Section above the table of the report.
    pub above: Option<Part>,
    /// Section below the table and its remarks.
    pub below: Option<Part>,
    /// Tables below the remarks on a terminal.
    pub tables: Findings,
}

/// Conventions of the table.
const CONVENTIONS: &str = "Losses are the paper's: half the mean absolute error of scaled accelerations; times the mean scale \
                           they are physical. Several runs: mean [lowest, highest]. Wrong signature: share of the fresh \
                           states. Integrated: starts of the trajectory test whose learned motion reached its end.";

/// Adds a section to a report, if there is one.
fn with(report: Report, part: Option<Part>) -> Report {
    match part {
        Some(part) => part(report),
        None => report,
    }
}

/// Writes table, pictures and report. They depend on the records alone. Times, except those that the experiment measures, appear only in
/// the text for a terminal; `started` is when this process began its work.
pub(crate) fn conclude(
    experiment: &dyn Experiment,
    results: Results,
    store: &ExperimentDirectory,
    watch: &Watch,
    started: Option<Instant>,
) -> Result<ExperimentReport, PipelineError> {
    let rows = rows(&results);
    let (table, (header, view)) = (experiment_table(&rows), experiment_view(&rows));
    let output = store.open_tables()?;
    experiment.command().write(&output)?;
    output.write("table.csv", table.to_csv().as_bytes())?;
    output.write("runs.csv", run_table(&results, store)?.to_csv().as_bytes())?;
    let mut figures = loss_figures(&results);
    let more = experiment.additions(&results, store, &output, watch)?;
    figures.extend(more.figures);
    let training: f64 = results.iter().filter_map(|(_, record)| record.as_ref()).map(|record| record.seconds).sum();
    let finished = results.iter().filter(|(_, record)| record.is_some()).count();
    let of_all = if finished == results.len() { String::new() } else { format!(", {finished} of them finished") };
    let runs = pluralize(results.len(), "run", "runs");
    let budget = match experiment.scale() {
        Some(scale) => format!("Scale {scale}, {runs}{of_all}"),
        None => format!("{runs}{of_all}"),
    };
    let headline = headline::of_experiment(&rows).findings();
    let report = Report::new(experiment.title()).findings(&headline);
    let report = more.introduction.iter().fold(report, |report, text| report.paragraph(text));
    let report = report.paragraph(&format!("{budget}.")).section("Pictures of all runs", &figures);
    let report = with(report, more.above);
    let report = report.heading("Losses and errors").table(&header, &view).paragraph(CONVENTIONS);
    let remarks = experiment.remarks(&results.iter().map(|(run, _)| run).collect::<Vec<_>>());
    let report = remarks.iter().fold(report, |report, remark| report.paragraph(remark));
    let report = with(report, more.below);
    output.write("report.html", report.to_html().as_bytes())?;
    figures.iter().try_for_each(|figure| output.write(&figure.file, figure.to_svg().as_bytes()))?;
    drop(output);

    let (energies, others): (Vec<usize>, Vec<usize>) =
        (1..header.len()).partition(|&k| ["energy", "motions"].iter().any(|word| header[k].contains(word)));
    let mut findings = Findings::default();
    findings.heading(format!("{}{}", experiment.title(), more.subtitle)).append(headline);
    for columns in [others, energies].into_iter().filter(|columns| !columns.is_empty()) {
        let columns: Vec<usize> = [0].into_iter().chain(columns).collect();
        let of = |row: &Vec<String>| columns.iter().map(|&k| row[k].clone()).collect::<Vec<_>>();
        findings.gap().table(&columns.iter().map(|&k| header[k]).collect::<Vec<_>>(), view.iter().map(of));
    }
    findings.gap().lines(remarks).append(more.tables);
    let clock = started.map(|began| format!(", {:.0} s on the clock this time", began.elapsed().as_secs_f64()));
    findings.gap().line(format!("{budget}, {training:.0} s of training{}.", clock.unwrap_or_default()));
    Ok(ExperimentReport { results, table, finished, training_seconds: training, findings })
}
