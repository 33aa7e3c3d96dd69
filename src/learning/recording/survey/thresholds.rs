//! Every number that decides a verdict or limits the work of a survey.
//!
//! `lnn-studies rates --part check` counts the verdicts of a survey on data whose right answer is known; `docs/verdicts.md` states the
//! rates.

// ---- Sampling and rows ----

/// Fewest samples per period of the fast motion. Half a period then has ten samples, for the seven coefficients of the two polynomials that
/// smoothing compares.
pub(super) const LEAST_SAMPLES_PER_PERIOD: f64 = 20.0;
/// Step of an angle, in rad, from which unwrapping is a guess. From half a turn on it is wrong; below 2 rad, an angle can reach half a turn
/// only if its step grows by half from one sample to the next.
pub(super) const AMBIGUOUS_STEP: f64 = 2.0;
/// Share of the rows that are missing or left out above which there is a warning.
pub(super) const MANY_LOST_ROWS: f64 = 0.01;
/// Largest deviation of a jump from a full turn, as a share of the turn, at which the coordinate may be an angle: the motion of one step,
/// 54 degrees.
pub(super) const TURN_TOLERANCE: f64 = 0.15;
/// Largest jitter that counts as rounding of the times and is shown as 0.
pub(super) const ROUNDING_JITTER: f64 = 1e-9;

// ---- Measured derivatives and those of the positions ----

/// Largest deviation from 1 of the ratio of a measured derivative to the computed one, if both were exact.
pub(super) const RATIO_TOLERANCE: f64 = 0.05;
/// Further deviation, in squares of the relative error of the computed derivative: twice the bias that this error causes in the slope of a
/// regression.
pub(super) const RATIO_PER_SQUARED_ERROR: f64 = 2.0;
/// Smallest correlation of a measured derivative with the computed one, less the relative error of the latter.
pub(super) const LEAST_CORRELATION: f64 = 0.9;
/// Largest relative deviation of the ratio from that of a common mistake, such as a wrong unit.
pub(super) const MISTAKE_TOLERANCE: f64 = 0.05;

// ---- Coordinates that do not move, move uniformly, or are copies ----

/// Scatter over the noise above which a coordinate moves: motion of two thirds of the noise, added in squares. The noise itself is
/// estimated to a few per cent.
pub(super) const MOVING_SCATTER: f64 = 1.2;
/// Remainder of a coordinate, as a share of its motion, that counts as rounding.
pub(super) const ROUNDING_REMAINDER: f64 = 1e-9;
/// Most decimal places that values rounded to a grid can have, and the relative deviation from the grid that is rounding of a double.
pub(super) const MOST_DECIMAL_PLACES: i32 = 9;
pub(super) const GRID_ROUNDING: f64 = 1e-9;
/// Share of a copy's motion from which a term of its sum is shown.
pub(super) const SHOWN_TERM: f64 = 1e-3;
/// Approximate number of samples that are examined for copies; more are thinned evenly.
pub(super) const COPY_SAMPLES: usize = 1 << 16;

// ---- Suspicious samples ----

/// Contrast, in standard deviations, from which a sample is suspicious: normal noise exceeds it once in 500 million samples.
pub(super) const SUSPICIOUS_CONTRAST: f64 = 6.0;
/// Longest time span of the neighbours in a contrast, over that of equal steps: a single missing sample gives 7/6, four missing ones 10/6.
pub(super) const LONGEST_CONTRAST: f64 = 1.7;
/// Fewest equal values in a row that may be due to a frozen sensor.
pub(super) const LEAST_FROZEN: usize = 8;
/// Step into or out of equal values from which the sensor was frozen, as a sum of standard deviations of the noise and of steps of the
/// sensor's grid: a curve on a grid rests at its turning points, but leaves them one step of the grid at a time.
pub(super) const FROZEN_STEP_NOISE: f64 = 6.0;
pub(super) const FROZEN_STEP_GRID: f64 = 3.0;
/// Largest number of warnings that are kept in detail.
pub(super) const KEPT_WARNINGS: usize = 1000;
/// Approximate number of samples from which the robust scale of a trajectory is estimated; the error of a standard deviation is then 0.5 %.
pub(super) const SCALE_SAMPLES: usize = 1 << 16;
/// Largest number of rows shown of a long table.
pub(super) const SHOWN_ROWS: usize = 20;

// ---- Motion of first order (chosen by `lnn-studies rates --part check`) ----

/// Largest residual of a velocity over its standard error.
pub(super) const RESIDUAL_OVER_ERROR: f64 = 2.5;
/// Residual, relative to the spread of the velocity, that is always accepted.
pub(super) const ACCEPTED_RESIDUAL: f64 = 0.03;
/// Residual, relative to the spread of the velocity, above which the fit is never accepted.
pub(super) const REFUSED_RESIDUAL: f64 = 0.35;
/// Smallest factor by which the residual of at least one velocity grows if the other quantities are left out.
pub(super) const GAIN_BY_OTHERS: f64 = 2.0;
/// Correlation with a velocity from which another quantity counts as a measurement of it.
pub(super) const SAME_QUANTITY: f64 = 0.995;
/// Largest degree of the polynomials.
pub(super) const FIRST_ORDER_DEGREE: usize = 3;
/// Largest number of terms: all monomials of six variables up to degree 3.
pub(super) const FIRST_ORDER_TERMS: usize = 84;
/// Fewest windows for each term.
pub(super) const WINDOWS_PER_TERM: usize = 8;
/// Windows that begin within half the width of one.
pub(super) const WINDOW_OVERLAP: f64 = 8.0;
/// Largest number of windows.
pub(super) const MOST_WINDOWS: f64 = 4000.0;
/// Number of windows in a block. Blocks are alternately fitted and tested; a block is four window widths long.
pub(super) const WINDOW_BLOCK: usize = 64;
/// Fewest windows, which leave half a block to test the fit.
pub(super) const LEAST_WINDOWS: usize = WINDOW_BLOCK + WINDOW_BLOCK / 2;
/// Ridge over the largest diagonal entry of the normal matrix: it only keeps copies of a quantity from making the matrix singular.
pub(super) const FIRST_ORDER_RIDGE: f64 = 1e-10;
