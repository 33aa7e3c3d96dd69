//! `lnn fit`: learns from recorded motion, judges by motion that was held out, writes.

use crate::cli::fit_args::Args;
use crate::cli::folder::Folder;
use crate::cli::judgement::{Judgement, Plan, judge};
use crate::cli::learning::{ended, history, training_pictures, write_figures};
use crate::cli::number::threads;
use crate::cli::train::hooks;
use crate::cli::train_config::PrecisionName;
use crate::cli::{CliError, interrupt, memory, output};
use crate::network::file::{FORMAT, Header, ModelFile, StoredPrecision};
use crate::network::{Architecture, NetworkLagrangian};
use crate::recording::smooth::SmoothOptions;
use crate::recording::{HeldOut, Reading, Targets};
use crate::report::Report;
use crate::scalar::Scalar;
use crate::training::shooting::{self, Shooting, Task};
use crate::training::{Config, Measured, Preparation, Regularizer, Stop, Trained, train, training_memory};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

/// What `config.toml` holds: everything but the data.
#[derive(Serialize)]
struct Record<'a> {
    targets: Targets,
    held_out: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    window: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<&'a [f64]>,
    shooting: Option<&'a Shooting>,
    training: &'a Config,
}

/// One coordinate of `summary.json`: what the data are like and what smoothing makes of them, in SI units.
#[derive(Serialize)]
struct Coordinate {
    name: String,
    noise: f64,
    window_samples: usize,
    window_seconds: f64,
    acceleration_error: f64,
    acceleration_error_relative: f64,
}

/// What `summary.json` holds.
#[derive(Serialize)]
struct Summary<'a> {
    system: &'a str,
    crate_version: &'static str,
    seed: u64,
    precision: &'static str,
    threads: usize,
    targets: Targets,
    trajectories: [usize; 3],
    samples: [usize; 3],
    held_out: &'a HeldOut,
    coordinates: Vec<Coordinate>,
    epochs: usize,
    weights: usize,
    /// Loss (paper) against the accelerations the network was trained on, of the validation and the held-out part.
    validation_loss: f64,
    test_loss: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    shooting: Option<ShootingSummary>,
    ended: String,
    training_seconds: f64,
    wall_seconds: f64,
    #[serde(flatten)]
    judgement: &'a Judgement,
}

/// Multiple shooting in `summary.json`; losses are mean squared residuals in units of noise.
#[derive(Serialize)]
struct ShootingSummary {
    epochs: usize,
    segments: usize,
    steps_per_segment: usize,
    start_loss: f64,
    validation_loss: f64,
    integration_error: f64,
}

/// Learns and writes everything into the output directory.
///
/// # Errors
/// A usage error for arguments, a data error for files and data that cannot be learned from, an interruption; after the
/// last the best model so far is written, if there is one.
pub fn run(args: &Args) -> Result<(), CliError> {
    let started = Instant::now();
    let reading = args.recording.read()?;
    let path = args.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(&args.name));
    if let Some(time) = &args.timelike {
        let names = &reading.recording.coordinates;
        if !names.contains(time) {
            let known = names.join(", ");
            return Err(CliError::usage(format_args!("--timelike {time}: expected one of the coordinates {known}")));
        }
    }
    let preparation = Preparation {
        smoothing: SmoothOptions { window: args.window, noise: args.noise.clone(), ..SmoothOptions::default() },
        held_out: args.hold_out,
        seed: args.seed,
        ..Preparation::default()
    };
    let measured = Measured::new(&reading.recording, &preparation).map_err(CliError::data)?;
    let targets = args.targets.map_or_else(|| measured.advice(), Targets::from);
    if targets == Targets::Measured && !measured.training.recording.has_accelerations() {
        return Err(CliError::usage("--targets measured: no accelerations were given, see --acceleration"));
    }
    let forced = reading.recording.tracks.iter().any(|track| !track.force.is_empty());
    if args.friction.is_some() && reading.recording.n() == 1 && !forced {
        let motion = "every motion of one coordinate has a Lagrangian";
        output::note(&format!("{motion}: without known forces (--force) L and the friction are not told apart"));
    }
    let folder = Folder::open(&path)?;
    let job = Job { args, reading: &reading, measured: &measured, targets, folder: &folder, started };
    match args.precision {
        PrecisionName::F32 => job.run::<f32>(),
        PrecisionName::F64 => job.run::<f64>(),
    }
}

/// What is to be done.
struct Job<'a> {
    args: &'a Args,
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
        let data = measured.datasets::<S>(*targets).map_err(CliError::data)?;
        let config = self.config(&measured.config(&args.name, &data));
        config.validate(names.len()).map_err(CliError::usage)?;
        let periodic = self.reading.recording.periodic.clone();
        let architecture = config.architecture_with(periodic, data.training[0].physical_scale());
        architecture.validate().map_err(CliError::usage)?;
        memory::require("training", training_memory(&config, &architecture))?;
        let penalty = config.penalty.penalty(names.iter().map(String::as_str)).map_err(CliError::usage)?;
        let stop = interrupt::flag()?;
        let threads = threads(args.threads);

        let mut trained =
            train(&config, &architecture, penalty, data, threads, &hooks(&stop)).map_err(CliError::data)?;
        let shooting = (*targets == Targets::Motion).then(|| self.shooting());
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
                seed: args.seed,
            };
            let fitted = shooting::fit(settings, task, threads, &hooks(&stop)).map_err(CliError::data)?;
            trained.weights.clone_from(&fitted.weights);
            trained.stop.clone_from(&fitted.stop);
            shot = Some(fitted);
        }

        // The model and its history first: nothing that comes after can lose them.
        let record = Record {
            targets: *targets,
            held_out: args.hold_out,
            window: args.window,
            noise: args.noise.as_deref(),
            shooting: shooting.as_ref(),
            training: &config,
        };
        let toml = toml::to_string(&record).map_err(CliError::data)?;
        let model =
            ModelFile { header: self.header::<S>(&config, &architecture, &trained), weights: trained.weights.clone() };
        let file = folder.file("model.safetensors");
        folder.write("config.toml", toml.as_bytes())?;
        folder.write("history.csv", history(&trained.history).as_bytes())?;
        if let Some(shot) = &shot {
            folder.write("shooting.csv", history(&shot.history).as_bytes())?;
        }
        model.save(&file).map_err(|e| CliError::file(&file, e))?;

        let network = NetworkLagrangian::new(architecture, model.weights).map_err(CliError::data)?.cast::<f64>();
        let time = args.timelike.as_ref().and_then(|name| names.iter().position(|n| n == name));
        let plan = Plan { part: &measured.test, horizon: args.horizon, time, threads };
        let judgement = judge(&network, &plan)?;
        let parts = [&measured.training, &measured.validation, &measured.test];
        let summary = Summary {
            system: &args.name,
            crate_version: env!("CARGO_PKG_VERSION"),
            seed: args.seed,
            precision: S::NAME,
            threads,
            targets: *targets,
            trajectories: parts.map(|part| part.recording.tracks.len()),
            samples: parts.map(|part| part.recording.samples()),
            held_out: &measured.held_out,
            coordinates: self.coordinates(),
            epochs: trained.history.len(),
            weights: trained.weights.len(),
            validation_loss: trained.validation_loss,
            test_loss: trained.test.loss.to_f64(),
            shooting: shot.as_ref().map(|fitted| ShootingSummary {
                epochs: fitted.history.len(),
                segments: fitted.segments.0,
                steps_per_segment: fitted.steps,
                start_loss: fitted.start_loss,
                validation_loss: fitted.validation_loss,
                integration_error: fitted.integration_error,
            }),
            ended: ended(&trained.stop),
            training_seconds: trained.seconds + shot.as_ref().map_or(0.0, |fitted| fitted.seconds),
            wall_seconds: self.started.elapsed().as_secs_f64(),
            judgement: &judgement,
        };
        let json = serde_json::to_string_pretty(&summary).map_err(CliError::data)? + "\n";
        let text = self.text(&summary);
        let mut figures = training_pictures(&trained.history)?;
        if let Some(shot) = &shot {
            let mut later = training_pictures(&shot.history)?;
            later.iter_mut().for_each(|figure| figure.file.insert_str(0, "shooting_"));
            figures.extend(later);
        }
        let report = Report::new(&format!("{}: learned from recorded motion", args.name)).preformatted(&text);
        let report = judgement.report(report).heading("Training");
        let report = figures.iter().fold(report, |report, figure| report.figure(&figure.png, &figure.caption));
        let report = report.heading("Configuration").preformatted(&toml);
        write_figures(folder, figures.iter().chain(&judgement.figures))?;
        folder.write("report.html", report.to_html().as_bytes())?;
        folder.write("summary.json", json.as_bytes())?;
        let text = format!("{text}\nreport: {}\n", folder.file("report.html").display());
        output::print(if args.json { &json } else { &text })?;
        match &trained.stop {
            Stop::Finished => Ok(()),
            Stop::Interrupted => {
                let place = folder.path().display();
                Err(CliError::interrupted(format_args!("interrupted, the best model so far is in {place}")))
            }
            Stop::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}"))),
        }
    }

    /// The configuration that suits the data, changed by the arguments.
    fn config(&self, suggested: &Config) -> Config {
        let Args { hidden, epochs, seed, friction, timelike, precision, .. } = self.args;
        let mut config = suggested.clone();
        config.seed = *seed;
        config.precision = (*precision).into();
        config.network.hidden.clone_from(hidden);
        config.network.dissipation = *friction;
        if let Some(time) = timelike {
            config.penalty = Regularizer::LorentzianSylvester { lambda: config.penalty.lambda(), time: time.clone() };
        }
        let phase = &mut config.phases[0];
        if let Some(epochs) = epochs {
            phase.epochs = *epochs;
        } else if self.targets == Targets::Motion {
            phase.epochs = phase.epochs.div_ceil(3);
        }
        phase.t_max = phase.epochs as f64;
        config
    }

    fn shooting(&self) -> Shooting {
        let mut settings = Shooting::default();
        settings.epochs = self.args.shooting_epochs.unwrap_or(settings.epochs);
        settings.samples_per_segment = self.args.segment.unwrap_or(settings.samples_per_segment);
        settings
    }

    /// What the model file says about this run.
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
            precision: match self.args.precision {
                PrecisionName::F32 => StoredPrecision::F32,
                PrecisionName::F64 => StoredPrecision::F64,
            },
            position: config.phases[0].position.clone(),
            velocity: config.phases[0].velocity.clone(),
            seed: config.seed,
            validation_loss: trained.validation_loss,
        }
    }

    fn coordinates(&self) -> Vec<Coordinate> {
        let pairs = self.reading.recording.coordinates.iter().zip(&self.measured.smoothing.coordinates);
        pairs
            .map(|(name, chosen)| Coordinate {
                name: name.clone(),
                noise: chosen.noise.sigma,
                window_samples: chosen.quality.window,
                window_seconds: chosen.seconds,
                acceleration_error: chosen.quality.total(2),
                acceleration_error_relative: chosen.quality.relative(),
            })
            .collect()
    }

    /// The run in words and tables.
    fn text(&self, summary: &Summary<'_>) -> String {
        let [training, validation, test] = summary.samples;
        let way = match summary.targets {
            Targets::Measured => "measured accelerations",
            Targets::Smoothed => "smoothed accelerations",
            Targets::Motion => "the motion itself (multiple shooting)",
        };
        let held = summary.held_out.describe(&self.reading.recording);
        let mut text = format!(
            "learned from {way}: {training} samples of {} trajectories, best epoch chosen on {validation}, judged on {test} \
             (held out: {held})\n",
            summary.trajectories[0]
        );
        // Writing to a string cannot fail.
        for c in &summary.coordinates {
            let _ = writeln!(
                text,
                "{}: noise {:.3e}, smoothed over {:.3} s ({} samples), accelerations good to {:.1} %",
                c.name,
                c.noise,
                c.window_seconds,
                c.window_samples,
                100.0 * c.acceleration_error_relative
            );
        }
        let _ = writeln!(
            text,
            "loss (paper) against those accelerations: validation {:.6}, held out {:.6}; {} epochs, {} weights, seed {}",
            summary.validation_loss, summary.test_loss, summary.epochs, summary.weights, summary.seed
        );
        if let Some(shooting) = &summary.shooting {
            let _ = writeln!(
                text,
                "mean squared residual of predictions, in units of noise (1: only noise is left): {:.3} before, {:.3} after {} epochs \
                 over {} segments",
                shooting.start_loss, shooting.validation_loss, shooting.epochs, shooting.segments
            );
        }
        let _ = writeln!(text, "{:.1} s of training, {:.1} s in all\n", summary.training_seconds, summary.wall_seconds);
        text + &summary.judgement.text()
    }
}
