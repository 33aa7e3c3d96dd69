//! Thresholds, limits and settings of the search for constraints.
//!
//! `lnn-studies rates --part constraints` checks the verdicts; see `docs/verdicts.md`.

// # Verdicts on functions that vanish

/// A combination whose variance is up to this many times that of its noise counts as vanishing: twice the standard deviation.
pub(super) const MOST_VARIANCE_RATIO: f64 = 4.0;
/// The same ratio for held-out parts of the data: three standard deviations.
pub(super) const MOST_HELD_OUT_RATIO: f64 = 9.0;
/// Largest deviation of a ratio of variances due to noise alone, in standard deviations.
pub(super) const NOISE_DEVIATIONS: f64 = 3.0;
/// Smallest ratio of the deviation of the smallest combination that does not vanish to that of the largest that does.
pub(super) const LEAST_GAP: f64 = 2.5;
/// A term may be removed if the ratio rises by no more than this over the number of independent samples: as much as a term of about 5.5
/// standard errors.
pub(super) const REMOVAL_RISE: f64 = 30.0;
/// Half-width of the confidence interval of a factor, over the largest factor, above which the factor is not determined.
pub(super) const UNDETERMINED_FACTOR: f64 = 0.3;
/// Largest root mean square distance of smoothed positions from their constraints, in standard deviations of the noise and over the size of
/// the motion, at which the motion is said to obey them.
pub(crate) const OBEDIENCE: (f64, f64) = (5.0, 0.01);
/// A column moves if its standard deviation along its trajectories exceeds this many standard deviations of its noise. Otherwise it would
/// vanish itself, and with it every function of it.
pub(super) const LEAST_MOTION_RATIO: f64 = 2.0;

// # Verdicts on directions and branches

/// Smallest root mean square of a unit row's part outside the span of others: below, the row follows from them.
pub(super) const LEAST_NEW_PART: f64 = 0.15;
/// Share of the states at which a function that vanishes must have a part outside the span of the constraints found so far, and the smallest
/// size of that part.
pub(super) const NEW_FUNCTION: (f64, f64) = (0.1, 0.1);
/// The same two for additional candidates, whose noise is larger.
pub(super) const FURTHER_CANDIDATE: (f64, f64) = (0.5, LEAST_NEW_PART);
/// Smallest part outside the span, over the largest one, at which a simpler candidate is taken first.
pub(super) const SIMPLER_PART: f64 = 0.5;
/// A row of unit length nearly follows from others at a state if its part outside their span is below this.
pub(super) const NEARLY_DEPENDENT: f64 = 0.1;
/// The curl of a row within its kernel counts as noise below this share of its derivatives.
pub(super) const MOST_CURL: f64 = 0.03;
/// Fraction of the gradients that must share the same directions.
pub(super) const COMMON_DIRECTIONS: f64 = 0.99;
/// Largest deviation of a ratio of gradients from a whole number.
pub(super) const WHOLE_NUMBER_ERROR: f64 = 0.05;
/// Integer multiples of an angle that are tried.
pub(super) const ANGLE_MULTIPLES: std::ops::RangeInclusive<u32> = 1..=12;
/// Smallest square of a gradient, over its mean square, at which its direction is more than noise.
pub(super) const VISIBLE_GRADIENT: f64 = 1e-2;
/// Ratio of the smallest singular value of the gradients to its largest along the motion below which a second branch counts as reached: half of
/// the value for a motion that crosses a branch with samples a hundredth of a radian apart.
pub(super) const BRANCH_RATIO: f64 = 0.005;

// # Verdicts on correlated noise

/// Largest lag-1 autocorrelation of noise; above it, noise and slow motion cannot be separated.
pub(super) const MOST_AUTOCORRELATION: f64 = 0.97;
/// Decrease of the misfit, in units of its standard deviation, above which noise counts as correlated.
pub(super) const COLOURED_MISFIT: f64 = 12.0;
/// Largest excess of the misfit over the smallest one that is not excluded. The differences at neighbouring distances share samples, so
/// that the misfit scatters by far more than one unit.
pub(super) const ALLOWED_MISFIT: f64 = 40.0;
/// Largest mean square of differences, relative to that at distance 1, at which the noise is visible beside the motion.
pub(super) const MOST_MOTION_SQUARE: f64 = 40.0;
/// Lags, in samples, at which differences are compared.
pub(super) const COMPARED_DISTANCES: std::ops::RangeInclusive<usize> = 1..=12;
/// Smallest number of differences that is used.
pub(super) const LEAST_DIFFERENCES: usize = 64;
/// Noise up to this multiple of the rounding error of the largest number means that the data are exact.
pub(super) const EXACT_ROUNDINGS: f64 = 16.0;

// # Limits of work

/// Largest number of terms that are searched together.
pub(super) const MOST_TERMS: usize = 1000;
/// Smallest number of samples per term.
pub(super) const SAMPLES_PER_TERM: usize = 4;
/// Largest number of samples that are used, evenly spaced.
pub(super) const MOST_SAMPLES: usize = 60_000;
/// Largest number of terms at which the data are cut into eight parts instead of four.
pub(super) const MOST_TERMS_IN_EIGHTHS: usize = 300;
/// Number of states at which gradients are compared.
pub(super) const GRADIENT_STATES: usize = 64;
/// Number of states at which functions are tested for independence, which must include one near a place where they depend on each other.
pub(super) const INDEPENDENCE_STATES: usize = 256;
/// Usual number of states at which a Lagrangian is examined.
pub const EXAMINED_STATES: usize = 64;
/// Shares of the largest weight below which several terms are removed at a time.
pub(super) const REMOVED_SHARES: [f64; 5] = [0.1, 0.03, 0.01, 3e-3, 1e-3];
/// Number of terms up to which terms are removed one at a time.
pub(super) const MOST_TERMS_REMOVED_SINGLY: usize = 40;
/// Rounds of reweighted least squares for combinations of few terms.
pub(super) const REWEIGHTING_ROUNDS: usize = 12;
/// Random starts of that search for each term.
pub(super) const STARTS_PER_TERM: usize = 4;
/// Largest number of multiplications of that search.
pub(super) const MOST_MULTIPLICATIONS: usize = 4_000_000_000;

// # Numerics

/// Deviations below this share of a term are rounding.
pub(super) const ROUNDING_SHARE: f64 = 1e-6;
/// Preference for pivots of lower degree, which would otherwise not divide terms of higher degree.
pub(super) const LOWER_DEGREE_PREFERENCE: f64 = 1e-3;
/// Factor above which a term belongs to a combination of few terms.
pub(super) const LEAST_SPARSE_FACTOR: f64 = 1e-3;
/// Ratio of weights above which a heavier term of the same degree gets the factor 1 instead of the first one.
pub(super) const HEAVIER_TERM: f64 = 3.0;
/// Smallest squared part of a row that is counted in a volume: a state at which rows depend on each other counts, but does not outweigh all
/// others.
pub(super) const LEAST_SQUARED_PART: f64 = 1e-6;
/// Largest sum of reciprocal volumes, over the previous one, at which an exchange of functions is an improvement.
pub(super) const IMPROVED_VOLUME: f64 = 0.999;
