//! Batched small dense linear algebra: solve, minimum-norm solution, symmetric eigen, inertia, minors; products.
//!
//! Matrices are row-major `(batch, n, n)` slices, vectors `(batch, n)`. Kernels run on lanes: element `(i, j)` of `LANES` matrices side by
//! side, every lane through the same branch-free steps, so that a matrix gives the same bits at any position in a batch. A [`Workspace`] is
//! reused; nothing else allocates for matrices below the size at which faer, with the feature of this name, takes over: 47 for systems of
//! one right-hand side and 40 for inverses, unless they are positive definite, and 33 for eigenvalues.
//!
//! ```
//! use lnn::linalg::{LinalgError, Workspace, eigenvalues, solve};
//!
//! // Two systems at once: [[2, 1], [1, 2]] x = (3, 3) and diag(4, -1) x = (4, 1).
//! let (matrices, right) = ([2.0, 1.0, 1.0, 2.0, 4.0, 0.0, 0.0, -1.0], [3.0, 3.0, 4.0, 1.0]);
//! let (mut x, mut values, mut workspace) = ([0.0_f64; 4], [0.0; 4], Workspace::new());
//! solve(2, &matrices, &right, &mut x, &mut workspace)?;
//! assert!(x.iter().zip([1.0, 1.0, 1.0, -1.0]).all(|(x, exact)| (x - exact).abs() < 1e-15));
//! eigenvalues(2, &matrices, &mut values, &mut workspace)?;
//! assert!(values.iter().zip([1.0, 3.0, -1.0, 4.0]).all(|(w, exact)| (w - exact).abs() < 1e-15));
//! # Ok::<(), LinalgError>(())
//! ```

mod batch;
mod blocks;
#[cfg(feature = "faer")]
mod by_faer;
mod compiled;
mod components;
mod condition;
mod definite;
mod eigen;
mod elimination;
mod inertia;
mod large_systems;
mod matmul;
mod signature;
mod singular;
mod solve;
mod thresholds;

pub use crate::scalar::{MatMut, MatRef};
pub use batch::Workspace;
pub(crate) use batch::{Buffer, LANES};
pub use condition::condition_number;
pub use eigen::{eigenvalues, eigh};
pub use inertia::Inertia;
pub(crate) use inertia::Scaled;
pub use solve::{inverse, solve, solve_symmetric};
pub(crate) use thresholds::SMALL_PIVOT;

// For the packages of this repository.
#[doc(hidden)]
pub use {
    components::components,
    inertia::{adjugate, inertia, is_positive_definite, leading_minors},
    matmul::{dot, gemm},
    signature::{
        SignatureBuffers, Violation, characteristic_scales, eigenvalue_violation, has_one_negative, has_signature,
        one_negative_violation, sylvester_violation,
    },
    singular::{MinimumNorm, minimum_norm, singular},
};

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Why one matrix of a batch gave no answer.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub enum Failure {
    /// Singular to working precision; the 2-norm condition number is infinite if exactly singular.
    Singular {
        /// 2-norm condition number of the matrix as given.
        condition: f64,
    },
    /// The input, or the answer, has an infinity or a `NaN`.
    NotFinite,
}

/// Error of a batched operation.
#[derive(Clone, Debug, PartialEq)]
pub enum LinalgError {
    /// A slice has the wrong length.
    Shape {
        /// Which argument.
        what: &'static str,
        /// Numbers expected.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// A matrix is singular to working precision.
    Singular {
        /// Row of the batch.
        row: usize,
        /// 2-norm condition number.
        condition: f64,
    },
    /// A matrix, a right-hand side or an answer is not finite.
    NotFinite {
        /// Row of the batch.
        row: usize,
    },
}

impl core::fmt::Display for LinalgError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Shape { what, expected, found } => write!(f, "{what}: expected {expected} numbers, found {found}"),
            Self::Singular { row, condition } => {
                write!(f, "matrix {row} is singular (condition number {condition:.3e})")
            }
            Self::NotFinite { row } => write!(f, "matrix {row} or its answer is not finite"),
        }
    }
}

impl core::error::Error for LinalgError {}

impl LinalgError {
    /// The error of one row.
    pub(crate) fn of_row(row: usize, failure: Failure) -> Self {
        match failure {
            Failure::Singular { condition } => Self::Singular { row, condition },
            Failure::NotFinite => Self::NotFinite { row },
        }
    }
}

/// Refuses a slice of the wrong length.
pub(crate) fn expect_length(what: &'static str, expected: usize, found: usize) -> Result<(), LinalgError> {
    if expected == found { Ok(()) } else { Err(LinalgError::Shape { what, expected, found }) }
}
