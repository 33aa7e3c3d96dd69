//! `lnn experiment`: the paper's tables and figures, one command each; finished runs are not run again.

use crate::cli::files::{holds_something, require_free};
use crate::cli::folder::Folder;
use crate::cli::learning::{Begin, Effort, Keeping, Learning, forget, learn};
use crate::cli::number::{count, threads};
use crate::cli::progress::Progress as Bar;
use crate::cli::taken::{pictures_of_runs, within};
use crate::cli::{CliError, Kind, headline, interrupt, output};
use crate::experiments::{Experiment, Outcome, Record, Run, Scale, experiments, find};
use crate::names::{WIDTH, counted, wrapped};
use crate::recording::Columns;
use crate::recording::read::read_recording;
use crate::report::{
    Curve, EXPERIMENT_HEADER, REDUCTION_HEADER, Report, experiment_curves, experiment_figures, experiment_table,
    experiment_view, reduction_table, text_table,
};
use crate::training::{Every, Hooks, Stop};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// An experiment by name, or `all`; without a name they are listed with the tables and figures they regenerate.
    name: Option<String>,
    /// Share of the paper's budget.
    #[arg(long, value_enum, value_name = "SCALE", default_value = "short")]
    scale: ScaleName,
    /// Seeds of every run.
    #[arg(long, value_name = "N", default_value = "1", allow_hyphen_values = true, value_parser = seeds)]
    seeds: usize,
    /// Only the runs whose row of the table begins with this text; a later command without it goes on from there.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Threads; as many runs go side by side, and the results do not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = count)]
    threads: Option<usize>,
    /// A curve from elsewhere for the picture of time-to-accuracy: a CSV with the columns seconds and validation_loss; may be
    /// repeated.
    #[arg(long, value_name = "LABEL=FILE.csv", value_parser = beside)]
    beside: Vec<(String, PathBuf)>,
    /// Directory; an experiment goes into NAME-SCALE in it, where it goes on with what is there.
    #[arg(long, value_name = "DIR", default_value = "runs/experiments")]
    out: PathBuf,
    /// One JSON object per line instead of tables.
    #[arg(long)]
    json: bool,
    /// Replace finished runs that are of other configurations.
    #[arg(long)]
    overwrite: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum ScaleName {
    /// All experiments in minutes; shows that they run.
    Smoke,
    /// Minutes each; gives a ranking.
    Short,
    /// The paper's own.
    Paper,
}

/// Runs experiments, or lists them.
///
/// # Errors
/// A usage error for an unknown name, a data error for a directory that cannot be written or that another run holds, an
/// interruption; runs that are finished stay finished.
pub fn run(args: &Args) -> Result<(), CliError> {
    let Some(name) = &args.name else {
        interrupt::end_at_once().map_err(CliError::signals)?;
        return output::print(&listing(args.json));
    };
    let scale = match args.scale {
        ScaleName::Smoke => Scale::Smoke,
        ScaleName::Short => Scale::Short,
        ScaleName::Paper => Scale::Paper,
    };
    let chosen: Vec<&Experiment> =
        if name == "all" { experiments().iter().collect() } else { vec![find(name).map_err(CliError::usage)?] };
    let chosen = chosen_runs(args, &chosen, scale)?;
    for (experiment, runs) in &chosen {
        let path = args.out.join(format!("{}-{}", experiment.name, scale.name()));
        let inputs: Vec<&Path> = args.beside.iter().map(|(_, file)| file.as_path()).collect();
        WRITTEN.iter().try_for_each(|name| require_free(&path.join(name), &inputs, true))?;
        if !args.overwrite {
            require_same(&path, runs)?;
        }
    }
    let curves = args.beside.iter().map(curve).collect::<Result<Vec<Curve>, CliError>>()?;
    let hooks = Hooks { watcher: None, interrupt: interrupt::flag().map_err(CliError::signals)? };
    for (experiment, runs) in chosen {
        let path = args.out.join(format!("{}-{}", experiment.name, scale.name()));
        perform((experiment, scale), runs, threads(args.threads), &path, (&curves, &hooks, args.json))?;
    }
    Ok(())
}

/// The experiments with those of their runs that were asked for, if there are any.
fn chosen_runs<'a>(
    args: &Args,
    chosen: &[&'a Experiment],
    scale: Scale,
) -> Result<Vec<(&'a Experiment, Vec<Run>)>, CliError> {
    let all = || chosen.iter().map(|experiment| (*experiment, experiment.runs(scale, args.seeds)));
    let Some(text) = &args.only else { return Ok(all().collect()) };
    let of = |(experiment, runs): (&'a Experiment, Vec<Run>)| {
        (experiment, runs.into_iter().filter(|run| run.label.starts_with(text)).collect::<Vec<Run>>())
    };
    let kept: Vec<_> = all().map(of).filter(|(_, runs)| !runs.is_empty()).collect();
    if kept.is_empty() {
        let mut rows: Vec<String> = all().flat_map(|(_, runs)| runs).map(|run| format!("`{}`", run.label)).collect();
        rows.dedup();
        let rows = rows.join(", ");
        return Err(CliError::usage(format_args!("--only {text:?}: no row begins so; there are {rows}")));
    }
    Ok(kept)
}

/// Seeds of every run, no more than can be listed.
fn seeds(text: &str) -> Result<usize, String> {
    const MOST: usize = 10_000;
    let seeds = count(text)?;
    if seeds <= MOST { Ok(seeds) } else { Err(format!("expected a whole number above 0, at most {MOST}")) }
}

/// Tables of an experiment, made anew of the records of its runs.
const WRITTEN: [&str; 2] = ["table.csv", "curves.csv"];

/// Refuses a directory with finished runs of other configurations than those asked for.
fn require_same(path: &Path, runs: &[Run]) -> Result<(), CliError> {
    let mut others = Vec::new();
    for run in runs {
        let toml = toml::to_string(&run.config).map_err(CliError::data)?;
        let directory = path.join(&run.name);
        if holds_something(&directory.join(RECORD)) && finished(&directory, &toml).is_none() {
            others.push(run.name.as_str());
        }
    }
    let Some((first, more)) = others.split_first() else { return Ok(()) };
    let more = if more.is_empty() { String::new() } else { format!(" (and {} more)", more.len()) };
    let problem = format!(
        "a finished run of another configuration is there{more}; --overwrite replaces it, or choose another --out"
    );
    Err(CliError::file(&path.join(first), problem))
}

/// `label=file`.
fn beside(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((label, file)) if !label.trim().is_empty() && !file.is_empty() => {
            Ok((label.trim().to_string(), PathBuf::from(file)))
        }
        _ => Err("expected LABEL=FILE.csv".to_string()),
    }
}

/// A curve of loss against time from a file.
fn curve((label, file): &(String, PathBuf)) -> Result<Curve, CliError> {
    let [time, loss] = ["seconds", "validation_loss"].map(str::to_string);
    let columns = Columns { coords: vec![loss], time: Some(time), ..Columns::default() };
    let reading = read_recording(&[file], &columns).map_err(CliError::data)?;
    let points = |track: crate::recording::Track| track.times.into_iter().zip(track.q).collect::<Vec<_>>();
    Ok(Curve { label: label.clone(), points: reading.recording.tracks.into_iter().flat_map(points).collect() })
}

fn listing(json: bool) -> String {
    if json {
        let described = |e: &Experiment| {
            let runs = e.runs(Scale::Paper, 1).len();
            serde_json::json!({ "name": e.name, "title": e.title, "paper": e.paper, "runs": runs })
        };
        return experiments().iter().map(|experiment| format!("{}\n", described(experiment))).collect();
    }
    let rows: Vec<Vec<String>> = experiments()
        .iter()
        .map(|e| vec![e.name.to_string(), e.paper.to_string(), e.runs(Scale::Paper, 1).len().to_string()])
        .collect();
    text_table(&["experiment", "of the paper", "runs"], &rows)
}

fn perform(
    (experiment, scale): (&Experiment, Scale),
    runs: Vec<Run>,
    threads: usize,
    path: &Path,
    (beside, hooks, json): (&[Curve], &Hooks, bool),
) -> Result<(), CliError> {
    let started = Instant::now();
    let folder = Folder::open(path)?;
    let bar = Bar::new(runs.len() as u64, "runs");
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Mutex<BTreeMap<usize, Result<Option<Record>, CliError>>> = Mutex::new(BTreeMap::new());
    let abreast = if experiment.is_timed() { 1 } else { threads.min(runs.len()).max(1) };
    let work = || {
        while let Some(run) = runs.get(next.fetch_add(1, Ordering::Relaxed)) {
            let result = one(run, scale, (threads / abreast).max(1), &path.join(&run.name), hooks);
            bar.advance(done.fetch_add(1, Ordering::Relaxed) as u64 + 1);
            let failed = result.is_err();
            let index = runs.iter().position(|other| other.name == run.name).unwrap_or(0);
            results.lock().unwrap_or_else(PoisonError::into_inner).insert(index, result);
            if failed || hooks.interrupt.load(Ordering::SeqCst) {
                // No new runs; those of the other threads come to their own end.
                next.store(runs.len(), Ordering::Relaxed);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..abreast {
            scope.spawn(work);
        }
    });
    drop(bar);
    let mut found = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    let results = runs
        .into_iter()
        .enumerate()
        .map(|(index, run)| Ok((run, found.remove(&index).transpose()?.flatten())))
        .collect::<Result<Vec<(Run, Option<Record>)>, CliError>>()?;
    if hooks.interrupt.load(Ordering::SeqCst) {
        let finished = results.iter().filter(|(_, record)| record.is_some()).count();
        return Err(CliError::interrupted(format_args!(
            "interrupted with {finished} of {} finished; the same command goes on from there",
            counted(results.len(), "run", "runs")
        )));
    }
    conclude(experiment, scale, (&results, beside, json), &folder, path, started)
}

/// The record of a run: the one that is there if it was made from the same configuration, or a new one. `None` if it was
/// interrupted.
fn one(run: &Run, scale: Scale, threads: usize, path: &Path, hooks: &Hooks) -> Result<Option<Record>, CliError> {
    let toml = toml::to_string(&run.config).map_err(CliError::data)?;
    if let Some(record) = finished(path, &toml) {
        return Ok(Some(record));
    }
    let folder = Folder::open(path)?;
    // That of another configuration must not be found beside the new one.
    match std::fs::remove_file(folder.file(RECORD)) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(CliError::file(&folder.file(RECORD), e)),
        _ => {}
    }
    let system = run.config.system().map_err(CliError::data)?;
    run.config.validate(system.coordinates).map_err(CliError::data)?;
    let (starts, horizon) = scale.trajectories();
    let began = Instant::now();
    // A run that was stopped goes on from its checkpoint.
    let keeping = Keeping { every: Every::Seconds(60.0), start: Begin::Either };
    let effort = Effort { threads, starts, horizon };
    let learned = match learn(&folder, &run.config, &system, effort, hooks, keeping) {
        Err(error) if error.kind() == Kind::Interrupted => return Ok(None),
        learned => learned?,
    };
    let record = match learned {
        _ if hooks.interrupt.load(Ordering::SeqCst) => return Ok(None),
        Learning::Finished(finished) => {
            if let Stop::Failed(error) = &finished.stop {
                tracing::warn!(run = run.name, %error, "training stopped early");
            }
            finished.record
        }
        Learning::Nothing(reason) => Record {
            outcome: Outcome::Nothing { reason },
            losses: Vec::new(),
            times: Vec::new(),
            seconds: began.elapsed().as_secs_f64(),
        },
    };
    folder.write("config.toml", toml.as_bytes())?;
    // What has a record is finished.
    let json = serde_json::to_string(&record).map_err(CliError::data)?;
    folder.write(RECORD, json.as_bytes())?;
    forget(&folder)?;
    Ok(Some(record))
}

/// Runs with their records, as far as they are finished.
type Results = [(Run, Option<Record>)];

/// File that a finished run has.
const RECORD: &str = "record.json";

/// The record in a directory if it was made from this configuration.
fn finished(path: &Path, toml: &str) -> Option<Record> {
    let read = |name: &str| crate::storage::read_regular(&path.join(name), 1 << 26).ok();
    let record = serde_json::from_slice(&read(RECORD)?).ok()?;
    (read("config.toml")? == toml.as_bytes()).then_some(record)
}

/// Writes table, pictures and report; prints the table.
fn conclude(
    experiment: &Experiment,
    scale: Scale,
    (results, beside, json): (&Results, &[Curve], bool),
    folder: &Folder,
    path: &Path,
    started: Instant,
) -> Result<(), CliError> {
    let rows = experiment.rows(results);
    let (table, (header, view)) = (experiment_table(&rows), experiment_view(&rows));
    let mut curves = experiment_curves(results);
    curves.extend_from_slice(beside);
    folder.write("table.csv", csv(&table).as_bytes())?;
    if experiment.is_timed() {
        folder.write("curves.csv", curves_csv(&curves).as_bytes())?;
    }
    let figures = experiment_figures(experiment, results, &curves);
    let taken = pictures_of_runs(experiment, results, path);
    let training: f64 = results.iter().filter_map(|(_, record)| record.as_ref()).map(|record| record.seconds).sum();
    let note = format!(
        "Scale {}, {}, {training:.0} s of training, {:.0} s on the clock this time.",
        scale.name(),
        counted(results.len(), "run", "runs"),
        started.elapsed().as_secs_f64()
    );
    let conventions = "Losses are the paper's: half the mean absolute error of scaled accelerations; times the mean scale \
                       they are physical. Several runs: mean [lowest, highest]. Wrong signature: share of the fresh \
                       states. Integrated: starts of the trajectory test whose learned motion reached its end.";
    let headline = headline::of_experiment(&rows);
    let report = headline
        .begin(Report::new(experiment.title))
        .paragraph(&format!("Regenerates: {}.", experiment.paper))
        .paragraph(&format!("The paper: {}", experiment.finding))
        .paragraph(&note)
        .table(&header, &view)
        .paragraph(conventions);
    let remarks = experiment.remarks(&results.iter().map(|(run, _)| run).collect::<Vec<_>>());
    let reductions = reduction_table(&experiment.reductions(results));
    let report = remarks.iter().fold(report, |report, remark| report.paragraph(remark));
    let report = if reductions.is_empty() { report } else { report.table(&REDUCTION_HEADER, &reductions) };
    let report = within(taken, report.figures(&figures));
    folder.write("report.html", report.to_html().as_bytes())?;
    figures.iter().try_for_each(|figure| folder.write(&figure.file, figure.picture.to_svg().as_bytes()))?;
    if json {
        let row = |cells: &Vec<String>| {
            let named = EXPERIMENT_HEADER.iter().zip(cells);
            named.map(|(name, cell)| (name.to_string(), cell.as_str().into())).collect::<serde_json::Map<_, _>>()
        };
        let object = serde_json::json!({
            "experiment": experiment.name,
            "scale": scale.name(),
            "runs": results.len(),
            "training_seconds": training,
            "rows": table.iter().map(row).collect::<Vec<_>>(),
            "report": folder.file("report.html").display().to_string(),
        });
        return output::print(&format!("{object}\n"));
    }
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
    let report = folder.file("report.html");
    let (title, paper) = (experiment.title, experiment.paper);
    let place = if paper == "-" { String::new() } else { format!(" (of the paper: {paper})") };
    output::print(&wrapped(&format!("{title}{place}\n{text}\n{note}\nreport: {}\n\n", report.display()), WIDTH))
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

/// Comma-separated values; cells hold brackets and words, so all are quoted.
fn csv(table: &[Vec<String>]) -> String {
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        cells.map(|cell| format!("\"{}\"", cell.replace('"', "\"\""))).collect::<Vec<_>>().join(",") + "\n"
    };
    let rows = table.iter().map(|row| line(&mut row.iter().map(String::as_str)));
    line(&mut EXPERIMENT_HEADER.into_iter()) + &rows.collect::<String>()
}
