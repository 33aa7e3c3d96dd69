//! The network Lagrangian: a multilayer perceptron as `L(q, v)`, evaluated in batches.

mod activation;
mod config;

pub use activation::Activation;
pub use config::{Architecture, Initialization};
