//! Numbers that decide, limit or set the routines for small matrices; widths of blocks in memory stand with their loops.

// Verdicts on matrices. `cargo test -p lnn-engine -- linalg` checks them.

/// Below this ratio of the smallest pivot to the largest element a solution is refined, or the matrix examined: ten bits may be lost.
pub(crate) const SMALL_PIVOT: f64 = 1.0 / 1024.0;
/// Also above this ratio of the largest element of the triangular factor to that of the matrix: two more bits.
pub(super) const LARGE_GROWTH: f64 = 4.0;
/// Below this many roundings, times `n^2`, of the largest element the smallest pivot may be that of a singular matrix.
pub(super) const SUSPICIOUS_ROUNDINGS: f64 = 1024.0;
/// A condition number, bounded by Frobenius norms, below this share of the reciprocal rounding excludes a singular matrix.
pub(super) const REGULAR_SHARE: f64 = 0.25;
/// Keeps the paper's denominators away from zero; the value is the paper's.
pub(super) const PENALTY_FLOOR: f64 = 1e-8;

// Sizes at which another routine is faster, by `cargo bench --bench linalg`.

/// Smaller matrices are eliminated with pivots in no more time than as definite ones.
pub(super) const LEAST_DEFINITE_SIZE: usize = 5;
/// From this size on the loops along a row are long enough for one definite matrix at a time.
pub(super) const ALONE_SIZE: usize = 47;
/// From this size on faer's blocked elimination of one right-hand side is faster than that on lanes, whose blocks then no longer fit into the
/// nearest cache.
pub(super) const BLOCKED_SIZE: usize = 47;
/// The same limit when the number of right-hand sides equals the number of rows.
pub(super) const BLOCKED_INVERSE_SIZE: usize = 40;
/// Size above which faer's tridiagonal method for eigenvalues beats Jacobi's on lanes.
pub(super) const TRIDIAGONAL_SIZE: usize = 32;
/// Size from which the search for independent blocks is cheap compared with a full matrix.
pub(super) const BLOCK_SEARCH_SIZE: usize = 16;
/// Rows up to which dot products are faster than a blocked product.
#[cfg(feature = "faer")]
pub(super) const DOT_PRODUCT_ROWS: usize = 8;

// Limits of work.

/// Sweeps of Jacobi's method for eigenvalues: about ten suffice at `n = 20` in double-double.
pub(super) const MOST_EIGEN_SWEEPS: usize = 40;
/// Sweeps of Jacobi's method for singular values, which converges as fast.
#[cfg(any(test, not(feature = "faer")))]
pub(super) const MOST_SINGULAR_SWEEPS: usize = 40;
/// Rounds that bring scales together; each halves their exponents, of at most eleven bits in `f64`.
pub(super) const MOST_BALANCING_ROUNDS: usize = 16;
