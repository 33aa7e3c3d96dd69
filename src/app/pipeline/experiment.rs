//! Experiments: performs their runs, several at a time and without repeating finished ones, and makes tables of their records.

use crate::configuration::Config;
use crate::data::SamplingError;
use crate::experiments::{Outcome, Record, Run};
use crate::network::NetworkLagrangian;
use crate::pipeline::checkpoints::Begin;
use crate::pipeline::experiment_directory::{ExperimentDirectory, LockedDirectory};
use crate::pipeline::experiment_report::{Additions, ExperimentReport, Results, conclude};
use crate::pipeline::thresholds::STARTS;
use crate::pipeline::train::{RunOptions, train_one};
use crate::pipeline::{Command, Event, Output, PipelineError, RECORD, Watch, from_table};
use crate::storage::container::text_checksum;
use crate::storage::in_order;
use crate::training::{StopReason, TrainingError};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

/// A set of trainings with a common table; implementations define its name, and what it adds to the runs and to the report.
pub trait Experiment: Sync {
    /// Name in lists and messages.
    fn name(&self) -> &str;

    /// Command that runs the experiment.
    fn command(&self) -> Command {
        Command::Experiment
    }

    /// Title of its report.
    fn title(&self) -> &str;

    /// Name of the size of its runs, if there are several sizes.
    fn scale(&self) -> Option<&str> {
        None
    }

    /// `true` if the time of its runs matters: they then run one after the other, each on all threads.
    fn is_timed(&self) -> bool {
        false
    }

    /// Number of starts of the trajectory test of a run, and the fraction of the system's time span that the test covers.
    fn trajectories(&self) -> (usize, f64) {
        (STARTS, 1.0)
    }

    /// Names of additional tables.
    fn tables(&self) -> &[&str] {
        &[]
    }

    /// Names of the files that [`look_at`](Self::look_at) writes; those of an earlier run are removed before a new one begins.
    fn files(&self) -> &[&str] {
        &[]
    }

    /// Analyses the model that a run learned, on `threads` threads, and writes the results into the directory of the run.
    ///
    /// # Errors
    /// Any error that ends the work on all runs.
    fn look_at(
        &self,
        _run: &Run,
        _learned: &NetworkLagrangian<f64>,
        _threads: usize,
        _output: &dyn Output,
        _watch: &Watch,
    ) -> Result<(), PipelineError> {
        Ok(())
    }

    /// Sentences below the table.
    fn remarks(&self, _runs: &[&Run]) -> Vec<String> {
        vec!["Instability: of the training loss without the penalty.".to_string()]
    }

    /// Adds to the headline, the loss curves and the table; also writes the experiment's own tables.
    ///
    /// # Errors
    /// Files that cannot be written.
    fn additions(
        &self,
        _results: &Results,
        _store: &ExperimentDirectory,
        _output: &dyn Output,
        _watch: &Watch,
    ) -> Result<Additions, PipelineError> {
        Ok(Additions::default())
    }
}

/// Runs the `runs` of an experiment on a number of threads, and writes table, pictures and report; runs with records of the same
/// configuration in the directory are not repeated.
///
/// # Errors
/// Files that cannot be written, [`PipelineError::InterruptedRuns`], [`PipelineError::HeldRuns`] if another process works on some of the
/// runs; finished runs are kept.
pub fn run_experiment(
    experiment: &dyn Experiment,
    runs: Vec<Run>,
    threads: usize,
    store: &ExperimentDirectory,
    watch: &Watch,
) -> Result<ExperimentReport, PipelineError> {
    let started = Instant::now();
    let results = finish_runs(experiment, runs, threads, store, watch)?;
    conclude(experiment, results, store, watch, Some(started))
}

/// Writes table, pictures and report from the records in a directory alone, without running anything. The same records give the same bytes,
/// independent of the machines that ran the experiment.
///
/// # Errors
/// [`PipelineError::NothingFinished`]; files that cannot be written.
pub fn merge_experiment(
    experiment: &dyn Experiment,
    runs: Vec<Run>,
    store: &ExperimentDirectory,
    watch: &Watch,
) -> Result<ExperimentReport, PipelineError> {
    let with_record = |run: Run| finished_record(store, &run).map(|record| (run, record));
    let results = runs.into_iter().map(with_record).collect::<Result<Results, PipelineError>>()?;
    if results.iter().all(|(_, record)| record.is_none()) {
        return Err(PipelineError::NothingFinished { total: results.len() });
    }
    conclude(experiment, results, store, watch, None)
}

/// Runs `runs` of an experiment, several at a time, without writing tables. A run that another process works on is skipped.
///
/// # Errors
/// Those of [`run_experiment`].
pub fn finish_runs(
    experiment: &dyn Experiment,
    runs: Vec<Run>,
    threads: usize,
    store: &ExperimentDirectory,
    watch: &Watch,
) -> Result<Results, PipelineError> {
    let total = runs.len();
    let abreast = if experiment.is_timed() { 1 } else { threads.min(total).max(1) };
    watch.say(Event::Runs { done: 0, total });
    let (done, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let work = |run: &Run| {
        if failed.load(Ordering::SeqCst) || watch.is_interrupted() {
            return Ok(None);
        }
        let result = one(run, experiment, (threads / abreast).max(1), store, watch);
        match &result {
            Ok(Some(_)) => watch.say(Event::Runs { done: 1 + done.fetch_add(1, Ordering::SeqCst), total }),
            Ok(None) | Err(PipelineError::Held { .. }) => {}
            Err(_) => failed.store(true, Ordering::SeqCst),
        }
        result
    };
    let results = in_order(&runs, abreast, work);
    let (mut found, mut held) = (Vec::new(), Vec::new());
    for (run, result) in runs.into_iter().zip(results) {
        match result {
            Ok(record) => found.push((run, record)),
            // The process may have ended since.
            Err(PipelineError::Held { owner, .. }) => match finished_record(store, &run)? {
                None => held.push(owner),
                record => found.push((run, record)),
            },
            Err(error) => return Err(error),
        }
    }
    let finished = found.iter().filter(|(_, record)| record.is_some()).count();
    if watch.is_interrupted() && finished < total {
        return Err(PipelineError::InterruptedRuns { finished, total });
    }
    match held.first() {
        Some(owner) => Err(PipelineError::HeldRuns { held: held.len(), owner: owner.clone() }),
        None => Ok(found),
    }
}

/// Returns the record of a run: an existing one of the same configuration, or a new one; `None` if the run was interrupted.
fn one(
    run: &Run,
    of: &dyn Experiment,
    threads: usize,
    store: &ExperimentDirectory,
    watch: &Watch,
) -> Result<Option<Record>, PipelineError> {
    if let Some(record) = finished_record(store, run)? {
        return Ok(Some(record));
    }
    let output = store.open_run(&run.name)?;
    // The process that held the directory before may have finished the run.
    match finished_record(store, run)? {
        None => make(run, of, threads, &output, watch),
        record => Ok(record),
    }
}

/// Performs a run and returns its record; `None` if it was interrupted.
fn make(
    run: &Run,
    experiment: &dyn Experiment,
    threads: usize,
    output: &LockedDirectory,
    watch: &Watch,
) -> Result<Option<Record>, PipelineError> {
    let toml = toml::to_string(&run.config).map_err(PipelineError::format)?;
    // A record of another configuration must not remain next to the new run.
    output.remove(RECORD)?;
    experiment.files().iter().try_for_each(|name| output.remove(name))?;
    let system = run.config.system()?;
    let (starts, span) = experiment.trajectories();
    let began = Instant::now();
    // An interrupted run resumes from its checkpoint.
    let checkpoints = Some(output.checkpoints().beginning(Begin::Either));
    let options = RunOptions { threads, starts, span, checkpoints };
    let watch = watch.remarks_alone();
    let trained = train_one(&run.config, &system, &options, output, &watch);
    let judged_or_empty = matches!(
        &trained,
        Ok(_)
            | Err(PipelineError::Interrupted
                | PipelineError::Unjudged(_)
                | PipelineError::Sampling(SamplingError::Interrupted)
                | PipelineError::Training(TrainingError::NothingLearned(_)))
    );
    let record = match trained {
        _ if judged_or_empty && watch.is_interrupted() => return Ok(None),
        Ok(trained) => {
            if let StopReason::Failed(error) = &trained.stop {
                tracing::warn!("{}: training stopped early: {error}", run.name);
            }
            experiment.look_at(run, &trained.network, threads, output, &watch)?;
            trained.record(text_checksum(&toml), system.system.trajectory(system.coordinates).t_end * span)
        }
        Err(PipelineError::Training(error @ TrainingError::NothingLearned(_))) => Record {
            run: text_checksum(&toml),
            outcome: Outcome::Nothing { reason: error.to_string() },
            losses: Vec::new(),
            times: Vec::new(),
            seconds: began.elapsed().as_secs_f64(),
        },
        Err(error) => return Err(error),
    };
    output.write("config.toml", toml.as_bytes())?;
    // A run with a record is finished.
    output.write(RECORD, serde_json::to_string(&record).map_err(PipelineError::format)?.as_bytes())?;
    options.checkpoints.map_or(Ok(()), |checkpoints| checkpoints.remove())?;
    Ok(Some(record))
}

/// Record of a run in a directory, or the reason for its absence.
#[derive(Debug)]
pub enum KeptRecord {
    /// The run is not finished.
    Nothing,
    /// A record of the same configuration.
    Finished(Record),
    /// A record of another configuration.
    OtherConfiguration,
    /// A file that cannot be read, with the reason.
    Damaged(&'static str, String),
}

/// The record of a run in a directory, if it was made from this configuration.
///
/// # Errors
/// A configuration that TOML cannot hold.
fn finished_record(store: &ExperimentDirectory, run: &Run) -> Result<Option<Record>, PipelineError> {
    Ok(match kept_record(store, run)? {
        KeptRecord::Finished(record) => Some(record),
        _ => None,
    })
}

/// Reads the record of a run in a directory, or returns the reason for its absence.
///
/// # Errors
/// A configuration that TOML cannot hold.
pub fn kept_record(store: &ExperimentDirectory, run: &Run) -> Result<KeptRecord, PipelineError> {
    const CONFIG: &str = "config.toml";
    let toml = toml::to_string(&run.config).map_err(PipelineError::format)?;
    let is_there = |file: &str| store.names(&run.name).iter().any(|name| name == file);
    let Some(record) = store.read(&run.name, RECORD) else {
        let unread = || KeptRecord::Damaged(RECORD, "cannot be read".to_string());
        return Ok(if is_there(RECORD) { unread() } else { KeptRecord::Nothing });
    };
    let record: Record = match serde_json::from_slice(&record) {
        Ok(record) => record,
        Err(error) => return Ok(KeptRecord::Damaged(RECORD, error.to_string())),
    };
    let Some(config) = store.read(&run.name, CONFIG) else {
        let problem = if is_there(CONFIG) { "cannot be read" } else { "is missing beside a record" };
        return Ok(KeptRecord::Damaged(CONFIG, problem.to_string()));
    };
    let config = String::from_utf8_lossy(&config);
    let read = config.parse::<toml::Table>().map_err(|error| error.message().to_string());
    let read = read.and_then(|table| from_table::<Config>(table.into()).map_err(|(_, problem)| problem));
    Ok(match read {
        _ if config == toml && record.run == text_checksum(&toml) => KeptRecord::Finished(record),
        _ if config == toml => KeptRecord::Damaged(RECORD, "is the record of another run".to_string()),
        Ok(_) => KeptRecord::OtherConfiguration,
        Err(problem) => KeptRecord::Damaged(CONFIG, problem),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::Reported;
    use crate::presets::Preset;

    #[test]
    fn damaged_runs_are_told_from_those_of_another_configuration() {
        let directory = tempfile::tempdir().unwrap();
        let store = ExperimentDirectory::new(directory.path());
        let system = crate::lagrangian::SystemInstance::named("harmonic-oscillator", &[]).unwrap();
        let run = &Run {
            name: "run".into(),
            label: "row".into(),
            abscissa: None,
            group: String::new(),
            config: Preset::Quick.config(&system).unwrap(),
            reported: Reported::NOTHING,
        };
        let folder = directory.path().join(&run.name);
        std::fs::create_dir(&folder).unwrap();
        let outcome = Outcome::Nothing { reason: String::new() };
        let now = toml::to_string(&run.config).unwrap();
        let record = Record { run: text_checksum(&now), outcome, losses: Vec::new(), times: Vec::new(), seconds: 0.0 };
        let kept = |file: &str, content: &str| {
            std::fs::write(folder.join("config.toml"), &now).unwrap();
            std::fs::write(folder.join(RECORD), serde_json::to_string(&record).unwrap()).unwrap();
            std::fs::write(folder.join(file), content).unwrap();
            kept_record(&store, run).unwrap()
        };
        assert!(matches!(kept("config.toml", &now), KeptRecord::Finished(_)));
        let other = kept("config.toml", &now.replace("seed = 0", "seed = 7"));
        assert!(matches!(other, KeptRecord::OtherConfiguration), "{other:?}");
        let foreign = serde_json::to_string(&Record { run: text_checksum("other"), ..record.clone() }).unwrap();
        let damaged = [(RECORD, "{\"outcome\""), (RECORD, ""), (RECORD, &foreign), ("config.toml", &now[..5])];
        for (file, content) in damaged {
            let found = kept(file, content);
            assert!(matches!(&found, KeptRecord::Damaged(name, _) if *name == file), "{content}: {found:?}");
        }
        std::fs::remove_file(folder.join(RECORD)).unwrap();
        assert!(matches!(kept_record(&store, run).unwrap(), KeptRecord::Nothing));
    }
}
