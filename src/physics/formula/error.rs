//! Why no formula was looked for.

use crate::cancellation::Cancelled;
use crate::recording::smooth::SmoothError;
use thiserror::Error;

/// Why no formula could be looked for.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FormulaError {
    /// The search was ended from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Too many coordinates, or none.
    #[error("expected 1 to {most} coordinates, found {found}")]
    Coordinates {
        /// Number found.
        found: usize,
        /// Largest number.
        most: usize,
    },
    /// A library that is too large.
    #[error("the library has {found} terms, at most {most} are searched: choose a smaller basis")]
    Terms {
        /// Terms found.
        found: usize,
        /// Largest number.
        most: usize,
    },
    /// A function of the user's own that is none.
    #[error("function {text:?}: {problem}")]
    Function {
        /// The function.
        text: String,
        /// What is wrong.
        problem: String,
    },
    /// A term that gives the scale but is not in the formula.
    #[error("scale: {term:?} is no term of the formula; its terms are {known}")]
    Scale {
        /// The term.
        term: String,
        /// Terms of the formula.
        known: String,
    },
    /// The motion cannot be smoothed.
    #[error(transparent)]
    Smooth(#[from] SmoothError),
    /// Too little motion.
    #[error("expected at least {needed} samples in a row, the longest trajectory has {found}")]
    Short {
        /// Samples of the longest trajectory.
        found: usize,
        /// Least number.
        needed: usize,
    },
    /// A model's terms are not finite at any state.
    #[error("the terms of the model are not finite at {failed} of {states} states")]
    NotFinite {
        /// States where they are not.
        failed: usize,
        /// All states.
        states: usize,
    },
}
