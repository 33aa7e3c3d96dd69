//! The network Lagrangian: a sum of multilayer perceptrons as `L(q, v)`, and a Rayleigh dissipation beside it, evaluated
//! in batches.

mod adjoint;
mod affine;
mod branch;
mod chunk;
mod config;
mod depth;
mod dissipation;
mod features;
#[cfg(feature = "model-files")]
pub mod file;
mod init;
mod layout;
mod model;
mod nonlinearity;
mod planes;
mod reference;

pub use crate::ops::Activation;
pub use adjoint::{Adjoint, Jets};
pub use chunk::Chunk;
pub use config::{Architecture, Initialization, InputLayer};
pub use depth::Depth;
pub use dissipation::Dissipation;
pub use init::initial_weights;
pub use layout::{Branch, DissipationLayout, Layer, Layout, LinearMap};
pub use model::{NetworkError, NetworkLagrangian};
pub use nonlinearity::{Nonlinearity, UnknownNonlinearity};
