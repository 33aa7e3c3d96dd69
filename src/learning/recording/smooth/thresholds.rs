//! Every number that sets the estimation of noise, the choice of windows or the limits of smoothing.
//!
//! The tests of this folder compare estimated errors with true ones, and noise with that which was added; `lnn-studies rates --part check`
//! checks the verdicts that use them.

// ---- Samples near gaps ----

/// Largest variance of an acceleration near a gap, over that of a full window of equal steps, for the sample to be used for learning: twice
/// the standard error.
pub(super) const MOST_GAP_VARIANCE: f64 = 4.0;
/// Largest time span of a window near a gap, over its length, for its sample to be used for learning.
pub(super) const MOST_GAP_STRETCH: f64 = 1.5;

// ---- Noise ----

/// Orders of the differences that are tried.
pub(super) const CONTRAST_ORDERS: [usize; 5] = [2, 4, 6, 8, 10];
/// Contrasts, in standard deviations, beyond which they do not count as noise: one in 16,000 of normal noise.
pub(super) const OUTLYING_CONTRAST: f64 = 4.0;
/// Standard errors within which the results of two orders agree.
pub(super) const ORDER_AGREEMENT: f64 = 2.0;
/// Ratio of the results of the last two orders below which the estimate is still decreasing, so that it may contain motion.
pub(super) const STILL_FALLING: f64 = 0.8;
/// Noise, in units of the rounding of the largest number, up to which it counts as rounding instead of motion.
pub(super) const ROUNDING_NOISE: f64 = 16.0;
/// Ratio of the noise at a sample to that of the recording, or its inverse, up to which they count as equal. The local estimate comes from
/// 2 [`LOCAL_CONTRASTS`] correlated contrasts, so that its error is 10 to 20 %.
pub(super) const SAME_NOISE: f64 = 2.0;
/// Contrasts on either side that determine the noise at a sample.
pub(super) const LOCAL_CONTRASTS: usize = 64;
/// Smallest noise at a sample over that of the recording.
pub(super) const LEAST_LOCAL_NOISE: f64 = 1e-3;
/// Most contrasts that are examined for one estimate; the error of a standard deviation is then below 1 %.
pub(super) const MOST_CONTRASTS: usize = 1 << 16;
/// Range of the ratio of the noise of positions to that of velocities, in time steps; beyond it the larger noise adds no information.
pub(super) const NOISE_RATIOS: [f64; 2] = [1e-6, 1e6];

// ---- Windows ----

/// Standard deviations by which an estimated squared bias must exceed 0 to be significant.
pub(super) const BIAS_SIGNIFICANCE: f64 = 3.0;
/// Largest squared error of the typical window, over the smallest, at which a trajectory or a sample keeps it: an error larger by a factor
/// of 1.4.
pub(super) const KEPT_SQUARED_ERROR: f64 = 2.0;
/// Squared error, relative to the smallest, that counts as a clear rise.
pub(super) const RISEN_SQUARED_ERROR: f64 = 1.5;
/// Squared error, relative to the smallest, above which longer windows are not tried: twice the error.
pub(super) const HOPELESS_SQUARED_ERROR: f64 = 4.0;
/// Smallest share of the samples on trajectories that are long enough for a window.
pub(super) const LEAST_COVERED: f64 = 0.5;
/// Longest window that is tried for a whole trajectory, in samples.
pub(super) const LONGEST_WINDOW: usize = 2001;
/// Places of a recording at which windows are tried.
pub(super) const TRIED_PLACES: usize = 2048;
/// Factors of the typical window that are tried along a trajectory: `2^(k/3)` for `k` from the first number to the second, 1/16 to 8.
pub(super) const WINDOW_FACTORS: [i32; 2] = [-12, 9];
/// Places per window at which a factor is tried.
pub(super) const PLACES_PER_WINDOW: usize = 8;
/// Independent places within a window to either side.
pub(super) const INDEPENDENT_PLACES: f64 = 4.0;
/// Largest degree of a local polynomial, including the two more degrees that estimate the bias.
pub(crate) const LARGEST_DEGREE: usize = 10;
