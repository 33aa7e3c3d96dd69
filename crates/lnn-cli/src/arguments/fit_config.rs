//! Arguments of `lnn fit` and the resulting configuration.

use crate::CliError;
use crate::arguments::constraints::formulas;
use crate::arguments::flags::Flags;
use crate::arguments::input::is_standard;
use crate::arguments::layers::{Entry, Layers, Mistake};
use crate::arguments::plain_name::plain_name;
use crate::arguments::recording_args::RecordingArgs;
use crate::arguments::run_args::{RunArgs, add_implied, fill_periods, structure};
use crate::directories::resume::{SavedText, parse, require_same};
use lnn::configuration::{Config, Data, Regularizer};
use lnn::network::Structure;
use lnn::pipeline::{FitColumns, FitConfig, FitOptions, PreparedFit, StartModel, shorten};
use lnn::presets::restructure;
use lnn::recording::Targets;
use lnn::shooting::Shooting;
use lnn::training::LATEST;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args(unless_known))]
pub struct Args {
    #[command(flatten)]
    pub recording: RecordingArgs,
    #[command(flatten)]
    flags: Flags<FitConfig>,
    #[command(flatten)]
    pub run: RunArgs,
}

/// Makes an argument optional if a configuration or a checkpoint can replace it.
fn unless_known(argument: clap::Arg) -> clap::Arg {
    match argument.get_id().as_str() {
        "data" => argument.required(false).required_unless_present_any(["config", "resume"]),
        _ => argument,
    }
}

impl Args {
    /// Adds guessed columns, unless the arguments, a configuration or a run to continue names them.
    ///
    /// # Errors
    /// Those of [`RecordingArgs::complete`].
    pub fn complete(&self) -> Result<Self, CliError> {
        let named = self.run.config.is_some() || self.run.resume.is_some() || !self.recording.coords.is_empty();
        let recording = if named { self.recording.clone() } else { self.recording.complete()? };
        Ok(Self { recording, ..self.clone() })
    }

    /// Files that the command reads.
    pub fn inputs(&self) -> Vec<&Path> {
        self.recording.data.iter().chain(&self.run.config).map(PathBuf::as_path).collect()
    }
}

/// Path of the training in the configuration of a fit.
const TRAINING: &str = "training.";

/// Settings of a fit from files and arguments, before its data are read.
pub struct Plan<'a> {
    /// The arguments.
    pub args: &'a Args,
    /// The configuration as far as it is known without the data.
    pub config: FitConfig,
    layers: Layers,
    /// The fit to continue, if any.
    saved: Option<Saved>,
}

/// A fit that continues: its configuration, and the directory in which it was started.
#[derive(Debug, Serialize, Deserialize)]
pub struct Saved {
    directory: PathBuf,
    fit: FitConfig,
    /// Text of its checkpoint.
    #[serde(skip)]
    text: String,
}

impl Saved {
    /// Reads the text of a run in a directory.
    ///
    /// # Errors
    /// A data error naming the file.
    pub fn read(path: &Path, text: SavedText<'_>) -> Result<Self, CliError> {
        match text {
            SavedText::Checkpoint(text) => Ok(Self { text: text.to_string(), ..parse(path, LATEST, text)? }),
            SavedText::Configuration(text) => Ok(Self::begin(parse(path, "config.toml", text)?)),
        }
    }

    /// Creates the description of a fit that starts in the present directory.
    fn begin(fit: FitConfig) -> Self {
        Self { directory: std::env::current_dir().unwrap_or_default(), fit, text: String::new() }
    }

    /// The paths of its recordings, as seen from the present directory. Standard input has to be supplied again.
    fn files(&self) -> Vec<String> {
        let here = std::env::current_dir().is_ok_and(|here| here == self.directory);
        let found = |file: &String| {
            if here || is_standard(Path::new(file)) {
                file.clone()
            } else {
                self.directory.join(file).display().to_string()
            }
        };
        self.fit.recording.files.iter().map(found).collect()
    }
}

impl<'a> Plan<'a> {
    /// Reads the file that the arguments name, if any, and reports all mistakes. If a fit continues, the arguments must agree with it,
    /// except for the files.
    ///
    /// # Errors
    /// A data error for a file that cannot be read, usage errors naming all mistakes.
    pub fn new(args: &'a Args, saved: Option<Saved>) -> Result<Self, CliError> {
        let mut options = columns(&args.recording)?;
        for entry in &args.flags.entries {
            options.push(match entry.text("constraints").filter(|text| !["none", "find"].contains(text)) {
                None => entry.clone(),
                Some(file) => {
                    let table = toml::Table::try_from(formulas(Path::new(file))?).map_err(CliError::data)?;
                    entry.clone().with(table)
                }
            });
        }
        let mut layers = Layers::new(FitConfig::KEYS, args.run.config.as_deref(), options)?;
        // A rate and a column of times exclude each other.
        for (given, other) in
            [(args.recording.rate.is_some(), "recording.time"), (args.recording.time.is_some(), "recording.rate")]
        {
            if given {
                layers.forget(other);
            }
        }
        let timed = layers_time(&layers).is_some();
        add_implied(&mut layers, TRAINING, timed);
        if structure(&layers, TRAINING).unwrap_or(Structure::BlackBox) == Structure::BlackBox {
            layers.add_implied("training.network.time_like", |time| {
                let kind = ("training.penalty.kind".to_string(), "lorentzian-sylvester".into());
                vec![kind, ("training.penalty.time".to_string(), time.clone())]
            });
        }
        let plan = Self { args, config: FitConfig::default(), layers, saved };
        if let Some(saved) = &plan.saved {
            let config = plan.beside(saved)?;
            return Ok(Self { config, ..plan });
        }
        let (config, mut mistakes) = plan.over(Config { system: "measured".to_string(), ..Config::default() })?;
        mistakes.extend(config.faults(config.recording.coords.len()).into_iter().map(Mistake::from));
        mistakes.extend(plain_name(&config.training.system).err().map(|e| Mistake::new("training.system", e)));
        plan.layers.check(mistakes)?;
        let FitColumns { files, coords, .. } = &config.recording;
        for (key, list) in [("recording.files", files), ("recording.coords", coords)] {
            if list.is_empty() {
                plan.layers.check(vec![Mistake::new(key, "expected a value here or as an argument")])?;
            }
        }
        Ok(Self { config, ..plan })
    }

    /// The configuration of a fit to continue, with the files of the arguments.
    fn beside(&self, saved: &Saved) -> Result<FitConfig, CliError> {
        let (mut config, mistakes) = self.layers.over(&saved.fit)?;
        self.layers.check(mistakes)?;
        self.finish(&mut config.training, &saved.fit.training.data)?;
        if saved.fit.shooting.is_none() {
            config.shooting = None;
        }
        let directory = self.args.run.resume.as_deref().unwrap_or(Path::new(""));
        require_same(directory, &saved.fit.without_files(), &config.without_files())?;
        if self.args.recording.data.is_empty() {
            config.recording.files = saved.files();
        }
        Ok(config)
    }

    /// Completes a training of merged layers for recorded states, whose numbers and bounds depend on the data alone; `data` holds them.
    fn finish(&self, training: &mut Config, data: &Data) -> Result<(), CliError> {
        let acceleration_weighting = training.data.acceleration_weighting;
        training.data = Data { acceleration_weighting, ..data.clone() };
        for phase in &mut training.phases {
            [&mut phase.position, &mut phase.velocity].into_iter().for_each(Vec::clear);
            phase.log_uniform.clear();
        }
        fill_periods(training, &self.layers, TRAINING);
        self.args.run.finish(training)
    }

    /// The text that identifies a fit in its checkpoints.
    ///
    /// # Errors
    /// A configuration that TOML cannot hold.
    pub fn identity(&self, config: &FitConfig) -> Result<String, CliError> {
        match &self.saved {
            Some(saved) => Ok(saved.text.clone()),
            None => toml::to_string(&Saved::begin(config.clone())).map_err(CliError::data),
        }
    }

    /// The files of the recorded motion.
    pub fn files(&self) -> Vec<PathBuf> {
        let given = &self.args.recording.data;
        if given.is_empty() { self.config.recording.files.iter().map(PathBuf::from).collect() } else { given.clone() }
    }

    /// Settings that apply before the configuration exists.
    pub fn options(&self) -> FitOptions {
        FitOptions::from(&self.config)
    }

    /// Rejects a time-like coordinate that is not in the list.
    ///
    /// # Errors
    /// A usage error that names them.
    pub fn require_time(&self, coordinates: &[String]) -> Result<(), CliError> {
        let Some(time) = self.config.training.network.time_like.as_ref().filter(|time| !coordinates.contains(time))
        else {
            return Ok(());
        };
        let problem = format!("expected one of the coordinates {}, found {time}", coordinates.join(", "));
        self.layers.check(vec![Mistake::new("training.network.time_like", problem)])
    }

    /// The configuration for the data: settings that suit them, overridden by files and arguments.
    ///
    /// # Errors
    /// A model to start from that cannot be read, a schedule that cannot be scaled, a file of a known part that is wrong.
    pub fn configure(&self, prepared: &PreparedFit<'_>) -> Result<FitConfig, CliError> {
        if self.saved.is_some() {
            return Ok(self.config.clone());
        }
        let targets = prepared.targets();
        let Config { system, precision, .. } = &self.config.training;
        let mut suggested = prepared.suggest_training(system, *precision)?;
        let has_epochs = self.args.run.epochs.is_some() || self.layers.has("training.phase[0].epochs");
        if targets == Targets::Motion && !has_epochs {
            shorten(&mut suggested);
        }
        let data = suggested.data.clone();
        let FitConfig { mut training, horizon, formula, members, recording, shooting, .. } = self.over(suggested)?.0;
        self.finish(&mut training, &data)?;
        self.refuse_overruled(&training, shooting.as_ref(), targets)?;
        let recording = FitColumns { files: recording.files, ..FitColumns::from(&prepared.reading.columns) };
        // A printed configuration always contains the keys of multiple shooting.
        let shooting = shooting.filter(|_| targets == Targets::Motion || self.args.run.print_config.is_some());
        Ok(FitConfig { formula, members, ..prepared.config(training, horizon, recording, shooting) })
    }

    /// Rejects keys that would have no effect: keys that the recording decides, and keys of multiple shooting if there is none.
    fn refuse_overruled(
        &self,
        training: &Config,
        shooting: Option<&Shooting>,
        targets: Targets,
    ) -> Result<(), CliError> {
        let decided = |key: &str| {
            let Some(key) = key.strip_prefix(TRAINING) else { return false };
            let bounds = [".position", ".velocity", ".log_uniform"];
            // A configuration written by a fit contains the numbers of states, which depend on other keys.
            let follows = ["training", "validation", "test"].map(|part| format!("data.{part}"));
            let free = key == "data.acceleration_weighting" || follows.iter().any(|part| part == key);
            (key.starts_with("data.") && !free)
                || (key.starts_with("phase[") && bounds.iter().any(|end| key.ends_with(end)))
                || ["parameters", "description"].iter().any(|name| key.split('.').next() == Some(name))
        };
        // Recorded motion has no system with parameters.
        let training = Config { parameters: Default::default(), description: None, ..training.clone() };
        let finished = FitConfig { training, shooting: shooting.cloned(), ..FitConfig::default() };
        let finished = toml::Value::try_from(&finished).map_err(CliError::data)?;
        let why = "the recording decides this in a fit: leave the key out";
        let mut mistakes = self.layers.overruled(&finished, decided, why);
        if targets != Targets::Motion {
            let usual = match self.layers.has("training.network.known") {
                true => Shooting::grey_box(),
                false => Shooting::default(),
            };
            let usual = FitConfig { shooting: Some(usual), ..FitConfig::default() };
            let usual = toml::Value::try_from(&usual).map_err(CliError::data)?;
            let why = "only a fit to the motion itself (targets motion) has multiple shooting";
            mistakes.extend(self.layers.overruled(&usual, |key| key.starts_with("shooting."), why));
        }
        self.layers.check(mistakes)
    }

    /// Merges the layers over this training, with the values that they imply.
    fn over(&self, training: Config) -> Result<(FitConfig, Vec<Mistake>), CliError> {
        let mut config = FitConfig { training, shooting: Some(Shooting::default()), ..FitConfig::default() };
        if self.layers.has("training.network.known") {
            config.take_known(None);
        }
        let training = &mut config.training;
        training.network.time_like = layers_time(&self.layers).map(str::to_string);
        if let Some(time) = &training.network.time_like {
            training.penalty =
                Regularizer::LorentzianSylvester { lambda: training.penalty.lambda(), time: time.clone() };
        }
        if let Some(structure) = structure(&self.layers, TRAINING) {
            restructure(training, structure);
        }
        if let Some(from) = self.layers.text("training.from") {
            StartModel::read(from)?.shape(training);
        }
        self.layers.over(&config)
    }
}

/// The time-like coordinate that the layers name.
fn layers_time(layers: &Layers) -> Option<&str> {
    layers.text("training.network.time_like").or_else(|| layers.text("training.penalty.time"))
}

/// Files and columns from the arguments.
fn columns(args: &RecordingArgs) -> Result<Vec<Entry>, CliError> {
    let files = args.data.iter().map(|file| file.display().to_string()).collect();
    let columns = FitColumns { files, ..FitColumns::from(&args.meaning()) };
    let table = toml::Table::try_from(&columns).map_err(CliError::data)?;
    let given = table.into_iter().filter(|(_, value)| value.as_array().is_none_or(|list| !list.is_empty()));
    let option = |name: &str| if name == "files" { "DATA".to_string() } else { format!("--{name}") };
    Ok(given.map(|(name, value)| Entry::option(option(&name), &format!("recording.{name}"), value)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    #[command(no_binary_name = true)]
    struct Words {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn arguments_stand_over_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("fit.toml");
        let text = "held_out = 0.1\n[recording]\nfiles = [\"a.csv\"]\ncoords = [\"x\"]\nrate = 5.0\n\
                    [training.network]\ntime_like = \"x\"\n";
        std::fs::write(&file, text).unwrap();
        let plan = |more: &[&str]| {
            let line = [&["--config", file.to_str().unwrap()], more].concat();
            let args = Words::try_parse_from(line).unwrap().args;
            Plan::new(&args, None).map(|plan| plan.config)
        };
        let config = plan(&[]).unwrap();
        assert_eq!((config.held_out, config.recording.rate), (0.1, Some(5.0)));
        assert!(matches!(&config.training.penalty, Regularizer::LorentzianSylvester { time, .. } if time == "x"));
        let config = plan(&["b.csv", "--time", "t", "--hold-out", "0", "--structure", "metric"]).unwrap();
        assert_eq!(
            (config.held_out, config.recording.rate, config.recording.files),
            (0.0, None, vec!["b.csv".to_string()])
        );
        assert_eq!(config.training.penalty, Regularizer::None);
        let refusal = plan(&["--hold-out", "2", "--set", "recording.units=[\"x\"]"]).unwrap_err().to_string();
        assert!(refusal.contains("--hold-out: held_out") && refusal.contains("recording.units[0]"), "{refusal}");
    }
}
