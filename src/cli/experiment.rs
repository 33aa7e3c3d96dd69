//! `lnn experiment`: the paper's tables and figures, one command each; finished runs are not run again.

use crate::cli::files::{holds_something, require_free};
use crate::cli::folder::Folder;
use crate::cli::number::{count, threads};
use crate::cli::watch::watch;
use crate::cli::{CliError, interrupt, output};
use crate::experiments::{Experiment, Run, Scale, experiments, find};
use crate::names::{WIDTH, wrapped};
use crate::pipeline::{Directory, RECORD, Watch, finished_record, run_experiment};
use crate::recording::Columns;
use crate::recording::read::read_recording;
use crate::report::{Curve, EXPERIMENT_HEADER, text_table};
use std::path::{Path, PathBuf};

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
    let stop = interrupt::flag().map_err(CliError::signals)?;
    for (experiment, runs) in chosen {
        let path = args.out.join(format!("{}-{}", experiment.name, scale.name()));
        perform((experiment, scale), runs, threads(args.threads), &path, (&curves, &watch(&stop), args.json))?;
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
    let store = Directory::at(path);
    let mut others = Vec::new();
    for run in runs {
        if holds_something(&path.join(&run.name).join(RECORD)) && finished_record(&store, run)?.is_none() {
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
    let points = |track: crate::recording::RecordedTrajectory| track.times.into_iter().zip(track.q).collect::<Vec<_>>();
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
    (beside, watch, json): (&[Curve], &Watch, bool),
) -> Result<(), CliError> {
    let folder = Folder::open(path)?;
    let done = run_experiment((experiment, scale), runs, threads, beside, &folder, watch)?;
    let report = folder.file("report.html");
    if json {
        let row = |cells: &Vec<String>| {
            let named = EXPERIMENT_HEADER.iter().zip(cells);
            named.map(|(name, cell)| (name.to_string(), cell.as_str().into())).collect::<serde_json::Map<_, _>>()
        };
        let object = serde_json::json!({
            "experiment": experiment.name,
            "scale": scale.name(),
            "runs": done.results.len(),
            "training_seconds": done.training_seconds,
            "rows": done.table.iter().map(row).collect::<Vec<_>>(),
            "report": report.display().to_string(),
        });
        return output::print(&format!("{object}\n"));
    }
    output::print(&(done.text().to_string() + &wrapped(&format!("report: {}\n\n", report.display()), WIDTH)))
}
