//! Every number that sets the weights of data, or limits how data are drawn.

/// Smallest noise that is assumed, relative to the spread of the data.
pub(super) const LEAST_NOISE: f64 = 1e-6;
/// Share of the spread of a force that is added to its error besides noise, because no model is more accurate than that.
pub(super) const FORCE_ERROR: f64 = 0.1;
/// Share by which ranges are widened under constraints, where a range may be as narrow as rounding.
pub(super) const WIDENED_RANGE: f64 = 1e-3;
/// States at about the same distance from the centre that share a typical acceleration.
pub(super) const STATES_PER_DISTANCE: usize = 200;
/// Smallest factor by which a velocity is multiplied to move a state off the mass shell.
pub(super) const SLOWEST: f64 = 0.03;
/// Average number of states that a motion of full length contributes.
pub(super) const STATES_PER_MOTION: f64 = 10.0;
