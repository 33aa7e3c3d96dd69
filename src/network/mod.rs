//! The network Lagrangian: a multilayer perceptron as `L(q, v)`, evaluated in batches.

mod activation;
mod adjoint;
mod affine;
mod chunk;
mod config;
mod features;
pub mod file;
mod init;
mod layout;
mod model;
mod reference;

pub use activation::{Activation, UnknownActivation};
pub use adjoint::{Adjoint, Jets};
pub use chunk::{Chunk, Depth};
pub use config::{Architecture, Initialization};
pub use init::initial_weights;
pub use layout::{Layer, Layout};
pub use model::{NetworkError, NetworkLagrangian};
