//! Numbers that decide, limit or set roll-outs; coefficients of the methods stand with the methods.

// Verdicts on starts and options. `cargo test --test suite -- rollout` checks what follows from them.

/// Most samples of one motion: with a few coordinates they already take gigabytes.
pub(super) const MOST_SAMPLES: f64 = 1e8;
/// A start closer to the constraints than this share of its size is projected onto them: far above the rounding of numbers in a file, far
/// below a mistake in one.
pub(super) const NEAR_CONSTRAINTS: f64 = 1e-3;
/// Finest relative tolerances of `f32` and `f64`, about nine roundings each. Below, steps no longer advance the time.
pub(super) const LEAST_TOLERANCES: (f64, f64) = (1e-6, 2e-15);
/// A time this close to a sample, in units of their distance, takes the value of the sample: the band-limited weight differs from 1 by about
/// the square of it.
pub(super) const AT_SAMPLE: f64 = 1e-12;

// Verdicts along a motion.

/// A branch begins where the smallest singular value of the constraints is below this share of the largest value that it had. Where it
/// passes through 0, the search finds a minimum far below; a motion that stays away from its branches by a thousandth is unique.
pub(super) const BRANCH: f64 = 1e-3;
/// A step is searched for a branch if a row turns by more than the angle of this cosine, 26 degrees: a row that passes through 0 turns by
/// 180.
pub(super) const SUSPICIOUS_COSINE: f64 = 0.9;
/// A step is searched for a branch if the smallest singular value is below this share of the largest: far above [`BRANCH`],
/// so that a step past a branch is noticed at its end.
pub(super) const SUSPICIOUS_SINGULAR_VALUE: f64 = 0.3;
/// Impacts of one event, each sooner after the one before than time resolves, from which they count as accumulating: with a coefficient of
/// restitution of 0.5, sixteen impacts shorten the flights by 1e5.
pub(super) const QUICK_IMPACTS: usize = 16;
/// Corrections of Newton's method up to this many roundings of the unknowns count as rounding. A stiff spring between two masses has
/// corrections of up to three: its force is uncertain by the rounding of either position times its constant.
pub(super) const NEWTON_ROUNDINGS: f64 = 16.0;
/// Residuals up to 2 to this power roundings of their largest term count as the rounding of a model: 4096, for sums of thousands of terms.
pub(super) const MODEL_ROUNDINGS_LOG2: i32 = 12;

// Limits of work.

/// Evaluations of one implicit step. With a matrix that is kept, every one halves the residual: 60 exceed the 53 bits of `f64`.
pub(super) const MOST_NEWTON_ITERATIONS: usize = 60;
/// New iteration matrices in one implicit step.
pub(super) const MOST_NEWTON_MATRICES: usize = 4;
/// A matrix is replaced before the next step once a step takes this many evaluations more than its best.
pub(super) const NEWTON_PATIENCE: usize = 1;
/// Newton steps from a momentum to its velocity.
pub(super) const MOST_VELOCITY_SWEEPS: usize = 50;
/// Halvings that determine the smallest singular value to the rounding of `f64`.
pub(super) const EXACT_HALVINGS: usize = 52;
/// Halvings that determine it to a four-thousandth, enough for comparisons.
pub(super) const ROUGH_HALVINGS: usize = 12;
/// Places of a step at which the smallest singular value is examined first.
pub(super) const BRANCH_PLACES: usize = 16;
/// Trisections around the lowest of them: they narrow the interval to 1e-7 of its width, below what a value that is flat at its minimum
/// resolves.
pub(super) const BRANCH_TRISECTIONS: usize = 40;
/// Trisections of a part of a step in which the number of an event may have an extreme beyond zero, to 1e-7 of its width.
pub(super) const EXTREME_TRISECTIONS: usize = 40;

// Numerics.

/// First step after a break of the force over the last step before it, which the break may have cut short.
pub(super) const STEP_GROWTH_AFTER_BREAK: f64 = 2.0;
/// Share of an accepted step that is retried where the model fails at its end.
pub(super) const RETRIED_SHARE: f64 = 0.25;
/// Parts of a step at whose ends the sides of events are compared.
pub(super) const EVENT_PARTS: usize = 8;
/// Share of such a part over which the slope of an event's number is measured.
pub(super) const SLOPE_SHARE: f64 = 1.0 / 256.0;
/// Parts of a step between which rows of constraints are compared: adaptive methods take steps in which wheels make whole turns.
pub(super) const ROW_PARTS: usize = 8;
/// Parts of a step with three nodes of Gauss each, by which powers are integrated.
pub(super) const QUADRATURE_PANELS: usize = 2;
/// Samples whose interpolating polynomial is integrated.
pub(super) const QUADRATURE_SAMPLES: usize = 6;
/// States that are evaluated, or handed over, at once: enough to fill the 64 lanes of a program several times.
pub(super) const STATES_TOGETHER: usize = 256;
/// Motions of a group; more gain nothing, since products of eight states at a time are as quick per state as any.
pub(super) const MOTIONS_TOGETHER: usize = 8;
