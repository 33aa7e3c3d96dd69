//! Failures of the terms of a batch.

use crate::linalg::Failure;

/// Why terms could not be computed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MechanicsError {
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
    /// The mass matrix of a state cannot be solved with.
    #[error("mass matrix of state {row} is singular (condition number {condition:.3e})")]
    Singular {
        /// Row of the batch.
        row: usize,
        /// Estimated 2-norm condition number (infinite if exactly singular).
        condition: f64,
    },
    /// A constraint that depends on the others at a state, although it does not elsewhere: they leave open what carries the load.
    #[error("constraint {constraint} depends on the others at state {row}")]
    Dependent {
        /// Row of the batch.
        row: usize,
        /// Which constraint, from 0.
        constraint: usize,
    },
    /// A term is not finite.
    #[error("{what} of state {row} is not finite")]
    NotFinite {
        /// Row of the batch.
        row: usize,
        /// Which term.
        what: &'static str,
    },
    /// A state at which the mass matrix is not certified, of a model that is to move where it is.
    #[error("mass matrix of state {row} is not certified")]
    Uncertified {
        /// Row of the batch.
        row: usize,
    },
    /// A model that a flag has ended.
    #[error("interrupted")]
    Interrupted,
    /// Derivatives that a model does not have.
    #[error("{what}: this model has no such derivatives")]
    Derivatives {
        /// Of which term.
        what: &'static str,
    },
}

impl MechanicsError {
    /// Row of the state that failed; `None` of an error that is not about one state.
    pub fn row(&self) -> Option<usize> {
        match *self {
            Self::Singular { row, .. }
            | Self::Dependent { row, .. }
            | Self::NotFinite { row, .. }
            | Self::Uncertified { row } => Some(row),
            Self::Shape { .. } | Self::Interrupted | Self::Derivatives { .. } => None,
        }
    }

    /// The same of the state in another row.
    pub(crate) fn at_row(mut self, to: usize) -> Self {
        if let Self::Singular { row, .. }
        | Self::Dependent { row, .. }
        | Self::NotFinite { row, .. }
        | Self::Uncertified { row } = &mut self
        {
            *row = to;
        }
        self
    }

    /// A state whose acceleration cannot be solved for.
    pub(crate) fn unsolved(row: usize, failure: Failure) -> Self {
        match failure {
            Failure::Singular { condition } => Self::Singular { row, condition },
            Failure::NotFinite => Self::NotFinite { row, what: "acceleration" },
        }
    }
}
