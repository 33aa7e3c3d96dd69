//! Configurations: every choice of a training, its ranges, and the penalty it asks for.

mod config;
mod error;
mod penalty;
pub(crate) mod table;

pub(crate) use config::MOST_SEED;
pub use config::{Config, Data, Known, Lbfgs, Network, OnFailure, Optimizer, Phase, Precision, Scaling, Shell};
pub(crate) use config::{FRICTION_UNITS, MOST_EPOCHS, MOST_RATE, PENALTY};
pub use error::ConfigError;
pub(crate) use error::{Faults, place};
pub use penalty::{Penalty, Regularizer};
pub(crate) use table::{Key, Ranges, join};
