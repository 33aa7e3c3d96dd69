//! Experiments: their runs side by side, in this process and others, those that are finished not again, and the tables that come
//! of them.

use crate::configuration::{Config, in_current_words};
use crate::data::SamplingError;
use crate::experiments::{Experiment, Outcome, Record, Run, Scale};
use crate::pipeline::checkpoints::Begin;
use crate::pipeline::experiment_queue::Queue;
use crate::pipeline::experiment_report::{ExperimentReport, Results, conclude};
use crate::pipeline::experiment_store::{ExperimentStore, RunClaim, RunOutput};
use crate::pipeline::readings::{READINGS, read_hole};
use crate::pipeline::train::{RunOptions, train};
use crate::pipeline::{Event, PipelineError, RECORD, Watch};
use crate::report::Curve;
use crate::training::{StopReason, TrainingError};
use std::sync::Arc;
use std::time::Instant;

/// Runs an experiment, `runs` of it, on so many threads, and writes table, pictures and report; runs whose records are in the
/// store and are of the same configuration are not run again. `beside` are curves of loss against time from elsewhere.
///
/// Several processes may run the same experiment in the same store at a time, if the store has claims: each run is one
/// process's, and this returns when all of `runs` are finished, by whomever.
///
/// # Errors
/// Files that cannot be written, [`PipelineError::InterruptedRuns`]; runs that are finished stay finished.
pub fn run_experiment(
    (experiment, scale): (&Experiment, Scale),
    runs: Vec<Run>,
    threads: usize,
    beside: &[Curve],
    store: &dyn ExperimentStore,
    watch: &Watch,
) -> Result<ExperimentReport, PipelineError> {
    let started = Instant::now();
    let results = finish_runs((experiment, scale), runs, threads, store, watch)?;
    conclude((experiment, scale), results, beside, store, watch, Some(started))
}

/// Writes table, pictures and report from the records that are in a store, and from nothing else; nothing is run. The same records
/// give the same bytes, whichever machines they were made on.
///
/// # Errors
/// [`PipelineError::NothingFinished`]; files that cannot be written.
pub fn merge_experiment(
    (experiment, scale): (&Experiment, Scale),
    runs: Vec<Run>,
    beside: &[Curve],
    store: &dyn ExperimentStore,
    watch: &Watch,
) -> Result<ExperimentReport, PipelineError> {
    let with_record = |run: Run| finished_record(store, &run).map(|record| (run, record));
    let results = runs.into_iter().map(with_record).collect::<Result<Results, PipelineError>>()?;
    if results.iter().all(|(_, record)| record.is_none()) {
        return Err(PipelineError::NothingFinished { total: results.len() });
    }
    conclude((experiment, scale), results, beside, store, watch, None)
}

/// Runs `runs` of an experiment until each is finished, by this process or by another that claimed it; no tables are written.
///
/// # Errors
/// As of [`run_experiment`].
pub fn finish_runs(
    (experiment, scale): (&Experiment, Scale),
    runs: Vec<Run>,
    threads: usize,
    store: &dyn ExperimentStore,
    watch: &Watch,
) -> Result<Results, PipelineError> {
    let total = runs.len();
    let abreast = if experiment.is_timed() { 1 } else { threads.min(total).max(1) };
    let queue = Queue::new(total);
    watch.say(Event::Runs { done: 0, total });
    let work = || {
        while let Some(index) = queue.next(watch) {
            let Some(run) = runs.get(index) else { break };
            match one(run, (experiment, scale), (threads / abreast).max(1), store, watch) {
                Ok(Turn::Held(holder)) => {
                    if queue.put_back(index) {
                        watch.say(Event::Note(&format!("{}: {holder} works on it; waiting for its record", run.name)));
                    }
                }
                // No other is begun: the flag of the watch is up.
                Ok(Turn::Interrupted) => {}
                Ok(Turn::Finished(record)) => {
                    let done = queue.finish(index, Ok(record));
                    watch.say(Event::Runs { done, total });
                }
                Err(error) => _ = queue.finish(index, Err(error)),
            }
        }
    };
    crate::storage::abreast(abreast, work);
    let mut found = queue.into_results();
    let results = runs
        .into_iter()
        .enumerate()
        .map(|(index, run)| Ok((run, found.remove(&index).transpose()?)))
        .collect::<Result<Results, PipelineError>>()?;
    let finished = results.iter().filter(|(_, record)| record.is_some()).count();
    if finished < total && watch.is_interrupted() {
        return Err(PipelineError::InterruptedRuns { finished, total });
    }
    Ok(results)
}

/// End of a turn of a run.
enum Turn {
    /// It has a record.
    Finished(Record),
    /// Another process works on it; which, in words.
    Held(String),
    /// The flag of the watch was raised.
    Interrupted,
}

/// The record of a run: the one that is there if it was made from the same configuration, or a new one.
fn one(
    run: &Run,
    (experiment, scale): (&Experiment, Scale),
    threads: usize,
    store: &dyn ExperimentStore,
    watch: &Watch,
) -> Result<Turn, PipelineError> {
    if let Some(record) = finished_record(store, run)? {
        return Ok(Turn::Finished(record));
    }
    let output = match store.claim_run(&run.name, &watch.interrupt)? {
        RunClaim::Ours(output) => output,
        RunClaim::Held(holder) => return Ok(Turn::Held(holder)),
    };
    // Whoever had it before may have finished it.
    if let Some(record) = finished_record(store, run)? {
        output.finish();
        return Ok(Turn::Finished(record));
    }
    tracing::info!(run = run.name, "claimed");
    let turn = match make(run, (experiment, scale), threads, output.as_ref(), watch) {
        Ok(Some(record)) => Turn::Finished(record),
        Err(_) | Ok(None) if output.is_lost() => Turn::Held("another process, which has taken it over".to_string()),
        Ok(None) => Turn::Interrupted,
        Err(error) => return Err(error),
    };
    if matches!(turn, Turn::Finished(_)) {
        tracing::info!(run = run.name, "finished");
        output.finish();
    } else {
        tracing::info!(run = run.name, "left");
    }
    Ok(turn)
}

/// Makes the record of a run that is ours; `None` if it was interrupted.
fn make(
    run: &Run,
    (experiment, scale): (&Experiment, Scale),
    threads: usize,
    output: &dyn RunOutput,
    watch: &Watch,
) -> Result<Option<Record>, PipelineError> {
    let toml = toml::to_string(&run.config).map_err(PipelineError::format)?;
    // That of another configuration must not be found beside the new one.
    output.remove(RECORD)?;
    output.remove(READINGS)?;
    let system = run.config.system()?;
    run.config.validate(system.coordinates)?;
    let (starts, span) = scale.trajectories();
    let began = Instant::now();
    // A run that was stopped goes on from its checkpoint.
    let checkpoints = output.checkpoints().map(|checkpoints| checkpoints.beginning(Begin::Either));
    let options = RunOptions { threads, starts, span, checkpoints };
    let interrupt = output.interrupt().unwrap_or_else(|| Arc::clone(&watch.interrupt));
    let watch = Watch { interrupt, ..watch.remarks_alone() };
    let trained = train(&run.config, &system, &options, output, &watch);
    let judged_or_empty = matches!(
        &trained,
        Ok(_)
            | Err(PipelineError::Interrupted
                | PipelineError::Sampling(SamplingError::Interrupted)
                | PipelineError::Training(TrainingError::NothingLearned(_)))
    );
    let record = match trained {
        _ if judged_or_empty && watch.is_interrupted() => return Ok(None),
        Ok(trained) => {
            if let StopReason::Failed(error) = &trained.stop {
                tracing::warn!(run = run.name, %error, "training stopped early");
            }
            if experiment.reads_holes() {
                read_hole(run, &trained.network, (scale, threads), output, &watch)?;
            }
            trained.record
        }
        Err(PipelineError::Training(error @ TrainingError::NothingLearned(_))) => Record {
            outcome: Outcome::Nothing { reason: error.to_string() },
            losses: Vec::new(),
            times: Vec::new(),
            seconds: began.elapsed().as_secs_f64(),
        },
        Err(error) => return Err(error),
    };
    output.write("config.toml", toml.as_bytes())?;
    // What has a record is finished.
    output.write(RECORD, serde_json::to_string(&record).map_err(PipelineError::format)?.as_bytes())?;
    options.checkpoints.map_or(Ok(()), |checkpoints| checkpoints.remove())?;
    Ok(Some(record))
}

/// Record of a run in a store, or the reason why there is none.
#[derive(Debug)]
pub(crate) enum KeptRecord {
    /// Nothing: the run is not finished.
    Nothing,
    /// A record that was made from its configuration.
    Finished(Record),
    /// A record of another configuration.
    OtherConfiguration,
    /// A file that cannot be read, and why.
    Damaged(&'static str, String),
}

/// The record of a run in a store, if it was made from this configuration.
///
/// # Errors
/// A configuration that TOML cannot hold.
fn finished_record(store: &dyn ExperimentStore, run: &Run) -> Result<Option<Record>, PipelineError> {
    Ok(match kept_record(store, run)? {
        KeptRecord::Finished(record) => Some(record),
        _ => None,
    })
}

/// Record of a run in a store, or the reason why there is none.
///
/// # Errors
/// A configuration that TOML cannot hold.
pub(crate) fn kept_record(store: &dyn ExperimentStore, run: &Run) -> Result<KeptRecord, PipelineError> {
    const CONFIG: &str = "config.toml";
    let toml = toml::to_string(&run.config).map_err(PipelineError::format)?;
    let is_there = |file: &str| store.names(&run.name).iter().any(|name| name == file);
    let Some(record) = store.read(&run.name, RECORD) else {
        let unread = || KeptRecord::Damaged(RECORD, "cannot be read".to_string());
        return Ok(if is_there(RECORD) { unread() } else { KeptRecord::Nothing });
    };
    let record = match serde_json::from_slice(&record) {
        Ok(record) => record,
        Err(error) => return Ok(KeptRecord::Damaged(RECORD, error.to_string())),
    };
    let Some(config) = store.read(&run.name, CONFIG) else {
        let problem = if is_there(CONFIG) { "cannot be read" } else { "is missing beside a record" };
        return Ok(KeptRecord::Damaged(CONFIG, problem.to_string()));
    };
    let config = in_current_words(&String::from_utf8_lossy(&config));
    Ok(match toml::from_str::<Config>(&config) {
        _ if config == toml => KeptRecord::Finished(record),
        Ok(_) => KeptRecord::OtherConfiguration,
        Err(error) => KeptRecord::Damaged(CONFIG, error.message().to_string()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::find;
    use crate::pipeline::Directory;

    #[test]
    fn runs_of_earlier_versions_are_finished() {
        let directory = tempfile::tempdir().unwrap();
        let store = Directory::at(directory.path());
        let runs = find("quick").unwrap().runs(Scale::Smoke, 1);
        let run = runs.iter().find(|run| run.config.system == "spring-pendulum").unwrap();
        let folder = directory.path().join(&run.name);
        std::fs::create_dir(&folder).unwrap();
        let outcome = Outcome::Nothing { reason: String::new() };
        let record = Record { outcome, losses: Vec::new(), times: Vec::new(), seconds: 0.0 };
        std::fs::write(folder.join(RECORD), serde_json::to_string(&record).unwrap()).unwrap();
        let now = toml::to_string(&run.config).unwrap();
        let past = now.replace("acceleration_weighting", "relative").replace("log_uniform", "logarithmic");
        assert!(past.contains("\nrelative = ") && past.contains("\nlogarithmic = "), "{past}");
        for (config, finished) in [(&now, true), (&past, true), (&now.replace("seed = 0", "seed = 7"), false)] {
            std::fs::write(folder.join("config.toml"), config).unwrap();
            assert_eq!(finished_record(&store, run).unwrap().is_some(), finished, "{config}");
        }
        // A file that is damaged is told from one of another configuration.
        let kept = |file: &str, content: &str| {
            std::fs::write(folder.join("config.toml"), &now).unwrap();
            std::fs::write(folder.join(RECORD), serde_json::to_string(&record).unwrap()).unwrap();
            std::fs::write(folder.join(file), content).unwrap();
            kept_record(&store, run).unwrap()
        };
        let other = kept("config.toml", &now.replace("seed = 0", "seed = 7"));
        assert!(matches!(other, KeptRecord::OtherConfiguration), "{other:?}");
        for (file, content) in [(RECORD, "{\"outcome\""), (RECORD, ""), ("config.toml", &now[..40])] {
            let found = kept(file, content);
            assert!(matches!(&found, KeptRecord::Damaged(name, _) if *name == file), "{content}: {found:?}");
        }
        std::fs::remove_file(folder.join(RECORD)).unwrap();
        assert!(matches!(kept_record(&store, run).unwrap(), KeptRecord::Nothing));
    }
}
