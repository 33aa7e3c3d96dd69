//! Presets: configurations that ship with the crate, trainings on arrays of states by them ([`Trainer`]), and the reference of all keys.
//!
//! ```
//! use lnn::lagrangian::configure;
//! use lnn::presets::Preset;
//!
//! let config = Preset::Quick.config(&configure("double-pendulum", &[])?).unwrap();
//! assert!(config.phases[0].epochs > 0 && !config.network.hidden.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod measured;
mod preset;
mod reference;
mod trainer;

#[doc(hidden)]
pub use measured::suggested;
pub use preset::Preset;
#[doc(hidden)]
pub use reference::{Key, SHOOTING_SECTION, Section, TRAINING_SECTIONS, configuration_reference, section_reference};
pub use trainer::{Learned, Trainer, TrainerError};
