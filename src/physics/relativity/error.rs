//! Errors of light in a metric.

use crate::geometry::GeometryError;
use crate::lagrangian::MechanicsError;

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RelativityError {
    /// The model is not one of space-time.
    #[error("expected a metric of a time and three places, found {found} coordinates")]
    Coordinates {
        /// Coordinates of the model.
        found: usize,
    },
    /// The same coordinate twice, or one that the model does not have.
    #[error("expected four different coordinates below 4 as time and space, found {time} and {space:?}")]
    Chart {
        /// Index of the time.
        time: usize,
        /// Indices of the places.
        space: [usize; 3],
    },
    /// The metric at the camera is not that of a space-time.
    #[error(
        "expected a metric with one time and three places at the camera, found {negative} negative and {positive} positive eigenvalues"
    )]
    Signature {
        /// Number of negative eigenvalues.
        negative: usize,
        /// Number of positive eigenvalues.
        positive: usize,
    },
    /// The camera would have to be faster than light.
    #[error("no camera rests at this place: it is within the ergosurface, or its time is no time there")]
    NothingRests,
    /// A metric that is another one at another time.
    #[error("the metric depends on its time, expected one that is the same at all times")]
    DependsOnTime,
    /// A number that makes no picture.
    #[error("{what}: expected {expected}, found {found}")]
    Invalid {
        /// Name of the number.
        what: &'static str,
        /// Numbers that are possible.
        expected: &'static str,
        /// The number.
        found: f64,
    },
    /// Two pictures of different sizes.
    #[error("expected pictures of the same size, found {} x {} and {} x {}", first.0, first.1, second.0, second.1)]
    Sizes {
        /// Width and height of the first.
        first: (usize, usize),
        /// Width and height of the second.
        second: (usize, usize),
    },
    /// The metric at the camera has no inverse.
    #[error("at the camera {0}")]
    Geometry(#[from] GeometryError),
    /// The model refused.
    #[error(transparent)]
    Mechanics(#[from] MechanicsError),
}

/// Refuses a number that is not as expected.
pub(super) fn expect(
    fine: bool,
    what: &'static str,
    expected: &'static str,
    found: f64,
) -> Result<(), RelativityError> {
    if fine { Ok(()) } else { Err(RelativityError::Invalid { what, expected, found }) }
}
