//! Thresholds, limits and settings of roll-outs; coefficients of the methods are in the files of the methods.

// Tests of initial states and options. `cargo test --test suite -- rollout` checks their consequences.

/// Largest number of samples of one motion: even with a few coordinates they take gigabytes.
pub(super) const MOST_SAMPLES: f64 = 1e8;
/// An initial state whose distance from the constraints is below this fraction of its size is projected onto them. This is far above the
/// rounding of numbers in a file, and far below a typing error in one.
pub(super) const NEAR_CONSTRAINTS: f64 = 1e-3;
/// Finest relative tolerances of `f32` and `f64`, about nine rounding errors each. With finer ones, steps no longer advance the time.
pub(super) const LEAST_TOLERANCES: (f64, f64) = (1e-6, 2e-15);
/// A time this close to a sample, as a fraction of the sampling interval, takes the value of the sample. The band-limited weight differs
/// from 1 by about the square of this fraction.
pub(super) const AT_SAMPLE: f64 = 1e-12;

// Tests along a motion.

/// A branch begins where the smallest singular value of the constraints is below this fraction of its largest value so far. If it passes
/// through 0, the search finds a minimum far below; a motion whose value always stays above a thousandth is unique.
pub(super) const BRANCH: f64 = 1e-3;
/// A step is searched for a branch if a row rotates by more than the angle with this cosine, 26 degrees; a row that passes through 0
/// rotates by 180 degrees.
pub(super) const SUSPICIOUS_COSINE: f64 = 0.9;
/// A step is searched for a branch if the smallest singular value is below this fraction of its maximum. This is far above [`BRANCH`], so
/// that a branch within a step is noticed at its end.
pub(super) const SUSPICIOUS_SINGULAR_VALUE: f64 = 0.3;
/// Impacts count as accumulating after this many impacts of one event at intervals below the resolution of time: with a coefficient of
/// restitution of 0.5, sixteen impacts shorten the flights by a factor of 1e5.
pub(super) const QUICK_IMPACTS: usize = 16;
/// Corrections of Newton's method below this multiple of the rounding error of the unknowns count as rounding. A stiff spring between two
/// masses has corrections of up to three rounding errors, since the rounding of either position times the spring constant is an uncertainty
/// of its force.
pub(super) const NEWTON_ROUNDINGS: f64 = 16.0;
/// Base-2 logarithm of the multiple of the rounding error of the largest term below which a residual counts as rounding: 4096, for sums of
/// thousands of terms.
pub(super) const MODEL_ROUNDINGS_LOG2: i32 = 12;

// Limits of computing time.

/// Largest number of evaluations in one implicit step. With a fixed matrix each one halves the residual, and 60 halvings exceed the 53 bits
/// of `f64`.
pub(super) const MOST_NEWTON_ITERATIONS: usize = 60;
/// Largest number of iteration matrices in one implicit step.
pub(super) const MOST_NEWTON_MATRICES: usize = 4;
/// A matrix is replaced before the next step if a step takes more evaluations than the best step with this matrix by at least this number.
pub(super) const NEWTON_PATIENCE: usize = 1;
/// Largest number of Newton steps from a momentum to its velocity.
pub(super) const MOST_VELOCITY_SWEEPS: usize = 50;
/// Number of bisections that determine the smallest singular value to the rounding of `f64`.
pub(super) const EXACT_HALVINGS: usize = 52;
/// Number of bisections that determine it to a relative accuracy of 1/4000, enough for comparisons.
pub(super) const ROUGH_HALVINGS: usize = 12;
/// Number of points in a step at which the smallest singular value is evaluated first.
pub(super) const BRANCH_PLACES: usize = 16;
/// Number of trisections around the lowest of these points: they narrow the interval to 1e-7 of its width, which is sufficient because the
/// value is flat at its minimum.
pub(super) const BRANCH_TRISECTIONS: usize = 40;
/// Number of trisections of a part of a step in which the value of an event may have an extremum beyond zero; they narrow it to 1e-7 of its
/// width.
pub(super) const EXTREME_TRISECTIONS: usize = 40;

// Numerical settings.

/// Ratio of the first step after a break of the force to the last step before it, which the break may have shortened.
pub(super) const STEP_GROWTH_AFTER_BREAK: f64 = 2.0;
/// Fraction of an accepted step that is retried if the model fails at its end.
pub(super) const RETRIED_SHARE: f64 = 0.25;
/// Number of parts of a step at whose ends the signs of events are compared.
pub(super) const EVENT_PARTS: usize = 8;
/// Fraction of such a part over which the slope of an event is measured.
pub(super) const SLOPE_SHARE: f64 = 1.0 / 256.0;
/// Number of parts of a step between which constraint rows are compared, since wheels may make whole turns in one adaptive step.
pub(super) const ROW_PARTS: usize = 8;
/// Number of panels per step, with three Gauss nodes each, for the integration of powers.
pub(super) const QUADRATURE_PANELS: usize = 2;
/// Number of samples per interpolating polynomial that is integrated.
pub(super) const QUADRATURE_SAMPLES: usize = 6;
/// Number of states that are evaluated or delivered at once: enough to fill the 64 lanes of a program several times.
pub(super) const STATES_TOGETHER: usize = 256;
/// Number of motions in a group; larger groups bring no gain, because products of eight states at a time are already as fast per state as
/// possible.
pub(super) const MOTIONS_TOGETHER: usize = 8;
