//! The configuration that suits recorded motion.

use crate::configuration::Config;
use crate::data::Datasets;
use crate::network::{Factor, JointFriction, Structure};
use crate::optimizers::Method;
use crate::presets::preset::{recorded, take_structure};
use crate::scalar::Scalar;

/// Number of steps of supervised training.
const STEPS: usize = 30_000;

/// Number of steps when training on known forces.
const STEPS_BY_FORCES: usize = 10_000;
/// Widths of the layers for a training from known forces, and its decoupled weight decay: such recordings have few states of many
/// coordinates, so the learned functions have to be smooth.
const BY_FORCES: ([usize; 3], f64) = ([64; 3], 0.3);

/// Changes the structure of a configuration for recorded motion; a change to a black box adds the default penalty.
pub fn restructure(config: &mut Config, structure: Structure) {
    if structure == Structure::BlackBox && config.network.structure != Structure::BlackBox {
        config.penalty = Config::default().penalty;
    }
    config.take_structure(structure);
}

/// Configuration of a training from these states: the network and the rates of the quick preset, 30,000 steps in whole epochs.
///
/// If forces are known, the network instead learns a kinetic energy, a potential and the friction of every coordinate; it is smaller, has
/// more weight decay and takes 10,000 steps.
pub fn suggested<S: Scalar>(name: &str, data: &Datasets<S>) -> Config {
    let [training, validation, test] = [&data.training[0], &data.validation, &data.test];
    let sizes = [training.len(), validation.len(), test.len()];
    if data.training[0].force_scale().is_empty() {
        return recorded(name, sizes, STEPS);
    }
    let mut config = recorded(name, sizes, STEPS_BY_FORCES);
    let rate = config.phases[0].rate;
    take_structure(&mut config, Structure::Mechanical, Some(rate));
    let (hidden, weight_decay) = BY_FORCES;
    (config.network.hidden, config.network.factor) = (hidden.to_vec(), Factor::Triangle);
    config.network.joint_friction = JointFriction::Dry;
    (config.optimizer.method, config.optimizer.weight_decay) = (Method::AdamW, weight_decay);
    config
}
