//! The configuration that suits recorded motion.

use crate::configuration::Config;
use crate::data::{Dataset, Datasets};
use crate::presets::preset::recorded;
use crate::scalar::Scalar;

/// Steps of a supervised training.
const STEPS: usize = 30_000;

/// Configuration of a training from these states: the network and the rates of the quick preset, 30,000 steps in whole epochs.
pub fn suggested<S: Scalar>(name: &str, data: &Datasets<S>) -> Config {
    let [training, validation, test] = [&data.training[0], &data.validation, &data.test];
    let [position, velocity] = ranges(training);
    let [validation_position, validation_velocity] = ranges(validation);
    let sizes = [training.len(), validation.len(), test.len()];
    recorded(name, sizes, [position, velocity], [validation_position, validation_velocity], STEPS)
}

/// Range of every coordinate and of every velocity.
fn ranges<S: Scalar>(data: &Dataset<S>) -> [Vec<[f64; 2]>; 2] {
    let n = data.coordinates();
    [data.q(), data.v()].map(|values| {
        let range = |i: usize| {
            let all = values.iter().skip(i).step_by(n).map(|x| x.to_f64());
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        (0..n).map(range).collect()
    })
}
