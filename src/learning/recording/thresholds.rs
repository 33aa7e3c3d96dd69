//! Thresholds for times, held readings and targets of a recording. Survey, column guesses, smoothing and reading have their own tables.

// ---- Targets of a fit ----

/// Relative error of smoothed accelerations above which a fit should learn from the motion itself.
pub(crate) const LARGE_ACCELERATION_ERROR: f64 = 0.1;
/// Share of the spread of a known force that is assumed to cause acceleration when an inertia is estimated.
pub(crate) const INERTIAL_SHARE: f64 = 0.5;

// ---- Steps in time ----

/// Step, in typical steps, above which it is a gap; jitter can raise this limit.
pub(super) const GAP_STEPS: f64 = 1.5;
/// Robust standard deviations of uneven steps by which a gap exceeds the median.
pub(super) const GAP_DEVIATIONS: f64 = 6.0;
/// Quantile of uneven steps that a gap exceeds by the factor [`GAP_STEPS`].
pub(super) const GAP_QUANTILE: f64 = 0.9;
/// Longest gap, in typical steps, that a trajectory continues across: nine missing rows, and half a step for rounding and jitter.
pub(super) const BRIDGED_STEPS: f64 = 10.5;
/// Deviation of times from even ones, in roundings of a double, up to which steps are equal.
pub(super) const EVEN_ROUNDINGS: f64 = 8.0;
/// Deviation of the length of a window from a whole number of typical steps, in steps, up to which its steps are the typical one.
pub(super) const TYPICAL_SPAN: f64 = 1e-6;
/// Steps of a trajectory that are examined for their quantiles.
pub(super) const EXAMINED_STEPS: usize = 1 << 17;

// ---- Held readings (checked by the rows "one reading in eight repeated" of `lnn-studies rates --part identify`) ----

/// Number of repetitions in a row from which the coordinate may be at rest.
pub(super) const RESTING_REPETITIONS: usize = 4;
/// Largest number of repetitions in a row that are filled in.
pub(super) const MOST_REPETITIONS: usize = 12;
/// Change after many repetitions, relative to that of a continuing motion, below which the coordinate was at rest.
pub(super) const RESTING_CHANGE: f64 = 0.5;
/// Change between two readings, in steps of the sensor, above which a reading in between cannot be a true repetition.
pub(super) const MOVING_STEPS: f64 = 3.0;
/// Typical change, in steps of the sensor, above which readings hardly ever repeat by chance.
pub(super) const FINE_STEPS: f64 = 20.0;
/// Share of repetitions that is too large for chance.
pub(super) const MANY_REPETITIONS: f64 = 0.01;
/// Fresh readings on either side that determine the interpolating polynomial, a cubic.
pub(super) const FRESH_NEIGHBOURS: usize = 2;

// ---- Marks of an encoder ----

/// Largest change that is examined, in marks.
pub(super) const EXAMINED_MARKS: f64 = 8.0;
/// Largest deviation of a change from a whole number of marks.
pub(super) const WHOLE_MARKS: f64 = 0.05;
/// Smallest number of examined changes.
pub(super) const LEAST_MARKED_CHANGES: usize = 20;
/// Smallest share of changes that are whole numbers of marks; by chance it would be 0.1. The remaining changes involve readings that were
/// filled in.
pub(super) const WHOLE_SHARE: f64 = 0.7;
