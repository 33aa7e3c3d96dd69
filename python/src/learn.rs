//! Trainings and fits.

use crate::arrays::slice;
use crate::attend::attended;
use crate::errors::{choice, pipeline, runtime, value};
use crate::readings::said;
use crate::recorded::{Motion, Source};
use crate::subject::{Subject, values};
use lnn::configuration::{Config, Known, Precision};
use lnn::data::Dataset;
use lnn::findings::Findings;
use lnn::network::Structure;
use lnn::pipeline::{
    Fit, FitConfig, FitConstraints, FitOptions, InMemory, LockedDirectory, Output, PipelineError, RunOptions, Swept,
    Unjudged,
};
use lnn::presets::{Preset, Trainer};
use lnn::training::{Epoch, StopReason};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// What was learned: models, that of the fit or training first, history as JSON, facts as JSON, what a terminal and what a notebook shows of
/// them, why it ended.
type Learned = (Vec<Subject>, String, String, (String, String), Option<String>);

/// A value of an enumeration by its name in a configuration.
fn named<T: DeserializeOwned>(what: &str, name: &str) -> PyResult<T> {
    serde_json::from_value(name.into()).map_err(|error| value(format_args!("{what}: {error}")))
}

/// A configuration with other values at paths such as `optimizer.batch` and `phase.0.rate`, from a JSON object.
fn changed<T: Serialize + DeserializeOwned>(config: &T, changes: &Map<String, Value>) -> Result<T, String> {
    let mut whole = serde_json::to_value(config).map_err(|error| error.to_string())?;
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
                    *place = Value::Object(Map::new());
                    place.as_object_mut().map(|table| table.entry(key).or_insert(Value::Null)).ok_or("no table")?
                }
                _ => return Err(format!("{path}: {key:?} is within a value")),
            };
        }
        *place = new.clone();
    }
    serde_json::from_value(whole).map_err(|error| {
        // The change that is refused alone is the one to name.
        let alone =
            |(path, new): (&String, &Value)| changed(config, &Map::from_iter([(path.clone(), new.clone())])).err();
        match changes.keys().next() {
            Some(path) if changes.len() == 1 => format!("{path}: {error}"),
            _ => changes.iter().find_map(alone).unwrap_or_else(|| error.to_string()),
        }
    })
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
    let chosen = choice("preset", preset_name, &Preset::ALL, Preset::name)?;
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
    let changes = serde_json::from_str(changes).map_err(value)?;
    let config = changed(&config, &changes).map_err(value)?;
    serde_json::to_string(&config).map_err(runtime)
}

/// Passes through the states in every phase; the learning rate falls over them.
fn set_epochs(config: &mut Config, epochs: usize) {
    for phase in &mut config.phases {
        (phase.epochs, phase.t_max) = (epochs, epochs as f64);
    }
}

/// A directory to write into, and whether what is there may be replaced.
type Target = (PathBuf, bool);

fn output(out: Option<Target>) -> Result<Box<dyn Output>, PipelineError> {
    Ok(match out {
        Some((path, overwrite)) => Box::new(LockedDirectory::claim(&path, overwrite)?),
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
    out: Option<Target>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Learned> {
    let instance = system.system_instance()?;
    let config: Config = serde_json::from_str(config).map_err(value)?;
    let (starts, threads) = plan;
    let mut options = RunOptions::default();
    (options.threads, options.starts) = (threads, starts);
    let report = attended(py, progress.as_ref(), |watch| {
        lnn::pipeline::train(&config, &instance, &options, output(out)?.as_ref(), &watch)
    })?;
    let report = match report {
        Err(PipelineError::Unjudged(learned)) => return unjudged(*learned),
        report => report.map_err(pipeline)?,
    };
    let (history, stop, said) = (history(&report.history)?, ended(&report.stop), said(&report.findings()));
    let json = report.json().map_err(pipeline)?;
    Ok((vec![Subject::learned(report.header, report.network)?], history, json, said, stop))
}

/// Trains several configurations, JSON with the choices that make each, into a directory: the table as JSON and as it is shown, finished runs.
#[pyfunction]
pub fn sweep(
    py: Python<'_>,
    configurations: Vec<(Vec<(String, String)>, String)>,
    plan: (usize, usize),
    out: Target,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, (String, String), usize)> {
    let parsed = configurations.into_iter().map(|(choice, text)| Ok((choice, serde_json::from_str(&text)?)));
    let parsed: Vec<(Vec<(String, String)>, Config)> =
        parsed.collect::<Result<_, serde_json::Error>>().map_err(value)?;
    let swept =
        attended(py, progress.as_ref(), |watch| lnn::pipeline::Sweep::run(parsed, plan, (&out.0, out.1), &watch))?;
    let Swept { rows, finished, findings } = swept.map_err(pipeline)?;
    Ok((serde_json::to_string(&rows).map_err(runtime)?, said(&findings), finished))
}

/// A model whose judgement was interrupted: there are no figures of it.
fn unjudged(learned: Unjudged) -> PyResult<Learned> {
    let Unjudged { header, network, history: epochs, .. } = learned;
    let (model, history) = (Subject::learned(header, network)?, history(&epochs)?);
    let mut findings = Findings::default();
    findings.line("interrupted while the model was judged: there are no figures");
    Ok((vec![model], history, "{}".to_string(), said(&findings), Some("interrupted".to_string())))
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
    #[serde(default)]
    members: Option<usize>,
    #[serde(default)]
    formula: bool,
    #[serde(default)]
    known: Option<Known>,
    #[serde(default)]
    constraints: FitConstraints,
    changes: Map<String, Value>,
}

/// Keys of the configuration of a fit that are decided before its data are divided.
const EARLY: [&str; 6] = ["targets", "held_out", "window", "noise", "between", "constraints"];

impl Choices {
    /// The choices that come before the configuration of a fit, taken out of the changes.
    ///
    /// # Errors
    /// A value that is none of such a key.
    fn early(&mut self) -> Result<FitOptions, String> {
        let given =
            EARLY.iter().filter_map(|key| self.changes.remove(*key).map(|new| (key.to_string(), new))).collect();
        let config = FitConfig { constraints: self.constraints.clone(), ..FitConfig::default() };
        let mut options = FitOptions::from(&changed(&config, &given)?);
        options.seed = self.seed;
        Ok(options)
    }
}

/// The table `constraints` of a file, formulas by name.
#[pyfunction]
pub fn read_constraints(path: PathBuf) -> PyResult<BTreeMap<String, String>> {
    #[derive(serde::Deserialize)]
    struct Table {
        constraints: BTreeMap<String, String>,
    }
    let text = std::fs::read_to_string(&path)?;
    let table: Table = toml::from_str(&text).map_err(|error| value(format_args!("{}: {error}", path.display())))?;
    Ok(table.constraints)
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
    progress: Option<Py<PyAny>>,
) -> PyResult<Learned> {
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
        trainer = trainer.configure(|config| config.network.dissipation = Some(units));
    }
    let formulas: Vec<(&str, &str)> = match &choices.constraints {
        FitConstraints::None => Vec::new(),
        FitConstraints::Find => return Err(value("constraints: expected formulas by name, found \"find\"")),
        FitConstraints::Formulas(all) => all.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect(),
    };
    trainer = trainer.constraints(&formulas);
    let mut refused = None;
    trainer = trainer.configure(|config| match changed(config, &choices.changes) {
        Ok(new) => *config = new,
        Err(problem) => refused = Some(problem),
    });
    if let Some(problem) = refused {
        return Err(value(problem));
    }
    let learned = attended(py, progress.as_ref(), |watch| trainer.train_watched(&watch.hooks()))?;
    let learned = learned.map_err(|error| match error {
        lnn::presets::TrainerError::Training(_) => runtime(error),
        _ => value(error),
    })?;
    let (history, stop, said) = (history(&learned.history)?, ended(&learned.stop), said(&learned.findings()));
    let losses = json!({ "validation_loss": learned.validation_loss, "test_loss": learned.test_loss });
    Ok((vec![Subject::learned(learned.header, learned.model)?], history, losses.to_string(), said, stop))
}

/// Learns from recorded motion: files, or trajectories in memory.
#[pyfunction]
pub fn fit(
    py: Python<'_>,
    motion: Motion,
    choices: &str,
    out: Option<Target>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Learned> {
    let mut choices: Choices = serde_json::from_str(choices).map_err(value)?;
    let options = choices.early().map_err(value)?;
    let source = Source::of(motion)?;
    let refused: Arc<Mutex<Option<String>>> = Arc::default();
    let result = Arc::clone(&refused);
    let report = attended(py, progress.as_ref(), move |watch| {
        task(source, choices, result, out).options(|all| *all = options).watch(watch).run()
    })?;
    if let Some(problem) = refused.lock().ok().and_then(|mut result| result.take()) {
        return Err(value(problem));
    }
    let report = match report {
        Err(PipelineError::Unjudged(learned)) => return unjudged(*learned),
        report => report.map_err(pipeline)?,
    };
    let (history, stop, said) = (history(&report.history)?, ended(&report.stop), said(report.findings()));
    let json = report.json().to_string();
    let models = [(report.header, report.network)].into_iter();
    let models = models.chain(report.others.into_iter().map(|other| (other.header, other.network)));
    let models = models.map(|(header, network)| Subject::learned(header, network)).collect::<PyResult<_>>()?;
    Ok((models, history, json, said, stop))
}

/// The fit with its choices; a change that the configuration refuses is put into `refused`.
fn task(source: Source, choices: Choices, refused: Arc<Mutex<Option<String>>>, out: Option<Target>) -> Fit {
    let mut task = match source {
        Source::Files(files, columns) => Fit::files(files).columns(|own| *own = *columns),
        Source::Memory(recording) => Fit::recording(recording),
    };
    task = task.friction(choices.friction).precision(choices.precision).threads(choices.threads);
    if let Some(structure) = choices.structure {
        task = task.structure(structure);
    }
    if let Some((path, overwrite)) = out {
        task = task.out(path).overwrite(overwrite);
    }
    task.configure(move |config: &mut FitConfig| {
        if choices.known.is_some() {
            config.take_known(choices.known);
        }
        if let Some(hidden) = choices.hidden {
            config.training.network.hidden = hidden;
        }
        if let Some(epochs) = choices.epochs {
            set_epochs(&mut config.training, epochs);
        }
        if let Some(members) = choices.members {
            config.members = members;
        }
        config.formula = choices.formula;
        match changed(config, &choices.changes) {
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
