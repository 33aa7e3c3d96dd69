//! Trains by a configuration and writes the files: model, history, summary, pictures, report.

use crate::analysis::{stretches, training_instability};
use crate::configuration::{Config, Penalty, Phase, Precision, Regularizer};
use crate::data::{Dataset, Datasets, sample_all_until};
use crate::experiments::{Learned, Outcome, Record};
use crate::findings::Findings;
use crate::lagrangian::system::TrajectoryTest;
use crate::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use crate::names::{number, percent, pluralize};
use crate::network::file::{Header, ModelFile};
use crate::network::{Architecture, Layout, NetworkLagrangian};
use crate::pipeline::checkpoints::Checkpoints;
use crate::pipeline::evaluation::{Evaluation, EvaluationOptions};
use crate::pipeline::model::{all_parameters, trained_on};
use crate::pipeline::report_files::{
    ended, history, parameter_table, training_pictures, write_page, write_report_and_figures,
};
use crate::pipeline::thresholds::{PENALTY_STATES, RTOL, STARTS};
use crate::pipeline::{Command, Event, MODEL, Output, PipelineError, SUMMARY, Unjudged, Watch, memory, start};
use crate::report::Report;
use crate::scalar::Scalar;
use crate::training::{Epoch, ResumeOptions, Snapshot, StopReason, Trained, resume, training_memory};
use serde::Serialize;
use std::time::Instant;

/// Figures of a training; losses in the paper's convention, errors in physical units.
#[derive(Clone, Debug, Serialize)]
pub struct TrainFigures {
    /// Name of the system.
    pub system: String,
    /// Version of this crate.
    pub crate_version: &'static str,
    /// The seed.
    pub seed: u64,
    /// Precision of weights and arithmetic in training.
    pub precision: &'static str,
    /// Threads.
    pub threads: usize,
    /// Epochs that were run.
    pub epochs: usize,
    /// Weights of the network.
    pub weights: usize,
    /// Best validation loss.
    pub validation_loss: f64,
    /// Test loss, on fresh states.
    pub test_loss: f64,
    /// Fresh states without a finite acceleration.
    pub test_states_left_out: usize,
    /// Instability of the training losses, if there are enough epochs.
    pub instability: Option<f64>,
    /// Duration without pictures and report, in s.
    pub wall_seconds: f64,
    /// Duration of the training, in s.
    pub training_seconds: f64,
    /// Training states processed per second of training.
    pub states_per_second: f64,
    /// Why training ended.
    pub ended: String,
}

/// Contents of `summary.json`.
#[derive(Serialize)]
struct Summary<'a> {
    #[serde(flatten)]
    figures: &'a TrainFigures,
    #[serde(flatten)]
    evaluation: &'a Evaluation,
}

/// Resources of a run, and its checkpoints.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RunOptions {
    /// Number of threads; results do not depend on it.
    pub threads: usize,
    /// Number of starts of the trajectory test; a fit has no such test.
    pub starts: usize,
    /// Fraction of the system's time span that the trajectory test covers.
    pub span: f64,
    /// Checkpoints, if enabled.
    #[doc(hidden)]
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
    /// Why training ended.
    pub stop: StopReason,
    /// Header of the model's file.
    pub header: Header,
    /// The network with its best weights.
    pub network: NetworkLagrangian<f64>,
    /// History, one row per epoch.
    pub history: Vec<Epoch>,
    /// Comparison of the model with the system that it learned.
    pub evaluation: Evaluation,
    /// Losses, times and sizes.
    pub figures: TrainFigures,
    /// Name of the system in titles.
    title: String,
}

impl TrainReport {
    /// Text of `summary.json`.
    ///
    /// # Errors
    /// [`PipelineError::Format`].
    pub fn json(&self) -> Result<String, PipelineError> {
        let summary = Summary { figures: &self.figures, evaluation: &self.evaluation };
        Ok(serde_json::to_string_pretty(&summary).map_err(PipelineError::format)? + "\n")
    }

    /// Headline and tables.
    pub fn findings(&self) -> Findings {
        let mut findings = self.evaluation.findings(&self.title);
        findings.gap().line(self.losses());
        findings
    }

    /// Describes losses, times and sizes in a line.
    fn losses(&self) -> String {
        let TrainFigures { validation_loss, test_loss, epochs, weights, .. } = self.figures;
        let fresh = match test_loss {
            loss if loss.is_finite() => number(loss),
            _ => format!("not finite ({} states left out)", self.figures.test_states_left_out),
        };
        format!(
            "loss (paper): validation {}, fresh states {fresh}; {} in {:.1} s, {:.0} states/s, {}, seed {}",
            number(validation_loss),
            pluralize(epochs, "epoch", "epochs"),
            self.figures.training_seconds,
            self.figures.states_per_second,
            pluralize(weights, "weight", "weights"),
            self.figures.seed
        )
    }

    /// Creates the record of this run for an experiment whose trajectory test ends at `t_end`.
    pub(crate) fn record(&self, run: String, t_end: f64) -> Record {
        let motions = || self.evaluation.trajectories.iter().map(|motion| &motion.summary);
        let scale = &self.network.architecture().scale;
        let learned = Learned {
            validation_loss: self.figures.validation_loss,
            instability: self.figures.instability,
            scale: scale.iter().sum::<f64>() / scale.len() as f64,
            wrong_signature: self.evaluation.wrong_signature,
            energy_errors: motions().map(|motion| finite(motion.energy_error.mean)).collect(),
            stretching: motions().map(|motion| finite(motion.lyapunov_exponent? * t_end)).collect(),
            integrated: motions().filter(|motion| motion.stopped.is_none()).count(),
        };
        Record {
            run,
            outcome: Outcome::Learned(learned),
            losses: self.history.iter().map(|e| [finite(e.training_loss), finite(e.validation_loss)]).collect(),
            times: self.history.iter().map(|e| e.seconds).collect(),
            seconds: self.figures.training_seconds,
        }
    }

    fn write(&self, output: &dyn Output, system: &SystemInstance<f64>, toml: &str) -> Result<(), PipelineError> {
        output.write(SUMMARY, self.json()?.as_bytes())?;
        let training = training_pictures(&self.history);
        let report = Report::new(&format!("{}: learned", self.title));
        let report = report.findings(&self.evaluation.headline(&self.title)).paragraph(&self.losses());
        let report = write_page(output, report, (&self.header, &self.network), Some(system))?;
        let report = self.evaluation.pictures(report);
        let report = self.evaluation.report(parameter_table(report, system)).section("Training", &training);
        let report = report.heading("Configuration").preformatted(toml);
        let Evaluation { figures, physics, .. } = &self.evaluation;
        write_report_and_figures(output, &report, training.iter().chain(figures).chain(&physics.figures))
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
    if let Some(note) = penalty_note(config, system) {
        watch.say(Event::Note(&note));
    }
    train_one(config, system, options, output, watch)
}

/// As [`train`], as one of many runs: without the notes that concern all of them.
///
/// # Errors
/// Those of [`train`].
pub(super) fn train_one(
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

fn train_in<S: Scalar>(
    config: &Config,
    system: &SystemInstance<f64>,
    options: &RunOptions,
    output: &dyn Output,
    watch: &Watch,
) -> Result<TrainReport, PipelineError> {
    let started = Instant::now();
    let toml = toml::to_string(config).map_err(PipelineError::format)?;
    let LearnedRun { trained, model, fresh } = LearnedRun::<S>::new((config, &toml), system, options, watch)?;
    // The model is written first, then small files, then pictures, so that a full disk only loses pictures.
    write_model(output, &model)?;
    Command::Train.write(output)?;
    output.write("config.toml", toml.as_bytes())?;
    output.write("history.csv", history(&trained.history).as_bytes())?;

    // From here on, all numbers are doubles.
    let ModelFile { header, weights } = model;
    let network = NetworkLagrangian::new(header.architecture.clone(), weights)?.cast::<f64>();
    let test = system.system.trajectory(system.coordinates);
    let judging = EvaluationOptions {
        states: fresh,
        starts: options.starts,
        span: TrajectoryTest { t_end: test.t_end * options.span, ..test },
        rtol: RTOL,
        trained: trained_on(&header),
        constraints: None,
        seed: config.seed,
        threads: options.threads,
    };
    let evaluation = match Evaluation::of(system, &network, judging, watch) {
        Ok(evaluation) if evaluation.interrupted.is_none() => evaluation,
        Ok(_) | Err(PipelineError::Interrupted) => {
            let (stop, history) = (trained.stop, trained.history);
            return Err(PipelineError::Unjudged(Box::new(Unjudged { header, network, history, stop })));
        }
        Err(error) => return Err(error),
    };
    let figures = TrainFigures::new(config, &trained, options.threads, started);
    let title = system.system.title.to_string();
    let (stop, history) = (trained.stop, trained.history);
    let report = TrainReport { stop, header, network, history, evaluation, figures, title };
    report.write(output, system, &toml)?;
    Ok(report)
}

/// Result of a training before its test.
struct LearnedRun<S> {
    trained: Trained<S>,
    model: ModelFile<S>,
    /// Coordinates and velocities of states that were not used for training.
    fresh: (Vec<f64>, Vec<f64>),
}

impl<S: Scalar> LearnedRun<S> {
    /// Draws the states and trains the network of a configuration.
    ///
    /// # Errors
    /// Configurations out of range, a model of another shape, too little memory, checkpoints that cannot be read or written, a training that
    /// learned nothing.
    fn new(
        (config, toml): (&Config, &str),
        system: &SystemInstance<f64>,
        options: &RunOptions,
        watch: &Watch,
    ) -> Result<Self, PipelineError> {
        let shape = config.architecture(system, vec![1.0; system.coordinates])?;
        memory::require("training", training_memory(config, &shape))?;
        let (data, scale) = sample_all_until::<S>(config, system, &watch.interrupt)?;
        let penalty = config.penalty()?;
        let shaped = |scale| Architecture { scale: config.network.scaling.of(scale), ..shape };
        let (architecture, before) = match &config.from {
            Some(from) => start::weights(from, shaped).map(|(weights, shape)| (shape, Some(weights)))?,
            None => (shaped(scale), None),
        };
        let ranges = ranges(config, system, &data);
        let fresh = data.test.cast::<f64>();
        let fresh = (fresh.q().to_vec(), fresh.v().to_vec());
        let sizes = (Layout::new(&architecture).parameters, config.data.training);
        let opened = options.checkpoints.as_ref();
        let opened =
            opened.map(|checkpoints| checkpoints.open::<S>((Command::Train, toml), data.checksums(), sizes, watch));
        let (manager, restored) = opened.transpose()?.map_or((None, None), |(manager, start)| (Some(manager), start));
        let start = restored.or_else(|| before.map(Snapshot::beginning_with));
        let resumed = ResumeOptions { checkpoints: manager, start };
        let trained = resume(config, &architecture, penalty, data, options.threads, &watch.hooks(), resumed)?;
        let header = header(config, system, architecture, ranges, trained.validation_loss);
        let model = ModelFile { header, weights: trained.weights.clone() };
        Ok(Self { trained, model, fresh })
    }
}

impl TrainFigures {
    fn new<S: Scalar>(config: &Config, trained: &Trained<S>, threads: usize, started: Instant) -> Self {
        let training_losses: Vec<f64> = trained.history.iter().map(|e| e.training_loss).collect();
        Self {
            system: config.system.clone(),
            crate_version: env!("CARGO_PKG_VERSION"),
            seed: config.seed,
            precision: S::NAME,
            threads,
            epochs: trained.history.len(),
            weights: trained.weights.len(),
            validation_loss: trained.validation_loss,
            test_loss: trained.test.loss.to_f64(),
            test_states_left_out: trained.test.left_out,
            instability: training_instability(&training_losses, &stretches(config)),
            wall_seconds: started.elapsed().as_secs_f64(),
            training_seconds: trained.seconds,
            states_per_second: trained.states as f64 / trained.seconds,
            ended: ended(&trained.stop),
        }
    }
}

/// Converts to `None` if a number is not finite, which a record cannot store.
fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

/// Ranges of the coordinates and velocities of the training states. The bounds of the configuration lack the velocity that a mass shell
/// fixes, and do not apply to states that were projected onto constraints.
fn ranges<S: Scalar>(config: &Config, system: &SystemInstance<f64>, data: &Datasets<S>) -> [Vec<[f64; 2]>; 2] {
    let join = |[low, high]: [f64; 2], [l, h]: [f64; 2]| [low.min(l), high.max(h)];
    let all: Vec<_> = data.training.iter().map(Dataset::ranges).collect();
    let found = |part: usize, i: usize| all.iter().map(|ranges| ranges[part][i]).reduce(join).unwrap_or_default();
    let chosen = |part: usize, i: usize| {
        let bounds = |phase: &Phase| [&phase.position, &phase.velocity][part].get(i).copied();
        config.phases.iter().filter_map(bounds).fold([f64::INFINITY, f64::NEG_INFINITY], join)
    };
    let shell = system.constrained_coordinate();
    let drawn = |part: usize, i: usize| system.constraints().is_none() && (part == 0 || shell != Some(i));
    [0, 1].map(|part| {
        (0..system.coordinates).map(|i| if drawn(part, i) { chosen(part, i) } else { found(part, i) }).collect()
    })
}

/// Header of the model file of this run.
fn header(
    config: &Config,
    system: &SystemInstance<f64>,
    architecture: Architecture,
    ranges: [Vec<[f64; 2]>; 2],
    validation_loss: f64,
) -> Header {
    // The file stores all parameters, so that later changes of defaults do not change this model.
    let mut parameters = all_parameters(system);
    parameters.extend(config.parameters.clone());
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

/// Returns a note if the exact metric violates the penalty at some of the training states.
fn penalty_note(config: &Config, system: &SystemInstance<f64>) -> Option<String> {
    let Regularizer::LorentzianSylvester { time, .. } = &config.penalty else { return None };
    let share = percent(forbidden_share(config, system).filter(|share| *share > 0.0)?);
    let advice = "as inside a horizon or an ergosphere: choose the penalty signature, or other bounds";
    Some(format!("the penalty acts against g_{time}{time} > 0, which {share} of the states have, {advice}"))
}

/// Share of the training states at which the exact metric violates the penalty; `None` without such a penalty, or if the share is unknown.
fn forbidden_share(config: &Config, system: &SystemInstance<f64>) -> Option<f64> {
    let Penalty::Sylvester { time: Some(time), .. } = config.penalty().ok()? else { return None };
    let mut few = config.clone();
    (few.data.training, few.data.validation, few.data.test) = (PENALTY_STATES, 1, 1);
    let (data, _) = Datasets::<f64>::sample(&few, system).ok()?;
    let (set, n, mut terms) = (&data.training[0], system.coordinates, Terms::default());
    system.build().ok()?.terms(set.q(), set.v(), Request::MASS_MATRIX, &mut terms).ok()?;
    let forbidden = terms.mass_matrix.chunks_exact(n * n).filter(|g| g[time * n + time] > 0.0).count();
    Some(forbidden as f64 / set.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Structure;
    use crate::presets::Preset;

    #[test]
    fn a_penalty_is_known_to_forbid_the_inside_of_a_horizon() {
        let share = |name: &str, radius: [f64; 2]| {
            let system = SystemInstance::<f64>::named(name, &[]).unwrap();
            let mut config = Preset::Quick.config(&system).unwrap();
            config.take_structure(Structure::BlackBox);
            config.penalty = Regularizer::LorentzianSylvester { lambda: 1.0, time: "t".to_string() };
            config.data.shell_radius = config.data.shell_radius.map(|_| radius);
            let (share, note) = (forbidden_share(&config, &system), penalty_note(&config, &system));
            assert_eq!(note.is_some_and(|note| note.contains("g_tt > 0")), share.is_some_and(|share| share > 0.0));
            share
        };
        // The horizon of mass 1 is at 2.
        assert_eq!(share("schwarzschild-cartesian", [3.0, 20.0]), Some(0.0));
        assert_eq!(share("schwarzschild-cartesian", [1.0, 1.9]), Some(1.0));
        assert!(share("schwarzschild-cartesian", [1.0, 4.0]).is_some_and(|share| (0.3..0.7).contains(&share)));
        assert_eq!(share("ads4-geodesic", [0.0; 2]), Some(0.0));
        let system = SystemInstance::<f64>::named("kepler", &[]).unwrap();
        assert_eq!(forbidden_share(&Preset::Quick.config(&system).unwrap(), &system), None);
    }
}
