//! Limits and settings of certificates. They set how far and how fast a proof comes; its rigour rests on the numerics of enclosures alone.

// # Limits of work

/// Largest number of coordinates.
pub(super) const MOST_COORDINATES: usize = 32;
/// Largest degree of the polynomials that enclose functions.
pub(super) const MOST_POLYNOMIAL_DEGREE: usize = 3;
/// Numbers of a layer that lie side by side, so that one vector instruction works on all: eight of 64 bits fill the widest vectors.
pub(super) const LANES: usize = 8;
/// Boxes that are taken from the queue at a time: enough work for all threads, and the same order on any number of them.
pub(super) const BOXES_AT_A_TIME: usize = 128;
/// Binary logarithm of the share of the region above which boxes are evaluated in the order of their size: about the first 700 boxes.
pub(super) const LARGE_BOX: f64 = -9.5;
/// Share of the estimated halvings of a box that is carried out at once: the estimate may be too large.
pub(super) const HALVING_CAUTION: f64 = 0.5;
/// Largest number of halvings at once, into 64 parts.
pub(super) const MOST_HALVINGS: usize = 6;

// # Numerics of enclosures

/// Largest share of the radius of a range that the distance from a polynomial may have; a constant encloses the function as well beyond.
pub(super) const MOST_POLYNOMIAL_DISTANCE: f64 = 0.7;
/// Covers losses by underflow: far above the smallest normal number, far below any result.
pub(super) const UNDERFLOW: f64 = 1e-290;
/// Relative error that a function of the standard library is granted: 8 units in the last place.
pub(super) const FUNCTION_ERROR: f64 = 8.0 * f64::EPSILON;
/// Angles beyond it are not reduced: their sines are enclosed by -1 and 1.
pub(super) const MOST_REDUCED_ANGLE: f64 = 1e6;
