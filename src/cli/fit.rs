//! `lnn fit`: learns from recorded motion, judges by motion that was held out, writes.

use crate::cli::attention::Attention;
use crate::cli::changes::PenaltyName;
use crate::cli::determined::Determined;
use crate::cli::fit_args::Args;
use crate::cli::fit_config::{FitConfig, Recording, Settled};
use crate::cli::fit_resume::Order;
use crate::cli::fit_summary::Found;
use crate::cli::folder::Folder;
use crate::cli::judgement::{Plan, WINDOWS, judge};
use crate::cli::learned::model_file;
use crate::cli::learning::{Begin, begin, forget, history, save};
use crate::cli::losses::Judges;
use crate::cli::number::threads;
use crate::cli::place::{self, Wanted};
use crate::cli::print_config::PrintFormat;
use crate::cli::results::Writer;
use crate::cli::resume::{self, how_to_go_on};
use crate::cli::said::Said;
use crate::cli::start::{Start, weights};
use crate::cli::train::hooks;
use crate::cli::train_config::PrecisionName;
use crate::cli::{CliError, forces, interrupt, memory, output};
use crate::network::file::container::checksum;
use crate::network::file::{FORMAT, Header, ModelFile, StoredPrecision};
use crate::network::{Architecture, Layout, NetworkLagrangian, Structure};
use crate::recording::smooth::SmoothOptions;
use crate::recording::survey::{SurveyOptions, survey};
use crate::recording::{Reading, Targets};
use crate::scalar::Scalar;
use crate::storage::Disk;
use crate::training::shooting::{self, Shooting, Task};
use crate::training::{
    Config, Datasets, Identity, Keeper, Measured, Preparation, Regularizer, Sitting, Snapshot, Stop, Trained,
    configuration_reference, resume as train, training_memory,
};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Learns and writes everything into the output directory.
///
/// # Errors
/// A usage error for arguments, a data error for files and data that cannot be learned from, an interruption; after the
/// last the best model so far is written, if there is one.
pub fn run(args: &Args, words: &[OsString]) -> Result<(), CliError> {
    let started = Instant::now();
    if args.print_config == Some(PrintFormat::Markdown) {
        return output::print(&(FitConfig::reference() + &configuration_reference()));
    }
    let Some(Order { args, said, resumed }) = Order::of(args, words)? else { return Ok(()) };
    let settled = Settled::of(&args)?;
    let args = &settled.args;
    let reading = args.recording.read()?;
    if let Some(time) = &args.timelike {
        let names = &reading.recording.coordinates;
        if !names.contains(time) {
            let known = names.join(", ");
            return Err(CliError::usage(format_args!("--timelike {time}: expected one of the coordinates {known}")));
        }
    }
    let preparation = Preparation {
        smoothing: SmoothOptions { window: args.window, noise: args.noise.clone(), ..SmoothOptions::default() },
        held_out: args.share(),
        seed: args.seed(),
        ..Preparation::default()
    };
    let measured = Measured::new(&reading.recording, &preparation).map_err(CliError::data)?;
    let targets = args.targets.map_or_else(|| measured.advice(), Targets::from);
    if targets == Targets::Measured && !measured.training.recording.has_accelerations() {
        return Err(CliError::usage("--targets measured: no accelerations were given, see --acceleration"));
    }
    let looking = SurveyOptions { smooth: preparation.smoothing, validation: args.share(), seed: args.seed() };
    let found = survey(&reading, &looking).map_err(CliError::data)?;
    found.warnings.iter().for_each(|warning| output::note(warning));
    let forced = reading.recording.tracks.iter().any(|track| !track.force.is_empty());
    if args.friction.is_some() && reading.recording.n() == 1 && !forced {
        let motion = "every motion of one coordinate has a Lagrangian";
        output::note(&format!("{motion}: without known forces (--force) L and the friction are not told apart"));
    }
    if args.print_config.is_some() {
        let data = measured.datasets::<f64>(targets).map_err(CliError::data)?;
        let start = args.from.as_deref().map(Start::read).transpose()?;
        let training = configured(&settled, targets, start.as_ref(), &measured.config(args.name(), &data))?;
        return output::print(&record(&settled, targets, Some(shooting_of(&settled)), &training).commented()?);
    }
    let begin = if resumed.is_some() { Begin::Resume } else { Begin::Anew };
    let folder = match resumed {
        Some(folder) => folder,
        None => {
            let usual = PathBuf::from("runs").join(args.name());
            let start = args.from.as_deref().map(|from| model_file(Path::new(from))).transpose()?;
            let inputs: Vec<&Path> = args.inputs().chain(start.as_deref()).collect();
            let (out, writer) = (args.out.as_deref(), Writer::Learner);
            place::open(&Wanted { out, usual: &usual, overwrite: args.overwrite, inputs: &inputs, writer })?
        }
    };
    let (reading, measured, settled) = (&reading, &measured, &settled);
    let job = Job { args, settled, said, begin, reading, measured, targets, folder: &folder, started };
    let fitted = match args.precision() {
        PrecisionName::F32 => job.run::<f32>(),
        PrecisionName::F64 => job.run::<f64>(),
    };
    fitted.map_err(resume::keeping(folder.path()))
}

/// One fit with everything it needs.
struct Job<'a> {
    args: &'a Args,
    settled: &'a Settled,
    said: Said,
    begin: Begin,
    reading: &'a Reading,
    measured: &'a Measured,
    targets: Targets,
    folder: &'a Folder,
    started: Instant,
}

impl Job<'_> {
    fn run<S: Scalar>(&self) -> Result<(), CliError> {
        let Self { args, measured, targets, folder, .. } = self;
        let names = &self.reading.recording.coordinates;
        let mut data = measured.datasets::<S>(*targets).map_err(CliError::data)?;
        let start = args.from.as_deref().map(Start::read).transpose()?;
        let config = configured(self.settled, *targets, start.as_ref(), &measured.config(args.name(), &data))?;
        CliError::all_usage(config.faults(names.len()).into_iter().map(|fault| fault.to_string()))?;
        let periodic = self.reading.recording.periodic.clone();
        let time_like = config.network.time_like_index(names.iter().map(String::as_str)).map_err(CliError::usage)?;
        let form = config.network.form(names.iter().map(String::as_str)).map_err(CliError::usage)?;
        let shaped = |scale| {
            let plain = config.architecture_with(periodic.clone(), scale);
            Architecture { time_like, form: form.clone(), ..plain }
        };
        let (architecture, weights) = match &start {
            Some(start) => {
                start.require(&config, periodic.clone())?;
                let (weights, shape) = weights(&start.from, shaped)?;
                (shape, Some(weights))
            }
            None => (shaped(data.training[0].physical_scale()), None),
        };
        // Every phase learns from the same states.
        data.training = vec![data.training.swap_remove(0); config.phases.len()];
        architecture.validate().map_err(CliError::usage)?;
        memory::require("training", training_memory(&config, &architecture))?;
        let penalty = config.penalty.penalty(names.iter().map(String::as_str)).map_err(CliError::usage)?;
        let stop = interrupt::flag().map_err(CliError::signals)?;
        let threads = threads(args.threads);

        let judges = Judges { validation: data.validation.clone(), test: data.test.clone() };
        let shooting = (*targets == Targets::Motion).then(|| shooting_of(self.settled));
        let record = record(self.settled, *targets, shooting.clone(), &config);
        let toml = toml::to_string(&record).map_err(CliError::data)?;
        let identity = Identity { config: self.said.text(&record.without_files())?, data: self.checksums(&data) };
        let keeper = Arc::new(Keeper::new(Arc::new(Disk), folder.path(), args.checkpoint_every, identity));
        let parameters = Layout::new(&architecture).parameters;
        let restored = begin(&keeper, folder, parameters, data.training[0].len(), self.begin)?;
        let shots = restored.clone().filter(Snapshot::is_shooting);
        let start = restored.or_else(|| weights.map(Snapshot::beginning_with));
        let sitting = Sitting { keeper: Some(Arc::clone(&keeper)), start };
        let mut trained = train(&config, &architecture, penalty, data, threads, &hooks(&stop), sitting)
            .map_err(|error| self.nothing(&error, &stop))?;
        let mut shot = None;
        if let (Some(settings), Stop::Finished) = (&shooting, &trained.stop) {
            let (training, validation) = (measured.training.estimated(), measured.validation.estimated());
            let noise = measured.noise();
            let task = Task {
                architecture: &architecture,
                penalty,
                weights: trained.weights.clone(),
                training: &training,
                validation: &validation,
                noise: &noise,
                seed: args.seed(),
            };
            let start = Some(shots.unwrap_or_else(|| trained.snapshot(&config)));
            let sitting = Sitting { keeper: Some(keeper), start };
            let fitted = shooting::resume(settings, task, threads, &hooks(&stop), sitting)
                .map_err(|error| self.nothing(&error, &stop))?;
            trained.weights.clone_from(&fitted.weights);
            trained.stop.clone_from(&fitted.stop);
            judges.judge(&architecture, penalty, threads, &mut trained)?;
            shot = Some(fitted);
        }

        // The model first, then what is small, pictures last: on a full disk nothing that comes after can lose them.
        let model =
            ModelFile { header: self.header::<S>(&config, &architecture, &trained), weights: trained.weights.clone() };
        save(folder, &model)?;
        folder.write("config.toml", toml.as_bytes())?;
        folder.write("history.csv", history(&trained.history).as_bytes())?;
        if let Some(shot) = &shot {
            folder.write("shooting.csv", history(&shot.history).as_bytes())?;
        }

        let network = NetworkLagrangian::new(architecture, model.weights).map_err(CliError::data)?.cast::<f64>();
        let time = args.timelike.as_ref().and_then(|name| names.iter().position(|n| n == name));
        let attention = Attention::new(Some(&stop), WINDOWS);
        let plan = Plan {
            part: &measured.test,
            horizon: args.horizon,
            time,
            forces: &args.recording.force,
            threads,
            attention: &attention,
        };
        let judgement = judge(&network, &plan)?;
        let determined = Determined::new(&network, measured, *targets)?;
        determined.suggestion().iter().for_each(|text| output::note(text));
        let found = Found {
            name: args.name(),
            recording: &self.reading.recording,
            measured,
            targets: *targets,
            seed: args.seed(),
            threads,
            trained: &trained,
            constants: network.architecture().known_constants(network.weights()),
            shot: shot.as_ref(),
            judgement: &judgement,
            determined: &determined,
            started: self.started,
        };
        let said = found.write(folder, &toml, args.json)?;
        if trained.stop != Stop::Interrupted {
            forget(folder)?;
        }
        output::print(&said)?;
        match &trained.stop {
            Stop::Finished => Ok(()),
            Stop::Interrupted => {
                let (place, on) = (folder.path().display(), how_to_go_on(folder.path()));
                Err(CliError::interrupted(format_args!("interrupted, the best model so far is in {place}{on}")))
            }
            Stop::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}"))),
        }
    }

    /// Name and checksum of everything that is learned from.
    fn checksums<S: Scalar>(&self, data: &Datasets<S>) -> Vec<(String, u32)> {
        let parts = [&self.measured.training, &self.measured.validation];
        let tracks = parts.into_iter().flat_map(|part| &part.recording.tracks);
        let numbers = tracks.flat_map(|track| [&track.times, &track.q, &track.v, &track.a, &track.force]).flatten();
        let recorded = ("recorded motion".to_string(), checksum(numbers, StoredPrecision::F64));
        data.checksums().into_iter().chain([recorded]).collect()
    }

    /// Why there is no model: an interruption before the first epoch ended, or an error, after which nothing is left to go
    /// on from.
    fn nothing(&self, error: &dyn std::fmt::Display, stop: &AtomicBool) -> CliError {
        if stop.load(Ordering::SeqCst) {
            let on = how_to_go_on(self.folder.path());
            return CliError::interrupted(format_args!("interrupted before the first epoch ended{on}"));
        }
        forget(self.folder).err().unwrap_or_else(|| CliError::data(error))
    }

    /// Header of the model file of this run.
    fn header<S: Scalar>(&self, config: &Config, architecture: &Architecture, trained: &Trained<S>) -> Header {
        let names = &self.reading.recording.coordinates;
        let velocities = names.iter().map(|name| format!("{name}_dot"));
        Header {
            format: FORMAT,
            crate_version: env!("CARGO_PKG_VERSION").to_string(),
            architecture: architecture.clone(),
            system: config.system.clone(),
            parameters: Default::default(),
            columns: names.iter().cloned().chain(velocities).collect(),
            forces: forces::recorded(&self.args.recording.force),
            description: None,
            precision: match self.args.precision() {
                PrecisionName::F32 => StoredPrecision::F32,
                PrecisionName::F64 => StoredPrecision::F64,
            },
            position: config.phases[0].position.clone(),
            velocity: config.phases[0].velocity.clone(),
            seed: config.seed,
            validation_loss: trained.validation_loss,
        }
    }
}

/// Width of the network beside a known part, and its weight decay: small, since what network and constants share is not
/// identifiable and should go to the constants.
const RESIDUAL_WIDTH: usize = 8;
const RESIDUAL_DECAY: f64 = 0.01;

/// The configuration that suits the data, changed by the file, by the model to start from and by the arguments.
fn configured(
    settled: &Settled,
    targets: Targets,
    start: Option<&Start>,
    suggested: &Config,
) -> Result<Config, CliError> {
    let args = &settled.args;
    let mut suggested = suggested.clone();
    if targets == Targets::Motion && args.changes.epochs.is_none() && !settled.has_epochs() {
        let phase = &mut suggested.phases[0];
        phase.epochs = phase.epochs.div_ceil(3);
        phase.t_max = phase.epochs as f64;
    }
    if args.changes.known.is_some() {
        suggested.network.hidden = vec![RESIDUAL_WIDTH];
        suggested.optimizer.weight_decay = RESIDUAL_DECAY;
    }
    if let Some(start) = start {
        start.shape(&mut suggested);
    }
    let mut config = settled.training(&suggested)?;
    config.system = args.name().to_string();
    config.from.clone_from(&args.from);
    config.seed = args.seed();
    config.precision = args.precision().into();
    config.network.dissipation = args.friction.or(config.network.dissipation);
    config.network.time_like = args.timelike.clone().or(config.network.time_like);
    if let Some(time) = &args.timelike {
        let classical = [PenaltyName::Eigenvalue, PenaltyName::Sylvester];
        if args.changes.penalty.is_some_and(|penalty| classical.contains(&penalty)) {
            let problem = "a time-like coordinate needs lorentzian-sylvester, or none";
            return Err(CliError::usage(format_args!("--penalty: {problem} (--timelike {time})")));
        }
        if config.network.structure == Structure::BlackBox {
            config.penalty = Regularizer::LorentzianSylvester { lambda: config.penalty.lambda(), time: time.clone() };
        }
    }
    args.changes.apply(&mut config, args.timelike.as_deref(), ", name it by --timelike")?;
    Ok(config)
}

/// Multiple shooting by the file and the arguments.
fn shooting_of(settled: &Settled) -> Shooting {
    let default = if settled.args.changes.known.is_some() { Shooting::grey_box() } else { Shooting::default() };
    let mut shooting = settled.shooting().unwrap_or(default);
    shooting.epochs = settled.args.shooting_epochs.unwrap_or(shooting.epochs);
    shooting.samples_per_segment = settled.args.segment.unwrap_or(shooting.samples_per_segment);
    shooting
}

/// Contents of `config.toml`.
fn record(settled: &Settled, targets: Targets, shooting: Option<Shooting>, training: &Config) -> FitConfig {
    let args = &settled.args;
    FitConfig {
        targets: Some(targets),
        held_out: args.share(),
        window: args.window,
        noise: args.noise.clone(),
        horizon: args.horizon,
        recording: Recording::of(&args.recording),
        shooting,
        training: training.clone(),
    }
}
