//! Recorded motion.

mod smoothing;
