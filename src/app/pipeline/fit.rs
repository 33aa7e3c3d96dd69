//! A fit of recorded motion: training, test on held-out motion, files.

use crate::cancellation::Cancellation;
use crate::configuration::Precision;
use crate::data::{Datasets, RecordingSplit, sizes};
use crate::findings::Findings;
use crate::formula::{FormulaError, FormulaOptions, FoundFormula};
use crate::lagrangian::EulerLagrange;
use crate::network::file::{Header, ModelFile, StoredPrecision};
use crate::network::{Architecture, Form, Layout, NetworkLagrangian};
use crate::pipeline::determination::Determined;
use crate::pipeline::fit_config::FitConfig;
use crate::pipeline::fit_summary::Found;
use crate::pipeline::force_errors::force_errors;
use crate::pipeline::hold_out::{HoldOut, HoldOutOptions, evaluate_hold_out};
use crate::pipeline::losses::LossStates;
use crate::pipeline::members::{Members, kept_members};
use crate::pipeline::model::trained_on;
use crate::pipeline::physics::{Physics, Subject};
use crate::pipeline::prepared_fit::PreparedFit;
use crate::pipeline::report_files::history;
use crate::pipeline::start::{StartModel, weights};
use crate::pipeline::train::{RunOptions, write_model};
use crate::pipeline::{Command, Event, MODEL, Output, PipelineError, Unjudged, Watch, memory};
use crate::recording::{LoadedRecording, Targets, formula_in};
use crate::report::with_unit;
use crate::scalar::Scalar;
use crate::shooting::{self, Fitted, Task};
use crate::storage::container::checksum;
use crate::training::{Epoch, ResumeOptions, Snapshot, StopReason, Trained, resume as train, training_memory};

/// A model of recorded motion, after its files were written.
#[derive(Debug)]
pub struct FitReport {
    /// Why learning ended.
    pub stop: StopReason,
    /// Describes the work after the training that an interruption left out.
    pub unfinished: Option<String>,
    /// Header of the model's file.
    pub header: Header,
    /// The network with its best weights.
    pub network: NetworkLagrangian<f64>,
    /// Epochs of the supervised training.
    pub history: Vec<Epoch>,
    /// Predictions of motion that was held out.
    pub hold_out: HoldOut,
    /// Fits of the other [members](FitConfig::members), from the second on; members that were interrupted are left out.
    pub others: Vec<FitReport>,
    json: String,
    findings: Findings,
}

impl FitReport {
    /// The learned motion: that of the network, under the constraints that were found or given, if there are any.
    ///
    /// # Errors
    /// [`PipelineError::Model`]; never for a model that was just learned.
    pub fn motion(&self) -> Result<Box<dyn EulerLagrange<f64> + '_>, PipelineError> {
        let wrong = |source| PipelineError::Model { path: MODEL.into(), source };
        self.header.constrain(Box::new(&self.network as &dyn EulerLagrange<f64>)).map_err(wrong)
    }
    /// Restores a member that an earlier run trained; its history is lost.
    pub(crate) fn restored(header: Header, network: NetworkLagrangian<f64>, hold_out: HoldOut) -> Self {
        let (stop, unfinished, others) = (StopReason::Finished, None, Vec::new());
        let (history, json, findings) = (Vec::new(), String::new(), Findings::default());
        Self { stop, unfinished, header, network, history, hold_out, others, json, findings }
    }
    /// Text of `summary.json`.
    pub fn json(&self) -> &str {
        &self.json
    }
    /// Headline and tables.
    pub fn findings(&self) -> &Findings {
        &self.findings
    }
}

/// Default name of the force on a coordinate.
pub fn usual_force(coordinate: &str) -> String {
    format!("{coordinate}_force")
}

/// Learns from recorded motion in the configuration's precision, tests it on held-out motion, and writes everything into the output.
///
/// # Errors
/// Configurations out of range, data that cannot be learned from, files that cannot be written;
/// [`TrainingError::NothingLearned`](crate::training::TrainingError::NothingLearned) if no epoch gave a finite loss, also when
/// the watch's flag ended the first one: then nothing was written.
pub fn fit(
    prepared: &PreparedFit<'_>,
    config: &FitConfig,
    options: &RunOptions,
    output: &dyn Output,
    watch: &Watch,
) -> Result<FitReport, PipelineError> {
    match config.training.precision {
        Precision::F32 => fit_in::<f32>(prepared, config, options, output, watch),
        Precision::F64 => fit_in::<f64>(prepared, config, options, output, watch),
    }
}

fn fit_in<S: Scalar>(
    prepared: &PreparedFit<'_>,
    config: &FitConfig,
    options: &RunOptions,
    output: &dyn Output,
    watch: &Watch,
) -> Result<FitReport, PipelineError> {
    prepared.check_horizon(config.horizon)?;
    prepared.remarks.iter().for_each(|text| watch.say(Event::Note(text)));
    let start = Start::<S>::new(prepared, config)?;
    let toml = toml::to_string(config).map_err(PipelineError::format)?;
    let learned = start.learn((prepared, config, &toml), options, watch)?;
    // Earlier members are read before the new model replaces them.
    let kept = options.checkpoints.as_ref().map_or_else(Vec::new, |kept| kept_members(kept.directory(), config));
    learned.write(output, &toml)?;
    let LearnedFit { mut trained, shot, model } = learned;
    // From here on, all numbers are doubles.
    let ModelFile { header, weights } = model;
    let network = NetworkLagrangian::new(header.architecture.clone(), weights)?.cast::<f64>();
    // The interruption of the training does not stop the test of its model.
    let was_interrupted = watch.is_interrupted();
    let judged = JudgedFit::new(prepared, config, (&header, &network), (options.threads, watch, was_interrupted));
    let judged = judged.map_err(|error| match error {
        PipelineError::Interrupted => {
            let (header, network) = (header.clone(), network.cast::<f64>());
            let (stop, history) = (trained.stop.clone(), trained.history.clone());
            PipelineError::Unjudged(Box::new(Unjudged { header, network, history, stop }))
        }
        error => error,
    })?;
    let (formula, mut unfinished) = formula(prepared, config, &network, (options.threads, watch, was_interrupted));
    let (members, others) = match (&trained.stop, &unfinished) {
        (StopReason::Finished, None) => {
            let first = (&network, &judged.hold_out, kept);
            others(prepared, config, first, (options, output, watch), &mut unfinished)?
        }
        _ => (None, Vec::new()),
    };
    if unfinished.is_some() {
        trained.stop = StopReason::Interrupted;
    }
    let found = Found {
        members: members.as_ref(),
        formula: formula.as_ref(),
        prepared,
        config: &config.training,
        threads: options.threads,
        trained: &trained,
        constants: network.architecture().known_constants(network.weights()),
        shot: shot.as_ref(),
        hold_out: &judged.hold_out,
        determined: &judged.determined,
        physics: &judged.physics,
        model: (&header, &network),
    };
    let (json, findings) = found.write(output, &toml)?;
    let (stop, history, hold_out) = (trained.stop, trained.history, judged.hold_out);
    Ok(FitReport { stop, unfinished, header, network, history, hold_out, others, json, findings })
}

/// The starting point of a fit.
struct Start<S: Scalar> {
    data: Datasets<S>,
    architecture: Architecture,
    /// Weights of the model that it starts from.
    weights: Option<Vec<S>>,
    /// Ranges of the training states.
    ranges: [Vec<[f64; 2]>; 2],
}

/// Result of a fit before its test.
struct LearnedFit<S> {
    trained: Trained<S>,
    shot: Option<Fitted<S>>,
    model: ModelFile<S>,
}

impl<S: Scalar> LearnedFit<S> {
    /// Writes the model first, then small files, then pictures, so that a full disk only loses pictures.
    fn write(&self, output: &dyn Output, toml: &str) -> Result<(), PipelineError> {
        write_model(output, &self.model)?;
        Command::Fit.write(output)?;
        output.write("config.toml", toml.as_bytes())?;
        output.write("history.csv", history(&self.trained.history).as_bytes())?;
        self.shot.as_ref().map_or(Ok(()), |shot| output.write("shooting.csv", history(&shot.history).as_bytes()))
    }
}

impl<S: Scalar> Start<S> {
    /// Creates states and network for a configuration.
    ///
    /// # Errors
    /// Configurations out of range, data that cannot be learned from, a model of another shape, too little memory.
    fn new(prepared: &PreparedFit<'_>, fit_config: &FitConfig) -> Result<Self, PipelineError> {
        let PreparedFit { measured, targets, .. } = prepared;
        let (recording, config) = (&prepared.reading.recording, &fit_config.training);
        let names = &recording.coordinates;
        let mut data = prepared.datasets::<S>()?;
        let faults = fit_config.faults(names.len());
        if !faults.is_empty() {
            return Err(PipelineError::Config(faults));
        }
        let (periodic, unscaled) = (recording.periodic.clone(), vec![1.0; names.len()]);
        let shape = config.architecture_with(names.iter().map(String::as_str), periodic.clone(), unscaled)?;
        let shaped = |scale| Architecture { scale: config.network.scaling.of(scale), ..shape };
        let (architecture, weights) = match &config.from {
            Some(from) => {
                StartModel::read(from)?.require(config, periodic)?;
                weights(from, shaped).map(|(weights, shape)| (shape, Some(weights)))?
            }
            None => (shaped(data.training[0].physical_scale()), None),
        };
        let architecture = match (targets, &config.from) {
            (Targets::Forces, None) => {
                let sizes = sizes(&data.training[0], &architecture.scale);
                Architecture { form: Form { sizes: Some(sizes), ..architecture.form }, ..architecture }
            }
            _ => architecture,
        };
        architecture.validate()?;
        let around: Vec<usize> = architecture.form.radial.first().map(|r| r.coordinates.clone()).unwrap_or_default();
        let floor = config.data.acceleration_weighting;
        data = measured.weigh(data, *targets, (floor, &architecture.scale, &around))?;
        let ranges = data.training[0].ranges();
        // All phases learn from the same states.
        data.training = vec![data.training.swap_remove(0); config.phases.len()];
        memory::require("training", training_memory(config, &architecture))?;
        Ok(Self { data, architecture, weights, ranges })
    }

    /// Trains on states, then through the motion.
    ///
    /// # Errors
    /// Checkpoints that cannot be read or written, a training that learned nothing.
    fn learn(
        self,
        (prepared, fit_config, toml): (&PreparedFit<'_>, &FitConfig, &str),
        options: &RunOptions,
        watch: &Watch,
    ) -> Result<LearnedFit<S>, PipelineError> {
        let Self { data, architecture, weights, ranges } = self;
        let (config, measured, threads) = (&fit_config.training, &prepared.measured, options.threads);
        let names = &prepared.reading.recording.coordinates;
        let penalty = config.penalty.resolve(names.iter().map(String::as_str))?;
        let judges = LossStates { validation: data.validation.clone(), test: data.test.clone() };
        let sizes = (Layout::new(&architecture).parameters, data.training[0].len());
        let opened = options.checkpoints.as_ref();
        let opened = opened
            .map(|checkpoints| checkpoints.open::<S>((Command::Fit, toml), checksums(measured, &data), sizes, watch));
        let (manager, restored) = opened.transpose()?.map_or((None, None), |(manager, start)| (Some(manager), start));
        let shots = restored.clone().filter(Snapshot::is_shooting);
        let start = restored.or_else(|| weights.map(Snapshot::beginning_with));
        let resumed = ResumeOptions { checkpoints: manager.clone(), start };
        let mut trained = train(config, &architecture, penalty, data, threads, &watch.hooks(), resumed)?;
        let mut shot = None;
        if let (Targets::Motion, StopReason::Finished) = (prepared.targets, &trained.stop) {
            let settings = fit_config.shooting.clone().unwrap_or_default();
            let (training, validation) = (measured.training.estimated(), measured.validation.estimated());
            let noise = measured.noise();
            let task = Task {
                architecture: &architecture,
                penalty,
                weights: trained.weights.clone(),
                training: &training,
                validation: &validation,
                noise: &noise,
                constraints: prepared.constraints(),
                seed: config.seed,
            };
            let start = Some(shots.unwrap_or_else(|| trained.snapshot(config)));
            let resumed = ResumeOptions { checkpoints: manager, start };
            let fitted = shooting::resume(&settings, task, threads, &watch.hooks(), resumed)?;
            trained.weights.clone_from(&fitted.weights);
            trained.stop.clone_from(&fitted.stop);
            judges.judge(&architecture, penalty, threads, &mut trained)?;
            shot = Some(fitted);
        }
        let columns = names.iter().cloned().chain(names.iter().map(|name| format!("{name}_dot"))).collect();
        let header = config.header(architecture, columns, ranges, trained.validation_loss);
        let constraints = prepared.constraints().map(|held| held.formulas().clone()).unwrap_or_default();
        let header = Header { forces: named_forces(&fit_config.recording.force), constraints, ..header };
        let model = ModelFile { header, weights: trained.weights.clone() };
        Ok(LearnedFit { trained, shot, model })
    }
}

/// Test results and physics of a learned model.
struct JudgedFit {
    hold_out: HoldOut,
    physics: Physics,
    determined: Determined,
}

impl JudgedFit {
    /// Tests the model on held-out motion and analyses its physics; an earlier interruption does not stop this.
    ///
    /// # Errors
    /// [`PipelineError::Interrupted`].
    fn new(
        prepared: &PreparedFit<'_>,
        config: &FitConfig,
        (header, network): (&Header, &NetworkLagrangian<f64>),
        (threads, watch, was_interrupted): (usize, &Watch, bool),
    ) -> Result<Self, PipelineError> {
        let hold_out = judge(prepared, config, (header, network), threads, watch)?;
        let determined = match prepared.constraints() {
            Some(_) => Determined::under_constraints(),
            None => Determined::new(network, (&prepared.measured, prepared.targets), &hold_out, threads)?,
        };
        let subject = Subject {
            network,
            trained: &trained_on(header),
            system: None,
            columns: header.columns.clone(),
            labels: labels(prepared.reading),
            motion: None,
            recorded: Some(&prepared.measured.training.recording),
            determined: Some(&determined),
            threads,
        };
        let is_ended = || watch.is_interrupted() && !was_interrupted;
        let check = || if is_ended() { Err(PipelineError::Interrupted) } else { Ok(()) };
        let physics = match prepared.constraints() {
            Some(_) => Physics::under_constraints(&subject),
            None => Physics::new(&subject, &check)?,
        };
        Ok(Self { hold_out, physics, determined })
    }
}

/// Trains the other networks of a fit with several members and returns their reports; `unfinished` is set if an interruption left some out.
fn others(
    prepared: &PreparedFit<'_>,
    config: &FitConfig,
    first: (&NetworkLagrangian<f64>, &HoldOut, Vec<ModelFile<f64>>),
    (options, output, watch): (&RunOptions, &dyn Output, &Watch),
    unfinished: &mut Option<String>,
) -> Result<(Option<Members>, Vec<FitReport>), PipelineError> {
    let (members, others) = Members::train(prepared, config, first, (options, output, watch))?.unzip();
    let others = others.unwrap_or_default();
    let (done, wanted) = (1 + others.len(), config.members);
    if watch.is_interrupted() && done < wanted {
        *unfinished = Some(format!("{done} of {wanted} members are trained"));
    }
    Ok((members, others))
}

/// Searches for a formula if the configuration requests it; also describes what an interruption left out.
fn formula(
    prepared: &PreparedFit<'_>,
    config: &FitConfig,
    network: &NetworkLagrangian<f64>,
    (threads, watch, was_interrupted): (usize, &Watch, bool),
) -> (Option<FoundFormula>, Option<String>) {
    if !config.formula {
        return (None, None);
    }
    let options = FormulaOptions {
        friction: network.architecture().has_friction(),
        // The network does not depend on the time.
        drive: false,
        noise: config.noise.clone(),
        units: prepared.reading.coordinate_units(),
        seed: config.training.seed,
        threads,
        cancellation: if was_interrupted { Cancellation::default() } else { watch.cancellation() },
        ..FormulaOptions::default()
    };
    match FoundFormula::of_motion(&prepared.measured.training.recording, &options) {
        Ok(found) => (Some(found), None),
        Err(FormulaError::Cancelled(_)) => (None, Some("before a formula was found".to_string())),
        Err(error) => {
            watch.say(Event::Note(&format!("no formula was looked for: {error}")));
            (None, None)
        }
    }
}

/// Tests a model on held-out motion.
///
/// # Errors
/// [`PipelineError::Interrupted`].
pub(crate) fn judge(
    prepared: &PreparedFit<'_>,
    config: &FitConfig,
    (header, network): (&Header, &NetworkLagrangian<f64>),
    threads: usize,
    watch: &Watch,
) -> Result<HoldOut, PipelineError> {
    let names = &prepared.reading.recording.coordinates;
    let time = header.architecture.time_like;
    let forces = match named_forces(&config.recording.force) {
        known if known.is_empty() => names.iter().map(|name| usual_force(name)).collect(),
        known => known,
    };
    let (part, horizon) = (&prepared.measured.test, config.horizon);
    let held_out = HoldOutOptions { part, horizon, time, forces: &forces, units: &units(prepared.reading), threads };
    let wrong = |source| PipelineError::Model { path: MODEL.into(), source };
    let motion = header.constrain(Box::new(network as &dyn EulerLagrange<f64>)).map_err(wrong)?;
    let mut hold_out = evaluate_hold_out(motion.as_ref(), &held_out, watch)?;
    drop(motion);
    if prepared.targets() == Targets::Forces && !part.states.is_empty() {
        let test = prepared.measured.datasets::<f64>(Targets::Forces)?.test;
        hold_out.force_errors = force_errors(network, &test, names).unwrap_or_default();
    }
    Ok(hold_out)
}

/// Names and checksums of all data that the fit learns from.
fn checksums<S: Scalar>(measured: &RecordingSplit, data: &Datasets<S>) -> Vec<(String, u32)> {
    let parts = [&measured.training, &measured.validation];
    let tracks = parts.into_iter().flat_map(|part| &part.recording.tracks);
    let numbers = tracks.flat_map(|track| [&track.times, &track.q, &track.v, &track.a, &track.force]).flatten();
    let recorded = ("recorded motion".to_string(), checksum(numbers, StoredPrecision::F64));
    data.checksums().into_iter().chain([recorded]).collect()
}

/// Units of the coordinates: those of the file converted to SI, otherwise `rad` for an angle and `SI`.
fn units(reading: &LoadedRecording) -> Vec<String> {
    let periodic = reading.recording.periodic.iter();
    // A recording from memory has no column names.
    let given = reading.coordinate_units().into_iter().chain(std::iter::repeat(String::new()));
    let unit = |(given, angle): (String, &bool)| match given.as_str() {
        "" => if *angle { "rad" } else { "SI" }.to_string(),
        _ => given,
    };
    given.zip(periodic).map(unit).collect()
}

/// Axis labels for coordinates and velocities.
fn labels(reading: &LoadedRecording) -> Vec<String> {
    let (names, units) = (&reading.recording.coordinates, units(reading));
    let positions = names.iter().zip(&units).map(|(name, unit)| with_unit(name, unit));
    let velocities = names.iter().zip(&units).map(|(name, unit)| match unit.as_str() {
        "SI" => format!("{name}_dot [SI]"),
        unit => format!("{name}_dot [{unit}/s]"),
    });
    positions.chain(velocities).collect()
}

/// Names of the force columns for the model file; column numbers and formulas are not names.
fn named_forces(columns: &[String]) -> Vec<String> {
    let is_name = |text: &String| text.parse::<f64>().is_err() && formula_in(text).is_none();
    if columns.iter().all(is_name) { columns.to_vec() } else { Vec::new() }
}
