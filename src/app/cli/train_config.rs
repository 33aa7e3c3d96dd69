//! Arguments of `lnn train` and the configuration they come to.

use crate::cli::changes::Changes;
use crate::cli::config_file::ConfigFile;
use crate::cli::mistake::Mistake;
use crate::cli::number::{finite, seconds, seed, thread_count, whole};
use crate::cli::print_config::{PrintFormat, commented, with_seed};
use crate::cli::{CliError, chosen, output, source};
use crate::configuration::{Config, MOST_EPOCHS, Precision};
use crate::data::SamplingError;
use crate::lagrangian::system::System;
use crate::lagrangian::{
    Description, DescriptionError, SystemError, SystemInstance, configure_system, configure_values, find,
};
use crate::names::plain;
use crate::network::Structure;
use crate::optimizers::Schedule;
use crate::pipeline::{StartModel as Start, all_parameters};
use crate::presets::{Preset, TRAINING_SECTIONS, configuration_reference};
use crate::training::CheckpointInterval;
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name (`lnn systems` lists them), or by the file that describes it, FILE.toml [default: that of the
    /// configuration or of the model].
    #[arg(required_unless_present_any = ["config", "resume", "from", "named"])]
    system: Option<String>,
    /// The same as SYSTEM.
    #[arg(id = "named", long = "system", value_name = "NAME|FILE.toml", conflicts_with = "system")]
    named: Option<String>,
    /// A configuration that ships with the program [default: quick].
    #[arg(long, value_enum, value_name = "NAME")]
    preset: Option<PresetName>,
    /// A configuration, such as the config.toml beside a model, or - for standard input; keys that are not in it have the
    /// preset's values.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print the configuration with comments, as it would be used, and train nothing; markdown prints a table of all keys.
    #[arg(long, value_enum, value_name = "FORMAT", num_args = 0..=1, require_equals = true, default_missing_value = "toml",
        conflicts_with = "resume")]
    pub print_config: Option<PrintFormat>,
    /// Start from the weights of a model, a file or the directory of a run: system, parameters, network and precision are the
    /// model's unless said otherwise, states are new; another network is refused.
    #[arg(long, value_name = "MODEL")]
    from: Option<String>,
    /// A parameter of the system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", value_parser = source::parameter)]
    param: Vec<(String, String)>,
    /// Seed of states, weights and the order of the data [default: the configuration's, 0 in all presets].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = seed)]
    seed: Option<u64>,
    #[command(flatten)]
    changes: Changes,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    pub threads: Option<usize>,
    /// Precision of weights and arithmetic [default: the configuration's, f32 in all presets].
    #[arg(long, value_enum, value_name = "TYPE")]
    precision: Option<PrecisionName>,
    /// Directory for everything the run writes; one that holds a run is refused [default: runs/SYSTEM, or the first free
    /// of runs/SYSTEM-2, runs/SYSTEM-3, ..].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace the run in the directory, pictures and evaluations of its model included, once the new model is there.
    #[arg(long, conflicts_with = "resume")]
    pub overwrite: bool,
    /// Go on with the training in a directory that was stopped; everything else comes from its checkpoint.
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    pub resume: Option<PathBuf>,
    /// Write a checkpoint every N epochs, or every Ts seconds with an s behind the number.
    #[arg(long, value_name = "N|Ts", default_value = "60s", allow_hyphen_values = true, value_parser = every)]
    pub checkpoint_every: CheckpointInterval,
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
    /// Single.
    F32,
    /// Double.
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

impl From<Precision> for PrecisionName {
    fn from(precision: Precision) -> Self {
        match precision {
            Precision::F32 => Self::F32,
            Precision::F64 => Self::F64,
        }
    }
}

impl Args {
    /// The configuration: the file's, the model's or the preset's, in this order, changed by the arguments, every value in
    /// range.
    ///
    /// # Errors
    /// Usage errors naming everything that is wrong, or a data error for a file that cannot be read.
    pub fn resolve(&self) -> Result<(Config, SystemInstance<f64>), CliError> {
        self.settle(None)
    }

    /// The configuration that the arguments ask for beside `--resume`: that of the checkpoint where they say nothing.
    ///
    /// # Errors
    /// As [`Args::resolve`].
    pub fn resolve_beside(&self, saved: &Config) -> Result<Config, CliError> {
        if self.config.is_some() || self.preset.is_some() || self.from.is_some() {
            return Ok(self.settle(Some(saved))?.0);
        }
        let asked = self.asked()?;
        let mut config = saved.clone();
        if let Some(asked) = asked {
            config.system = asked.name;
            if asked.description.is_some() {
                config.description = asked.description;
            }
        }
        self.changed(config)
    }

    /// Files that are read.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        let system = self.system_argument().filter(|system| chosen::is_file(system)).map(Path::new);
        self.config.iter().map(PathBuf::as_path).chain(system)
    }

    fn system_argument(&self) -> Option<&str> {
        self.system.as_deref().or(self.named.as_deref())
    }

    /// The system that the arguments name; whether there is one of this name is found out later.
    fn asked(&self) -> Result<Option<Named>, CliError> {
        let Some(argument) = self.system_argument() else { return Ok(None) };
        if !chosen::is_file(argument) {
            return Ok(Some(Named { name: argument.to_string(), description: None }));
        }
        let system = chosen::system(argument)?;
        let description = system.described.as_ref().map(|described| described.description.clone());
        Ok(Some(Named { name: system.name.to_string(), description }))
    }

    /// The configuration's system; every value is in range.
    ///
    /// # Errors
    /// Usage errors naming everything that is wrong.
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
        let (config, system) = self.resolve()?;
        if format == PrintFormat::Markdown {
            return output::print(&configuration_reference());
        }
        let described = crate::cli::systems::parameters(&system.system);
        let remark = |name: &str| {
            let [_, default, unit, range] = described.iter().find(|[symbol, ..]| symbol == name)?;
            let unit = if unit == "1" { String::new() } else { format!(", in {unit}") };
            Some(format!("{range}{unit}; {default} unless set"))
        };
        let table = toml::Table::try_from(&Config { seed: 0, ..config.clone() }).map_err(CliError::data)?;
        output::print(&with_seed(&commented(&TRAINING_SECTIONS, &table, &remark), config.seed))
    }

    /// The configuration that files and arguments come to; `saved` has a system where they name none.
    fn settle(&self, saved: Option<&Config>) -> Result<(Config, SystemInstance<f64>), CliError> {
        let mut file = self.config.as_deref().map(ConfigFile::read).transpose()?;
        let from = self.from.clone().or_else(|| file.as_ref()?.text(&["from"]));
        let start = from.as_deref().map(Start::read).transpose()?;
        let (Named { name, description }, wrong) = self.named(file.as_mut(), start.as_ref(), saved)?;
        let system = match &description {
            Some(description) => description.system().map(Cow::Owned).map_err(Unusable::Description),
            None => find(&name).map(Cow::Borrowed).map_err(Unusable::System),
        };
        let system = wrong.map_or(system, |problem| Err(Unusable::Text(problem)));
        // Something to tell the types of the other keys by.
        let usable = match &system {
            Ok(system) => system.clone(),
            Err(_) => Cow::Borrowed(find("double-pendulum").map_err(CliError::usage)?),
        };
        let mut parameters = match &start {
            Some(start) if start.header.system == name => start.header.parameters.clone(),
            _ => BTreeMap::new(),
        };
        let mut mistakes: Vec<Mistake> = system.as_ref().err().map(Unusable::mistake).into_iter().collect();
        parameters.extend(file.as_ref().map(file_parameters).unwrap_or_default());
        // What is wrong in the arguments is not the file's.
        match &system {
            Ok(system) => drop(configure_system::<f64>(system.clone(), &self.param).map_err(CliError::usage)?),
            Err(_) if file.is_some() && self.system_argument().is_none() => {}
            Err(error) => return Err(CliError::usage(error)),
        }
        let given = self.param.iter().filter_map(|(symbol, text)| Some((symbol.clone(), finite(text).ok()?)));
        parameters.extend(given);
        let (system, known) = match (system, configure_values::<f64>(usable.clone(), &parameters)) {
            (Ok(_), Ok(system)) => (system, true),
            (Ok(_), Err(error)) => {
                mistakes.extend(wrong_parameters(&usable, &parameters, &error));
                (configure_system(usable, &self.param).map_err(CliError::usage)?, false)
            }
            (Err(_), _) => (configure_system(usable, &[]).map_err(CliError::usage)?, false),
        };
        let mut config = self.preset_config(&system)?;
        config.parameters = all_parameters(&system);
        if let Some(start) = &start {
            start.shape(&mut config);
        }
        if let Some(file) = &file {
            // A file with a structure means what the argument means, and does not write zeros down.
            if file.text(&["network", "structure"]).is_some_and(|structure| structure != Structure::BlackBox.name()) {
                config.data.rescaled_fraction = 0.0;
            }
            let (filled, wrong) = file.over(&config)?;
            config = with_periods(file, filled);
            config.seed = file.large(&["seed"]).unwrap_or(config.seed);
            mistakes.extend(wrong);
            if known {
                mistakes.extend(config.sampling_faults(&system).into_iter().map(Mistake::from));
                mistakes.extend(config.penalty().err().map(|error| match error {
                    SamplingError::Config(fault) => Mistake::from(fault),
                    other => Mistake::new("", other),
                }));
            }
            file.check(mistakes)?;
        }
        config.system = name;
        config.description = description;
        config.from = from;
        let config = self.changed(config)?;
        let system = self.check(&config)?;
        if let Some(start) = &start {
            let coordinates = system.system.coordinates(system.coordinates);
            start.require(&config, coordinates.iter().map(|c| c.periodic).collect())?;
        }
        Ok((config, system))
    }

    /// The system: the argument's, the file's, the model's or the checkpoint's; and what is wrong with the file's description.
    fn named(
        &self,
        file: Option<&mut ConfigFile>,
        start: Option<&Start>,
        saved: Option<&Config>,
    ) -> Result<(Named, Option<String>), CliError> {
        let place = || self.config.as_deref().map(crate::cli::input::name).unwrap_or_default();
        let asked = self.asked()?;
        let in_file = file.as_ref().and_then(|file| file.text(&["system"]));
        // A system is taken as a whole, not key by key.
        let written = file.and_then(|file| file.take("description")).map(Description::deserialize).transpose();
        let (written, wrong) = match written {
            Ok(written) => (written, None),
            Err(error) => (None, Some(plain(error.message()))),
        };
        let name = match (&asked, in_file) {
            (Some(asked), Some(found)) if asked.name != found => {
                return Err(CliError::usage(format_args!("{} is about {found:?}, not {:?}", place(), asked.name)));
            }
            (Some(asked), _) => asked.name.clone(),
            (None, Some(name)) => name,
            (None, None) => {
                let known = start.map(|start| &start.header.system).or(saved.map(|saved| &saved.system));
                known.cloned().ok_or_else(|| {
                    let problem = "system: no system is named, neither here nor as an argument";
                    CliError::usage(format_args!("{}: {problem}", place()))
                })?
            }
        };
        let asked = asked.and_then(|asked| asked.description);
        if let (Some(asked), Some(written)) = (&asked, &written)
            && asked != written
        {
            let file = self.system_argument().unwrap_or_default();
            let problem =
                format!("{} has another description of {name} than {file}: leave one of the two out", place());
            return Err(CliError::usage(problem));
        }
        let known = start.and_then(|start| start.header.description.clone());
        let candidates = [written, known, saved.and_then(|saved| saved.description.clone())];
        let description = asked.or(candidates.into_iter().flatten().find(|description| description.name == name));
        Ok((Named { name, description }, wrong))
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
        if let Some(precision) = self.precision {
            config.precision = precision.into();
        }
        // Whoever takes the configuration finds out what is wrong with its system.
        let time = config.system().ok().and_then(|system| {
            let coordinates = system.system.coordinates(system.coordinates);
            coordinates.into_iter().nth(system.system.time_like?).map(|coordinate| coordinate.name)
        });
        self.changes.apply(&mut config, time.as_deref(), "")?;
        Ok(config)
    }

    /// The preset's configuration of the system.
    fn preset_config(&self, system: &SystemInstance<f64>) -> Result<Config, CliError> {
        let (preset, known) = match self.preset.unwrap_or(PresetName::Quick) {
            PresetName::Quick => (Preset::Quick, "quick"),
            PresetName::Best => (Preset::Best, "best"),
            PresetName::Paper => (Preset::Paper, "paper"),
        };
        let config = match self.changes.structure {
            Some(structure) => preset.config_of(system, structure),
            None => preset.config(system),
        };
        config.ok_or_else(|| {
            let name = &system.system.name;
            CliError::usage(format_args!("--preset {known}: there is none for {name}, use quick or --config"))
        })
    }
}

/// The numbers of a file's `[parameters]`.
fn file_parameters(file: &ConfigFile) -> BTreeMap<String, f64> {
    let table = file.get(&["parameters"]).and_then(toml::Value::as_table);
    let number = |value: &toml::Value| value.as_float().or_else(|| value.as_integer().map(|x| x as f64));
    let entries = table.into_iter().flatten();
    entries.filter_map(|(symbol, value)| Some((symbol.clone(), number(value)?))).collect()
}

/// The system that is asked for, by name or with its description.
#[derive(Debug)]
struct Named {
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
    #[error("{0}")]
    Text(String),
}

impl Unusable {
    /// As a mistake of a configuration.
    fn mistake(&self) -> Mistake {
        match self {
            Self::System(error) => Mistake::new("system", error),
            Self::Description(error) => Mistake::new(format!("description.{}", error.key), &error.problem),
            Self::Text(problem) => Mistake::new("description", problem),
        }
    }
}

/// Mistakes in the parameters of a system, each of them by itself.
fn wrong_parameters(system: &System, parameters: &BTreeMap<String, f64>, error: &SystemError) -> Vec<Mistake> {
    let alone = parameters.iter().filter_map(|(symbol, value)| {
        let one = BTreeMap::from([(symbol.clone(), *value)]);
        let problem = configure_values::<f64>(Cow::Owned(system.clone()), &one).err()?;
        Some(Mistake::new(format!("parameters.{symbol}"), problem))
    });
    let found: Vec<Mistake> = alone.collect();
    if found.is_empty() { vec![Mistake::new("parameters", error)] } else { found }
}

/// The configuration with a `t_max` of all epochs where the file changes these alone and the schedule has no periods.
fn with_periods(file: &ConfigFile, mut config: Config) -> Config {
    for (k, phase) in config.phases.iter_mut().enumerate() {
        let has = |key: &str| file.has(&format!("phase[{k}].{key}"));
        if has("epochs") && !has("t_max") && phase.schedule != Schedule::CosineAnnealing {
            phase.t_max = phase.epochs as f64;
        }
    }
    config
}

/// Interval of checkpoints: `10` epochs, `90s`.
pub fn every(text: &str) -> Result<CheckpointInterval, String> {
    match text.trim().strip_suffix('s') {
        Some(text) => seconds(text).map(CheckpointInterval::Seconds),
        None => whole(1, MOST_EPOCHS)(text).map(CheckpointInterval::Epochs),
    }
    .map_err(|problem| format!("{problem}, of epochs, such as 10, or of seconds with an s, such as 90s"))
}
