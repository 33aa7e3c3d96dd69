//! Configurations that ship with the program.

use crate::configuration::{Config, Data, FRICTION_UNITS, Network, Optimizer, PENALTY, Phase, Regularizer, Scaling};
use crate::data::boxes;
use crate::lagrangian::SystemInstance;
use crate::lagrangian::system::{Bounds, PaperBudget, PaperPhase, ShellAdvice, StateAdvice};
use crate::network::{Factor, Structure};
use crate::optimizers::Method;
use crate::optimizers::Schedule;
use std::f64::consts::PI;

/// A configuration by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// Trains a useful model within a minute on two cores.
    Quick,
    /// Wider layers and more epochs than [`Preset::Quick`].
    Best,
    /// Uses the budget and the settings of the paper.
    Paper,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 3] = [Self::Quick, Self::Best, Self::Paper];

    /// Returns its name in options.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Quick => "quick",
            Self::Best => "best",
            Self::Paper => "paper",
        }
    }

    /// Describes it in a few words.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Quick => "A minute on two cores",
            Self::Best => "Wider layers and more epochs: five minutes on two cores",
            Self::Paper => "The paper's budget and choices: hours",
        }
    }

    /// The configuration of a system; `None` if the preset has none for it.
    pub fn config(self, system: &SystemInstance<f64>) -> Option<Config> {
        match self {
            Self::Quick => Some(ours(system, quick())),
            Self::Best => Some(ours(system, BEST)),
            Self::Paper => paper(system),
        }
    }

    /// The configuration of a system for a Lagrangian of this structure. If the structure fixes the signature, our own presets use another
    /// rate and, except around a centre, no weight decay and a higher clip. A black box has states off the mass shell, even if the preset
    /// itself would choose another structure.
    pub fn config_of(self, system: &SystemInstance<f64>, structure: Structure) -> Option<Config> {
        let mut config = self.config(system)?;
        if self == Self::Paper {
            config.take_structure(structure);
            return Some(config);
        }
        take_structure(&mut config, structure, system.system.learning.structure_rate);
        if structure == Structure::BlackBox {
            config.data.rescaled_fraction = off_shell(system);
        }
        Some(config)
    }
}

/// Sets the structure of one of our configurations with a suitable rate, weight decay and clip; `rate` overrides the learning rate.
pub(crate) fn take_structure(config: &mut Config, structure: Structure, rate: Option<f64>) {
    config.take_structure(structure);
    if structure == Structure::BlackBox {
        return;
    }
    let rate = rate.unwrap_or(match config.network.factor {
        Factor::Triangle => TRIANGLE_RATE,
        _ => Phase::default().rate,
    });
    config.phases.iter_mut().for_each(|phase| phase.rate = rate);
    if config.data.shell.is_empty() {
        (config.optimizer.weight_decay, config.optimizer.clip) = (0.0, STRUCTURE_CLIP);
    }
}

impl Config {
    /// Changes the structure. Except for a black box, the signature holds by construction, and motion on a mass shell determines the whole
    /// metric: no penalty, no state off the shell and no learned `alpha` are needed. Without a time the factor is a rectangle.
    pub fn take_structure(&mut self, structure: Structure) {
        self.network.structure = structure;
        let free = structure != Structure::BlackBox && self.network.time_like.is_none();
        self.network.factor = if free { Factor::Rectangle } else { Factor::Triangle };
        if structure != Structure::BlackBox {
            self.penalty = Regularizer::None;
            self.data.rescaled_fraction = 0.0;
            self.network.learn_alpha = false;
        }
    }
}

/// Name of the time-like coordinate of a system.
fn time_like(system: &SystemInstance<f64>) -> Option<String> {
    let coordinates = system.system.coordinates(system.coordinates);
    system.system.time_like.and_then(|index| coordinates.into_iter().nth(index)).map(|time| time.name.into_owned())
}

/// The penalty on a wrong signature: eigenvalues, or Lorentzian Sylvester where a coordinate is a time.
fn regularizer(system: &SystemInstance<f64>, lambda: f64) -> Regularizer {
    match time_like(system) {
        Some(time) => Regularizer::LorentzianSylvester { lambda, time },
        None => Regularizer::Eigenvalue { lambda },
    }
}

fn base(system: &SystemInstance<f64>, states: usize, network: Network) -> Config {
    let validation: Bounds = system.system.validation(system.coordinates);
    Config {
        system: system.system.name.to_string(),
        description: system.system.described.as_ref().map(|described| described.description.clone()),
        data: Data {
            training: states,
            validation: states / 5,
            test: states / 5,
            validation_position: boxes(&validation.positions),
            validation_velocity: boxes(&validation.velocities),
            ..Data::default()
        },
        network: Network {
            time_like: time_like(system),
            dissipation: system.dissipation().is_some().then_some(FRICTION_UNITS),
            ..network
        },
        penalty: regularizer(system, 5.0),
        optimizer: Optimizer { method: Method::Radam, ..Optimizer::default() },
        phases: Vec::new(),
        ..Config::default()
    }
}

/// Learning rate for a triangular factor; a black box and a rectangular factor use the default.
const TRIANGLE_RATE: f64 = 1e-2;

/// Largest gradient norm for networks with a structure: larger than the norms of ordinary steps.
const STRUCTURE_CLIP: f64 = 10.0;

/// Weight decay if accelerations may have any size: weight decay adds to the loss and would dominate it for geodesics parametrised by a
/// clock, whose scaled accelerations are about a thousandth.
const ANY_SIZE: f64 = 0.0;

/// Settings that differ between our own presets.
#[derive(Clone, Copy)]
struct Size {
    width: usize,
    epochs: usize,
    weight_decay: f64,
}

const BEST: Size = Size { width: 192, epochs: 100, weight_decay: 0.0 };

/// Share of states off the mass shell in our own presets.
const OFF_SHELL: f64 = 0.75;

/// Settings of the preset `quick`: the defaults of the configuration.
fn quick() -> Size {
    Size { width: 128, epochs: Phase::default().epochs, weight_decay: Optimizer::default().weight_decay }
}

/// A phase whose learning rate falls to zero once.
fn phase(epochs: usize) -> Phase {
    Phase { epochs, t_max: epochs as f64, ..Phase::default() }
}

/// The box of the paper with one turn for every angle, enlarged where the motions of the trajectory test soon leave it.
fn training_states(system: &SystemInstance<f64>) -> (Bounds, StateAdvice) {
    let n = system.coordinates;
    let mut bounds: Bounds = system.system.training(n);
    // Embedded angles repeat, so they are sampled over one turn, except for a described system, whose file states its bounds.
    let whole = system.system.described.is_none();
    for (bound, coordinate) in bounds.positions.iter_mut().zip(system.system.coordinates(n)) {
        if coordinate.periodic && whole {
            *bound = (0.0, 2.0 * PI);
        }
    }
    let mut advice = system.system.learning.states.map_or_else(StateAdvice::default, |advise| advise(&mut bounds));
    if let Some(shell) = system.system.described.as_ref().and_then(|described| described.around_centre.clone()) {
        (advice.shell, advice.acceleration_weighting) = (Some(shell), 1.0);
    }
    (bounds, advice)
}

fn ours(system: &SystemInstance<f64>, size: Size) -> Config {
    let (bounds, StateAdvice { log_uniform, acceleration_weighting, trajectory_fraction, shell }) =
        training_states(system);
    let (position, velocity) = (boxes(&bounds.positions), boxes(&bounds.velocities));
    let network = Network { hidden: vec![size.width; 3], ..Network::default() };
    let base = base(system, Data::default().training, network);
    let rescaled_fraction = off_shell(system);
    let config = Config {
        data: Data { rescaled_fraction, acceleration_weighting, trajectory_fraction, ..base.data },
        penalty: regularizer(system, PENALTY),
        optimizer: Optimizer {
            weight_decay: if system.system.described.is_some() { ANY_SIZE } else { size.weight_decay },
            ..Optimizer::default()
        },
        phases: vec![Phase { position, velocity, log_uniform, ..phase(size.epochs) }],
        ..base
    };
    match shell {
        Some(shell) => around_a_centre(config, system, shell),
        None => config,
    }
}

/// Share of states off the mass shell, if the system has one.
fn off_shell(system: &SystemInstance<f64>) -> f64 {
    if system.constrained_coordinate().is_some() { OFF_SHELL } else { 0.0 }
}

/// Batch and epochs of our own presets around a centre, relative to those elsewhere: more epochs of larger batches take no longer and reach
/// a lower loss.
const SHELL_BATCH: usize = 4;
const SHELL_EPOCHS: usize = 3;

/// The metric of a field around a centre, the same at all times: states in a shell, features of direction and distance. No penalty: the
/// shell may reach inside a horizon, where `g_tt` is positive, which Lorentzian Sylvester forbids.
fn around_a_centre(mut config: Config, system: &SystemInstance<f64>, shell: ShellAdvice) -> Config {
    let names = system.system.coordinates(system.coordinates);
    let coordinates: Vec<String> = shell.coordinates.iter().map(|&i| names[i].name.to_string()).collect();
    let (low, high) = shell.radius;
    config.take_structure(Structure::Metric);
    config.network.cyclic = config.network.time_like.iter().cloned().collect();
    config.network.scaling = Scaling::None;
    (config.network.radial, config.network.radial_unit) = (vec![coordinates.clone()], Some(low));
    config.data.shell = coordinates;
    (config.data.shell_radius, config.data.rapidity) = (Some([low, high]), Some(shell.rapidity));
    config.optimizer.batch *= SHELL_BATCH;
    for phase in &mut config.phases {
        phase.epochs *= SHELL_EPOCHS;
        phase.t_max *= SHELL_EPOCHS as f64;
    }
    config
}

/// The quick preset for recorded states: numbers of training, validation and test states, and how many steps to take, in whole
/// epochs.
pub(crate) fn recorded(name: &str, [training, validation, test]: [usize; 3], steps: usize) -> Config {
    let optimizer = Optimizer { method: Method::Radam, ..Optimizer::default() };
    let epochs = steps.div_ceil(training.div_ceil(optimizer.batch));
    Config {
        system: name.to_string(),
        data: Data { training, validation, test, ..Data::default() },
        optimizer,
        phases: vec![Phase { rate: 3e-3, ..phase(epochs) }],
        ..Config::default()
    }
}

/// The quick preset for exact states of a system without a name; the numbers of states are theirs.
pub(crate) fn of_states() -> Config {
    let optimizer = Optimizer { weight_decay: ANY_SIZE, ..Optimizer::default() };
    Config { system: "states".to_string(), optimizer, ..Config::default() }
}

/// Appendix "Training details" of Hamzaogullari and Ozakin. Its table for AdS4 lists the eigenvalue penalty, which no
/// Lorentzian metric could satisfy; its text says Lorentzian Sylvester, which is used here.
fn paper(system: &SystemInstance<f64>) -> Option<Config> {
    let n = system.coordinates;
    let PaperBudget { states, hidden, phases } = system.system.learning.paper?;
    let network = Network { hidden: hidden.to_vec(), embed_periodic: false, ..Network::default() };
    let bounds: Bounds = system.system.training(n);
    let phase = |phase: &PaperPhase| {
        let PaperPhase { epochs, rate, lowest_rate: eta_min, positions } = *phase;
        let position = positions.map_or_else(|| boxes(&bounds.positions), |all| boxes(&vec![all; n]));
        let velocity = boxes(&bounds.velocities);
        let (schedule, t_max) = (Schedule::CosineAnnealing, 30.0);
        Phase { epochs, rate, eta_min, schedule, t_max, position, velocity, ..Phase::default() }
    };
    let phases = phases.iter().map(phase).collect();
    Some(Config { phases, ..base(system, states, network) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_have_no_weight_decay_and_a_higher_clip_except_around_a_centre() {
        let choices = |name: &str, structure| {
            let config = Preset::Quick.config_of(&SystemInstance::named(name, &[]).unwrap(), structure).unwrap();
            (config.optimizer.weight_decay, config.optimizer.clip, config.phases[0].rate)
        };
        assert_eq!(choices("double-pendulum", Structure::Mechanical), (0.0, 10.0, 5e-3));
        assert_eq!(choices("triple-pendulum", Structure::Mechanical), (0.0, 10.0, 1.6e-3));
        assert_eq!(choices("ads4-geodesic", Structure::Metric), (0.0, 10.0, 1e-2));
        assert_eq!(choices("double-pendulum", Structure::BlackBox), (1e-6, 1.0, 5e-3));
        assert_eq!(choices("schwarzschild-cartesian", Structure::Metric), (1e-6, 1.0, 1e-2));
    }
}
