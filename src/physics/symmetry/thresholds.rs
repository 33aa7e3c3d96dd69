//! Every number that decides what counts as a symmetry, limits the search or sets its method.
//!
//! The rows "conserved" of `lnn-studies rates --part readings` count how often charges and energies are rightly called conserved;
//! `docs/verdicts.md` states the rates.

use super::Symmetries;

// ---- Singular values that count as zero ----

impl Symmetries {
    /// Noise of the terms of a Lagrangian written down: singular values below it are zero.
    pub const EXACT: f64 = 1e-8;
}
/// Largest value that may be meant to be zero if the noise is unknown: a tenth of its size without a symmetry.
pub(super) const MOST_ZERO_VALUE: f64 = 0.1;
/// Tolerances that can be used: from the rounding of a number near 1 to the largest value that may be meant to be zero.
pub const TOLERANCES: [f64; 2] = [f64::EPSILON, MOST_ZERO_VALUE];
/// Smallest gap between values that are zero and others, if the noise is unknown.
pub(super) const LEAST_MODEL_GAP: f64 = 10.0;
/// Least noise of a model: smaller values are not distinguished.
pub(super) const LEAST_MODEL_NOISE: f64 = 1e-3;
/// Smallest gap if the noise is known.
pub(super) const LEAST_EXACT_GAP: f64 = 30.0;
/// Smallest ratio of the first value that is not zero to a known noise.
pub(super) const LEAST_ABOVE_NOISE: f64 = 3.0;

// ---- What is new, even or at rest ----

/// Smallest independent fraction at which a quantity counts as new.
pub(super) const NEW_PART: f64 = 1e-4;
/// Work of a force along a field, relative to that of its components, that counts as rounding.
pub(super) const WORKLESS: f64 = 1e-9;
/// Relative rounding of terms that agree, such as those at `v` and `-v`.
pub(super) const EQUAL_TERMS: f64 = 1e-10;
/// Part of the whole below which a term of a comparison is rounding, or an energy the same at all states.
pub(super) const ROUNDING_TERM: f64 = 1e-9;
/// Standard errors that a column of a gauge function must explain to be significant.
pub(super) const GAUGE_SIGNIFICANCE: f64 = 3.0;
/// Largest relative distance at which motions agree, and smallest one at which Lagrangians do not.
pub(super) const SAME_MOTION: f64 = 1e-6;
pub(super) const OTHER_LAGRANGIAN: f64 = 1e-3;

// ---- Algebras ----

/// Noise of an entry of a field, in units of the last singular value that is zero, and its range.
pub(super) const ENTRY_NOISE: f64 = 10.0;
pub(super) const ENTRY_NOISES: (f64, f64) = (1e-9, 0.05);
/// Noise of a structure constant, in units of that of the fields, and at least.
pub(super) const CONSTANT_NOISE: f64 = 10.0;
pub(super) const LEAST_CONSTANT_NOISE: f64 = 1e-7;
/// Largest remainder of the commutators of an algebra, in units of the noise of the fields, and its range.
pub(super) const CLOSURE_NOISE: f64 = 30.0;
pub(super) const CLOSURES: (f64, f64) = (1e-6, 0.1);
/// Share of squares up to which their difference is rounding: it has only half of the digits.
pub(super) const SQUARE_ROUNDING: f64 = 1e-12;
/// Part of an axis that must be independent of the axes before it.
pub(super) const INDEPENDENT_AXIS: f64 = 1e-6;
/// Largest number of fields whose algebra is computed: beyond, their commutators take minutes.
pub const MOST_FIELDS: usize = 200;
/// Largest dimension of an algebra that is identified: named ones are far smaller.
pub(super) const MOST_NAMED_DIMENSION: usize = 64;
/// Largest number of states at which commutators are computed, and of products of numbers, which take seconds.
pub(super) const COMMUTATOR_STATES: usize = 400;
pub(super) const COMMUTATOR_PRODUCTS: usize = 10_000_000_000;

// ---- Size of a search ----

/// Largest number of unknown coefficients of a search.
pub const MOST_UNKNOWNS: usize = 4000;
/// Largest number of unknown coefficients of a search over the default basis: it takes seconds.
pub(super) const MOST_USUAL_UNKNOWNS: usize = 1300;
/// Largest product of unknown coefficients and states; a search stores up to about eight times as many numbers, two gigabytes.
pub(super) const MOST_NUMBERS: usize = MOST_UNKNOWNS * 2 * MOST_UNKNOWNS;
/// Highest degree of a family of functions.
pub(super) const HIGHEST_DEGREE: usize = 12;
/// States of a search at least: of a Lagrangian that is written down, and of a model, whose errors average out.
pub(super) const EXACT_STATES: usize = 400;
pub(super) const MODEL_STATES: usize = 1000;
/// States of a search for each unknown coefficient.
pub(super) const STATES_PER_UNKNOWN: usize = 2;
/// Draws for each accepted state, at most.
pub(super) const DRAWS_PER_STATE: usize = 100;
/// Share of every training range over which a model is examined: it is worst near the edges.
pub(super) const INNER_RANGE: f64 = 0.8;
/// States of a motion that are evaluated at once.
pub(super) const STATES_AT_ONCE: usize = 1024;
/// Highest power of `B` in `f`, for geodesics.
pub(super) const METRIC_POWERS: usize = 3;

// ---- Functions and columns that depend on others ----

/// Smallest independent part of a function, or of a quantity: less counts as a combination of the others, as `sin^2` given `1` and `cos
/// 2x`.
pub(super) const INDEPENDENT_FUNCTION: f64 = 1e-7;
/// Smallest independent part of a column of a comparison, or of a known quantity.
pub(super) const INDEPENDENT_COLUMN: f64 = 1e-9;
/// Smallest independent part of a column of a null vector.
pub(super) const INDEPENDENT_NULL_COLUMN: f64 = 1e-10;
/// Smallest size of a combination of fields, over the largest: rounding of a square.
pub(super) const LEAST_FIELD_SIZE: f64 = 1e-13;
/// Smallest eigenvalue of a frame over the largest.
pub(super) const LEAST_EIGENVALUE: f64 = 1e-12;

// ---- Fields with few terms ----

/// Smallest pivot over the largest entry left.
pub(super) const LEAST_PIVOT: f64 = 0.3;
/// Parts of the largest entry below which entries are left out on trial, one after the other.
pub(super) const NEGLIGIBLE_ENTRIES: [f64; 4] = [1e-4, 1e-5, 1e-6, 1e-7];
/// Largest residual of a null vector with fewer entries, in units of the noise, and in any case.
pub(super) const REFINED_RESIDUAL: f64 = 10.0;
pub(super) const REFINED_ROUNDING: f64 = 1e-9;
/// Part of the largest entry up to which a fitted entry is rounding.
pub(super) const ROUNDING_ENTRY: f64 = 1e-10;
/// Largest factor by which the noise of a field may grow to need fewer functions.
pub(super) const SIMPLER_NOISE: f64 = 3.0;
/// Number of fields times the cube of their unknown coefficients up to which fields of few functions are sought, half a minute.
pub(super) const MOST_SIMPLIFIED: f64 = 2e10;
/// Steps of the reweighted least squares.
pub(super) const SPARSE_STEPS: usize = 12;
/// Part of the largest entry that counts as zero in the end.
pub(super) const SPARSE_ZERO: f64 = 2e-3;
/// Penalty of an entry, in units of the squared noise.
pub(super) const SPARSE_PENALTY: f64 = 0.3;
/// Largest growth of the residual that few entries justify.
pub(super) const SPARSE_RESIDUAL: f64 = 2.0;
/// Smallest squared residual, in units of the squared noise.
pub(super) const SPARSE_LEAST_RESIDUAL: f64 = 1e-2;
/// Part of the current width of the penalty up to which an entry stays active.
pub(super) const SPARSE_WIDTH: f64 = 0.1;

// ---- Reports ----

/// Singular values that are shown beyond the gap, and at most.
pub(super) const SHOWN_BEYOND_GAP: usize = 5;
pub(super) const MOST_SHOWN: usize = 20;
/// Largest deviation from 1 of a factor that is not shown.
pub(super) const UNIT_FACTOR: f64 = 1e-6;
