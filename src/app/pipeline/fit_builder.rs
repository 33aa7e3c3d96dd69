//! A fit of recorded motion in one expression: files and columns, the choices that matter, the result.

use crate::configuration::{Config, ConfigError, Data, FRICTION_UNITS, Phase, Precision};
use crate::network::Structure;
use crate::pipeline::fit::{FitReport, fit};
use crate::pipeline::fit_config::{FitColumns, FitConfig, FitOptions};
use crate::pipeline::prepared_fit::PreparedFit;
use crate::pipeline::train::RunOptions;
use crate::pipeline::{InMemory, LockedDirectory, Output, PipelineError, Watch};
use crate::presets::restructure;
use crate::recording::read::read_recording;
use crate::recording::{Columns, LoadedRecording, Recording};
use std::path::PathBuf;

/// A fit of recorded motion.
///
/// Every choice has the default of `lnn fit`: if unsure, leave it.
///
/// ```
/// use lnn::prelude::*;
///
/// let angles = ["theta1", "theta2"];
/// let fit = Fit::new("examples/data/pendulum.csv").coordinates(angles).angles(angles).trajectory("run").friction(true);
/// let fit = fit.configure(|config| {
///     config.training.network.hidden = vec![8]; // as small as can be: this runs in a moment
///     config.training.phases[0].epochs = 2;
/// });
/// let fitted = fit.run()?;
/// println!("{}", fitted.findings());
/// assert!(fitted.hold_out.model[0].median.is_finite());
/// let a = fitted.network.acceleration(&[0.3, 0.1], &[0.0, 0.0])?;
/// # assert!(a[0].is_finite());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Fit {
    source: Source,
    columns: Columns,
    options: FitOptions,
    change: Box<dyn FnOnce(&mut FitConfig)>,
    friction: bool,
    structure: Option<Structure>,
    precision: Precision,
    threads: usize,
    out: Option<PathBuf>,
    overwrite: bool,
    watch: Watch,
}

/// Origin of the motion.
enum Source {
    Files(Vec<PathBuf>),
    Memory(Box<LoadedRecording>),
}

impl Fit {
    /// A fit of a file: CSV, XLSX, NPY or NPZ.
    pub fn new(file: impl Into<PathBuf>) -> Self {
        Self::of(Source::Files(vec![file.into()]))
    }

    /// A fit of several files, each with at least one trajectory.
    pub fn files(files: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        Self::of(Source::Files(files.into_iter().map(Into::into).collect()))
    }

    /// A fit of motion in memory, which defines its own coordinates.
    pub fn recording(recording: Recording) -> Self {
        Self::of(Source::Memory(Box::new(LoadedRecording::from(recording))))
    }

    fn of(source: Source) -> Self {
        Self {
            source,
            columns: Columns::default(),
            options: FitOptions::default(),
            change: Box::new(|_| {}),
            friction: false,
            structure: None,
            precision: Precision::F32,
            threads: 1,
            out: None,
            overwrite: false,
            watch: Watch::default(),
        }
    }

    /// Columns of the coordinates.
    pub fn coordinates<const N: usize>(mut self, names: [&str; N]) -> Self {
        self.columns.coords = names.map(String::from).to_vec();
        self
    }

    /// Coordinates that are angles in rad.
    pub fn angles<const N: usize>(mut self, names: [&str; N]) -> Self {
        self.columns.periodic = names.map(String::from).to_vec();
        self
    }

    /// Column whose value distinguishes the trajectories of a file.
    pub fn trajectory(mut self, column: &str) -> Self {
        self.columns.trajectory = Some(column.to_string());
        self
    }

    /// Changes the other meanings of columns: times, units, measured velocities.
    pub fn columns(mut self, change: impl FnOnce(&mut Columns)) -> Self {
        change(&mut self.columns);
        self
    }

    /// Learns friction in addition to the Lagrangian.
    pub fn friction(self, friction: bool) -> Self {
        Self { friction, ..self }
    }

    /// Builds the signature of the mass matrix in.
    pub fn structure(self, structure: Structure) -> Self {
        Self { structure: Some(structure), ..self }
    }

    /// Seed of the weights and of held-out trajectories.
    pub fn seed(mut self, seed: u64) -> Self {
        self.options.seed = seed;
        self
    }

    /// Changes the choices that come before the configuration: held-out share, smoothing windows, noise.
    pub fn options(mut self, change: impl FnOnce(&mut FitOptions)) -> Self {
        change(&mut self.options);
        self
    }

    /// Precision of weights and arithmetic in training.
    pub fn precision(self, precision: Precision) -> Self {
        Self { precision, ..self }
    }

    /// Threads; results do not depend on them.
    pub fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Directory for model, tables, pictures and report, created if need be; without one nothing is written.
    pub fn out(self, directory: impl Into<PathBuf>) -> Self {
        Self { out: Some(directory.into()), ..self }
    }

    /// Replaces a run that is already in the directory, which is otherwise refused.
    pub fn overwrite(self, overwrite: bool) -> Self {
        Self { overwrite, ..self }
    }

    /// Receiver of progress and remarks, with a flag that ends the fit.
    pub fn watch(self, watch: Watch) -> Self {
        Self { watch, ..self }
    }

    /// Changes any other choice of the [`FitConfig`] that suits the data.
    pub fn configure(self, change: impl FnOnce(&mut FitConfig) + 'static) -> Self {
        Self { change: Box::new(change), ..self }
    }

    /// Reads, learns, and judges the model by held-out motion.
    ///
    /// # Errors
    /// [`PipelineError`]: [`PipelineError::Data`] for files that do not fit their description, [`PipelineError::Training`] if nothing was learned.
    pub fn run(self) -> Result<FitReport, PipelineError> {
        let Self { source, columns, options, change, friction, structure, precision, threads, out, overwrite, watch } =
            self;
        let (loaded, files) = match source {
            Source::Files(files) => (read_recording(&files, &columns)?, files),
            Source::Memory(loaded) => (*loaded, Vec::new()),
        };
        // Columns of files have the names of their headers.
        let columns = if files.is_empty() { columns } else { loaded.columns.clone() };
        let prepared = PreparedFit::new(&loaded, &options)?;
        let mut config = prepared.suggest(&FitConfig::default().training.system, precision)?;
        config.recording = FitColumns {
            files: files.iter().map(|file| file.display().to_string()).collect(),
            ..FitColumns::from(&columns)
        };
        config.training.network.dissipation = friction.then_some(FRICTION_UNITS);
        if let Some(structure) = structure {
            restructure(&mut config.training, structure);
        }
        let decided = config.training.data.clone();
        change(&mut config);
        require_decided(&config.training, decided)?;
        let options = RunOptions { threads, ..RunOptions::default() };
        let output: Box<dyn Output> = match &out {
            Some(path) => Box::new(LockedDirectory::claim(path, overwrite)?),
            None => Box::new(InMemory::default()),
        };
        fit(&prepared, &config, &options, output.as_ref(), &watch)
    }
}

/// Rejects settings that the recording decides, because they would have no effect.
fn require_decided(training: &Config, decided: Data) -> Result<(), PipelineError> {
    let refused = |field: &str| {
        let (expected, found) = ("what the recording decides".into(), "another value".to_string());
        Err(ConfigError { field: format!("training.{field}"), expected, found }.into())
    };
    let Data { acceleration_weighting, .. } = training.data;
    if training.data != (Data { acceleration_weighting, ..decided }) {
        return refused("data");
    }
    let bounded =
        |phase: &Phase| !(phase.position.is_empty() && phase.velocity.is_empty() && phase.log_uniform.is_empty());
    match training.phases.iter().position(bounded) {
        Some(k) => refused(&format!("phase[{k}]: position, velocity, log_uniform")),
        None if !training.parameters.is_empty() => refused("parameters"),
        None => Ok(()),
    }
}
