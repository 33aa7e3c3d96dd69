//! Targets of learning in recorded motion.

use serde::{Deserialize, Serialize};

/// Relative error of accelerations by smoothing above which the motion itself is the better teacher.
pub const LARGE_ERROR: f64 = 0.1;

/// Quantity that a network learns from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Targets {
    /// Accelerations that were measured.
    Measured,
    /// Accelerations by local polynomials.
    Smoothed,
    /// The motion itself, from the network that smoothed or measured accelerations give.
    Motion,
}

impl Targets {
    /// The way that suits the data: measured accelerations if there are any, smoothed ones if they are good to
    /// `LARGE_ERROR`, the motion itself if not. `error` is that of smoothed accelerations over their size.
    pub(crate) fn advised(has_accelerations: bool, error: f64) -> Self {
        if has_accelerations {
            Self::Measured
        } else if error <= LARGE_ERROR {
            Self::Smoothed
        } else {
            Self::Motion
        }
    }
}
