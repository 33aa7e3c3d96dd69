//! The configuration of a fit, as `config.toml` holds it and `--config` reads it.

use crate::cli::CliError;
use crate::cli::config_file::{ConfigFile, Mistake};
use crate::cli::fit_args::Args;
use crate::cli::number::{count, positive};
use crate::cli::print_config::{commented, with_seed};
use crate::cli::recording_args::{RecordingArgs, unit};
use crate::recording::Targets;
use crate::training::shooting::Shooting;
use crate::training::{Config, Key, Preset, SHOOTING_SECTION, Schedule, Section, TRAINING_SECTIONS, section_reference};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Everything that determines a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitConfig {
    /// Targets to learn from; as the data advise if they are not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub targets: Option<Targets>,
    /// Share of the samples that is held out; 0: none.
    pub held_out: f64,
    /// Length of the smoothing windows in samples; chosen if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<usize>,
    /// Noise of the coordinates in SI units; estimated if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<Vec<f64>>,
    /// Time over which held-out motion is predicted, in s; chosen if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<f64>,
    /// The files and what their columns mean.
    #[serde(default)]
    pub recording: Recording,
    /// Multiple shooting, of a fit to the motion itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shooting: Option<Shooting>,
    /// The supervised training.
    pub training: Config,
}

impl FitConfig {
    /// The same of files that may have other names.
    pub fn without_files(&self) -> Self {
        let mut other = self.clone();
        other.recording.files.clear();
        other
    }
}

/// The files and what their columns mean, as [`RecordingArgs`] say it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Recording {
    pub files: Vec<String>,
    pub coords: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub velocity: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub acceleration: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trajectory: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub periodic: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub units: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<String>,
}

impl Recording {
    /// Files and columns as the arguments give them.
    pub fn of(args: &RecordingArgs) -> Self {
        Self {
            files: args.data.iter().map(|file| file.display().to_string()).collect(),
            coords: args.coords.clone(),
            velocity: args.velocity.clone(),
            acceleration: args.acceleration.clone(),
            force: args.force.clone(),
            time: args.time.clone(),
            rate: args.rate,
            trajectory: args.trajectory.clone(),
            periodic: args.periodic.clone(),
            units: args.units.iter().map(|(column, unit)| format!("{column}={unit}")).collect(),
            columns: args.columns.clone(),
        }
    }

    /// Arguments with these values where they say nothing.
    fn under(self, args: &RecordingArgs) -> RecordingArgs {
        let list = |said: &Vec<String>, here: Vec<String>| if said.is_empty() { here } else { said.clone() };
        let units = self.units.iter().filter_map(|text| unit(text).ok());
        // A rate and a column of times exclude each other.
        let time = if args.rate.is_some() { None } else { args.time.clone().or(self.time) };
        let rate = if args.time.is_some() { None } else { args.rate.or(self.rate) };
        RecordingArgs {
            data: if args.data.is_empty() { self.files.iter().map(PathBuf::from).collect() } else { args.data.clone() },
            coords: list(&args.coords, self.coords),
            velocity: list(&args.velocity, self.velocity),
            acceleration: list(&args.acceleration, self.acceleration),
            force: list(&args.force, self.force),
            time,
            rate,
            trajectory: args.trajectory.clone().or(self.trajectory),
            periodic: list(&args.periodic, self.periodic),
            units: if args.units.is_empty() { units.collect() } else { args.units.clone() },
            columns: list(&args.columns, self.columns),
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let wrong = |text: &String| unit(text).err();
        let units = self.units.iter().enumerate();
        let units = units.filter_map(|(k, text)| Some(Mistake::new(format!("recording.units[{k}]"), wrong(text)?)));
        let rate = self.rate.filter(|rate| positive(&rate.to_string()).is_err());
        let rate = rate.map(|rate| Mistake::new("recording.rate", format!("expected a number above 0, found {rate}")));
        let both = self.time.is_some() && self.rate.is_some();
        let both = both.then(|| Mistake::new("recording.rate", "there is a column of times beside it"));
        units.chain(rate).chain(both).collect()
    }
}

/// The configuration file of a fit, and the arguments with its values where they say nothing.
pub struct Settled {
    /// The arguments.
    pub args: Args,
    file: Option<ConfigFile>,
    shooting: Option<Shooting>,
}

impl Settled {
    /// Reads the file that the arguments name, if they do, and looks for everything that is wrong in it.
    ///
    /// # Errors
    /// A data error for a file that cannot be read, usage errors for everything in it.
    pub fn of(args: &Args) -> Result<Self, CliError> {
        let Some(path) = &args.config else {
            return Ok(Self { args: args.clone(), file: None, shooting: None });
        };
        let file = ConfigFile::read(path)?;
        let coordinates = file.get(&["recording", "coords"]).and_then(toml::Value::as_array).map_or(0, Vec::len);
        let n = if args.recording.coords.is_empty() { coordinates } else { args.recording.coords.len() };
        let (found, mut mistakes) = file.over(&stand_in(n)?)?;
        mistakes.extend(found.mistakes(n));
        file.check(mistakes)?;
        let FitConfig { targets, held_out, window, noise, horizon, recording, shooting, training } = found;
        let mut args = args.clone();
        args.recording = recording.under(&args.recording);
        args.targets = args.targets.or(targets.map(Into::into));
        args.hold_out = args.hold_out.or(Some(held_out));
        args.window = args.window.or(window);
        args.noise = args.noise.or(noise);
        args.horizon = args.horizon.or(horizon);
        args.friction = args.friction.or(training.network.dissipation);
        args.seed = args.seed.or(file.large(&["training", "seed"])).or(Some(training.seed));
        args.name = args.name.or(file.has("training.system").then_some(training.system));
        args.precision = args.precision.or(Some(training.precision.into()));
        args.from = args.from.or(training.from);
        if let crate::training::Regularizer::LorentzianSylvester { time, .. } = training.penalty {
            args.timelike = args.timelike.or(Some(time));
        }
        if args.recording.data.is_empty() || args.recording.coords.is_empty() {
            let missing = if args.recording.data.is_empty() { "recording.files" } else { "recording.coords" };
            file.check(vec![Mistake::new("recording", format!("{missing}: neither here nor an argument"))])?;
        }
        let shooting = shooting.filter(|_| file.has("shooting"));
        Ok(Self { args, file: Some(file), shooting })
    }

    /// The configuration that suits the data with the values of the file. What the data alone decide, numbers and bounds of
    /// states, is not read.
    ///
    /// # Errors
    /// A data error if the configuration cannot be written.
    pub fn training(&self, suggested: &Config) -> Result<Config, CliError> {
        let Some(file) = &self.file else { return Ok(suggested.clone()) };
        let base = FitConfig { training: suggested.clone(), ..stand_in(suggested.data.validation_position.len())? };
        let mut training = file.over(&base)?.0.training;
        training.data.clone_from(&suggested.data);
        for (k, phase) in training.phases.iter_mut().enumerate() {
            let all = &suggested.phases[0];
            (phase.position, phase.velocity) = (all.position.clone(), all.velocity.clone());
            phase.logarithmic.clear();
            let has = |key: &str| file.has(&format!("training.phase[{k}].{key}"));
            if has("epochs") && !has("t_max") && phase.schedule != Schedule::CosineAnnealing {
                phase.t_max = phase.epochs as f64;
            }
        }
        Ok(training)
    }

    /// `true` if the file gives the number of epochs.
    pub fn has_epochs(&self) -> bool {
        self.file.as_ref().is_some_and(|file| file.has("training.phase[0].epochs"))
    }

    /// Multiple shooting by the file, if it says anything of it.
    pub fn shooting(&self) -> Option<Shooting> {
        self.shooting.clone()
    }
}

/// A configuration to tell the types of a file's keys by, for `n` coordinates.
fn stand_in(n: usize) -> Result<FitConfig, CliError> {
    let system = crate::lagrangian::configure("double-pendulum", &[]).map_err(CliError::data)?;
    let mut training = Preset::Quick.config(&system).ok_or_else(|| CliError::data("there is no preset"))?;
    let bounds = vec![[0.0, 0.0]; n];
    training.system = "measured".to_string();
    training.data.validation_position.clone_from(&bounds);
    training.data.validation_velocity.clone_from(&bounds);
    (training.phases[0].position, training.phases[0].velocity) = (bounds.clone(), bounds);
    Ok(FitConfig {
        targets: None,
        held_out: HELD_OUT,
        window: None,
        noise: None,
        horizon: None,
        recording: Recording::default(),
        shooting: Some(Shooting::default()),
        training,
    })
}

/// Share of the samples that is held out unless told otherwise.
pub const HELD_OUT: f64 = 0.2;

impl FitConfig {
    fn mistakes(&self, n: usize) -> Vec<Mistake> {
        let mut found = self.recording.mistakes();
        if !(0.0..1.0).contains(&self.held_out) {
            found.push(Mistake::new("held_out", format!("expected 0 or a share below 1, found {}", self.held_out)));
        }
        if let Some(window) = self.window.filter(|w| count(&w.to_string()).is_err()) {
            found.push(Mistake::new("window", format!("expected a whole number above 0, found {window}")));
        }
        let numbers =
            self.noise.iter().flatten().map(|x| ("noise", x)).chain(self.horizon.iter().map(|x| ("horizon", x)));
        for (key, x) in numbers.filter(|(_, x)| !(x.is_finite() && **x > 0.0)) {
            found.push(Mistake::new(key, format!("expected a finite number above 0, found {x}")));
        }
        let training = self.training.faults(n).into_iter().map(|mut fault| {
            fault.field.insert_str(0, "training.");
            fault
        });
        // What the data decide is not read: nothing can be wrong with it.
        let decided = ["training.data.", "position", "velocity", "logarithmic"];
        let training = training.filter(|fault| !decided.iter().any(|part| fault.field.contains(part)));
        let shooting = self.shooting.iter().flat_map(Shooting::faults);
        found.extend(training.chain(shooting).map(Mistake::from));
        found
    }

    /// The configuration with comments.
    ///
    /// # Errors
    /// A configuration that TOML cannot hold.
    pub fn commented(&self) -> Result<String, CliError> {
        let mut unseeded = self.clone();
        unseeded.training.seed = 0;
        let table = toml::Table::try_from(unseeded).map_err(CliError::data)?;
        let named: Vec<(String, Section<'_>)> = TRAINING_SECTIONS
            .iter()
            .filter(|section| section.name != "parameters")
            .map(|section| (format!("training.{}", section.name).trim_end_matches('.').to_string(), *section))
            .collect();
        let training = named.iter().map(|(name, section)| Section { name, ..*section });
        let sections: Vec<Section<'_>> = FIT_SECTIONS.into_iter().chain([SHOOTING_SECTION]).chain(training).collect();
        Ok(with_seed(&commented(&sections, &table, &|_| None), self.training.seed))
    }

    /// Tables of the keys that a fit has beside those of a training.
    pub fn reference() -> String {
        FIT_SECTIONS.iter().map(|section| section_reference(section, &serde_json::Value::Null, "default")).collect()
    }
}

const fn optional(name: &'static str, example: &'static str, values: &'static str, purpose: &'static str) -> Key {
    Key { name, values, purpose, example }
}

/// The tables of a fit beside multiple shooting and those of a training.
pub const FIT_SECTIONS: [Section<'static>; 2] = [
    Section {
        name: "",
        purpose: "",
        keys: &[
            optional(
                "targets",
                "\"smoothed\"",
                "measured, smoothed, motion",
                "What is learned from: measured accelerations, smoothed ones, or the motion itself; as the data advise unless \
                 set.",
            ),
            optional("held_out", "0.2", "0 to below 1", "Share of the samples held out to judge the model; 0: none."),
            optional("window", "21", "an odd number of samples", "Length of the smoothing windows; chosen unless set."),
            optional("noise", "[0.01, 0.01]", "in SI units", "Noise of every coordinate; estimated unless set."),
            optional(
                "horizon",
                "0.5",
                "above 0, in s",
                "How far ahead held-out motion is predicted; chosen unless set.",
            ),
        ],
    },
    Section {
        name: "recording",
        purpose: "The files and what their columns mean, as the options of the same names say it.",
        keys: &[
            optional("files", "[\"data.csv\"]", "paths", "Files of recorded motion: CSV, NPY or NPZ."),
            optional(
                "coords",
                "[\"q1\", \"q2\"]",
                "columns",
                "Columns of the coordinates, by name or by number from 1.",
            ),
            optional("velocity", "[\"v1\", \"v2\"]", "columns", "Columns of measured velocities."),
            optional("acceleration", "[\"a1\", \"a2\"]", "columns", "Columns of measured accelerations."),
            optional("force", "[\"f1\", \"f2\"]", "columns", "Columns of known external generalized forces."),
            optional("time", "\"t\"", "a column", "Column of time."),
            optional("rate", "100.0", "above 0, in samples per second", "Rate, if no column holds the time."),
            optional("trajectory", "\"run\"", "a column", "Column whose value tells the trajectories of a file apart."),
            optional("periodic", "[\"q1\"]", "coordinates", "Coordinates that are angles."),
            optional("units", "[\"q1=deg\"]", "COLUMN=UNIT", "Units of columns that are not SI, or factors to SI."),
            optional("columns", "[\"t\", \"q1\"]", "names", "Names of all columns of files without a header."),
        ],
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::parse_config;

    #[test]
    fn the_commented_configuration_is_the_configuration() {
        let mut config = stand_in(2).unwrap();
        for full in [false, true] {
            if full {
                (config.targets, config.window) = (Some(Targets::Motion), Some(21));
                (config.noise, config.horizon) = (Some(vec![0.1, 0.2]), Some(2.0));
                config.recording.files = vec!["a b.csv".to_string()];
                config.recording.units = vec!["x=deg".to_string()];
                (config.recording.rate, config.recording.time) = (Some(10.0), Some("t".to_string()));
            }
            let text = config.commented().unwrap();
            assert_eq!(parse_config::<FitConfig>(&text).unwrap(), config, "{text}");
            for key in FIT_SECTIONS.iter().flat_map(|section| section.keys) {
                assert!(text.contains(&format!("{} = ", key.name)), "{} is not in\n{text}", key.name);
            }
        }
        assert!(FitConfig::reference().contains("| `held_out` |"));
    }
}
