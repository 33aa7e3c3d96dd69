//! Draws of single states.

use crate::configuration::ConfigError;
use crate::data::dataset::DatasetError;
use crate::lagrangian::{DescriptionError, SystemError, SystemInstance};
use rand::Rng;
use std::sync::atomic::{AtomicBool, Ordering};
use thiserror::Error;

/// Why states could not be sampled.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SamplingError {
    /// The system does not exist or has no such parameter.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A wrong description of a system.
    #[error("description.{0}")]
    Description(#[from] DescriptionError),
    /// The configuration is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Most of the box lies outside the domain of the system.
    #[error("{field}: most of these bounds lie where {demand} is violated or accelerations are not finite")]
    Domain {
        /// Which bounds.
        field: String,
        /// Demand of the system.
        demand: &'static str,
    },
    /// Motions of the trajectory test hardly pass through the box.
    #[error(
        "{field}: hardly any motion of the trajectory test stays within these bounds; data.trajectory_fraction asks for such states"
    )]
    Motions {
        /// Which bounds.
        field: String,
    },
    /// A flag ended it.
    #[error("interrupted while states were drawn")]
    Interrupted,
    /// The accelerations do not fit the precision.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// States as they are drawn, with their exact accelerations.
#[derive(Default)]
pub(crate) struct Drawn {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
}

impl Drawn {
    /// Goes on unless a flag was raised.
    ///
    /// # Errors
    /// [`SamplingError::Interrupted`].
    pub fn go_on(interrupt: &AtomicBool) -> Result<(), SamplingError> {
        if interrupt.load(Ordering::Relaxed) { Err(SamplingError::Interrupted) } else { Ok(()) }
    }

    /// Takes a state, unless it lies outside the system's domain or has no finite acceleration: then what is demanded.
    pub fn take(
        &mut self,
        system: &SystemInstance<f64>,
        q: &[f64],
        v: &[f64],
    ) -> Result<Option<&'static str>, SamplingError> {
        let a = system.exact_acceleration(q, v)?;
        let finite = a.iter().all(|a| a.is_finite());
        let demand = system.check_domain(q).err().or((!finite).then_some("a finite acceleration"));
        if demand.is_none() {
            self.q.extend(q);
            self.v.extend(v);
            self.a.extend(a);
        }
        Ok(demand)
    }
}

/// Coordinates and velocities of a state, uniform within bounds; half of the [`log_uniform`](crate::configuration::Phase::log_uniform)
/// coordinates uniform in their logarithm.
pub(crate) fn draw(
    (position, velocity): (&[[f64; 2]], &[[f64; 2]]),
    log_uniform: &[bool],
    rng: &mut impl Rng,
) -> (Vec<f64>, Vec<f64>) {
    let mut uniform = |bounds: &[[f64; 2]]| -> Vec<f64> {
        let one = |&[low, high]: &[f64; 2]| match high - low {
            length if length.is_infinite() => {
                let share = rng.random::<f64>();
                (1.0 - share) * low + share * high
            }
            _ if low < high => rng.random_range(low..high),
            _ => low,
        };
        bounds.iter().map(one).collect()
    };
    let (mut q, v) = (uniform(position), uniform(velocity));
    for (i, q) in q.iter_mut().enumerate() {
        if log_uniform.get(i) == Some(&true) && rng.random::<bool>() {
            let [low, high] = position[i];
            *q = low * (high / low).powf(rng.random::<f64>());
        }
    }
    (q, v)
}

/// Bounds in the form of a configuration.
pub(crate) fn boxes(bounds: &[(f64, f64)]) -> Vec<[f64; 2]> {
    bounds.iter().map(|&(low, high)| [low, high]).collect()
}
