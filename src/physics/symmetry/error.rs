//! Errors of searches for symmetries.

use crate::lagrangian::MechanicsError;

/// Why nothing could be found out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SymmetryError {
    /// Slices of states of unfit lengths.
    #[error("expected as many velocities as coordinates, whole states of {coordinates}; found {q} and {v} numbers")]
    Shape {
        /// Number of coordinates of the model.
        coordinates: usize,
        /// Numbers of the coordinates found.
        q: usize,
        /// Numbers of the velocities found.
        v: usize,
    },
    /// Terms that are not finite.
    #[error("the terms of L are finite at {found} of {states} states alone")]
    States {
        /// States asked for.
        states: usize,
        /// States with finite terms.
        found: usize,
    },
    /// More unknowns than equations.
    #[error(
        "{unknowns} unknown coefficients need as many states at least, found {states}: more states or a smaller basis"
    )]
    TooFew {
        /// Unknowns.
        unknowns: usize,
        /// States.
        states: usize,
    },
    /// A basis of too many functions.
    #[error("{unknowns} unknown coefficients are too many, at most {most}: a smaller basis")]
    TooMany {
        /// Unknowns.
        unknowns: usize,
        /// Unknowns that there may be.
        most: usize,
    },
    /// More states than a search has room for.
    #[error("{states} states are too many for {unknowns} unknown coefficients, at most {most}")]
    TooManyStates {
        /// States.
        states: usize,
        /// Unknowns.
        unknowns: usize,
        /// States that there may be.
        most: usize,
    },
    /// A tolerance at which nothing can be decided.
    #[error("a tolerance of {found:e}: expected one from {least:e} to {most:e}")]
    Tolerance {
        /// The tolerance.
        found: f64,
        /// The least.
        least: f64,
        /// The largest.
        most: f64,
    },
    /// A basis for another number of coordinates.
    #[error("the functions are of {found} coordinates, the model has {expected}")]
    Basis {
        /// Number of coordinates of the model.
        expected: usize,
        /// Number of coordinates of the basis.
        found: usize,
    },
    /// A base state at which a Lagrangian has no canonical form.
    #[error("no canonical form at this state: {0}")]
    Base(MechanicsError),
    /// Numbers of a decomposition that are not finite.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which.
        what: &'static str,
    },
}
