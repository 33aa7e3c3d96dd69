//! One training from configuration to files: model, history, summary, pictures, report.

use crate::analysis::{stretches, training_instability};
use crate::cli::attention::Attention;
use crate::cli::evaluation::{Evaluation, PIECES, Plan, RTOL, evaluate};
use crate::cli::folder::Folder;
use crate::cli::learned::{MODEL, all_parameters, given, trained_on};
use crate::cli::results::{CAPTIONS, remove_stale};
use crate::cli::systems::parameters;
use crate::cli::{CliError, memory, output, start};
use crate::experiments::{Outcome, Record};
use crate::lagrangian::system::TrajectoryTest;
use crate::lagrangian::{Configured, configure_system};
use crate::names::{counted, number};
use crate::network::file::{FORMAT, Header, ModelFile, StoredPrecision};
use crate::network::{Architecture, Layout, NetworkLagrangian};
use crate::report::{Figure, HistoryRow, Report, training_figures};
use crate::scalar::Scalar;
use crate::storage::Disk;
use crate::training::{
    Config, Datasets, Epoch, Every, Hooks, Identity, Keeper, NEWEST, PREVIOUS, Phase, Precision, Restored,
    SamplingError, Sitting, Snapshot, Stop, TrainingError, remove_checkpoints, resume, sample_all, training_memory,
};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Instant;

/// Contents of `summary.json`; losses in the paper's convention, errors in physical units.
#[derive(Serialize)]
struct Summary<'a> {
    system: &'a str,
    crate_version: &'static str,
    seed: u64,
    precision: &'static str,
    threads: usize,
    epochs: usize,
    weights: usize,
    validation_loss: f64,
    test_loss: f64,
    test_states_left_out: usize,
    instability: Option<f64>,
    wall_seconds: f64,
    training_seconds: f64,
    states_per_second: f64,
    ended: String,
    #[serde(flatten)]
    evaluation: &'a Evaluation,
}

/// Amount of work that a run may take.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Threads of the training.
    pub threads: usize,
    /// Starts of the trajectory test.
    pub starts: usize,
    /// Fraction of the test's time span.
    pub horizon: f64,
}

/// A run that ended, after its files were written.
#[derive(Debug)]
pub struct Finished {
    /// Why training ended.
    pub stop: Stop,
    /// Epochs that were run.
    pub epochs: usize,
    /// `summary.json`.
    pub json: String,
    /// Tables for a terminal.
    pub text: String,
    /// The record that an experiment keeps of it.
    pub record: Record,
}

/// Where a training begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// At its beginning.
    Anew,
    /// At its checkpoint, which must be there.
    Resume,
    /// At its checkpoint if there is one that fits, at its beginning if not.
    Either,
}

/// Use of checkpoints in a training.
#[derive(Clone, Copy, Debug)]
pub struct Keeping {
    /// Interval at which one is written.
    pub every: Every,
    /// Place where the training begins.
    pub start: Begin,
}

/// The checkpoint to go on from, or nothing, with old checkpoints out of the way.
///
/// # Errors
/// A data error for a checkpoint that must be there and is not, or that is of another run.
pub fn begin<S: Scalar>(
    keeper: &Keeper,
    folder: &Folder,
    parameters: usize,
    states: usize,
    start: Begin,
) -> Result<Option<Snapshot<S>>, CliError> {
    if start != Begin::Anew {
        match keeper.restore(parameters, states) {
            Ok(Restored { content, fallback }) => {
                if let Some(problem) = fallback {
                    let (newest, previous) = (folder.file(NEWEST), folder.file(PREVIOUS));
                    let place = newest.display();
                    output::note(&format!("{place}: {problem}; going on from {}", previous.display()));
                }
                return Ok(Some(content));
            }
            Err(error) if start == Begin::Resume => return Err(CliError::file(folder.path(), error)),
            Err(_) => {}
        }
    }
    forget(folder)?;
    Ok(None)
}

/// The network's shape, and the weights of the model that the training starts from, if it does: then the scales are the
/// model's.
fn begin_shape<S: Scalar>(
    config: &Config,
    system: &Configured<f64>,
    scale: Vec<f64>,
) -> Result<(Architecture, Option<Vec<S>>), CliError> {
    let Some(from) = &config.from else { return Ok((config.architecture(system, scale), None)) };
    let (weights, architecture) = start::weights(from, |scale| config.architecture(system, scale))?;
    Ok((architecture, Some(weights)))
}

/// Removes the checkpoints of a training that is over.
///
/// # Errors
/// A data error naming the directory.
pub fn forget(folder: &Folder) -> Result<(), CliError> {
    let cannot = |e| CliError::file(folder.path(), format_args!("cannot remove checkpoints: {e}"));
    remove_checkpoints(&Disk, folder.path()).map_err(cannot)
}

/// Outcome of a training.
#[derive(Debug)]
pub enum Learning {
    /// There is a model.
    Finished(Box<Finished>),
    /// No epoch gave a finite loss, and why; nothing was written.
    Nothing(String),
}

/// Trains in the configuration's precision and writes everything into the directory. Checkpoints stay until
/// [`forget`].
///
/// # Errors
/// A usage error for bounds that cannot be sampled and for penalties that do not fit, a data error for files that cannot be
/// written.
pub fn learn(
    folder: &Folder,
    config: &Config,
    system: &Configured<f64>,
    effort: Effort,
    hooks: &Hooks,
    keeping: Keeping,
) -> Result<Learning, CliError> {
    match config.precision {
        Precision::F32 => learn_in::<f32>(folder, config, system, effort, hooks, keeping),
        Precision::F64 => learn_in::<f64>(folder, config, system, effort, hooks, keeping),
    }
}

fn learn_in<S: Scalar>(
    folder: &Folder,
    config: &Config,
    system: &Configured<f64>,
    effort: Effort,
    hooks: &Hooks,
    keeping: Keeping,
) -> Result<Learning, CliError> {
    let started = Instant::now();
    let unscaled = config.architecture(system, vec![1.0; system.coordinates]);
    memory::require("training", training_memory(config, &unscaled))?;
    let (data, scale) = sample_all::<S>(config, system).map_err(|e| match e {
        SamplingError::Dataset(_) => CliError::data(e),
        _ => CliError::usage(e),
    })?;
    let penalty = config.penalty().map_err(CliError::usage)?;
    let (architecture, before) = begin_shape::<S>(config, system, scale)?;
    let imposed = imposed_velocities(system, &data);
    let fresh = (data.test.cast::<f64>().q().to_vec(), data.test.cast::<f64>().v().to_vec());
    let toml = toml::to_string(config).map_err(CliError::data)?;
    let identity = Identity { config: toml.clone(), data: data.checksums() };
    let keeper = Arc::new(Keeper::new(Arc::new(Disk), folder.path(), keeping.every, identity));
    let parameters = Layout::new(&architecture).parameters;
    let start = begin(&keeper, folder, parameters, config.data.training, keeping.start)?;
    let start = start.or_else(|| before.map(Snapshot::beginning_with));
    let sitting = Sitting { keeper: Some(keeper), start };
    let trained = match resume(config, &architecture, penalty, data, effort.threads, hooks, sitting) {
        Ok(trained) => trained,
        Err(error @ TrainingError::NothingLearned(_)) => return Ok(Learning::Nothing(error.to_string())),
        Err(error) => return Err(CliError::data(error)),
    };

    // The model first, then what is small, pictures last: on a full disk nothing that comes after can lose them.
    let header = header(config, system, architecture.clone(), imposed, trained.validation_loss)?;
    let domain = trained_on(&header);
    let model = ModelFile { header, weights: trained.weights.clone() };
    save(folder, &model)?;
    folder.write("config.toml", toml.as_bytes())?;
    folder.write("history.csv", history(&trained.history).as_bytes())?;

    let scale = architecture.scale.iter().sum::<f64>() / architecture.scale.len() as f64;
    let network = NetworkLagrangian::new(architecture, model.weights).map_err(CliError::data)?.cast::<f64>();
    let Effort { threads, starts, horizon } = effort;
    let test = system.system.trajectory(system.coordinates);
    let plan = Plan {
        states: (&fresh.0, &fresh.1),
        starts,
        span: TrajectoryTest { t_end: test.t_end * horizon, ..test },
        rtol: RTOL,
        trained: domain,
        seed: config.seed,
        threads,
        attention: &Attention::new(Some(&hooks.interrupt), PIECES),
    };
    let evaluation = evaluate(system, &network, plan)?;
    let finite = |x: f64| x.is_finite().then_some(x);
    let losses: Vec<[Option<f64>; 2]> =
        trained.history.iter().map(|e| [finite(e.training_loss), finite(e.validation_loss)]).collect();
    let times = trained.history.iter().map(|e| e.seconds).collect();
    let training_losses: Vec<f64> = trained.history.iter().map(|e| e.training_loss).collect();
    let instability = training_instability(&training_losses, &stretches(config));
    let summary = Summary {
        system: &config.system,
        crate_version: env!("CARGO_PKG_VERSION"),
        seed: config.seed,
        precision: S::NAME,
        threads,
        epochs: trained.history.len(),
        weights: trained.weights.len(),
        validation_loss: trained.validation_loss,
        test_loss: trained.test.loss.to_f64(),
        test_states_left_out: trained.test.left_out,
        instability,
        wall_seconds: started.elapsed().as_secs_f64(),
        training_seconds: trained.seconds,
        states_per_second: trained.states as f64 / trained.seconds,
        ended: ended(&trained.stop),
        evaluation: &evaluation,
    };
    let json = serde_json::to_string_pretty(&summary).map_err(CliError::data)? + "\n";
    folder.write("summary.json", json.as_bytes())?;
    write_report(folder, system, &summary, &trained.history, &toml)?;
    let text = format!(
        "{}\n{}\nreport: {}\n",
        evaluation.text(&system.system.title),
        headline(&summary),
        folder.file("report.html").display()
    );
    let outcome = Outcome::Learned(crate::experiments::Learned {
        validation_loss: trained.validation_loss,
        instability,
        scale,
        wrong_signature: evaluation.wrong_signature,
        energy_errors: evaluation.trajectories.iter().map(|t| finite(t.summary.energy_error.mean)).collect(),
        stretching: evaluation
            .trajectories
            .iter()
            .map(|t| finite(t.summary.lyapunov_exponent? * test.t_end * horizon))
            .collect(),
        integrated: evaluation.trajectories.iter().filter(|t| t.summary.stopped.is_none()).count(),
    });
    Ok(Learning::Finished(Box::new(Finished {
        epochs: trained.history.len(),
        json,
        text,
        record: Record { outcome, losses, times, seconds: trained.seconds },
        stop: trained.stop,
    })))
}

pub(super) fn ended(stop: &Stop) -> String {
    match stop {
        Stop::Finished => "finished".to_string(),
        Stop::Interrupted => "interrupted".to_string(),
        Stop::Failed(error) => error.to_string(),
    }
}

/// The velocity that the mass shell fixes and its range over the training states, which no bounds of the configuration
/// tell.
fn imposed_velocities<S: Scalar>(system: &Configured<f64>, data: &Datasets<S>) -> Option<(usize, [f64; 2])> {
    let i = system.constrained_coordinate()?;
    let ranges = data.training.iter().map(|set| set.velocity_range(i));
    ranges.reduce(|[low, high], [l, h]| [low.min(l), high.max(h)]).map(|range| (i, range))
}

/// Header of the model file of this run.
fn header(
    config: &Config,
    system: &Configured<f64>,
    architecture: Architecture,
    imposed: Option<(usize, [f64; 2])>,
    validation_loss: f64,
) -> Result<Header, CliError> {
    // Defaults that change in a later version must not change this model.
    let mut parameters = all_parameters(system);
    parameters.extend(config.parameters.clone());
    configure_system::<f64>(system.system.clone(), &given(&parameters)).map_err(CliError::data)?;
    let hull = |bounds: fn(&Phase) -> &Vec<[f64; 2]>| {
        (0..system.coordinates)
            .map(|i| {
                let all = config.phases.iter().filter_map(|phase| bounds(phase).get(i));
                all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], b| [low.min(b[0]), high.max(b[1])])
            })
            .collect()
    };
    let mut velocity: Vec<[f64; 2]> = hull(|phase| &phase.velocity);
    if let Some((i, range)) = imposed {
        velocity[i] = range;
    }
    Ok(Header {
        format: FORMAT,
        crate_version: env!("CARGO_PKG_VERSION").to_string(),
        architecture,
        system: config.system.clone(),
        parameters,
        columns: system.system.columns(system.coordinates),
        forces: Vec::new(),
        description: config.description.clone(),
        precision: match config.precision {
            Precision::F32 => StoredPrecision::F32,
            Precision::F64 => StoredPrecision::F64,
        },
        position: hull(|phase| &phase.position),
        velocity,
        seed: config.seed,
        validation_loss,
    })
}

/// `history.csv`: one row per epoch.
pub(super) fn history(epochs: &[Epoch]) -> String {
    let mut csv =
        "epoch,phase,rate,training_loss,penalty,penalised,validation_loss,gradient_norm,left_out,skipped,seconds\n"
            .to_string();
    for e in epochs {
        // Writing to a string cannot fail.
        let _ = writeln!(
            csv,
            "{},{},{},{},{},{},{},{},{},{},{:.3}",
            e.epoch,
            e.phase,
            e.rate,
            e.training_loss,
            e.penalty,
            e.penalised,
            e.validation_loss,
            e.gradient_norm,
            e.left_out,
            e.skipped,
            e.seconds
        );
    }
    csv
}

/// The figures of a run in one line.
fn headline(summary: &Summary<'_>) -> String {
    let fresh = match summary.test_loss {
        loss if loss.is_finite() => number(loss),
        _ => format!("not finite ({} states left out)", summary.test_states_left_out),
    };
    format!(
        "loss (paper): validation {}, fresh states {fresh}; {} in {:.1} s, {:.0} states/s, {}, seed {}\n",
        number(summary.validation_loss),
        counted(summary.epochs, "epoch", "epochs"),
        summary.training_seconds,
        summary.states_per_second,
        counted(summary.weights, "weight", "weights"),
        summary.seed
    )
}

/// Adds the system's parameters to a report.
pub(super) fn parameter_table(report: Report, system: &Configured<f64>) -> Report {
    let values = all_parameters(system);
    let row = |[symbol, _, unit, _]: &[String; 4]| {
        let value = values.get(symbol).map(f64::to_string).unwrap_or_default();
        vec![symbol.clone(), value, if unit == "1" { "-".to_string() } else { unit.clone() }]
    };
    let rows: Vec<Vec<String>> = parameters(&system.system).iter().map(row).collect();
    if rows.is_empty() {
        return report;
    }
    report.heading("Parameters of the system").table(&["parameter", "value", "unit"], &rows)
}

fn write_report(
    folder: &Folder,
    system: &Configured<f64>,
    summary: &Summary<'_>,
    epochs: &[Epoch],
    toml: &str,
) -> Result<(), CliError> {
    let training = training_pictures(epochs);
    let report = Report::new(&format!("{}: learned", system.system.title));
    let report = summary.evaluation.summarise(report, &system.system.title).paragraph(&headline(summary));
    let report = summary.evaluation.report(parameter_table(report, system)).heading("Training");
    let report = report.figures(&training).heading("Configuration").preformatted(toml);
    write_report_and_figures(folder, &report, training.iter().chain(&summary.evaluation.figures))
}

/// Writes the model, and lets what an earlier run left beside it go.
///
/// # Errors
/// A data error naming the file.
pub(super) fn save<S: Scalar>(folder: &Folder, model: &ModelFile<S>) -> Result<(), CliError> {
    let file = folder.file(MODEL);
    model.save(&file).map_err(|e| CliError::file(&file, e))?;
    remove_stale(folder)
}

/// Pictures of a history.
pub(super) fn training_pictures(epochs: &[Epoch]) -> Vec<Figure> {
    let row = |e: &Epoch| HistoryRow {
        epoch: e.epoch as f64,
        training_loss: e.training_loss,
        validation_loss: e.validation_loss,
        learning_rate: e.rate,
        gradient_norm: e.gradient_norm,
        penalty: e.penalty,
    };
    training_figures(&epochs.iter().map(row).collect::<Vec<_>>())
}

/// Writes [`CAPTIONS`], which name the pictures and tell what they show, the report, and the pictures.
///
/// # Errors
/// A data error naming the file.
pub(super) fn write_report_and_figures<'a>(
    folder: &Folder,
    report: &Report,
    figures: impl Iterator<Item = &'a Figure> + Clone,
) -> Result<(), CliError> {
    let captions: BTreeMap<&str, &str> = figures.clone().map(|f| (f.file.as_str(), f.caption.as_str())).collect();
    folder.write(CAPTIONS, serde_json::to_string_pretty(&captions).map_err(CliError::data)?.as_bytes())?;
    folder.write("report.html", report.to_html().as_bytes())?;
    figures.into_iter().try_for_each(|figure| folder.write(&figure.file, figure.picture.to_svg().as_bytes()))
}
