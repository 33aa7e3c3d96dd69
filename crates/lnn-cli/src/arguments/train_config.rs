//! Arguments of `lnn train` and the resulting configuration.

use crate::CliError;
use crate::arguments::flags::Flags;
use crate::arguments::layers::{Entry, Layers, Mistake};
use crate::arguments::number::{choice, finite};
use crate::arguments::print_config::{PrintFormat, commented, training_reference};
use crate::arguments::run_args::{RunArgs, add_implied, fill_periods, structure};
use crate::arguments::{source, system_arg};
use crate::terminal::output;
use lnn::configuration::Config;
use lnn::data::SamplingError;
use lnn::lagrangian::system::System;
use lnn::lagrangian::{Description, DescriptionError, SystemError, SystemInstance, resolve};
use lnn::network::Initialization;
use lnn::pipeline::{StartModel as Start, all_parameters};
use lnn::presets::Preset;
use lnn::report::SystemEntry;
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name (`lnn systems` lists them), or by the file that describes it, FILE.toml [default: that of the
    /// configuration or of the model].
    #[arg(required_unless_present_any = ["config", "resume", "from"])]
    system: Option<String>,
    /// A configuration that ships with the program [default: quick].
    #[arg(long, value_parser = choice(&Preset::ALL, Preset::name, Preset::about), value_name = "NAME")]
    preset: Option<Preset>,
    /// A parameter of the system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", value_parser = source::parameter)]
    param: Vec<(String, String)>,
    #[command(flatten)]
    flags: Flags<Config>,
    #[command(flatten)]
    pub run: RunArgs,
}

impl Args {
    /// Merges the configuration from the preset or the model, the file and the options, and checks every value. A `saved` configuration of
    /// a checkpoint is the base unless the arguments name another one.
    ///
    /// # Errors
    /// Usage errors naming all mistakes, or a data error for a file that cannot be read.
    pub fn resolve(&self, saved: Option<&Config>) -> Result<(Config, SystemInstance<f64>), CliError> {
        let mut options = self.flags.entries.clone();
        for (symbol, text) in &self.param {
            let value = finite(text).map_or_else(|_| text.as_str().into(), toml::Value::from);
            options.push(Entry::option(format!("--param {symbol}"), &format!("parameters.{symbol}"), value));
        }
        let mut layers = Layers::new(Config::KEYS, self.run.config.as_deref(), options)?;
        let start = layers.text("from").map(Start::read).transpose()?;
        let goes_on = saved.filter(|_| self.run.config.is_none() && self.preset.is_none() && start.is_none());
        let NamedSystem { name, description } = self.named(&layers, start.as_ref(), saved)?;
        if let Some(saved) = goes_on.filter(|saved| saved.system != name) {
            return Ok((Config { system: name, ..saved.clone() }, self.check(saved)?));
        }
        let system = match &description {
            Some(description) => description.system().map(Cow::Owned).map_err(Unusable::Description),
            None => resolve(&name).map_err(Unusable::System),
        };
        // A catalogue system that consists of formulas, such as one under constraints, is stored with the model, and its links are
        // expanded.
        let description = system.as_ref().ok().and_then(|system| system.description().cloned()).or(description);
        let mut parameters = match (&start, goes_on) {
            (_, Some(saved)) => saved.parameters.clone(),
            (Some(start), _) if start.header.system == name => start.header.parameters.clone(),
            _ => BTreeMap::new(),
        };
        parameters.extend(layers.numbers("parameters"));
        let mut mistakes: Vec<Mistake> = system.as_ref().err().map(Unusable::mistake).into_iter().collect();
        // If the system is unknown, the other keys are checked with a known one.
        let usable = match system {
            Ok(system) => system,
            Err(_) if layers.has_file() => Cow::Borrowed(System::named("double-pendulum").map_err(CliError::usage)?),
            Err(error) => return Err(CliError::usage(error)),
        };
        let system = instance(&usable, &parameters, &mut mistakes)?;
        let known = mistakes.is_empty();
        let base = match goes_on {
            Some(saved) => saved.clone(),
            None => self.base(&system, &layers, start.as_ref())?,
        };
        let timed = layers.has("network.time_like") || base.network.time_like.is_some();
        add_implied(&mut layers, "", timed);
        let (mut config, wrong) = layers.over(&base)?;
        (config.system, config.description) = (name, description);
        fill_periods(&mut config, &layers, "");
        mistakes.extend(wrong);
        if known {
            mistakes.extend(config.sampling_faults(&system).into_iter().map(Mistake::from));
            mistakes.extend(config.penalty().err().map(|error| match error {
                SamplingError::Config(fault) => Mistake::from(fault),
                other => Mistake::new("", other),
            }));
        }
        layers.check(mistakes)?;
        self.run.finish(&mut config)?;
        let system = self.check(&config)?;
        if let Some(start) = &start {
            let coordinates = system.system.coordinates(system.coordinates);
            start.require(&config, coordinates.iter().map(|c| c.periodic).collect())?;
        }
        Ok((config, system))
    }

    /// The base of all layers: the preset's configuration, with the shape of a model to start from.
    fn base(&self, system: &SystemInstance<f64>, layers: &Layers, start: Option<&Start>) -> Result<Config, CliError> {
        let preset = self.preset.unwrap_or(Preset::Quick);
        let config = match structure(layers, "") {
            Some(structure) => preset.config_of(system, structure),
            None => preset.config(system),
        };
        let mut config = config.ok_or_else(|| {
            let name = &system.system.name;
            CliError::usage(format_args!(
                "--preset {}: {name} has no such preset, use quick or --config",
                preset.name()
            ))
        })?;
        config.parameters = all_parameters(system);
        if layers.has("network.known") {
            (config.network.alpha, config.network.initialization) = (0.0, Initialization::NearZero);
        }
        if let Some(start) = start {
            start.shape(&mut config);
        }
        Ok(config)
    }

    /// Files that are read.
    pub fn inputs(&self) -> Vec<&Path> {
        let system = self.system.as_deref().filter(|system| system_arg::is_file(system)).map(Path::new);
        self.run.config.iter().map(PathBuf::as_path).chain(system).collect()
    }

    /// The system in the arguments; whether it exists is checked later.
    fn requested(&self) -> Result<Option<NamedSystem>, CliError> {
        let Some(argument) = self.system.as_deref() else { return Ok(None) };
        if !system_arg::is_file(argument) {
            return Ok(Some(NamedSystem { name: argument.to_string(), description: None }));
        }
        let system = system_arg::system(argument)?;
        let description = system.described.as_ref().map(|described| described.description.clone());
        Ok(Some(NamedSystem { name: system.name.to_string(), description }))
    }

    /// Checks every value of the configuration and returns its system.
    ///
    /// # Errors
    /// Usage errors naming all mistakes.
    pub fn check(&self, config: &Config) -> Result<SystemInstance<f64>, CliError> {
        let system = config.system().map_err(CliError::usage)?;
        CliError::all_usage(config.sampling_faults(&system).into_iter().map(|fault| fault.to_string()))?;
        Ok(system)
    }

    /// Prints the configuration or its reference.
    ///
    /// # Errors
    /// As [`Args::resolve`]; standard output that cannot be written.
    pub fn print(&self, format: PrintFormat) -> Result<(), CliError> {
        let (config, system) = self.resolve(None)?;
        if format == PrintFormat::Markdown {
            return output::print(&training_reference());
        }
        let described = SystemEntry::of(&system.system).parameters;
        let remark = |name: &str| {
            let known = described.iter().find(|parameter| parameter.symbol == name)?;
            let unit = if known.unit == "1" { String::new() } else { format!(", in {}", known.unit) };
            Some(format!("{}{unit}; {} unless set", known.range, known.default))
        };
        let table = toml::Table::try_from(&config).map_err(CliError::data)?;
        output::print(&commented(Config::KEYS, &table, &remark))
    }

    /// Determines the system from the argument, the file, the model or the checkpoint.
    fn named(&self, layers: &Layers, start: Option<&Start>, saved: Option<&Config>) -> Result<NamedSystem, CliError> {
        let place =
            || self.run.config.as_deref().map_or("the configuration".to_string(), crate::arguments::input::name);
        let requested = self.requested()?;
        let in_file = layers.text("system");
        // A wrong description is reported with the other mistakes of the file.
        let written = layers.get("description").and_then(|value| Description::deserialize(value.clone()).ok());
        let name = match (&requested, in_file) {
            (Some(requested), Some(found)) if requested.name != found => {
                return Err(CliError::usage(format_args!(
                    "{} is for the system {found:?}, not {:?}",
                    place(),
                    requested.name
                )));
            }
            (Some(requested), _) => requested.name.clone(),
            (None, Some(name)) => name.to_string(),
            (None, None) => {
                let known = start.map(|start| &start.header.system).or(saved.map(|saved| &saved.system));
                known.cloned().ok_or_else(|| {
                    let problem = "system: expected a system, here or as an argument";
                    CliError::usage(format_args!("{}: {problem}", place()))
                })?
            }
        };
        let requested = requested.and_then(|requested| requested.description);
        if let (Some(requested), Some(written)) = (&requested, &written)
            && requested != written
        {
            let file = self.system.as_deref().unwrap_or_default();
            let problem = format!("{} describes {name} differently from {file}: leave out one of the two", place());
            return Err(CliError::usage(problem));
        }
        let known = start.and_then(|start| start.header.description.clone());
        let candidates = [written, known, saved.and_then(|saved| saved.description.clone())];
        let description = requested.or(candidates.into_iter().flatten().find(|description| description.name == name));
        Ok(NamedSystem { name, description })
    }
}

/// The requested system, by name or with its description.
#[derive(Debug)]
struct NamedSystem {
    name: String,
    description: Option<Description>,
}

/// Why there is no system to train on.
#[derive(Debug, thiserror::Error)]
enum Unusable {
    #[error(transparent)]
    System(SystemError),
    #[error("description.{0}")]
    Description(DescriptionError),
}

impl Unusable {
    /// Converts the error to a mistake in a configuration.
    fn mistake(&self) -> Mistake {
        match self {
            Self::System(error) => Mistake::new("system", error),
            Self::Description(error) => Mistake::new(format!("description.{}", error.key), &error.problem),
        }
    }
}

/// Configures a system with these parameters; if they have mistakes, reports them and uses the defaults.
fn instance(
    system: &System,
    parameters: &BTreeMap<String, f64>,
    mistakes: &mut Vec<Mistake>,
) -> Result<SystemInstance<f64>, CliError> {
    let defaults = BTreeMap::new();
    let chosen = if mistakes.is_empty() { parameters } else { &defaults };
    let configured = SystemInstance::with_values(Cow::Owned(system.clone()), chosen).or_else(|error| {
        mistakes.extend(wrong_parameters(system, parameters, &error));
        SystemInstance::with_values(Cow::Owned(system.clone()), &defaults)
    });
    configured.map_err(CliError::usage)
}

/// Finds the mistakes in the parameters of a system, each separately.
fn wrong_parameters(system: &System, parameters: &BTreeMap<String, f64>, error: &SystemError) -> Vec<Mistake> {
    let alone = parameters.iter().filter_map(|(symbol, value)| {
        let one = BTreeMap::from([(symbol.clone(), *value)]);
        let problem = SystemInstance::<f64>::with_values(Cow::Owned(system.clone()), &one).err()?;
        Some(Mistake::new(format!("parameters.{symbol}"), problem))
    });
    let found: Vec<Mistake> = alone.collect();
    if found.is_empty() { vec![Mistake::new("parameters", error)] } else { found }
}
