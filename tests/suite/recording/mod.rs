//! Recorded motion.

mod arm;
#[cfg(feature = "cli")]
mod determined;
mod gaps;
mod smoothing;
