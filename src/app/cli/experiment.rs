//! `lnn experiment`: the paper's tables and figures, one command each, whole or in shares; finished runs are not run again.

use crate::cli::experiment_list::list;
use crate::cli::files::require_free;
use crate::cli::number::{thread_count, threads, whole};
use crate::cli::shard::Shard;
use crate::cli::source::parameter;
use crate::cli::watch::watch;
use crate::cli::{CliError, interrupt, output, system_arg};
use crate::experiments::{Experiment, Run, Scale, experiments, find};
use crate::findings::text_table;
use crate::lagrangian::{SystemInstance, configure_system};
use crate::names::{WIDTH, pluralize, wrap_text};
use crate::pipeline::{
    ExperimentDirectory, ExperimentReport, KeptRecord, finish_runs, kept_record, merge_experiment, run_experiment,
};
use crate::recording::Columns;
use crate::recording::read::read_recording;
use crate::relativity::depends_on_time;
use crate::report::Curve;
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
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
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
    scale: ScaleName,
    /// Seeds of every run.
    #[arg(long, value_name = "N", default_value = "1", allow_hyphen_values = true, value_parser = whole(1, MOST_SEEDS))]
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

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum ScaleName {
    /// All experiments in minutes; a test that they run.
    Smoke,
    /// Minutes each; enough for a ranking.
    Short,
    /// The paper's own.
    Paper,
}

impl Chosen {
    fn scale(&self) -> Scale {
        match self.scale {
            ScaleName::Smoke => Scale::Smoke,
            ScaleName::Short => Scale::Short,
            ScaleName::Paper => Scale::Paper,
        }
    }

    /// The system that was requested instead of the experiment's own, with the parameters given.
    #[allow(clippy::type_complexity)]
    fn own_system(&self) -> Result<Option<(SystemInstance<f64>, BTreeMap<String, f64>)>, CliError> {
        let Some(name) = &self.system else { return Ok(None) };
        let configured = configure_system::<f64>(system_arg::system(name)?, &self.param).map_err(CliError::usage)?;
        require_stationary(&configured)?;
        let symbols = configured.system.parameters.iter().map(|p| p.symbol.to_string());
        let values: BTreeMap<String, f64> = symbols.zip(configured.parameters.iter().copied()).collect();
        let given = self.param.iter().filter_map(|(symbol, _)| Some((symbol.clone(), *values.get(symbol)?))).collect();
        Ok(Some((configured, given)))
    }

    /// The runs of experiments in their directories, numbered on from one to the next.
    fn work(&self, name: &str) -> Result<Vec<Work>, CliError> {
        let mut numbers = 0..;
        let work = |(experiment, runs): (&'static Experiment, Vec<Run>)| {
            let path = self.out.join(format!("{}-{}", experiment.name, self.scale().name()));
            let words = self.words(experiment);
            let merge = format!("lnn experiment merge {words}");
            let list = format!("lnn experiment {words} --list");
            let runs = numbers.by_ref().zip(runs).collect();
            Work { experiment, scale: self.scale(), path, runs, merge, list }
        };
        Ok(chosen_runs(self, name)?.into_iter().map(work).collect())
    }

    /// Words of a command about the same runs, behind a verb.
    fn words(&self, experiment: &Experiment) -> String {
        let mut words = format!("{} --scale {}", experiment.name, self.scale().name());
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
        return merge(chosen.work(name)?, &chosen.beside, chosen.json);
    }
    let chosen = &args.chosen;
    let Some(name) = &args.name else {
        return output::print(&listing(chosen.json));
    };
    let all = chosen.work(name)?;
    if args.list {
        return print_list(share(all, args.shard), chosen.json);
    }
    let Args { threads, shard, overwrite, .. } = *args;
    perform(all, &Orders { threads, shard, overwrite, beside: &chosen.beside, json: chosen.json })
}

/// Runs of an experiment in their directory.
pub struct Work {
    pub experiment: &'static Experiment,
    pub scale: Scale,
    /// Directory.
    pub path: PathBuf,
    /// Runs with their numbers.
    pub runs: Vec<(usize, Run)>,
    /// Commands that make the tables of all shares, and that list the runs.
    pub merge: String,
    pub list: String,
}

/// How runs are performed.
pub struct Orders<'a> {
    pub threads: Option<usize>,
    pub shard: Option<Shard>,
    pub overwrite: bool,
    pub beside: &'a [(String, PathBuf)],
    pub json: bool,
}

impl Work {
    fn runs(&self) -> impl Iterator<Item = &Run> {
        self.runs.iter().map(|(_, run)| run)
    }

    /// Name of the scale; none of a sweep, whose configurations stand as they are.
    fn scale_name(&self) -> Option<&'static str> {
        (!self.experiment.is_sweep()).then(|| self.scale.name())
    }

    /// Refuses tables that cannot be written, or that the command reads.
    fn require_writable(&self, beside: &[(String, PathBuf)]) -> Result<(), CliError> {
        let inputs: Vec<&Path> = beside.iter().map(|(_, file)| file.as_path()).collect();
        WRITTEN.iter().try_for_each(|name| require_free(&self.path.join(name), &inputs, true))
    }
}

/// Runs experiments, or a share of them.
///
/// # Errors
/// As of [`run`].
pub fn perform(all: Vec<Work>, orders: &Orders<'_>) -> Result<(), CliError> {
    let shard = match orders.shard {
        Some(shard) => Some(shard),
        None => Shard::of_slurm(|name| std::env::var(name).ok()).map_err(CliError::usage)?.inspect(|shard| {
            output::note(&format!("share {shard} of the runs, by SLURM_ARRAY_TASK_ID; --shard 1/1 takes all of them"));
        }),
    };
    let shard = shard.filter(|shard| shard.is_part());
    let shares = share(all, shard);
    for work in &shares {
        work.require_writable(orders.beside)?;
        if !orders.overwrite {
            if let Some(problem) = damaged(work)?.first() {
                return Err(CliError::data(format_args!("{problem}; --overwrite repeats its run")));
            }
            require_same(work, "--overwrite replaces it, or choose another --out")?;
        }
    }
    let curves = curves(orders.beside)?;
    let stop = interrupt::flag().map_err(CliError::signals)?;
    for work in shares {
        let folder = ExperimentDirectory::new(&work.path);
        let (threads, watch) = (threads(orders.threads), watch(&stop));
        let runs: Vec<Run> = work.runs().cloned().collect();
        let of = (work.experiment, work.scale);
        match shard {
            None => {
                let done = run_experiment(of, runs, threads, &curves, &folder, &watch)?;
                print_results(&work, &done, orders.json)?;
            }
            Some(shard) => {
                let results = finish_runs(of, runs, threads, &folder, &watch)?;
                print_share(&work, shard, results.len(), orders.json)?;
            }
        }
    }
    Ok(())
}

/// Makes table, pictures and report of the records that are there.
///
/// # Errors
/// As of [`run`].
pub fn merge(all: Vec<Work>, beside: &[(String, PathBuf)], json: bool) -> Result<(), CliError> {
    for work in &all {
        work.require_writable(beside)?;
        require_same(work, "give the options of the runs, including --scale and --seeds")?;
    }
    let curves = curves(beside)?;
    let stop = interrupt::flag().map_err(CliError::signals)?;
    let mut left_out = Vec::new();
    for work in all {
        let folder = ExperimentDirectory::new(&work.path);
        let damaged = damaged(&work)?;
        damaged.iter().for_each(|problem| output::note(&format!("{problem}; its run is left out")));
        left_out.extend(damaged);
        let runs = work.runs().cloned().collect();
        let done = merge_experiment((work.experiment, work.scale), runs, &curves, &folder, &watch(&stop))
            .map_err(|error| CliError::file(&work.path, error))?;
        if done.finished < done.results.len() {
            let open = pluralize(done.results.len() - done.finished, "run is", "runs are");
            output::note(&format!("{open} not finished; `{}` lists them", work.list));
        }
        print_results(&work, &done, json)?;
    }
    match left_out.split_first() {
        None => Ok(()),
        Some((first, more)) => {
            let more = if more.is_empty() { String::new() } else { format!(" (and {} more)", more.len()) };
            Err(CliError::data(format_args!("{first}{more}; the tables leave out the damaged runs")))
        }
    }
}

/// The runs of a share, of those experiments that have any in it.
pub fn share(all: Vec<Work>, shard: Option<Shard>) -> Vec<Work> {
    let Some(shard) = shard else { return all };
    let of = |mut work: Work| {
        work.runs.retain(|(number, _)| shard.holds(*number));
        work
    };
    all.into_iter().map(of).filter(|work| !work.runs.is_empty()).collect()
}

/// The experiments of a name, or all, with those of their runs that were requested, if there are any.
fn chosen_runs(chosen: &Chosen, name: &str) -> Result<Vec<(&'static Experiment, Vec<Run>)>, CliError> {
    let named: Vec<&'static Experiment> =
        if name == "all" { experiments().iter().collect() } else { vec![find(name).map_err(CliError::usage)?] };
    let own = chosen.own_system()?;
    let runs = |experiment: &Experiment| match &own {
        None => Ok(experiment.runs(chosen.scale(), chosen.seeds)),
        Some((system, parameters)) => {
            experiment.runs_of((system, parameters), chosen.scale(), chosen.seeds).ok_or_else(|| {
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

/// Tables of an experiment, made again of the records of its runs.
const WRITTEN: [&str; 4] = ["table.csv", "runs.csv", "curves.csv", "readings.csv"];

/// Refuses a directory with finished runs of other configurations than those requested; `hint` says what to do then.
fn require_same(work: &Work, hint: &str) -> Result<(), CliError> {
    let store = ExperimentDirectory::new(&work.path);
    let mut others = Vec::new();
    for run in work.runs() {
        if matches!(kept_record(&store, run)?, KeptRecord::OtherConfiguration) {
            others.push(run.name.as_str());
        }
    }
    let Some((first, more)) = others.split_first() else { return Ok(()) };
    let more = if more.is_empty() { String::new() } else { format!(" (and {} more)", more.len()) };
    let problem = format!("this is a finished run of another configuration{more}; {hint}");
    Err(CliError::file(&work.path.join(first), problem))
}

/// Runs with files that cannot be read: each file and what is wrong with it.
fn damaged(work: &Work) -> Result<Vec<String>, CliError> {
    let store = ExperimentDirectory::new(&work.path);
    let mut found = Vec::new();
    for run in work.runs() {
        if let KeptRecord::Damaged(file, problem) = kept_record(&store, run)? {
            found.push(format!("{}: {problem}", work.path.join(&run.name).join(file).display()));
        }
    }
    Ok(found)
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

/// The curves from elsewhere.
fn curves(beside: &[(String, PathBuf)]) -> Result<Vec<Curve>, CliError> {
    beside.iter().map(curve).collect()
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

/// Prints the runs with their states.
///
/// # Errors
/// Standard output that cannot be written.
pub fn print_list(works: Vec<Work>, json: bool) -> Result<(), CliError> {
    let (mut rows, mut objects) = (Vec::new(), String::new());
    for work in works {
        let named = work.scale_name();
        for run in list(&work.path, work.experiment.name, work.runs)? {
            objects += &format!("{}\n", run.json(named));
            rows.push(run.row());
        }
    }
    output::print(&if json { objects } else { text_table(&["number", "experiment", "run", "state"], &rows) })
}

/// Prints the table of an experiment.
fn print_results(work: &Work, done: &ExperimentReport, json: bool) -> Result<(), CliError> {
    let report = work.path.join("report.html");
    if json {
        let object = serde_json::json!({
            "experiment": work.experiment.name,
            "scale": work.scale_name(),
            "runs": done.results.len(),
            "finished": done.finished,
            "training_seconds": done.training_seconds,
            "rows": done.table.objects(),
            "report": report.display().to_string(),
        });
        return output::print(&format!("{object}\n"));
    }
    output::print(&(done.text().to_string() + &wrap_text(&format!("report: {}\n\n", report.display()), WIDTH)))
}

/// Prints what became of a share of an experiment.
fn print_share(work: &Work, shard: Shard, runs: usize, json: bool) -> Result<(), CliError> {
    let (name, scale) = (work.experiment.name, work.scale_name());
    if json {
        let object = serde_json::json!({
            "experiment": name, "scale": scale, "shard": shard.to_string(), "runs": runs, "finished": runs,
        });
        return output::print(&format!("{object}\n"));
    }
    output::print(&format!(
        "{name}: share {shard} is finished, {}; to write tables and report of all shares:\n{}\n",
        pluralize(runs, "run", "runs"),
        work.merge
    ))
}
