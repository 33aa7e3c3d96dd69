//! Experiments: their runs side by side, those that are finished not again, and the tables that come of them.

use crate::experiments::{Experiment, Outcome, Record, Run, Scale};
use crate::pipeline::checkpoints::Begin;
use crate::pipeline::experiment_report::{ExperimentReport, Results, conclude};
use crate::pipeline::experiment_store::ExperimentStore;
use crate::pipeline::readings::READINGS;
use crate::pipeline::train::{RunOptions, train};
use crate::pipeline::{Event, PipelineError, RECORD, Watch};
use crate::report::Curve;
use crate::training::{Stop, TrainingError};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Runs an experiment, `runs` of it, on so many threads, and writes table, pictures and report; runs whose records are in the
/// store and are of the same configuration are not run again. `beside` are curves of loss against time from elsewhere.
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
    let total = runs.len();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Mutex<BTreeMap<usize, Result<Option<Record>, PipelineError>>> = Mutex::new(BTreeMap::new());
    let abreast = if experiment.is_timed() { 1 } else { threads.min(total).max(1) };
    watch.say(Event::Runs { done: 0, total });
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(run) = runs.get(index) else { break };
            let result = one(run, scale, (threads / abreast).max(1), store, watch);
            watch.say(Event::Runs { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
            let failed = result.is_err();
            results.lock().unwrap_or_else(PoisonError::into_inner).insert(index, result);
            if failed || watch.is_interrupted() {
                // No new runs; those of the other threads come to their own end.
                next.store(total, Ordering::Relaxed);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..abreast {
            scope.spawn(work);
        }
    });
    let mut found = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    let results = runs
        .into_iter()
        .enumerate()
        .map(|(index, run)| Ok((run, found.remove(&index).transpose()?.flatten())))
        .collect::<Result<Results, PipelineError>>()?;
    if watch.is_interrupted() {
        let finished = results.iter().filter(|(_, record)| record.is_some()).count();
        return Err(PipelineError::InterruptedRuns { finished, total });
    }
    conclude(experiment, scale, results, beside, store, (started, threads, watch))
}

/// The record of a run: the one that is there if it was made from the same configuration, or a new one. `None` if it was
/// interrupted.
fn one(
    run: &Run,
    scale: Scale,
    threads: usize,
    store: &dyn ExperimentStore,
    watch: &Watch,
) -> Result<Option<Record>, PipelineError> {
    if let Some(record) = finished_record(store, run)? {
        return Ok(Some(record));
    }
    let toml = toml::to_string(&run.config).map_err(PipelineError::format)?;
    let output = store.open_run(&run.name)?;
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
    let trained = train(&run.config, &system, &options, output.as_ref(), &watch.remarks_alone());
    let judged_or_empty = matches!(
        &trained,
        Ok(_) | Err(PipelineError::Interrupted | PipelineError::Training(TrainingError::NothingLearned(_)))
    );
    let record = match trained {
        _ if judged_or_empty && watch.is_interrupted() => return Ok(None),
        Ok(trained) => {
            if let Stop::Failed(error) = &trained.stop {
                tracing::warn!(run = run.name, %error, "training stopped early");
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

/// The record of a run in a store, if it was made from this configuration.
///
/// # Errors
/// A configuration that TOML cannot hold.
pub fn finished_record(store: &dyn ExperimentStore, run: &Run) -> Result<Option<Record>, PipelineError> {
    let toml = toml::to_string(&run.config).map_err(PipelineError::format)?;
    let record = store.read(&run.name, RECORD).and_then(|json| serde_json::from_slice(&json).ok());
    let same = || store.read(&run.name, "config.toml").is_some_and(|text| text == toml.as_bytes());
    Ok(record.filter(|_| same()))
}
