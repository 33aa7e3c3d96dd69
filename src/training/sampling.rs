//! Training data of hand-written systems: uniform states with exact accelerations.

use crate::lagrangian::{Configured, SystemError};
use crate::scalar::Scalar;
use crate::training::config::{Config, ConfigError};
use crate::training::dataset::{Dataset, DatasetError};
use crate::training::trainer::{Datasets, Stream};
use rand::Rng;
use thiserror::Error;

/// Why states could not be sampled.
#[derive(Debug, Error)]
pub enum SamplingError {
    /// The system does not exist or has no such parameter.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The configuration is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Most of the box lies outside the domain of the system.
    #[error("{field}: most of these bounds lie where {demand} is violated or accelerations are not finite")]
    Domain {
        /// Which bounds.
        field: String,
        /// What the system demands.
        demand: &'static str,
    },
    /// The accelerations do not fit the precision.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// Draws `states` states uniformly from a box, with their exact accelerations, all in double precision.
///
/// States outside the system's domain, or with an acceleration that is not finite, are drawn again.
///
/// # Errors
/// [`SamplingError::Domain`] if more than nine in ten draws are refused.
pub fn sample(
    system: &Configured<f64>,
    field: &str,
    (position, velocity): (&[[f64; 2]], &[[f64; 2]]),
    states: usize,
    rng: &mut impl Rng,
) -> Result<Dataset<f64>, SamplingError> {
    let n = system.coordinates;
    let (mut q, mut v, mut a) = (Vec::new(), Vec::new(), Vec::new());
    let mut refused = 0_usize;
    while q.len() < states * n {
        let mut draw = |bounds: &[[f64; 2]]| -> Vec<f64> {
            bounds.iter().map(|&[low, high]| if low < high { rng.random_range(low..high) } else { low }).collect()
        };
        let (new_q, new_v) = (draw(position), draw(velocity));
        let demand = system.check_domain(&new_q).err();
        let new_a = system.exact_acceleration(&new_q, &new_v)?;
        if demand.is_some() || new_a.iter().any(|a| !a.is_finite()) {
            refused += 1;
            if refused > 1000 && refused > 9 * (q.len() / n) {
                let demand = demand.unwrap_or("a finite acceleration");
                return Err(SamplingError::Domain { field: field.to_string(), demand });
            }
            continue;
        }
        q.extend(new_q);
        v.extend(new_v);
        a.extend(new_a);
    }
    Ok(Dataset::new(n, q, v, a)?)
}

/// All datasets of a run in its precision, with the physical scale of the first phase's training states.
///
/// # Errors
/// [`SamplingError`].
pub fn sample_all<S: Scalar>(
    config: &Config,
    system: &Configured<f64>,
) -> Result<(Datasets<S>, Vec<f64>), SamplingError> {
    config.validate(system.coordinates)?;
    let seed = config.seed;
    let mut training = Vec::with_capacity(config.phases.len());
    for (k, phase) in config.phases.iter().enumerate() {
        let field = format!("phase[{k}].position");
        let bounds = (phase.position.as_slice(), phase.velocity.as_slice());
        let mut rng = Stream::Training(k).generator(seed);
        training.push(sample(system, &field, bounds, config.data.training, &mut rng)?);
    }
    let scale = training[0].physical_scale();
    let data = &config.data;
    let bounds = (data.validation_position.as_slice(), data.validation_velocity.as_slice());
    let field = "data.validation_position";
    let validation = sample(system, field, bounds, data.validation, &mut Stream::Validation.generator(seed))?;
    let test = sample(system, field, bounds, data.test, &mut Stream::Test.generator(seed))?;
    let training = training.iter().map(Dataset::cast).collect();
    Ok((Datasets { training, validation: validation.cast(), test: test.cast() }, scale))
}
