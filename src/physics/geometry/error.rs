//! Errors of the geometry of a point.

use crate::lagrangian::MechanicsError;

/// Why there is no geometry at a point.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// The metric has no inverse to working precision.
    #[error("the metric is degenerate (condition number {condition:.3e})")]
    Degenerate {
        /// 2-norm condition number; infinite if exactly singular.
        condition: f64,
    },
    /// The metric, or a derivative of it, is infinite or not a number.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
    },
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
    /// Curvature of more coordinates than there is room for.
    #[error("{found} coordinates are too many, at most {most}: curvature has n^4 components")]
    TooMany {
        /// Coordinates of the model.
        found: usize,
        /// Coordinates that there may be.
        most: usize,
    },
    /// The model refused.
    #[error(transparent)]
    Mechanics(#[from] MechanicsError),
}

/// Refuses a slice of the wrong length.
pub(super) fn expect_length(what: &'static str, expected: usize, found: usize) -> Result<(), GeometryError> {
    if expected == found { Ok(()) } else { Err(GeometryError::Shape { what, expected, found }) }
}
