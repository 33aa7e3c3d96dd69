//! Configurations: every choice of a training, its ranges and its penalty.

mod config;
mod error;
mod penalty;
pub(crate) mod table;

pub use config::{Config, Data, Known, Lbfgs, Network, OnFailure, Optimizer, Phase, Precision, Scaling, Shell};
pub use error::ConfigError;
pub use penalty::{Penalty, Regularizer};

// For the packages of this repository.
#[doc(hidden)]
pub use {
    config::{FRICTION_UNITS, MOST_EPOCHS, MOST_RATE, MOST_SEED, PENALTY},
    error::{Faults, place},
    table::{Below, Key, Ranges, find_key, join},
};
