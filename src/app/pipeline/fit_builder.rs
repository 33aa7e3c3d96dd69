//! Builder for a fit of recorded motion: files, columns, settings, result.

use crate::configuration::{Config, ConfigError, Data, FRICTION_UNITS, Phase, Precision};
use crate::network::Structure;
use crate::pipeline::fit::{FitReport, fit};
use crate::pipeline::fit_config::{FitColumns, FitConfig, FitOptions};
use crate::pipeline::prepared_fit::PreparedFit;
use crate::pipeline::train::RunOptions;
use crate::pipeline::{InMemory, LockedDirectory, Output, PipelineError, Watch};
use crate::presets::restructure;
use crate::recording::{Columns, LoadedRecording, Recording};
use std::path::PathBuf;

/// A fit of recorded motion.
///
/// Every setting has the default of `lnn fit`; keep it if unsure.
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
    /// Fits a file: CSV, XLSX, NPY or NPZ.
    pub fn new(file: impl Into<PathBuf>) -> Self {
        Self::of(Source::Files(vec![file.into()]))
    }

    /// Fits several files, each with at least one trajectory.
    pub fn files(files: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        Self::of(Source::Files(files.into_iter().map(Into::into).collect()))
    }

    /// Fits motion in memory, which defines its own coordinates.
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

    /// Names the columns of the coordinates.
    pub fn coordinates<const N: usize>(mut self, names: [&str; N]) -> Self {
        self.columns.coords = names.map(String::from).to_vec();
        self
    }

    /// Marks coordinates as angles in rad.
    pub fn angles<const N: usize>(mut self, names: [&str; N]) -> Self {
        self.columns.periodic = names.map(String::from).to_vec();
        self
    }

    /// Names the column whose value distinguishes the trajectories of a file.
    pub fn trajectory(mut self, column: &str) -> Self {
        self.columns.trajectory = Some(column.to_string());
        self
    }

    /// Changes other column settings: times, units, measured velocities.
    pub fn columns(mut self, change: impl FnOnce(&mut Columns)) -> Self {
        change(&mut self.columns);
        self
    }

    /// Learns friction in addition to the Lagrangian.
    pub fn friction(self, friction: bool) -> Self {
        Self { friction, ..self }
    }

    /// Sets the structure of the network, which fixes the signature of the mass matrix.
    pub fn structure(self, structure: Structure) -> Self {
        Self { structure: Some(structure), ..self }
    }

    /// Sets the seed of the weights and of the choice of held-out trajectories.
    pub fn seed(mut self, seed: u64) -> Self {
        self.options.seed = seed;
        self
    }

    /// Changes the settings that apply before training: held-out share, smoothing windows, noise.
    pub fn options(mut self, change: impl FnOnce(&mut FitOptions)) -> Self {
        change(&mut self.options);
        self
    }

    /// Sets the precision of weights and arithmetic in training.
    pub fn precision(self, precision: Precision) -> Self {
        Self { precision, ..self }
    }

    /// Sets the number of threads; results do not depend on it.
    pub fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Sets the directory for model, tables, pictures and report, which is created if needed. By default no files are written.
    pub fn out(self, directory: impl Into<PathBuf>) -> Self {
        Self { out: Some(directory.into()), ..self }
    }

    /// Allows replacing an existing run in the directory.
    pub fn overwrite(self, overwrite: bool) -> Self {
        Self { overwrite, ..self }
    }

    /// Sets the receiver of progress and remarks, with its interrupt flag.
    pub fn watch(self, watch: Watch) -> Self {
        Self { watch, ..self }
    }

    /// Changes any other setting of the [`FitConfig`].
    pub fn configure(self, change: impl FnOnce(&mut FitConfig) + 'static) -> Self {
        Self { change: Box::new(change), ..self }
    }

    /// Reads the data, trains the model and tests it on held-out motion.
    ///
    /// # Errors
    /// [`PipelineError`]: [`PipelineError::Data`] for files that do not fit their description, [`PipelineError::Training`] if nothing was learned.
    pub fn run(self) -> Result<FitReport, PipelineError> {
        let Self { source, columns, options, change, friction, structure, precision, threads, out, overwrite, watch } =
            self;
        let (loaded, files) = match source {
            Source::Files(files) => (LoadedRecording::read(&files, &columns)?, files),
            Source::Memory(loaded) => (*loaded, Vec::new()),
        };
        // The columns of files are named by their headers.
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

/// Rejects settings that the recording determines, because they would have no effect.
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
