//! Every number that decides how times, held readings and targets of a recording are judged. The numbers of a survey, of the guess of
//! columns, of smoothing and of reading are in tables of their own.

// ---- Targets of a fit ----

/// Relative error of smoothed accelerations above which a fit should learn from the motion itself.
pub(crate) const LARGE_ACCELERATION_ERROR: f64 = 0.1;
/// Share of the spread of a known force that is assumed to accelerate when the size of an inertia is sought.
pub(crate) const INERTIAL_SHARE: f64 = 0.5;

// ---- Steps in time ----

/// Step over the typical one from which it is a gap; jitter can raise this limit.
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

/// Repetitions in a row from which a motion may be at rest.
pub(super) const RESTING_REPETITIONS: usize = 4;
/// Most repetitions in a row that are filled in.
pub(super) const MOST_REPETITIONS: usize = 12;
/// Change after many repetitions, over that of a continuing motion, below which the motion was at rest.
pub(super) const RESTING_CHANGE: f64 = 0.5;
/// Change of a reading, in steps of the sensor, from which a reading in between cannot repeat.
pub(super) const MOVING_STEPS: f64 = 3.0;
/// Typical change, in steps of the sensor, from which readings hardly ever repeat by chance.
pub(super) const FINE_STEPS: f64 = 20.0;
/// Share of repetitions that is too large for chance.
pub(super) const MANY_REPETITIONS: f64 = 0.01;
/// Fresh readings on either side that the polynomial passes through: it is a cubic.
pub(super) const FRESH_NEIGHBOURS: usize = 2;

// ---- Marks of an encoder ----

/// Largest change that is examined, in marks.
pub(super) const EXAMINED_MARKS: f64 = 8.0;
/// Largest distance of a change from a whole number of marks.
pub(super) const WHOLE_MARKS: f64 = 0.05;
/// Smallest number of examined changes.
pub(super) const LEAST_MARKED_CHANGES: usize = 20;
/// Smallest share of changes by whole marks; by chance it would be 0.1. The others are readings that were filled in.
pub(super) const WHOLE_SHARE: f64 = 0.7;
