//! `lnn experiment`: the paper's tables and figures, one command each, whole or in shares; finished runs are not run again.

use crate::cli::experiment_list::{Listed, list};
use crate::cli::files::require_free;
use crate::cli::number::{thread_count, threads, whole};
use crate::cli::shard::Shard;
use crate::cli::source::parameter;
use crate::cli::watch::watch;
use crate::cli::{CliError, chosen, interrupt, output};
use crate::experiments::{Experiment, Run, Scale, experiments, find};
use crate::lagrangian::{SystemInstance, configure_system};
use crate::names::{WIDTH, counted, wrapped};
use crate::pipeline::{
    ExperimentDirectory, ExperimentReport, KeptRecord, finish_runs, kept_record, merge_experiment, run_experiment,
};
use crate::recording::Columns;
use crate::recording::read::read_recording;
use crate::relativity::depends_on_time;
use crate::report::{Curve, EXPERIMENT_HEADER, text_table};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// An experiment by name, or `all`; without a name they are listed with the tables and figures they regenerate.
    name: Option<String>,
    #[command(flatten)]
    chosen: Chosen,
    /// Threads; as many runs go side by side, and the results do not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    /// Only the I-th of N shares of the runs, I from 1 to N; no tables are written [default: that of a Slurm array, or all].
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// List the runs: finished, in progress, or open.
    #[arg(long, requires = "name", conflicts_with_all = ["beside", "overwrite"])]
    list: bool,
    /// Replace finished runs that are of other configurations.
    #[arg(long)]
    overwrite: bool,
}

/// Work on an experiment beside running it.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Write table, pictures and report from the records of finished runs, whichever machines they ran on; nothing is run.
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
    /// Only the runs whose row of the table begins with this text; a later command without it goes on from there.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Another system than those of the experiment, by name or by the file that describes it: of black-holes, whose coordinates
    /// are t, x, y, z or t, r, theta, phi.
    #[arg(long, value_name = "NAME|FILE.toml", requires = "name")]
    system: Option<String>,
    /// A parameter of that system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1.., value_parser = parameter, requires = "system")]
    param: Vec<(String, String)>,
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

impl Chosen {
    fn scale(&self) -> Scale {
        match self.scale {
            ScaleName::Smoke => Scale::Smoke,
            ScaleName::Short => Scale::Short,
            ScaleName::Paper => Scale::Paper,
        }
    }

    /// The system that was asked for instead of the experiment's own, with the parameters given.
    #[allow(clippy::type_complexity)]
    fn own_system(&self) -> Result<Option<(SystemInstance<f64>, BTreeMap<String, f64>)>, CliError> {
        let Some(name) = &self.system else { return Ok(None) };
        let configured = configure_system::<f64>(chosen::system(name)?, &self.param).map_err(CliError::usage)?;
        require_stationary(&configured)?;
        let symbols = configured.system.parameters.iter().map(|p| p.symbol.to_string());
        let values: BTreeMap<String, f64> = symbols.zip(configured.parameters.iter().copied()).collect();
        let given = self.param.iter().filter_map(|(symbol, _)| Some((symbol.clone(), *values.get(symbol)?))).collect();
        Ok(Some((configured, given)))
    }

    /// Directory of an experiment.
    fn directory(&self, experiment: &Experiment) -> PathBuf {
        self.out.join(format!("{}-{}", experiment.name, self.scale().name()))
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
        let problem = "expected a metric that is the same at all times";
        return Err(CliError::usage(format_args!("--system: the metric depends on its time {name}, {problem}")));
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
        return merge(name, chosen);
    }
    let chosen = &args.chosen;
    let Some(name) = &args.name else {
        return output::print(&listing(chosen.json));
    };
    let all = numbered(chosen_runs(chosen, name)?);
    if args.list {
        return listed(chosen, share(all, args.shard));
    }
    let shard = match args.shard {
        Some(shard) => Some(shard),
        None => Shard::of_slurm(|name| std::env::var(name).ok()).map_err(CliError::usage)?.inspect(|shard| {
            output::note(&format!("share {shard} of the runs, by SLURM_ARRAY_TASK_ID; --shard 1/1 takes all of them"));
        }),
    };
    let shard = shard.filter(|shard| shard.is_part());
    let shares = share(all, shard);
    for (experiment, runs) in &shares {
        require_writable(chosen, experiment)?;
        let path = chosen.directory(experiment);
        if !args.overwrite {
            if let Some(problem) = damaged(&path, runs.iter().map(|(_, run)| run))?.first() {
                return Err(CliError::data(format_args!("{problem}; --overwrite makes its run again")));
            }
            let replace = "--overwrite replaces it, or choose another --out";
            require_same(&path, runs.iter().map(|(_, run)| run), replace)?;
        }
    }
    let curves = curves(chosen)?;
    let stop = interrupt::flag().map_err(CliError::signals)?;
    for (experiment, runs) in shares {
        let folder = ExperimentDirectory::new(&chosen.directory(experiment));
        let (threads, watch) = (threads(args.threads), watch(&stop));
        let runs: Vec<Run> = runs.into_iter().map(|(_, run)| run).collect();
        let of = (experiment, chosen.scale());
        match shard {
            None => told(chosen, experiment, &run_experiment(of, runs, threads, &curves, &folder, &watch)?)?,
            Some(shard) => {
                let results = finish_runs(of, runs, threads, &folder, &watch)?;
                told_of_share(chosen, experiment, shard, results.len())?;
            }
        }
    }
    Ok(())
}

/// Makes table, pictures and report of the records that are there.
fn merge(name: &str, chosen: &Chosen) -> Result<(), CliError> {
    let all = chosen_runs(chosen, name)?;
    for (experiment, runs) in &all {
        require_writable(chosen, experiment)?;
        let same = "give the --scale and --seeds that the runs were made with";
        require_same(&chosen.directory(experiment), runs.iter(), same)?;
    }
    let curves = curves(chosen)?;
    let stop = interrupt::flag().map_err(CliError::signals)?;
    let mut left_out = Vec::new();
    for (experiment, runs) in all {
        let path = chosen.directory(experiment);
        let folder = ExperimentDirectory::new(&path);
        let of = (experiment, chosen.scale());
        let damaged = damaged(&path, runs.iter())?;
        damaged.iter().for_each(|problem| output::note(&format!("{problem}; its run is left out")));
        left_out.extend(damaged);
        let done = merge_experiment(of, runs, &curves, &folder, &watch(&stop))
            .map_err(|error| CliError::file(&path, error))?;
        if done.finished < done.results.len() {
            let open = counted(done.results.len() - done.finished, "run is", "runs are");
            let words = chosen.words(experiment);
            output::note(&format!("{open} not finished; `lnn experiment {words} --list` says which"));
        }
        told(chosen, experiment, &done)?;
    }
    match left_out.split_first() {
        None => Ok(()),
        Some((first, more)) => {
            let more = if more.is_empty() { String::new() } else { format!(" (and {} more)", more.len()) };
            Err(CliError::data(format_args!("{first}{more}; the tables are without what is damaged")))
        }
    }
}

/// Runs with their numbers, which count on from one experiment to the next.
type Numbered = Vec<(&'static Experiment, Vec<(usize, Run)>)>;

/// Gives every run its number, from 0.
fn numbered(all: Vec<(&'static Experiment, Vec<Run>)>) -> Numbered {
    let mut numbers = 0..;
    all.into_iter().map(|(experiment, runs)| (experiment, numbers.by_ref().zip(runs).collect())).collect()
}

/// The runs of a share, of those experiments that have any in it.
fn share(all: Numbered, shard: Option<Shard>) -> Numbered {
    let Some(shard) = shard else { return all };
    let of = |(experiment, mut runs): (&'static Experiment, Vec<(usize, Run)>)| {
        runs.retain(|(number, _)| shard.holds(*number));
        (experiment, runs)
    };
    all.into_iter().map(of).filter(|(_, runs)| !runs.is_empty()).collect()
}

/// Refuses tables that cannot be written, or that the command reads.
fn require_writable(chosen: &Chosen, experiment: &Experiment) -> Result<(), CliError> {
    let inputs: Vec<&Path> = chosen.beside.iter().map(|(_, file)| file.as_path()).collect();
    let path = chosen.directory(experiment);
    WRITTEN.iter().try_for_each(|name| require_free(&path.join(name), &inputs, true))
}

/// The experiments of a name, or all, with those of their runs that were asked for, if there are any.
fn chosen_runs(chosen: &Chosen, name: &str) -> Result<Vec<(&'static Experiment, Vec<Run>)>, CliError> {
    let named: Vec<&'static Experiment> =
        if name == "all" { experiments().iter().collect() } else { vec![find(name).map_err(CliError::usage)?] };
    let own = chosen.own_system()?;
    let runs = |experiment: &Experiment| match &own {
        None => Ok(experiment.runs(chosen.scale(), chosen.seeds)),
        Some((system, parameters)) => {
            experiment.runs_of((system, parameters), chosen.scale(), chosen.seeds).ok_or_else(|| {
                let name = experiment.name;
                CliError::usage(format_args!("--system: {name} is about systems of its own; black-holes takes another"))
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
        return Err(CliError::usage(format_args!("--only {text:?}: no row begins so; there are {rows}")));
    }
    Ok(kept)
}

/// Seeds of every run at most: no more than can be listed.
const MOST_SEEDS: usize = 10_000;

/// Tables of an experiment, made anew of the records of its runs.
const WRITTEN: [&str; 3] = ["table.csv", "curves.csv", "readings.csv"];

/// Refuses a directory with finished runs of other configurations than those asked for; `hint` says what to do then.
fn require_same<'a>(path: &Path, runs: impl Iterator<Item = &'a Run>, hint: &str) -> Result<(), CliError> {
    let store = ExperimentDirectory::new(path);
    let mut others = Vec::new();
    for run in runs {
        if matches!(kept_record(&store, run)?, KeptRecord::OtherConfiguration) {
            others.push(run.name.as_str());
        }
    }
    let Some((first, more)) = others.split_first() else { return Ok(()) };
    let more = if more.is_empty() { String::new() } else { format!(" (and {} more)", more.len()) };
    let problem = format!("a finished run of another configuration is there{more}; {hint}");
    Err(CliError::file(&path.join(first), problem))
}

/// Runs with files that cannot be read: each file and what is wrong with it.
fn damaged<'a>(path: &Path, runs: impl Iterator<Item = &'a Run>) -> Result<Vec<String>, CliError> {
    let store = ExperimentDirectory::new(path);
    let mut found = Vec::new();
    for run in runs {
        if let KeptRecord::Damaged(file, problem) = kept_record(&store, run)? {
            found.push(format!("{}: {problem}", path.join(&run.name).join(file).display()));
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
fn curves(chosen: &Chosen) -> Result<Vec<Curve>, CliError> {
    chosen.beside.iter().map(curve).collect()
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
fn listed(chosen: &Chosen, runs: Numbered) -> Result<(), CliError> {
    let mut all = Vec::new();
    for (experiment, runs) in runs {
        all.extend(list(&chosen.directory(experiment), experiment.name, runs)?);
    }
    if chosen.json {
        return output::print(
            &all.iter().map(|run| format!("{}\n", run.json(chosen.scale().name()))).collect::<String>(),
        );
    }
    let rows: Vec<Vec<String>> = all.iter().map(Listed::row).collect();
    output::print(&text_table(&["number", "experiment", "run", "state"], &rows))
}

/// Prints the table of an experiment.
fn told(chosen: &Chosen, experiment: &Experiment, done: &ExperimentReport) -> Result<(), CliError> {
    let report = chosen.directory(experiment).join("report.html");
    if chosen.json {
        let row = |cells: &Vec<String>| {
            let named = EXPERIMENT_HEADER.iter().zip(cells);
            named.map(|(name, cell)| (name.to_string(), cell.as_str().into())).collect::<serde_json::Map<_, _>>()
        };
        let object = serde_json::json!({
            "experiment": experiment.name,
            "scale": chosen.scale().name(),
            "runs": done.results.len(),
            "finished": done.finished,
            "training_seconds": done.training_seconds,
            "rows": done.table.iter().map(row).collect::<Vec<_>>(),
            "report": report.display().to_string(),
        });
        return output::print(&format!("{object}\n"));
    }
    output::print(&(done.text().to_string() + &wrapped(&format!("report: {}\n\n", report.display()), WIDTH)))
}

/// Prints what became of a share of an experiment.
fn told_of_share(chosen: &Chosen, experiment: &Experiment, shard: Shard, runs: usize) -> Result<(), CliError> {
    if chosen.json {
        let (name, scale) = (experiment.name, chosen.scale().name());
        let object = serde_json::json!({
            "experiment": name, "scale": scale, "shard": shard.to_string(), "runs": runs, "finished": runs,
        });
        return output::print(&format!("{object}\n"));
    }
    let (name, words) = (experiment.name, chosen.words(experiment));
    output::print(&format!(
        "{name}: share {shard} is finished, {}; table and report of all shares by\nlnn experiment merge {words}\n",
        counted(runs, "run", "runs")
    ))
}
