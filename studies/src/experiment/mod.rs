//! The paper's tables and figures, one command each, whole or in shares; finished runs are not run again.

mod black_holes;
mod experiments;
mod figures;
mod hole_pictures;
mod network;
mod physical;
mod planned;
mod readings;
mod reductions;
mod run_figures;

use crate::setups::named;
use experiments::{Experiment, Scale, experiments, find};
use figures::Curve;
use lnn::experiments::Run;
use lnn::findings::text_table;
use lnn::lagrangian::SystemInstance;
use lnn::recording::{Columns, LoadedRecording};
use lnn::relativity::depends_on_time;
use lnn_cli::{CliError, Orders, Shard, Work, merge, perform, print, print_list};
use planned::Planned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// An experiment by name, or `all`. Without a name, all experiments are listed with the tables and figures that they regenerate.
    name: Option<String>,
    #[command(flatten)]
    chosen: Chosen,
    /// Threads; as many runs are trained in parallel, and the results do not depend on the number [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = whole(256))]
    threads: Option<usize>,
    /// Only the I-th of N shares of the runs, I from 1 to N; no tables are written [default: that of a Slurm array, or all].
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// List the runs: finished, in progress, or open.
    #[arg(long, requires = "name", conflicts_with_all = ["beside", "overwrite"])]
    list: bool,
    /// Replace finished runs of other configurations.
    #[arg(long)]
    overwrite: bool,
}

/// Work on an experiment beside running it.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Write tables, plots and report from the records of the finished runs, without running any.
    Merge {
        /// An experiment by name, or `all`.
        name: String,
        #[command(flatten)]
        chosen: Chosen,
    },
}

/// Which runs of experiments, and where they are.
#[derive(Debug, clap::Args)]
struct Chosen {
    /// Share of the paper's budget.
    #[arg(long, value_enum, value_name = "SCALE", default_value = "short")]
    scale: Scale,
    /// Seeds of every run.
    #[arg(long, value_name = "N", default_value = "1", allow_hyphen_values = true, value_parser = whole(MOST_SEEDS))]
    seeds: usize,
    /// Only the runs whose row of the table begins with this text; a later command without it completes the table.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// A system other than those of the experiment, by name or by its file; for black-holes only. Its coordinates are t, x, y, z
    /// or t, r, theta, phi.
    #[arg(long, value_name = "NAME|FILE.toml", requires = "name")]
    system: Option<String>,
    /// A parameter of that system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1.., value_parser = parameter, requires = "system")]
    param: Vec<(String, String)>,
    /// The curve of another program for the plot of time-to-accuracy: a CSV with the columns seconds and validation_loss; may be
    /// repeated.
    #[arg(long, value_name = "LABEL=FILE.csv", value_parser = beside)]
    beside: Vec<(String, PathBuf)>,
    /// Directory; an experiment is written into NAME-SCALE in it and continues with the runs that are there.
    #[arg(long, value_name = "DIR", default_value = "runs/experiments")]
    out: PathBuf,
    /// One JSON object per line instead of tables.
    #[arg(long)]
    json: bool,
}

impl Chosen {
    /// The system that was asked for instead of the experiment's own, with the parameters given.
    #[allow(clippy::type_complexity)]
    fn own_system(&self) -> Result<Option<(SystemInstance<f64>, BTreeMap<String, f64>)>, CliError> {
        let Some(name) = &self.system else { return Ok(None) };
        let configured = named(name, &self.param)?;
        require_stationary(&configured)?;
        let symbols = configured.system.parameters.iter().map(|p| p.symbol.to_string());
        let values: BTreeMap<String, f64> = symbols.zip(configured.parameters.iter().copied()).collect();
        let given = self.param.iter().filter_map(|(symbol, _)| Some((symbol.clone(), *values.get(symbol)?))).collect();
        Ok(Some((configured, given)))
    }

    /// The runs of experiments in their directories, numbered on from one to the next.
    fn work(&self, name: &str) -> Result<Vec<Work>, CliError> {
        let mut numbers = 0..;
        let beside = self.beside.iter().map(curve).collect::<Result<Vec<Curve>, CliError>>()?;
        let work = |(experiment, runs): (&'static Experiment, Vec<Run>)| {
            let path = self.out.join(format!("{}-{}", experiment.name, self.scale.name()));
            let words = self.words(experiment);
            let merge = format!("lnn-studies experiment merge {words}");
            let list = format!("lnn-studies experiment {words} --list");
            let runs = numbers.by_ref().zip(runs).collect();
            let inputs = self.beside.iter().map(|(_, file)| file.clone()).collect();
            let planned = Planned { experiment, scale: self.scale, beside: beside.clone() };
            Work { experiment: Box::new(planned), path, runs, merge, list, inputs }
        };
        Ok(chosen_runs(self, name)?.into_iter().map(work).collect())
    }

    /// Words of a command about the same runs, behind a verb.
    fn words(&self, experiment: &Experiment) -> String {
        let mut words = format!("{} --scale {}", experiment.name, self.scale.name());
        if self.seeds != 1 {
            words += &format!(" --seeds {}", self.seeds);
        }
        if let Some(system) = &self.system {
            words += &format!(" --system {system}");
        }
        words.extend(self.param.iter().map(|(symbol, value)| format!(" --param {symbol}={value}")));
        if let Some(text) = &self.only {
            words += &format!(" --only {text:?}");
        }
        if self.out != Path::new("runs/experiments") {
            words += &format!(" --out {}", self.out.display());
        }
        words
    }
}

/// Refuses a metric that changes with its time: its orbits, horizons and shadows would be those of one moment.
fn require_stationary(system: &SystemInstance<f64>) -> Result<(), CliError> {
    let n = system.coordinates;
    let Some(time) = system.system.time_like else { return Ok(()) };
    let bounds = system.system.validation(n).positions;
    // Points of the box at fractions that are all different.
    let place = |k: usize, i: usize| (0.618_034 * (k + 1) as f64 * (2.0 + i as f64).sqrt()).fract();
    let points =
        (0..8).flat_map(|k| bounds.iter().enumerate().map(move |(i, (low, high))| low + place(k, i) * (high - low)));
    let (points, span) = (points.collect::<Vec<f64>>(), bounds[time].1 - bounds[time].0);
    let model = system.build().map_err(CliError::usage)?;
    if depends_on_time(model.as_ref(), time, &points, span).map_err(CliError::data)? {
        let name = &system.system.coordinates(n)[time].name;
        let problem = "expected a metric that is constant in time";
        return Err(CliError::usage(format_args!("--system: the metric depends on its time {name}; {problem}")));
    }
    Ok(())
}

/// Runs experiments, a share of them, or lists them; makes tables of what others ran.
///
/// # Errors
/// A usage error for an unknown name or a share that cannot be told, a data error for a directory that cannot be written or
/// records that are missing, an interruption; runs that are finished stay finished.
pub fn run(args: &Args) -> Result<(), CliError> {
    if let Some(Action::Merge { name, chosen }) = &args.action {
        return merge(chosen.work(name)?, chosen.json);
    }
    let chosen = &args.chosen;
    let Some(name) = &args.name else {
        return print(&listing(chosen.json));
    };
    let all = chosen.work(name)?;
    if args.list {
        return print_list(all, args.shard, chosen.json);
    }
    let Args { threads, shard, overwrite, .. } = *args;
    perform(all, &Orders { threads, shard, overwrite, json: chosen.json })
}

/// The experiments of a name, or all, with those of their runs that were asked for, if there are any.
fn chosen_runs(chosen: &Chosen, name: &str) -> Result<Vec<(&'static Experiment, Vec<Run>)>, CliError> {
    let named: Vec<&'static Experiment> =
        if name == "all" { experiments().iter().collect() } else { vec![find(name).map_err(CliError::usage)?] };
    let own = chosen.own_system()?;
    let runs = |experiment: &Experiment| match &own {
        None => Ok(experiment.runs(chosen.scale, chosen.seeds)),
        Some((system, parameters)) => {
            experiment.runs_of((system, parameters), chosen.scale, chosen.seeds).ok_or_else(|| {
                let name = experiment.name;
                CliError::usage(format_args!("--system: {name} has fixed systems; only black-holes takes another"))
            })
        }
    };
    let every = named.iter().map(|experiment| Ok((*experiment, runs(experiment)?)));
    let every = every.collect::<Result<Vec<_>, CliError>>()?;
    let all = || every.iter().cloned();
    let Some(text) = &chosen.only else { return Ok(all().collect()) };
    let of = |(experiment, runs): (&'static Experiment, Vec<Run>)| {
        (experiment, runs.into_iter().filter(|run| run.label.starts_with(text)).collect::<Vec<Run>>())
    };
    let kept: Vec<_> = all().map(of).filter(|(_, runs)| !runs.is_empty()).collect();
    if kept.is_empty() {
        let mut rows: Vec<String> = all().flat_map(|(_, runs)| runs).map(|run| format!("`{}`", run.label)).collect();
        rows.dedup();
        let rows = rows.join(", ");
        return Err(CliError::usage(format_args!(
            "--only {text:?}: no row begins with this text; the rows are {rows}"
        )));
    }
    Ok(kept)
}

/// Seeds of every run at most: no more than can be listed.
const MOST_SEEDS: usize = 10_000;

/// A parser of whole numbers from 1 to `most`.
fn whole(most: usize) -> impl Fn(&str) -> Result<usize, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.trim().parse().ok().filter(|n| (1..=most).contains(n));
        number.ok_or_else(|| format!("expected a whole number from 1 to {most}"))
    }
}

/// `symbol=value`.
fn parameter(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((symbol, value)) if !symbol.trim().is_empty() && !value.trim().is_empty() => {
            Ok((symbol.trim().to_string(), value.trim().to_string()))
        }
        _ => Err("expected SYMBOL=VALUE".to_string()),
    }
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
    let reading = LoadedRecording::read(&[file], &columns).map_err(CliError::data)?;
    let points = |track: lnn::recording::RecordedTrajectory| track.times.into_iter().zip(track.q).collect::<Vec<_>>();
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
