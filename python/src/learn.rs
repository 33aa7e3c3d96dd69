//! Trainings and fits.

use crate::attend::attended;
use crate::errors::{pipeline, runtime, value};
use crate::recorded::{Motion, Source};
use crate::subject::{Subject, slice, values};
use lnn::configuration::{Config, Precision};
use lnn::data::Dataset;
use lnn::network::Structure;
use lnn::network::file::ModelFile;
use lnn::pipeline::{Directory, Fit, FitConfig, InMemory, Output, PipelineError, RunOptions};
use lnn::presets::{Preset, Trainer};
use lnn::training::{Epoch, StopReason};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// What was learned: model, history as JSON, facts as JSON, text for a terminal, why it ended.
type Learned = (Subject, String, String, String, Option<String>);

fn preset(name: &str) -> PyResult<Preset> {
    match name {
        "quick" => Ok(Preset::Quick),
        "best" => Ok(Preset::Best),
        "paper" => Ok(Preset::Paper),
        other => Err(value(format_args!("preset: expected quick, best or paper, found {other:?}"))),
    }
}

/// A value of an enumeration by its name in a configuration.
fn named<T: DeserializeOwned>(what: &str, name: &str) -> PyResult<T> {
    serde_json::from_value(name.into()).map_err(|error| value(format_args!("{what}: {error}")))
}

/// A configuration with other values at paths such as `optimizer.batch` and `phase.0.rate`, from a JSON object.
fn changed<T: Serialize + DeserializeOwned>(config: &T, changes: &str) -> Result<T, String> {
    let mut whole = serde_json::to_value(config).map_err(|error| error.to_string())?;
    let changes: serde_json::Map<String, Value> = serde_json::from_str(changes).map_err(|error| error.to_string())?;
    for (path, new) in changes {
        let mut place = &mut whole;
        for key in path.split('.') {
            place = match place {
                Value::Object(table) => table.entry(key).or_insert(Value::Null),
                Value::Array(list) => key
                    .parse::<usize>()
                    .ok()
                    .and_then(|index| list.get_mut(index))
                    .ok_or_else(|| format!("{path}: expected the index of an entry, found {key:?}"))?,
                Value::Null => {
                    *place = Value::Object(serde_json::Map::new());
                    place.as_object_mut().map(|table| table.entry(key).or_insert(Value::Null)).ok_or("no table")?
                }
                _ => return Err(format!("{path}: {key:?} is within a value")),
            };
        }
        *place = new;
    }
    serde_json::from_value(whole).map_err(|error| error.to_string())
}

/// The configuration of a preset for a system, as JSON.
#[pyfunction]
pub fn configuration(
    system: &Subject,
    preset_name: &str,
    structure: Option<&str>,
    epochs: Option<usize>,
    changes: &str,
) -> PyResult<String> {
    let instance = system.system_instance()?;
    let chosen = preset(preset_name)?;
    let config = match structure {
        Some(structure) => chosen.config_of(&instance, named("structure", structure)?),
        None => chosen.config(&instance),
    };
    let mut config =
        config.ok_or_else(|| value(format_args!("the preset {preset_name} has nothing for this system")))?;
    if let Some(epochs) = epochs {
        set_epochs(&mut config, epochs);
    }
    config.parameters = values(&instance);
    let config = changed(&config, changes).map_err(value)?;
    serde_json::to_string(&config).map_err(runtime)
}

/// Passes through the states in every phase; the learning rate falls over them.
fn set_epochs(config: &mut Config, epochs: usize) {
    for phase in &mut config.phases {
        (phase.epochs, phase.t_max) = (epochs, epochs as f64);
    }
}

fn output(out: Option<PathBuf>) -> Result<Box<dyn Output>, PipelineError> {
    Ok(match out {
        Some(path) => Box::new(Directory::create(&path)?),
        None => Box::new(InMemory::default()),
    })
}

fn ended(stop: &StopReason) -> Option<String> {
    match stop {
        StopReason::Finished => None,
        StopReason::Interrupted => Some("interrupted".to_string()),
        StopReason::Failed(error) => Some(error.to_string()),
        other => Some(format!("{other:?}")),
    }
}

fn history(epochs: &[Epoch]) -> PyResult<String> {
    serde_json::to_string(epochs).map_err(runtime)
}

/// Learns a system by a configuration, JSON.
#[pyfunction]
pub fn train(
    py: Python<'_>,
    system: &Subject,
    config: &str,
    plan: (usize, usize),
    out: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Learned> {
    let instance = system.system_instance()?;
    let config: Config = serde_json::from_str(config).map_err(value)?;
    let (starts, threads) = plan;
    let options = RunOptions { threads, starts, ..RunOptions::default() };
    let report = attended(py, progress.as_ref(), |watch| {
        lnn::pipeline::train(&config, &instance, &options, output(out)?.as_ref(), &watch)
    })?
    .map_err(pipeline)?;
    let (text, result, stop) = (report.text(), history(&report.history)?, ended(&report.stop));
    let json = report.json().map_err(pipeline)?;
    Ok((Subject::learned(report.header, report.network)?, result, json, text, stop))
}

/// Choices of [`learn`] and [`fit`], as JSON.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Choices {
    structure: Option<Structure>,
    hidden: Option<Vec<usize>>,
    epochs: Option<usize>,
    precision: Precision,
    seed: u64,
    threads: usize,
    #[serde(default)]
    dissipation: Option<usize>,
    #[serde(default)]
    friction: bool,
    changes: Value,
}

/// Learns from states with their accelerations, each `(b, n)`.
#[pyfunction]
pub fn learn(
    py: Python<'_>,
    q: PyReadonlyArray2<'_, f64>,
    v: PyReadonlyArray2<'_, f64>,
    a: PyReadonlyArray2<'_, f64>,
    columns: (Vec<String>, Vec<String>),
    choices: &str,
) -> PyResult<(Subject, String, f64, f64)> {
    let choices: Choices = serde_json::from_str(choices).map_err(value)?;
    let (names, angles) = columns;
    let owned = |array| slice(array).map(<[f64]>::to_vec);
    let data = Dataset::new(names.len(), owned(&q)?, owned(&v)?, owned(&a)?).map_err(value)?;
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let places: Option<Vec<usize>> = angles.iter().map(|angle| names.iter().position(|name| name == angle)).collect();
    let places = places.ok_or_else(|| value("angles: expected names of coordinates"))?;
    let mut trainer = Trainer::new(&data).coordinates(&names).angles(&places);
    trainer = trainer.precision(choices.precision).seed(choices.seed).threads(choices.threads);
    if let Some(structure) = choices.structure {
        trainer = trainer.structure(structure);
    }
    if let Some(hidden) = &choices.hidden {
        trainer = trainer.hidden(hidden);
    }
    if let Some(epochs) = choices.epochs {
        trainer = trainer.epochs(epochs);
    }
    if let Some(units) = choices.dissipation {
        trainer = trainer.dissipation(units);
    }
    let mut refused = None;
    trainer = trainer.configure(|config| match changed(config, &choices.changes.to_string()) {
        Ok(new) => *config = new,
        Err(problem) => refused = Some(problem),
    });
    if let Some(problem) = refused {
        return Err(value(problem));
    }
    let learned = attended(py, None, |_| trainer.train())?.map_err(|error| match error {
        lnn::presets::TrainerError::Training(_) => runtime(error),
        _ => value(error),
    })?;
    // The header is known to the file alone.
    let place = std::env::temp_dir().join(format!("lnn-{}-{:p}.safetensors", std::process::id(), &learned));
    let loaded = learned.save(&place).and_then(|()| ModelFile::<f64>::load(&place));
    let _ = std::fs::remove_file(&place);
    let header = loaded.map_err(runtime)?.header;
    let result = history(&learned.history)?;
    Ok((Subject::learned(header, learned.model)?, result, learned.validation_loss, learned.test_loss))
}

/// Learns from recorded motion: files, or trajectories in memory.
#[pyfunction]
pub fn fit(
    py: Python<'_>,
    motion: Motion,
    choices: &str,
    out: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Learned> {
    let choices: Choices = serde_json::from_str(choices).map_err(value)?;
    let source = Source::of(motion)?;
    let refused: Arc<Mutex<Option<String>>> = Arc::default();
    let result = Arc::clone(&refused);
    let report = attended(py, progress.as_ref(), move |watch| task(source, choices, result, out).watch(watch).run())?;
    if let Some(problem) = refused.lock().ok().and_then(|mut result| result.take()) {
        return Err(value(problem));
    }
    let report = report.map_err(pipeline)?;
    let (text, result, stop) = (report.text().to_string(), history(&report.history)?, ended(&report.stop));
    let json = report.json().to_string();
    Ok((Subject::learned(report.header, report.network)?, result, json, text, stop))
}

/// The fit with its choices; a change that the configuration refuses is put into `refused`.
fn task(source: Source, choices: Choices, refused: Arc<Mutex<Option<String>>>, out: Option<PathBuf>) -> Fit {
    let mut task = match source {
        Source::Files(files, columns) => Fit::files(files).columns(|own| *own = columns),
        Source::Memory(recording) => Fit::recording(recording),
    };
    task = task.friction(choices.friction).seed(choices.seed).precision(choices.precision).threads(choices.threads);
    if let Some(structure) = choices.structure {
        task = task.structure(structure);
    }
    if let Some(out) = out {
        task = task.out(out);
    }
    task.configure(move |config: &mut FitConfig| {
        if let Some(hidden) = choices.hidden {
            config.training.network.hidden = hidden;
        }
        if let Some(epochs) = choices.epochs {
            set_epochs(&mut config.training, epochs);
        }
        match changed(config, &choices.changes.to_string()) {
            Ok(new) => *config = new,
            Err(problem) => {
                // The fit refuses this at once.
                config.training.network.hidden.clear();
                if let Ok(mut refused) = refused.lock() {
                    *refused = Some(problem);
                }
            }
        }
    })
}
