//! Errors of a batch of matrices, and the failure of a row.

use serde::{Deserialize, Serialize};

/// Why one matrix of a batch gave no answer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinalgError {
    /// A slice has the wrong length.
    #[error("{what}: expected {expected} numbers, found {found}")]
    Shape {
        /// Which argument.
        what: &'static str,
        /// Numbers expected.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// A matrix is singular to working precision.
    #[error("matrix {row} is singular (condition number {condition:.3e})")]
    Singular {
        /// Row of the batch.
        row: usize,
        /// 2-norm condition number.
        condition: f64,
    },
    /// A matrix, a right-hand side or an answer is not finite.
    #[error("matrix {row} or its answer is not finite")]
    NotFinite {
        /// Row of the batch.
        row: usize,
    },
}

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
