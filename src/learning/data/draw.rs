//! Draws of single states.

use crate::configuration::ConfigError;
use crate::data::dataset::{Dataset, DatasetError};
use crate::lagrangian::{DescriptionError, EulerLagrange, SystemError, SystemInstance, project};
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

/// States of a system as they are drawn, with their exact accelerations.
pub(crate) struct Drawn<'a> {
    system: &'a SystemInstance<f64>,
    /// The motion of a system under constraints.
    constrained: Option<Box<dyn EulerLagrange<f64>>>,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    a: Vec<f64>,
}

/// Where a state is not finite, or cannot be brought.
const FINITE: &str = "a finite acceleration";
const CONSTRAINTS: &str = "some constraint";

impl<'a> Drawn<'a> {
    /// None yet.
    ///
    /// # Errors
    /// [`SamplingError::System`] for constraints that contradict each other or leave no motion.
    pub fn new(system: &'a SystemInstance<f64>) -> Result<Self, SamplingError> {
        let constrained = system.constraints().map(|_| system.build()).transpose()?;
        Ok(Self { system, constrained, q: Vec::new(), v: Vec::new(), a: Vec::new() })
    }

    /// Goes on unless a flag was raised.
    ///
    /// # Errors
    /// [`SamplingError::Interrupted`].
    pub fn go_on(interrupt: &AtomicBool) -> Result<(), SamplingError> {
        if interrupt.load(Ordering::Relaxed) { Err(SamplingError::Interrupted) } else { Ok(()) }
    }

    /// Brings a state to the mass shell of the system, or the shortest way to its constraints; what is demanded where there is no way.
    pub fn impose(&self, q: &mut [f64], v: &mut [f64]) -> Result<Option<&'static str>, SamplingError> {
        self.system.impose_constraint(q, v)?;
        let manifold = self.constrained.as_ref().and_then(|model| model.manifold());
        Ok(manifold.and_then(|manifold| project(manifold, q, v).err()).map(|_| CONSTRAINTS))
    }

    /// Takes a state, unless it lies outside the system's domain or has no finite acceleration: then what is demanded.
    pub fn take(&mut self, q: &[f64], v: &[f64]) -> Result<Option<&'static str>, SamplingError> {
        let a = match &self.constrained {
            Some(model) => model.acceleration(q, v).unwrap_or_default(),
            None => self.system.exact_acceleration(q, v)?,
        };
        let finite = a.len() == q.len() && a.iter().all(|a| a.is_finite());
        let demand = self.system.check_domain(q).err().or((!finite).then_some(FINITE));
        if demand.is_none() {
            self.q.extend(q);
            self.v.extend(v);
            self.a.extend(a);
        }
        Ok(demand)
    }

    /// The states, with the rows of the constraints if there are any.
    ///
    /// # Errors
    /// [`SamplingError::Dataset`] without any state, or where a constraint is not finite.
    pub fn finish(self) -> Result<Dataset<f64>, SamplingError> {
        let set = Dataset::new(self.system.coordinates, self.q, self.v, self.a)?;
        match self.constrained.as_ref().and_then(|model| model.manifold()) {
            Some(manifold) => Ok(set.on(manifold)?),
            None => Ok(set),
        }
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
