//! The network Lagrangian: a sum of multilayer perceptrons as `L(q, v)`, and a Rayleigh dissipation beside it, evaluated
//! in batches.

mod activation_choice;
mod config;
mod dynamics;
mod factor;
mod features;
#[cfg(feature = "model-files")]
pub mod file;
mod init;
mod known;
mod layout;
mod model;
mod recorded;
mod structure;

pub use crate::ops::Activation;
pub use activation_choice::{ActivationChoice, UnknownActivation};
pub use config::{Architecture, Initialization, InputLayer};
#[doc(hidden)]
pub use dynamics::{Dynamics, Model};
pub use factor::Factor;
pub use init::initial_weights;
#[doc(hidden)]
pub use layout::{Branch, DissipationLayout, Layer, Layout, LinearMap};
pub use model::{NetworkError, NetworkLagrangian};
pub use structure::{Form, Radial, Structure};
