//! Recorded motion.

mod arm;
mod determined;
mod gaps;
mod smoothing;
