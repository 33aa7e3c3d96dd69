//! Arguments of `lnn train` and the configuration they come to.

use crate::cli::learned::given;
use crate::cli::number::{count, finite, positive};
use crate::cli::{CliError, config, source};
use crate::lagrangian::{Configured, configure};
use crate::training::{Config, Every, Precision, Preset};
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name (`lnn systems` lists them) [default: the configuration's].
    #[arg(required_unless_present_any = ["config", "resume"])]
    system: Option<String>,
    /// A configuration that ships with the program [default: quick].
    #[arg(long, value_enum, conflicts_with = "config")]
    preset: Option<PresetName>,
    /// A complete configuration, such as the config.toml beside a model.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// A parameter of the system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", value_parser = source::parameter)]
    param: Vec<(String, String)>,
    /// Seed of states, weights and the order of the data.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<u64>,
    /// Epochs of every phase.
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = count)]
    epochs: Option<usize>,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = count)]
    pub threads: Option<usize>,
    /// Precision of weights and arithmetic.
    #[arg(long, value_enum)]
    precision: Option<PrecisionName>,
    /// Directory for everything the run writes [default: runs/SYSTEM].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Go on with the training in a directory that was stopped; everything else comes from its checkpoint.
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    pub resume: Option<PathBuf>,
    /// Write a checkpoint every N epochs, or every Ts seconds with an s behind the number.
    #[arg(long, value_name = "N|Ts", default_value = "60s", allow_hyphen_values = true, value_parser = every)]
    pub checkpoint_every: Every,
    /// Print summary.json instead of tables.
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PresetName {
    /// A minute on two cores.
    Quick,
    /// Wider and longer: five minutes on two cores.
    Best,
    /// The paper's budget and choices: hours.
    Paper,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum PrecisionName {
    F32,
    F64,
}

impl From<PrecisionName> for Precision {
    fn from(name: PrecisionName) -> Self {
        match name {
            PrecisionName::F32 => Self::F32,
            PrecisionName::F64 => Self::F64,
        }
    }
}

impl Args {
    /// The configuration: the file's or the preset's, changed by the arguments, every value in range.
    ///
    /// # Errors
    /// A usage error naming what is wrong, or a data error for a file that cannot be read.
    pub fn resolve(&self) -> Result<(Config, Configured<f64>), CliError> {
        let config = match &self.config {
            Some(path) => self.file_config(path)?,
            None => self.preset_config(self.system.as_deref().unwrap_or_default())?,
        };
        let config = self.changed(config)?;
        let system = self.check(&config)?;
        Ok((config, system))
    }

    /// The configuration that the arguments ask for beside `--resume`: that of the checkpoint where they say nothing.
    ///
    /// # Errors
    /// As [`Args::resolve`].
    pub fn resolve_beside(&self, saved: &Config) -> Result<Config, CliError> {
        let config = match (&self.config, self.preset) {
            (Some(path), _) => self.file_config(path)?,
            (None, Some(_)) => self.preset_config(self.system.as_ref().unwrap_or(&saved.system))?,
            (None, None) => {
                let system = self.system.clone().unwrap_or_else(|| saved.system.clone());
                Config { system, ..saved.clone() }
            }
        };
        self.changed(config)
    }

    /// The configuration's system; every value is in range.
    ///
    /// # Errors
    /// A usage error naming what is wrong.
    pub fn check(&self, config: &Config) -> Result<Configured<f64>, CliError> {
        let system = configure(&config.system, &given(&config.parameters)).map_err(CliError::usage)?;
        let place = |e: &dyn std::fmt::Display| match &self.config {
            Some(path) => CliError::usage(format_args!("{}: {e}", path.display())),
            None => CliError::usage(e),
        };
        config.validate(system.coordinates).map_err(|e| place(&e))?;
        Ok(system)
    }

    fn file_config(&self, path: &Path) -> Result<Config, CliError> {
        let config: Config = config::load(path)?;
        if let Some(system) = self.system.as_ref().filter(|name| **name != config.system) {
            let problem = format!("{} is about {:?}, not {system:?}", path.display(), config.system);
            return Err(CliError::usage(problem));
        }
        // Before the arguments change anything: what is wrong here is the file's.
        configure::<f64>(&config.system, &given(&config.parameters))
            .map_err(|e| CliError::usage(format_args!("{}: {e}", path.display())))?;
        Ok(config)
    }

    /// A configuration with the values that arguments name.
    fn changed(&self, mut config: Config) -> Result<Config, CliError> {
        for (symbol, value) in &self.param {
            let value = finite(value).map_err(|e| CliError::usage(format_args!("--param {symbol}={value}: {e}")))?;
            config.parameters.insert(symbol.clone(), value);
        }
        if let Some(seed) = self.seed {
            config.seed = seed;
        }
        if let Some(epochs) = self.epochs {
            config.phases.iter_mut().for_each(|phase| phase.epochs = epochs);
        }
        if let Some(precision) = self.precision {
            config.precision = precision.into();
        }
        Ok(config)
    }

    /// The preset's configuration of the system, whose size the parameters decide.
    fn preset_config(&self, name: &str) -> Result<Config, CliError> {
        let system = configure::<f64>(name, &self.param).map_err(CliError::usage)?;
        let (preset, known) = match self.preset.unwrap_or(PresetName::Quick) {
            PresetName::Quick => (Preset::Quick, "quick"),
            PresetName::Best => (Preset::Best, "best"),
            PresetName::Paper => (Preset::Paper, "paper"),
        };
        preset.config(&system).ok_or_else(|| {
            CliError::usage(format_args!("--preset {known}: there is none for {name}, use quick or --config"))
        })
    }
}

/// How often checkpoints are written: `10` epochs, `90s`.
fn every(text: &str) -> Result<Every, String> {
    match text.trim().strip_suffix('s') {
        Some(seconds) => positive(seconds).map(Every::Seconds),
        None => count(text).map(Every::Epochs),
    }
    .map_err(|_| "expected a number of epochs, such as 10, or of seconds, such as 90s".to_string())
}
