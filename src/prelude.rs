//! The names that most programs need: `use lnn::prelude::*;`.

pub use crate::lagrangian::{EulerLagrange, Lagrangian, Mechanics, MechanicsError, Request, Terms};
pub use crate::network::{NetworkLagrangian, Structure};
#[cfg(feature = "rollout")]
pub use crate::rollout::{Motion, RolloutOptions, Trajectory, rollout};
pub use crate::scalar::{Dd, Real, Scalar};

#[cfg(feature = "training")]
pub use crate::data::Dataset;
#[cfg(feature = "training")]
pub use crate::presets::Trainer;

#[cfg(feature = "pipeline")]
pub use crate::pipeline::Fit;
