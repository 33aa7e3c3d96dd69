//! Presets: configurations that ship with the crate, and trainings on arrays of states by them ([`Trainer`]).
//!
//! ```
//! use lnn::lagrangian::SystemInstance;
//! use lnn::presets::Preset;
//!
//! let config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[])?).unwrap();
//! assert!(config.phases[0].epochs > 0 && !config.network.hidden.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod measured;
mod preset;
mod trainer;

pub use preset::Preset;
pub use trainer::{Learned, Trainer, TrainerError};

// Used by the other packages of this repository.
#[doc(hidden)]
pub use measured::{restructure, suggested};
