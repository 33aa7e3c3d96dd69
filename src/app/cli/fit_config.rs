//! The configuration of a fit, as `config.toml` holds it and `--config` reads it.

use crate::cli::CliError;
use crate::cli::config_file::ConfigFile;
use crate::cli::fit_args::Args;
use crate::cli::mistake::Mistake;
use crate::cli::number;
use crate::cli::print_config::{commented, with_seed};
use crate::cli::recording_args::{RecordingArgs, unit};
use crate::configuration::{Config, Data};
use crate::optimizers::Schedule;
use crate::pipeline::{FIT_SECTIONS, FitColumns, FitConfig, HELD_OUT};
use crate::presets::{Preset, SHOOTING_SECTION, Section, TRAINING_SECTIONS, section_reference};
use crate::shooting::Shooting;
use std::path::PathBuf;

/// Files and columns as the arguments give them.
pub fn columns_of(args: &RecordingArgs) -> FitColumns {
    let files = args.data.iter().map(|file| file.display().to_string()).collect();
    FitColumns { files, ..FitColumns::from(&args.meaning()) }
}

/// Arguments with these values where they say nothing.
fn under(columns: FitColumns, args: &RecordingArgs) -> RecordingArgs {
    let list = |said: &Vec<String>, here: Vec<String>| if said.is_empty() { here } else { said.clone() };
    let units = columns.units.iter().filter_map(|text| unit(text).ok());
    // A rate and a column of times exclude each other.
    let time = if args.rate.is_some() { None } else { args.time.clone().or(columns.time) };
    let rate = if args.time.is_some() { None } else { args.rate.or(columns.rate) };
    RecordingArgs {
        data: if args.data.is_empty() { columns.files.iter().map(PathBuf::from).collect() } else { args.data.clone() },
        coords: list(&args.coords, columns.coords),
        velocity: list(&args.velocity, columns.velocity),
        acceleration: list(&args.acceleration, columns.acceleration),
        force: list(&args.force, columns.force),
        time,
        rate,
        trajectory: args.trajectory.clone().or(columns.trajectory),
        periodic: list(&args.periodic, columns.periodic),
        units: if args.units.is_empty() { units.collect() } else { args.units.clone() },
        columns: list(&args.columns, columns.columns),
    }
}

/// Mistakes in the meaning of the columns.
fn column_mistakes(columns: &FitColumns) -> Vec<Mistake> {
    let wrong = |text: &String| unit(text).err();
    let units = columns.units.iter().enumerate();
    let units = units.filter_map(|(k, text)| Some(Mistake::new(format!("recording.units[{k}]"), wrong(text)?)));
    let rate = columns.rate.and_then(|rate| Some((rate, number::rate(&rate.to_string()).err()?)));
    let rate = rate.map(|(rate, problem)| Mistake::new("recording.rate", format!("{problem}, found {rate}")));
    let both = columns.time.is_some() && columns.rate.is_some();
    let both = both.then(|| Mistake::new("recording.rate", "there is a column of times beside it"));
    units.chain(rate).chain(both).collect()
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
        let (found, mut mistakes) = file.over(&stand_in()?)?;
        mistakes.extend(column_mistakes(&found.recording));
        mistakes.extend(found.faults(n).into_iter().map(Mistake::from));
        file.check(mistakes)?;
        let FitConfig { targets, held_out, window, noise, horizon, recording, shooting, training } = found;
        let mut args = args.clone();
        args.recording = under(recording, &args.recording);
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
        if let crate::configuration::Regularizer::LorentzianSylvester { time, .. } = training.penalty {
            args.timelike = args.timelike.or(Some(time));
        }
        if args.recording.data.is_empty() || args.recording.coords.is_empty() {
            let missing = if args.recording.data.is_empty() { "recording.files" } else { "recording.coords" };
            file.check(vec![Mistake::new("recording", format!("{missing}: neither here nor an argument"))])?;
        }
        let shooting = shooting.filter(|_| file.has("shooting"));
        Ok(Self { args, file: Some(file), shooting })
    }

    /// The configuration that suits the data with the values of the file. Numbers and bounds of states, which the data alone decide, are not
    /// read.
    ///
    /// # Errors
    /// A data error if the configuration cannot be written.
    pub fn training(&self, suggested: &Config) -> Result<Config, CliError> {
        self.file.as_ref().map_or_else(|| Ok(suggested.clone()), |file| training_of(file, suggested))
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

/// The suggested training with the values of a file.
fn training_of(file: &ConfigFile, suggested: &Config) -> Result<Config, CliError> {
    let base = FitConfig { training: suggested.clone(), ..stand_in()? };
    let mut training = file.over(&base)?.0.training;
    let acceleration_weighting = training.data.acceleration_weighting;
    training.data = Data { acceleration_weighting, ..suggested.data.clone() };
    for (k, phase) in training.phases.iter_mut().enumerate() {
        [&mut phase.position, &mut phase.velocity].into_iter().for_each(Vec::clear);
        phase.log_uniform.clear();
        let has = |key: &str| file.has(&format!("training.phase[{k}].{key}"));
        if has("epochs") && !has("t_max") && phase.schedule != Schedule::CosineAnnealing {
            phase.t_max = phase.epochs as f64;
        }
    }
    Ok(training)
}

/// A configuration to tell the types of a file's keys by.
fn stand_in() -> Result<FitConfig, CliError> {
    let system = crate::lagrangian::configure("double-pendulum", &[]).map_err(CliError::data)?;
    let mut training = Preset::Quick.config(&system).ok_or_else(|| CliError::data("there is no preset"))?;
    training.system = "measured".to_string();
    let (data, phase) = (&mut training.data, &mut training.phases[0]);
    let bounds =
        [&mut data.validation_position, &mut data.validation_velocity, &mut phase.position, &mut phase.velocity];
    bounds.into_iter().for_each(Vec::clear);
    Ok(FitConfig {
        targets: None,
        held_out: HELD_OUT,
        window: None,
        noise: None,
        horizon: None,
        recording: FitColumns::default(),
        shooting: Some(Shooting::default()),
        training,
    })
}

/// The configuration with comments.
///
/// # Errors
/// A configuration that TOML cannot hold.
pub fn commented_fit(config: &FitConfig) -> Result<String, CliError> {
    let mut unseeded = config.clone();
    unseeded.training.seed = 0;
    let table = toml::Table::try_from(unseeded).map_err(CliError::data)?;
    let named: Vec<(String, Section<'_>)> = TRAINING_SECTIONS
        .iter()
        .filter(|section| section.name != "parameters")
        .map(|section| (format!("training.{}", section.name).trim_end_matches('.').to_string(), *section))
        .collect();
    let training = named.iter().map(|(name, section)| Section { name, ..*section });
    let sections: Vec<Section<'_>> = FIT_SECTIONS.into_iter().chain([SHOOTING_SECTION]).chain(training).collect();
    Ok(with_seed(&commented(&sections, &table, &|_| None), config.training.seed))
}

/// Tables of the keys that a fit has beside those of a training.
pub fn fit_reference() -> String {
    FIT_SECTIONS.iter().map(|section| section_reference(section, &serde_json::Value::Null, "default")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::parse_config;
    use crate::recording::Targets;

    #[test]
    fn the_commented_configuration_is_the_configuration() {
        let mut config = stand_in().unwrap();
        for full in [false, true] {
            if full {
                (config.targets, config.window) = (Some(Targets::Motion), Some(21));
                (config.noise, config.horizon) = (Some(vec![0.1, 0.2]), Some(2.0));
                config.recording.files = vec!["a b.csv".to_string()];
                config.recording.units = vec!["x=deg".to_string()];
                (config.recording.rate, config.recording.time) = (Some(10.0), Some("t".to_string()));
            }
            let text = commented_fit(&config).unwrap();
            assert_eq!(parse_config::<FitConfig>(&text).unwrap(), config, "{text}");
            for key in FIT_SECTIONS.iter().flat_map(|section| section.keys) {
                assert!(text.contains(&format!("{} = ", key.name)), "{} is not in\n{text}", key.name);
            }
        }
        assert!(fit_reference().contains("| `held_out` |"));
    }

    /// Bounds, which files of earlier versions hold, are passed over; how states weigh is not.
    #[test]
    fn a_file_says_how_states_weigh_and_not_where_they_lie() {
        let text = "[training.data]\nacceleration_weighting = 0.5\ntraining = 7\nvalidation_position = [[0.0, 1.0]]\n\
                    [[training.phase]]\nposition = [[0.0, 1.0]]\nvelocity = [[0.0, 1.0]]\n";
        let suggested = stand_in().unwrap().training;
        let file = ConfigFile::parse("fit.toml".to_string(), text).unwrap();
        let training = training_of(&file, &suggested).unwrap();
        assert_eq!(training.data, Data { acceleration_weighting: 0.5, ..suggested.data.clone() });
        assert_eq!(training.phases, suggested.phases);
        assert!(training.validate(2).is_ok() && training.validate(3).is_ok());
    }
}
