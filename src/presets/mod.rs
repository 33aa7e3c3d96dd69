//! Presets: configurations that ship with the crate, and the reference of all keys.

mod measured;
mod preset;
mod reference;

pub use measured::suggested;
pub use preset::Preset;
#[doc(hidden)]
pub use reference::{Key, SHOOTING_SECTION, Section, TRAINING_SECTIONS, configuration_reference, section_reference};
