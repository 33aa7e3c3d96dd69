//! Settings of a test by held-out motion.

use crate::data::Split;

/// Held-out motion and the settings of the test.
#[derive(Clone, Copy, Debug)]
pub struct HoldOutOptions<'a> {
    /// The held-out motion.
    pub part: &'a Split,
    /// Prediction horizon in s. By default 200 samples, or one period of the fastest motion if that is longer, but at most a quarter of the
    /// shortest trajectory, ignoring pieces much shorter than the others.
    pub horizon: Option<f64>,
    /// The time-like coordinate, if there is one.
    pub time: Option<usize>,
    /// Names of the known forces, if there are any.
    pub forces: &'a [String],
    /// Units of the coordinates, for pictures.
    pub units: &'a [String],
    /// Number of threads.
    pub threads: usize,
}
