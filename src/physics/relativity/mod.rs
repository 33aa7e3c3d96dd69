//! Black holes, learned or written down: quantities read off their metrics, and the view of a camera near them.
//!
//! A [`LearnedHole`] of an exact metric and a learned one gives [`Reading`]s: orbits of matter and of light, the advance of periastra,
//! falls through a horizon, mass and spin, curvature, symmetries. It needs the feature `training`.
//!
//! A [`Camera`] stands at a point of a metric whose space has Cartesian coordinates around a centre. Through every pixel a null geodesic is
//! followed backwards in time, by the accelerations of the model alone, until it reaches a great distance, where its direction gives a
//! point of the sky, or piles up at a horizon, in which case the pixel belongs to the shadow. [`Shadow::of()`] does so for a picture,
//! [`Outline::of`] finds the edge of the shadow by bisection, with the impact parameters of its rays, and [`Sky`] gives the colours. A
//! [`Scene`] does all of it for an exact metric, a learned one, or both side by side.
//!
//! ```
//! use lnn::lagrangian::SystemInstance;
//! use lnn::relativity::{Camera, Outline, Shadow, Sky, Tracing};
//!
//! let hole = SystemInstance::<f64>::named("schwarzschild-cartesian", &[])?.build()?;
//! let camera = Camera { width: 24, height: 24, ..Camera::new(20.0, 1.4) };
//! let seen = Shadow::of(&*hole, &camera, &Tracing::of(&camera), &|_| ())?;
//! let image = Sky::around(&camera).image(&seen);
//! assert_eq!((image.pixels.len(), image.pixels[12 * 24 + 12]), (24 * 24, [0, 0, 0]));
//! let edge = Outline::of(&*hole, &camera, &Tracing::of(&camera), 8)?.unwrap();
//! assert!((edge.right().celestial[0] - 27f64.sqrt()).abs() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod camera;
mod coordinates;
mod orbits;
mod rays;
#[cfg(feature = "training")]
mod readings;
mod report;
mod scene;
mod shadow;
mod sky;
mod thresholds;
mod two_sided;

pub use camera::{Camera, Observer};
pub use coordinates::{CentralCoordinates, Chart};
pub use rays::{Ray, RayOutcome, Tracing};
#[cfg(feature = "training")]
pub use readings::{LearnedHole, Reading};
pub use report::{ShadowSummary, View, ViewDifference, ViewSummary};
pub use scene::Scene;
pub use shadow::{Edge, Outline, Shadow};
pub use sky::{Image, Sky};
pub use two_sided::TwoSided;

// For the packages of this repository.
#[doc(hidden)]
pub use {coordinates::depends_on_time, orbits::orbits, sky::difference_image, thresholds::TOLERANCES};

use crate::geometry::GeometryError;
use crate::lagrangian::MechanicsError;

/// Reason why no picture can be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RelativityError {
    /// The model is not one of space-time.
    #[error("expected a metric with one time and three spatial coordinates, found {found} coordinates")]
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
        "expected a metric with one time and three spatial directions at the camera, found {negative} negative and {positive} positive eigenvalues"
    )]
    Signature {
        /// Number of negative eigenvalues.
        negative: usize,
        /// Number of positive eigenvalues.
        positive: usize,
    },
    /// A camera at rest would be faster than light.
    #[error(
        "no camera can be at rest here: the position is inside the ergosurface, or the time coordinate is not timelike there"
    )]
    NothingRests,
    /// A metric that changes with time.
    #[error("the metric depends on its time coordinate, expected a stationary metric")]
    DependsOnTime,
    /// A radial coordinate that does not lead from one region far away to another.
    #[error(
        "expected a radial coordinate that goes to minus and to plus infinity, where spheres have the area of flat space, with a regular metric \
         between; it is none at {radius}"
    )]
    OneSided {
        /// Value of the radial coordinate at which the metric is another one.
        radius: f64,
    },
    /// A number out of range.
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

/// Rejects a number out of range.
fn expect(fine: bool, what: &'static str, expected: &'static str, found: f64) -> Result<(), RelativityError> {
    if fine { Ok(()) } else { Err(RelativityError::Invalid { what, expected, found }) }
}

#[cfg(test)]
mod tests;
