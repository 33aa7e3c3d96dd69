//! Runs an experiment or a sweep, completely or in shares; lists its runs, and combines them in tables. Finished runs are not repeated.

use crate::CliError;
use crate::arguments::number::threads;
use crate::directories::files::require_free;
use crate::directories::run_list::list;
use crate::directories::shard::Shard;
use crate::terminal::watch::watch;
use crate::terminal::{interrupt, output};
use lnn::experiments::Run;
use lnn::findings::text_table;
use lnn::names::pluralize;
use lnn::pipeline::{
    Experiment, ExperimentDirectory, ExperimentReport, KeptRecord, finish_runs, kept_record, merge_experiment,
    run_experiment,
};
use std::path::{Path, PathBuf};

/// Runs of an experiment in their directory.
pub struct Work {
    /// The experiment that they belong to.
    pub experiment: Box<dyn Experiment>,
    /// Directory of the runs.
    pub path: PathBuf,
    /// Runs with their numbers.
    pub runs: Vec<(usize, Run)>,
    /// The command that combines all shares in tables.
    pub merge: String,
    /// The command that lists the runs.
    pub list: String,
    /// Files that were read for it; they are never overwritten.
    pub inputs: Vec<PathBuf>,
}

/// Settings for performing runs.
#[derive(Clone, Copy, Debug)]
pub struct Orders {
    /// Number of threads; by default, all.
    pub threads: Option<usize>,
    /// The share of the runs to perform; by default, that of a Slurm array, or all.
    pub shard: Option<Shard>,
    /// `true` to replace finished runs of other configurations.
    pub overwrite: bool,
    /// `true` to print JSON.
    pub json: bool,
}

impl Work {
    fn runs(&self) -> impl Iterator<Item = &Run> {
        self.runs.iter().map(|(_, run)| run)
    }

    /// Rejects tables that cannot be written, or that are inputs of the command.
    fn require_writable(&self) -> Result<(), CliError> {
        let inputs: Vec<&Path> = self.inputs.iter().map(PathBuf::as_path).collect();
        let tables = TABLES.iter().chain(self.experiment.tables());
        tables.into_iter().try_for_each(|name| require_free(&self.path.join(name), &inputs, true))
    }
}

/// Tables of every experiment, rewritten from the records of its runs.
const TABLES: [&str; 2] = ["table.csv", "runs.csv"];

/// Runs experiments, or a share of them.
///
/// # Errors
/// A usage error for a share that cannot be determined, a data error for a directory that cannot be written, an interruption; finished runs
/// are kept.
pub fn perform(all: Vec<Work>, orders: &Orders) -> Result<(), CliError> {
    let shard = match orders.shard {
        Some(shard) => Some(shard),
        None => Shard::of_slurm(|name| std::env::var(name).ok()).map_err(CliError::usage)?.inspect(|shard| {
            output::note(&format!("share {shard} of the runs, by SLURM_ARRAY_TASK_ID; --shard 1/1 takes all of them"));
        }),
    };
    let shard = shard.filter(|shard| shard.is_part());
    let shares = share(all, shard);
    for work in &shares {
        work.require_writable()?;
        if !orders.overwrite {
            if let Some(problem) = damaged(work)?.first() {
                return Err(CliError::data(format_args!("{problem}; --overwrite repeats its run")));
            }
            require_same(work, "--overwrite replaces it, or choose another --out")?;
        }
    }
    let stop = interrupt::flag()?;
    for work in shares {
        let folder = ExperimentDirectory::new(&work.path);
        let (threads, watch) = (threads(orders.threads), watch(&stop));
        let runs: Vec<Run> = work.runs().cloned().collect();
        let of = &*work.experiment;
        match shard {
            None => {
                let done = run_experiment(of, runs, threads, &folder, &watch)?;
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

/// Writes table, pictures and report from the existing records.
///
/// # Errors
/// A data error for a directory that cannot be written or records that are missing, an interruption.
pub fn merge(all: Vec<Work>, json: bool) -> Result<(), CliError> {
    for work in &all {
        work.require_writable()?;
        require_same(work, "give the options of the runs, including --scale and --seeds")?;
    }
    let stop = interrupt::flag()?;
    let mut left_out = Vec::new();
    for work in all {
        let folder = ExperimentDirectory::new(&work.path);
        let damaged = damaged(&work)?;
        damaged.iter().for_each(|problem| output::note(&format!("{problem}; its run is left out")));
        left_out.extend(damaged);
        let runs = work.runs().cloned().collect();
        let done = merge_experiment(&*work.experiment, runs, &folder, &watch(&stop))
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
            Err(CliError::data(format_args!("{first}{}; the tables leave out the damaged runs", and_more(more.len()))))
        }
    }
}

/// Selects the runs of a share, and drops experiments without any.
fn share(all: Vec<Work>, shard: Option<Shard>) -> Vec<Work> {
    let Some(shard) = shard else { return all };
    let of = |mut work: Work| {
        work.runs.retain(|(number, _)| shard.holds(*number));
        work
    };
    all.into_iter().map(of).filter(|work| !work.runs.is_empty()).collect()
}

/// Rejects a directory with finished runs of other configurations; `hint` advises what to do.
fn require_same(work: &Work, hint: &str) -> Result<(), CliError> {
    let store = ExperimentDirectory::new(&work.path);
    let mut others = Vec::new();
    for run in work.runs() {
        if matches!(kept_record(&store, run)?, KeptRecord::OtherConfiguration) {
            others.push(run.name.as_str());
        }
    }
    let Some((first, more)) = others.split_first() else { return Ok(()) };
    let problem = format!("this is a finished run of another configuration{}; {hint}", and_more(more.len()));
    Err(CliError::file(&work.path.join(first), problem))
}

/// Formats the number of further items.
fn and_more(count: usize) -> String {
    if count == 0 { String::new() } else { format!(" (and {count} more)") }
}

/// Lists the unreadable files of runs, each with its problem.
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

/// Prints the runs of a share, or all, with their states.
///
/// # Errors
/// Standard output that cannot be written.
pub fn print_list(all: Vec<Work>, shard: Option<Shard>, json: bool) -> Result<(), CliError> {
    let (mut rows, mut objects) = (Vec::new(), String::new());
    for work in share(all, shard) {
        let (name, scale) = (work.experiment.name(), work.experiment.scale());
        for run in list(&work.path, work.runs)? {
            objects += &format!("{}\n", run.json(name, scale));
            rows.push(run.row(name));
        }
    }
    output::print(&if json { objects } else { text_table(&["number", "experiment", "run", "state"], &rows) })
}

/// Prints the table of an experiment.
fn print_results(work: &Work, done: &ExperimentReport, json: bool) -> Result<(), CliError> {
    let report = work.path.join("report.html");
    if json {
        let object = serde_json::json!({
            "experiment": work.experiment.name(),
            "scale": work.experiment.scale(),
            "runs": done.results.len(),
            "finished": done.finished,
            "training_seconds": done.training_seconds,
            "rows": done.table.objects(),
            "report": report.display().to_string(),
        });
        return output::print(&format!("{object}\n"));
    }
    output::print(&format!("{}report: {}\n\n", done.findings, report.display()))
}

/// Prints the outcome of a share of an experiment.
fn print_share(work: &Work, shard: Shard, runs: usize, json: bool) -> Result<(), CliError> {
    let (name, scale) = (work.experiment.name(), work.experiment.scale());
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
