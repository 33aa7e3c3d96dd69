//! Configurations: every choice of a training, its ranges, and the penalty it asks for.

mod config;
mod error;
mod penalty;

pub use config::{Config, Data, Known, Lbfgs, Network, OnFailure, Optimizer, Phase, Precision, Scaling, Shell};
pub(crate) use config::{MOST_EPOCHS, MOST_LAMBDA, MOST_RATE};
pub use error::ConfigError;
pub(crate) use error::{Faults, place};
pub(crate) use penalty::BESIDE_A_TIME;
pub use penalty::{Penalty, PenaltyKind, Regularizer};
