//! Options for what is changed most, of `train` and `fit` alike.

use crate::cli::number::{number, positive, whole};
use crate::cli::{CliError, chosen};
use crate::configuration::{
    BESIDE_A_TIME, Config, Known, MOST_EPOCHS, MOST_LAMBDA, MOST_RATE, PenaltyKind, Regularizer,
};
use crate::network::file::MAX_WIDTH;
use crate::network::{ActivationChoice, Initialization, Structure};
use clap::builder::{PossibleValue, PossibleValuesParser};

/// Changes of a configuration.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Changes {
    /// Widths of the hidden layers [default: the configuration's; 128,128,128 in the preset quick and in fits].
    #[arg(long, value_name = "W1,W2,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = whole(1, MAX_WIDTH))]
    pub hidden: Vec<usize>,
    #[arg(long, value_name = "NAME", value_parser = activation, help = format!(
        "Activation of the hidden layers: {}; the last is two networks of half the widths [default: the configuration's, gelu in all presets]",
        ActivationChoice::NAMES
    ))]
    pub activation: Option<ActivationChoice>,
    /// Way in which the Lagrangian is made of the network's outputs: black-box, mechanical (a positive mass matrix, potentials) or metric (of
    /// geodesics, with its signature); the last two need no penalty and have none unless one is chosen [default: the
    /// configuration's, black-box in all presets].
    #[arg(long, value_name = "NAME", value_parser = structure)]
    pub structure: Option<Structure>,
    /// Coordinates that the Lagrangian does not depend on, their momenta conserved exactly.
    #[arg(long, value_name = "C1,C2,..", value_delimiter = ',')]
    pub cyclic: Vec<String>,
    /// Make the Lagrangian even in the velocities: motion can be run backwards.
    #[arg(long)]
    pub even_in_v: bool,
    /// Learn the factor alpha of the added |v|^2 of a black box.
    #[arg(long)]
    pub learn_alpha: bool,
    /// System file of a Lagrangian that is known: it is added to what the network learns, and its parameters marked learn are
    /// learned too.
    #[arg(long, value_name = "FILE.toml")]
    pub known: Option<String>,
    /// Penalty that keeps the signature of the mass matrix.
    #[arg(long, value_name = "KIND", value_parser = penalties())]
    pub penalty: Option<String>,
    /// Weight of the penalty beside the loss.
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = number(0.0, MOST_LAMBDA))]
    pub lambda: Option<f64>,
    /// Learning rate of the first phase; the rates of later phases and all lowest rates are scaled with it.
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = learning_rate)]
    pub learning_rate: Option<f64>,
    /// Epochs of all phases together; the whole schedule is scaled, with the periods of its rates.
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = whole(1, MOST_EPOCHS))]
    pub epochs: Option<usize>,
}

/// The kinds of penalty by name.
fn penalties() -> PossibleValuesParser {
    let value =
        |kind: &PenaltyKind| PossibleValue::new(kind.name).help(kind.purpose.trim_start().trim_end_matches('.'));
    PossibleValuesParser::new(Regularizer::KINDS.iter().map(value))
}

/// A learning rate.
fn learning_rate(text: &str) -> Result<f64, String> {
    let refused = || format!("expected a number above 0, at most {MOST_RATE}");
    positive(text).ok().filter(|rate| *rate <= MOST_RATE).ok_or_else(refused)
}

/// An activation by name.
fn activation(text: &str) -> Result<ActivationChoice, String> {
    let known = ActivationChoice::ALL.map(ActivationChoice::name);
    let found = ActivationChoice::ALL.into_iter().find(|choice| choice.name() == text);
    found.ok_or_else(|| crate::names::unknown("activation", text, known))
}

/// A structure by name.
fn structure(text: &str) -> Result<Structure, String> {
    let known = Structure::ALL.map(Structure::name);
    let found = Structure::ALL.into_iter().find(|choice| choice.name() == text);
    found.ok_or_else(|| crate::names::unknown("structure", text, known))
}

impl Changes {
    /// Changes a configuration; `time` is the time-like coordinate of the system, if it has one, and `how` says how to name
    /// one otherwise.
    ///
    /// # Errors
    /// A usage error for options that contradict each other or the configuration.
    pub fn apply(&self, config: &mut Config, time: Option<&str>, how: &str) -> Result<(), CliError> {
        if !self.hidden.is_empty() {
            config.network.hidden.clone_from(&self.hidden);
        }
        if let Some(activation) = self.activation {
            config.network.activation = activation;
        }
        if let Some(structure) = self.structure {
            config.take_structure(structure);
        }
        if !self.cyclic.is_empty() {
            config.network.cyclic.clone_from(&self.cyclic);
        }
        config.network.even_in_v |= self.even_in_v;
        if let Some(path) = &self.known {
            config.network.known = Some(Known::File(path.clone()));
            // What is known has its own kinetic energy, and the network begins with next to nothing beside it.
            config.network.alpha = 0.0;
            config.network.initialization = Initialization::NearZero;
        }
        if let Some(Known::File(path)) = &config.network.known {
            let system = chosen::system(path)?;
            let Some(described) = &system.described else {
                return Err(CliError::usage(format_args!(
                    "--known {path}: expected the file of a system, ending in .toml"
                )));
            };
            config.network.known = Some(Known::Description(Box::new(described.description.clone())));
        }
        config.network.learn_alpha |= self.learn_alpha;
        self.penalise(config, time, how)?;
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

    fn penalise(&self, config: &mut Config, time: Option<&str>, how: &str) -> Result<(), CliError> {
        let lambda = self.lambda.unwrap_or(match config.penalty {
            // The weight of the presets quick and best.
            Regularizer::None => 100.0,
            _ => config.penalty.lambda(),
        });
        let kind = match (&self.penalty, &config.penalty) {
            (Some(kind), _) => kind.clone(),
            (None, _) if self.lambda.is_none() => return Ok(()),
            (None, Regularizer::None) => {
                return Err(CliError::usage("--lambda: there is no penalty to weigh, choose one by --penalty"));
            }
            (None, penalty) => penalty.kind().to_string(),
        };
        if kind == Regularizer::None.kind() && self.lambda.is_some() {
            return Err(CliError::usage("--lambda: --penalty none has no weight"));
        }
        let time = config.network.time_like.as_deref().or(time);
        let Some(penalty) = Regularizer::of_kind(&kind, lambda, config.penalty.time().or(time)) else {
            let problem = format!("{} has no time-like coordinate{how}", config.system);
            return Err(CliError::usage(format_args!("--penalty {kind}: {problem}")));
        };
        if let Some(time) = time.filter(|_| penalty.is_classical()) {
            let problem = format!("the coordinate {time} is a time, expected {BESIDE_A_TIME}");
            return Err(CliError::usage(format_args!("--penalty: {problem}")));
        }
        config.penalty = penalty;
        Ok(())
    }
}

/// Makes the phases last `total` epochs together, in the proportions they have.
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
        // An epoch at least for this phase and for each of the later ones.
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
    use crate::lagrangian::configure;
    use crate::presets::Preset;

    fn changed(preset: Preset, system: &str, changes: Changes) -> Result<Config, String> {
        let mut config = preset.config(&configure(system, &[]).unwrap()).unwrap();
        changes.apply(&mut config, None, "").map(|()| config).map_err(|e| e.to_string())
    }

    #[test]
    fn the_whole_schedule_is_scaled() {
        let of = |epochs, rate| {
            let changes = Changes { epochs: Some(epochs), learning_rate: rate, ..Changes::default() };
            changed(Preset::Paper, "double-pendulum", changes)
        };
        let phases = |config: Config| config.phases.iter().map(|p| (p.epochs, p.t_max)).collect::<Vec<_>>();
        assert_eq!(phases(of(70, None).unwrap()), [(30, 3.0), (20, 3.0), (20, 3.0)]);
        assert_eq!(phases(of(700, None).unwrap()), [(300, 30.0), (200, 30.0), (200, 30.0)]);
        assert_eq!(phases(of(3, None).unwrap()).iter().map(|p| p.0).collect::<Vec<_>>(), [1, 1, 1]);
        assert_eq!(phases(of(1001, None).unwrap()).iter().map(|p| p.0).sum::<usize>(), 1001);
        assert!(of(2, None).unwrap_err().contains("3 phases"));
        let config = of(700, Some(2e-3)).unwrap();
        assert_eq!((config.phases[0].rate, config.phases[0].eta_min), (2e-3, 2e-6));
        assert_eq!((config.phases[1].rate, config.phases[1].eta_min), (8e-5, 2e-7));
    }

    #[test]
    fn penalties_are_named_and_weighed() {
        let of = |system: &str, penalty: Option<&str>, lambda| {
            let penalty = penalty.map(str::to_string);
            changed(Preset::Quick, system, Changes { penalty, lambda, ..Changes::default() }).map(|c| c.penalty)
        };
        assert_eq!(of("kepler", None, Some(3.0)), Ok(Regularizer::Eigenvalue { lambda: 3.0 }));
        assert_eq!(of("kepler", Some("sylvester"), None), Ok(Regularizer::Sylvester { lambda: 100.0 }));
        assert_eq!(of("kepler", Some("none"), None), Ok(Regularizer::None));
        assert!(of("kepler", Some("none"), Some(1.0)).unwrap_err().contains("no weight"));
        assert!(of("kepler", Some("lorentzian-sylvester"), None).unwrap_err().contains("no time-like coordinate"));
        for classical in ["eigenvalue", "sylvester"] {
            let refused = of("ads4-geodesic", Some(classical), None).unwrap_err();
            assert!(refused.starts_with("--penalty: ") && refused.contains(BESIDE_A_TIME), "{refused}");
        }
        assert_eq!(of("ads4-geodesic", Some("none"), None), Ok(Regularizer::None));
        for system in ["ads4-geodesic", "kepler"] {
            assert_eq!(of(system, Some("signature"), Some(4.0)), Ok(Regularizer::Signature { lambda: 4.0 }));
        }
        let time = "t".to_string();
        let lorentzian = Regularizer::LorentzianSylvester { lambda: 2.0, time };
        assert_eq!(of("ads4-geodesic", None, Some(2.0)), Ok(lorentzian));
    }
}
