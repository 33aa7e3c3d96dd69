//! Recorded motion.

mod arm;
mod gaps;
mod smoothing;
