//! Arguments of `lnn train` and the configuration they come to.

use crate::cli::learned::given;
use crate::cli::number::{count, finite};
use crate::cli::{CliError, config, source};
use crate::lagrangian::{Configured, configure};
use crate::training::{Config, Precision, Preset};
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name (`lnn systems` lists them) [default: the configuration's].
    #[arg(required_unless_present = "config")]
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
    /// Print summary.json instead of tables.
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PresetName {
    Quick,
    Paper,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PrecisionName {
    F32,
    F64,
}

impl Args {
    /// The configuration: the file's or the preset's, changed by the arguments, every value in range.
    ///
    /// # Errors
    /// A usage error naming what is wrong, or a data error for a file that cannot be read.
    pub fn resolve(&self) -> Result<(Config, Configured<f64>), CliError> {
        let mut config = match &self.config {
            Some(path) => {
                let config: Config = config::load(path)?;
                if let Some(system) = self.system.as_ref().filter(|name| **name != config.system) {
                    let problem = format!("{} is about {:?}, not {system:?}", path.display(), config.system);
                    return Err(CliError::usage(problem));
                }
                // Before the arguments change anything: what is wrong here is the file's.
                configure::<f64>(&config.system, &given(&config.parameters))
                    .map_err(|e| CliError::usage(format_args!("{}: {e}", path.display())))?;
                config
            }
            None => self.preset_config()?,
        };
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
            config.precision = match precision {
                PrecisionName::F32 => Precision::F32,
                PrecisionName::F64 => Precision::F64,
            };
        }
        let system = configure(&config.system, &given(&config.parameters)).map_err(CliError::usage)?;
        let place = |e: &dyn std::fmt::Display| match &self.config {
            Some(path) => CliError::usage(format_args!("{}: {e}", path.display())),
            None => CliError::usage(e),
        };
        config.validate(system.coordinates).map_err(|e| place(&e))?;
        Ok((config, system))
    }

    /// The preset's configuration of the system, whose size the parameters decide.
    fn preset_config(&self) -> Result<Config, CliError> {
        let name = self.system.as_deref().unwrap_or_default();
        let system = configure::<f64>(name, &self.param).map_err(CliError::usage)?;
        let (preset, known) = match self.preset.unwrap_or(PresetName::Quick) {
            PresetName::Quick => (Preset::Quick, "quick"),
            PresetName::Paper => (Preset::Paper, "paper"),
        };
        preset.config(&system).ok_or_else(|| {
            CliError::usage(format_args!("--preset {known}: there is none for {name}, use quick or --config"))
        })
    }
}
