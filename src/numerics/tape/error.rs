//! Errors of tapes.

/// Why a recording or a sweep gave no result.
///
/// Operators cannot fail, so the first error is kept by the tape, the number becomes `NaN`, and the call that asks
/// for a result returns the error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TapeError {
    /// An operation joined variables of two tapes.
    #[error("an operation mixes variables of two tapes")]
    MixedTapes,
    /// A program that is to be replayed read a value while it was recorded.
    #[error("the recorded program reads a value (a data-dependent branch); express the branch by `select`")]
    DataDependentBranch,
    /// The tape is full.
    #[error("the tape is full: {limit} nodes")]
    Full {
        /// Nodes it may hold.
        limit: u32,
    },
    /// A result was asked of a tape for a variable that it did not record.
    #[error("the variable was not recorded on this tape")]
    Foreign,
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
}

/// `Ok` if a slice has the expected length.
pub(super) fn check_length(what: &'static str, expected: usize, found: usize) -> Result<(), TapeError> {
    if expected == found { Ok(()) } else { Err(TapeError::Shape { what, expected, found }) }
}
