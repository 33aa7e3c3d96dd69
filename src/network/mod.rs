//! The network Lagrangian: a multilayer perceptron as `L(q, v)`, evaluated in batches.

mod activation;
mod config;
mod features;
mod layout;

pub use activation::Activation;
pub use layout::{Layer, Layout};
pub use config::{Architecture, Initialization};
