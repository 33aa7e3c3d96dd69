//! The configuration that suits recorded motion.

use crate::configuration::Config;
use crate::data::Datasets;
use crate::presets::preset::recorded;
use crate::scalar::Scalar;

/// Steps of a supervised training.
const STEPS: usize = 30_000;

/// Configuration of a training from these states: the network and the rates of the quick preset, 30,000 steps in whole epochs.
pub fn suggested<S: Scalar>(name: &str, data: &Datasets<S>) -> Config {
    let [training, validation, test] = [&data.training[0], &data.validation, &data.test];
    let sizes = [training.len(), validation.len(), test.len()];
    recorded(name, sizes, STEPS)
}
