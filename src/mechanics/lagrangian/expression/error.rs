//! Mistakes in a formula.

/// A mistake in the text of a formula.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column {column}: {problem}")]
pub struct ExpressionError {
    /// Character of the text where it is, from 1.
    pub column: usize,
    /// The mistake, and what was expected.
    pub problem: String,
}

impl ExpressionError {
    pub(in crate::mechanics::lagrangian) fn new(column: usize, problem: impl Into<String>) -> Self {
        Self { column, problem: problem.into() }
    }
}
