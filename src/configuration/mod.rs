//! Configurations: every choice of a training, its ranges, and the penalty it asks for.

mod config;
mod error;
mod penalty;

pub use config::{Config, Data, Known, Network, OnFailure, Optimizer, Phase, Polish, Precision, Scaling};
pub use error::ConfigError;
pub(crate) use error::Faults;
pub use penalty::{Penalty, Regularizer};
