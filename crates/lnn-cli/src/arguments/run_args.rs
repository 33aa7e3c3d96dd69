//! Options that `lnn train` and `lnn fit` share: where a run's choices come from, where it writes, how it continues.

use crate::CliError;
use crate::arguments::layers::Layers;
use crate::arguments::number::{positive_up_to, seconds, thread_count, whole};
use crate::arguments::print_config::PrintFormat;
use lnn::configuration::{Config, Known, MOST_EPOCHS, MOST_RATE};
use lnn::network::Structure;
use lnn::optimizers::Schedule;
use lnn::training::CheckpointInterval;
use std::path::PathBuf;
use toml::Value;

/// Options of a run.
#[derive(Clone, Debug, clap::Args)]
pub struct RunArgs {
    /// A configuration, such as the config.toml beside a model, or - for standard input. Missing keys have their default
    /// values, and options override it.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print the resulting configuration with comments, without learning; markdown prints a table of all keys.
    #[arg(long, value_enum, value_name = "FORMAT", num_args = 0..=1, require_equals = true, default_missing_value = "toml",
        conflicts_with = "resume")]
    pub print_config: Option<PrintFormat>,
    /// Learning rate of the first phase; the rates of later phases and all lowest rates are scaled in proportion.
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = positive_up_to(MOST_RATE))]
    pub learning_rate: Option<f64>,
    /// Epochs of all phases together; the schedule is scaled, including the periods of its rates.
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = whole(1, MOST_EPOCHS))]
    pub epochs: Option<usize>,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    pub threads: Option<usize>,
    /// Directory for everything the run writes; one that holds a run is refused [default: runs/NAME of the system, or the
    /// first free of runs/NAME-2, runs/NAME-3, ..].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace the run in the directory, including plots and evaluations of its model, once the new model is written.
    #[arg(long, conflicts_with = "resume")]
    pub overwrite: bool,
    /// Continue the interrupted run in this directory. Everything else comes from its checkpoint, including recorded data
    /// unless they are given again.
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    pub resume: Option<PathBuf>,
    /// Write a checkpoint every N epochs, or every T seconds if the number ends in s.
    #[arg(long, value_name = "N|Ts", default_value = "60s", allow_hyphen_values = true, value_parser = every)]
    pub checkpoint_every: CheckpointInterval,
    /// Print summary.json instead of tables.
    #[arg(long)]
    pub json: bool,
}

/// Parses the interval of checkpoints: `10` epochs, `90s`.
fn every(text: &str) -> Result<CheckpointInterval, String> {
    match text.trim().strip_suffix('s') {
        Some(text) => seconds(text).map(CheckpointInterval::Seconds),
        None => whole(1, MOST_EPOCHS)(text).map(CheckpointInterval::Epochs),
    }
    .map_err(|problem| format!("{problem}, of epochs, such as 10, or of seconds with an s, such as 90s"))
}

impl RunArgs {
    /// Completes a training: reads the file of a known part, and scales the schedule according to the options.
    ///
    /// # Errors
    /// Usage errors for a schedule that cannot be scaled and for the file, a data error for one that cannot be read.
    pub fn finish(&self, config: &mut Config) -> Result<(), CliError> {
        if let Some(Known::File(file)) = &config.network.known {
            let system = crate::arguments::system_arg::system(file)?;
            let Some(described) = &system.described else {
                let problem = "expected the file of a system, ending in .toml";
                return Err(CliError::usage(format_args!("network.known: {problem}, found {file:?}")));
            };
            config.network.known = Some(Known::Description(Box::new(described.description.clone())));
        }
        if let Some(rate) = self.learning_rate
            && let Some(first) = config.phases.first().map(|phase| phase.rate)
        {
            let factor = rate / first;
            for phase in &mut config.phases {
                (phase.rate, phase.eta_min) = (phase.rate * factor, phase.eta_min * factor);
            }
            config.phases[0].rate = rate;
        }
        self.epochs.map_or(Ok(()), |epochs| scale_epochs(config, epochs))
    }
}

/// Sets `t_max` of the phases equal to their epochs, if only the epochs were given and the schedule is not periodic; `path` is that of the
/// training in the merged layers.
pub fn fill_periods(config: &mut Config, layers: &Layers, path: &str) {
    for (k, phase) in config.phases.iter_mut().enumerate() {
        let has = |key: &str| layers.has(&format!("{path}phase[{k}].{key}"));
        if has("epochs") && !has("t_max") && phase.schedule != Schedule::CosineAnnealing {
            phase.t_max = phase.epochs as f64;
        }
    }
}

/// Adds the values that options of the network imply for other keys; `path` is that of the training.
pub fn add_implied(layers: &mut Layers, path: &str, timed: bool) {
    let at = |key: &str, value: Value| (format!("{path}{key}"), value);
    layers.add_implied(&format!("{path}network.structure"), |structure| {
        let mut model = Config::default();
        model.network.time_like = timed.then(String::new);
        let structure = Structure::ALL.into_iter().find(|known| structure.as_str() == Some(known.name()));
        model.take_structure(structure.unwrap_or(Structure::BlackBox));
        let factor = Value::try_from(model.network.factor).unwrap_or_else(|_| "triangle".into());
        let mut also = vec![at("network.factor", factor)];
        if structure.is_some_and(|structure| structure != Structure::BlackBox) {
            also.extend([at("penalty.kind", "none".into()), at("network.learn_alpha", false.into())]);
            // The states of a fit come from its recording.
            also.extend(path.is_empty().then(|| at("data.rescaled_fraction", 0.0.into())));
        }
        also
    });
    // A known part has its own kinetic energy, and the output of the additional network starts near zero.
    layers.add_implied(&format!("{path}network.known"), |_| {
        vec![at("network.alpha", 0.0.into()), at("network.initialization", "near-zero".into())]
    });
}

/// The structure that the layers set for the network at `path`.
pub fn structure(layers: &Layers, path: &str) -> Option<Structure> {
    let name = layers.text(&format!("{path}network.structure"))?;
    Structure::ALL.into_iter().find(|known| known.name() == name)
}

/// Scales the epochs of the phases in proportion so that they sum to `total`.
fn scale_epochs(config: &mut Config, total: usize) -> Result<(), CliError> {
    let phases = config.phases.len();
    if total < phases {
        return Err(CliError::usage(format_args!(
            "--epochs {total}: the schedule has {phases} phases, expected at least {phases}"
        )));
    }
    let all: usize = config.phases.iter().map(|phase| phase.epochs).sum();
    let (mut before, mut given) = (0, 0);
    for (k, phase) in config.phases.iter_mut().enumerate() {
        before += phase.epochs;
        // At least one epoch remains for this phase and for each later one.
        let end = (total as f64 * before as f64 / all as f64).round() as usize;
        let end = end.clamp(given + 1, total - (phases - 1 - k));
        phase.t_max *= (end - given) as f64 / phase.epochs as f64;
        phase.epochs = end - given;
        given = end;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lnn::lagrangian::SystemInstance;
    use lnn::presets::Preset;

    #[test]
    fn the_whole_schedule_is_scaled() {
        let of = |total| {
            let mut config = Preset::Paper.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
            scale_epochs(&mut config, total)?;
            Ok::<_, CliError>(config.phases.iter().map(|p| (p.epochs, p.t_max)).collect::<Vec<_>>())
        };
        assert_eq!(of(70).unwrap(), [(30, 3.0), (20, 3.0), (20, 3.0)]);
        assert_eq!(of(700).unwrap(), [(300, 30.0), (200, 30.0), (200, 30.0)]);
        assert_eq!(of(3).unwrap().iter().map(|p| p.0).collect::<Vec<_>>(), [1, 1, 1]);
        assert_eq!(of(1001).unwrap().iter().map(|p| p.0).sum::<usize>(), 1001);
        assert!(of(2).is_err());
    }
}
