//! Every number that decides the guessed meaning of a column.
//!
//! `lnn-studies rates --part columns` counts how often a guess is right on simulated motion; `docs/verdicts.md` states the rates.

// ---- Time ----

/// Fewest rows between two restarts of a time on average, and for each repeated time.
pub(super) const ROWS_PER_RESTART: usize = 16;
/// Largest relative deviation of a step from the median step in a time column that is not recognised by its name; one step in
/// [`STEPS_PER_UNEVEN_ONE`] may deviate more.
pub(super) const EVEN_STEP: f64 = 0.5;
pub(super) const STEPS_PER_UNEVEN_ONE: usize = 10;
/// Step of whole numbers, in s, from which they may be milliseconds; only a hint is printed.
pub(super) const SUSPICIOUS_STEP: f64 = 5.0;

// ---- Trajectories and copies ----

/// Fewest rows per value of a column that distinguishes trajectories: the fewest samples of a trajectory.
pub(super) const ROWS_PER_LABEL: usize = 16;
/// Largest deviation of a copy from its original, over its range: the rounding of numbers with seven digits.
pub(super) const COPY_ROUNDING: f64 = 1e-6;

// ---- Derivatives ----

/// Smallest correlation with the derivative of a position, for a column whose name says so.
pub(super) const NAMED_CORRELATION: f64 = 0.8;
/// The same for any other column, and the largest relative difference of its size from that derivative.
pub(super) const UNNAMED_CORRELATION: f64 = 0.995;
pub(super) const UNNAMED_DIFFERENCE: f64 = 0.03;
/// The same two limits once another velocity was found: the remaining velocities are then probably present too, perhaps with more noise.
pub(super) const FURTHER_CORRELATION: f64 = 0.9;
pub(super) const FURTHER_DIFFERENCE: f64 = 0.2;
/// Largest difference in size, in units of [`UNNAMED_DIFFERENCE`], at which a position is the derivative of its own velocity, as on a
/// circle.
pub(super) const MUTUAL_DIFFERENCE: f64 = 3.0;
/// Difference of correlations up to which the shorter of two differences is preferred.
pub(super) const EQUAL_CORRELATION: f64 = 1e-3;
/// Distances, in rows, over which differences are taken; longer differences suffer less from noise.
pub(super) const DIFFERENCE_REACHES: [usize; 5] = [1, 2, 4, 8, 16];
/// Samples at which derivatives are compared.
pub(super) const COMPARED_SAMPLES: usize = 4000;

// ---- Fixed points ----

/// Largest range of a fixed point over the widest range of a coordinate.
pub(super) const FIXED_RANGE: f64 = 0.03;
/// Largest range of a fixed point over its own distance from 0.
pub(super) const FIXED_OF_DISTANCE: f64 = 0.05;

// ---- Angles ----

/// Largest deviation of a jump from a full turn, as a share of it: the motion of one step.
pub(super) const TURN_TOLERANCE: f64 = 0.25;
/// Largest range of a wrapped angle, in turns; noise may exceed a full turn a little.
pub(super) const WRAPPED_RANGE: f64 = 1.05;
/// Fewest samples per jump by a turn.
pub(super) const SAMPLES_PER_JUMP: usize = 4;
/// Largest magnitude of an angle, in turns, that is assumed to be in radians; beyond it, and within 360, an angle is in degrees.
pub(super) const MOST_TURNS_IN_RADIANS: f64 = 2.0;
