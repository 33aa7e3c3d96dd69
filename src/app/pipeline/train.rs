//! A training from its configuration to files: model, history, summary, pictures, report.

use crate::analysis::{stretches, training_instability};
use crate::configuration::{Config, Phase, Precision};
use crate::data::{Datasets, sample_all_until};
use crate::experiments::{Learned, Outcome, Record};
use crate::lagrangian::SystemInstance;
use crate::lagrangian::system::TrajectoryTest;
use crate::names::{counted, number};
use crate::network::file::{Header, ModelFile};
use crate::network::{Architecture, Layout, NetworkLagrangian};
use crate::pipeline::checkpoints::Checkpoints;
use crate::pipeline::evaluation::{Evaluation, EvaluationOptions, RTOL, STARTS, evaluate};
use crate::pipeline::model::{all_parameters, trained_on};
use crate::pipeline::report_files::{ended, history, parameter_table, training_pictures, write_report_and_figures};
use crate::pipeline::{MODEL, Output, PipelineError, SUMMARY, Watch, memory, start};
use crate::report::Report;
use crate::scalar::Scalar;
use crate::training::{Epoch, ResumeOptions, Snapshot, StopReason, resume, training_memory};
use serde::Serialize;
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

/// Resources of a run, and its checkpoints.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Threads; results do not depend on them.
    pub threads: usize,
    /// Starts of the trajectory test; a fit has none.
    pub starts: usize,
    /// Fraction of the time span of the trajectory test.
    pub span: f64,
    /// Checkpoints, if they are wanted.
    pub checkpoints: Option<Checkpoints>,
}

impl Default for RunOptions {
    /// One thread, four starts over the whole time span, no checkpoints.
    fn default() -> Self {
        Self { threads: 1, starts: STARTS, span: 1.0, checkpoints: None }
    }
}

/// A model of a known system, after its files were written.
#[derive(Debug)]
pub struct TrainReport {
    /// Reason for which training ended.
    pub stop: StopReason,
    /// Header of the model's file.
    pub header: Header,
    /// The network with its best weights.
    pub network: NetworkLagrangian<f64>,
    /// Epochs that were run.
    pub history: Vec<Epoch>,
    /// The model beside the system it learned.
    pub evaluation: Evaluation,
    /// Text of `summary.json`.
    pub json: String,
    /// The record that an experiment keeps of it.
    pub(crate) record: Record,
    /// The losses in one line.
    headline: String,
    title: String,
}

impl TrainReport {
    /// Headline and tables for a terminal.
    pub fn text(&self) -> String {
        format!("{}\n{}\n", self.evaluation.text(&self.title), self.headline)
    }
}

/// Trains in the configuration's precision, evaluates, and writes everything into the output.
///
/// # Errors
/// Bounds that cannot be sampled, penalties that do not fit, files that cannot be written;
/// [`TrainingError::NothingLearned`](crate::training::TrainingError::NothingLearned) if no epoch gave a finite loss, also when
/// the watch's flag ended the first one: then nothing was written.
pub fn train(
    config: &Config,
    system: &SystemInstance<f64>,
    options: &RunOptions,
    output: &dyn Output,
    watch: &Watch,
) -> Result<TrainReport, PipelineError> {
    match config.precision {
        Precision::F32 => train_in::<f32>(config, system, options, output, watch),
        Precision::F64 => train_in::<f64>(config, system, options, output, watch),
    }
}

/// The network's shape, and the weights of the model that the training starts from, if it does: then the scales are the
/// model's.
fn begin_shape<S: Scalar>(
    config: &Config,
    system: &SystemInstance<f64>,
    scale: Vec<f64>,
) -> Result<(Architecture, Option<Vec<S>>), PipelineError> {
    let Some(from) = &config.from else { return Ok((config.architecture(system, scale)?, None)) };
    let (weights, architecture) = start::weights(from, |scale| config.architecture(system, scale))?;
    Ok((architecture, Some(weights)))
}

fn train_in<S: Scalar>(
    config: &Config,
    system: &SystemInstance<f64>,
    options: &RunOptions,
    output: &dyn Output,
    watch: &Watch,
) -> Result<TrainReport, PipelineError> {
    let started = Instant::now();
    let unscaled = config.architecture(system, vec![1.0; system.coordinates])?;
    memory::require("training", training_memory(config, &unscaled))?;
    let (data, scale) = sample_all_until::<S>(config, system, &watch.interrupt)?;
    let penalty = config.penalty()?;
    let (architecture, before) = begin_shape::<S>(config, system, scale)?;
    let imposed = imposed_velocities(system, &data);
    let fresh = data.test.cast::<f64>();
    let fresh = (fresh.q().to_vec(), fresh.v().to_vec());
    let toml = toml::to_string(config).map_err(PipelineError::format)?;
    let parameters = Layout::new(&architecture).parameters;
    let opened = options
        .checkpoints
        .as_ref()
        .map(|checkpoints| checkpoints.open::<S>(&toml, data.checksums(), (parameters, config.data.training), watch));
    let (keeper, restored) = opened.transpose()?.map_or((None, None), |(keeper, start)| (Some(keeper), start));
    let start = restored.or_else(|| before.map(Snapshot::beginning_with));
    let sitting = ResumeOptions { checkpoints: keeper, start };
    let trained = resume(config, &architecture, penalty, data, options.threads, &watch.hooks(), sitting)?;

    // The model first, then what is small, pictures last: on a full disk nothing that comes after can lose them.
    let header = header(config, system, architecture.clone(), imposed, trained.validation_loss);
    let model = ModelFile { header, weights: trained.weights.clone() };
    write_model(output, &model)?;
    output.write("config.toml", toml.as_bytes())?;
    output.write("history.csv", history(&trained.history).as_bytes())?;

    let scale = architecture.scale.iter().sum::<f64>() / architecture.scale.len() as f64;
    let network = NetworkLagrangian::new(architecture, model.weights)?.cast::<f64>();
    let test = system.system.trajectory(system.coordinates);
    let full = test.t_end;
    let judging = EvaluationOptions {
        states: fresh,
        starts: options.starts,
        span: TrajectoryTest { t_end: full * options.span, ..test },
        rtol: RTOL,
        trained: trained_on(&model.header),
        seed: config.seed,
        threads: options.threads,
    };
    let evaluation = evaluate(system, &network, judging, watch)?;
    if evaluation.interrupted.is_some() {
        return Err(PipelineError::Interrupted);
    }
    let training_losses: Vec<f64> = trained.history.iter().map(|e| e.training_loss).collect();
    let instability = training_instability(&training_losses, &stretches(config));
    let summary = Summary {
        system: &config.system,
        crate_version: env!("CARGO_PKG_VERSION"),
        seed: config.seed,
        precision: S::NAME,
        threads: options.threads,
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
    let json = serde_json::to_string_pretty(&summary).map_err(PipelineError::format)? + "\n";
    output.write(SUMMARY, json.as_bytes())?;
    write_report(output, system, &summary, &trained.history, &toml)?;
    let headline = headline(&summary);
    let learned = learned(&evaluation, (trained.validation_loss, instability), scale, (full, options.span));
    let record = record(learned, &trained.history, trained.seconds);
    let title = system.system.title.to_string();
    let (stop, history, header) = (trained.stop, trained.history, model.header);
    Ok(TrainReport { stop, header, network, history, evaluation, json, record, headline, title })
}

/// A number that a record can hold.
fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

/// Figures of a learned model for an experiment.
fn learned(
    evaluation: &Evaluation,
    (validation_loss, instability): (f64, Option<f64>),
    scale: f64,
    (t_end, share): (f64, f64),
) -> Learned {
    let motions = || evaluation.trajectories.iter().map(|motion| &motion.summary);
    Learned {
        validation_loss,
        instability,
        scale,
        wrong_signature: evaluation.wrong_signature,
        energy_errors: motions().map(|motion| finite(motion.energy_error.mean)).collect(),
        stretching: motions().map(|motion| finite(motion.lyapunov_exponent? * t_end * share)).collect(),
        integrated: motions().filter(|motion| motion.stopped.is_none()).count(),
    }
}

fn record(learned: Learned, epochs: &[Epoch], seconds: f64) -> Record {
    Record {
        outcome: Outcome::Learned(learned),
        losses: epochs.iter().map(|e| [finite(e.training_loss), finite(e.validation_loss)]).collect(),
        times: epochs.iter().map(|e| e.seconds).collect(),
        seconds,
    }
}

/// The velocity that the mass shell fixes and its range over the training states, which no bounds of the configuration
/// tell.
fn imposed_velocities<S: Scalar>(system: &SystemInstance<f64>, data: &Datasets<S>) -> Option<(usize, [f64; 2])> {
    let i = system.constrained_coordinate()?;
    let ranges = data.training.iter().map(|set| set.ranges()[1][i]);
    ranges.reduce(|[low, high], [l, h]| [low.min(l), high.max(h)]).map(|range| (i, range))
}

/// Header of the model file of this run.
fn header(
    config: &Config,
    system: &SystemInstance<f64>,
    architecture: Architecture,
    imposed: Option<(usize, [f64; 2])>,
    validation_loss: f64,
) -> Header {
    // Defaults that change in a later version must not change this model.
    let mut parameters = all_parameters(system);
    parameters.extend(config.parameters.clone());
    let hull = |bounds: fn(&Phase) -> &Vec<[f64; 2]>| {
        let range = |i: usize| {
            let all = config.phases.iter().filter_map(|phase| bounds(phase).get(i));
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], b| [low.min(b[0]), high.max(b[1])])
        };
        (0..system.coordinates).map(range).collect()
    };
    let mut ranges: [Vec<[f64; 2]>; 2] = [hull(|phase| &phase.position), hull(|phase| &phase.velocity)];
    if let Some((i, range)) = imposed {
        ranges[1][i] = range;
    }
    let columns = system.system.columns(system.coordinates);
    let header = config.header(architecture, columns, ranges, validation_loss);
    Header { parameters, description: config.description.clone(), ..header }
}

/// Writes the model's file.
///
/// # Errors
/// [`PipelineError::Model`] for weights that make no file, [`PipelineError::Output`].
pub(crate) fn write_model<S: Scalar>(output: &dyn Output, model: &ModelFile<S>) -> Result<(), PipelineError> {
    let bytes = model.to_bytes().map_err(|source| PipelineError::Model { path: MODEL.into(), source })?;
    output.write(MODEL, &bytes)
}

/// One-line summary of a run.
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

fn write_report(
    output: &dyn Output,
    system: &SystemInstance<f64>,
    summary: &Summary<'_>,
    epochs: &[Epoch],
    toml: &str,
) -> Result<(), PipelineError> {
    let training = training_pictures(epochs);
    let report = Report::new(&format!("{}: learned", system.system.title));
    let report = summary.evaluation.summarise(report, &system.system.title).paragraph(&headline(summary));
    let report = summary.evaluation.pictures(report);
    let report = summary.evaluation.report(parameter_table(report, system)).section("Training", &training);
    let report = report.heading("Configuration").preformatted(toml);
    write_report_and_figures(output, &report, {
        let Evaluation { figures, physics, .. } = summary.evaluation;
        training.iter().chain(figures).chain(&physics.figures)
    })
}
