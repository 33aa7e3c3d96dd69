//! Black holes, learned or written down: what is read off their metrics, and what a camera near them sees.
//!
//! A [`LearnedHole`] of an exact metric and a learned one gives [`Reading`]s: orbits of matter and of light, the advance of periastra
//! ([`radial_period`]), falls through a horizon ([`infall`]), mass and spin ([`nearest_parameters`]), curvature, symmetries; `LearnedHole` and
//! `nearest_parameters` take the feature `training`.
//!
//! A [`Camera`] stands at a place of a metric whose space has Cartesian coordinates around a centre. Through every pixel a null geodesic is
//! followed backwards in time, by the accelerations of the model alone, until it comes from far away, where its direction is that of a point
//! of the sky, or piles up at a horizon: that pixel belongs to the shadow. [`shadow()`] does so for a picture, [`outline`] finds the edge of the
//! shadow by bisection, with the impact parameters of its rays, and [`Sky`] gives the colours.
//!
//! ```
//! use lnn::lagrangian::build;
//! use lnn::relativity::{Camera, Sky, Tracing, outline, shadow};
//!
//! let hole = build::<f64>("schwarzschild-cartesian", &[])?;
//! let camera = Camera { width: 24, height: 24, ..Camera::new(20.0, 1.4) };
//! let seen = shadow(&*hole, &camera, &Tracing::of(&camera), &|_| ())?;
//! let image = Sky::around(&camera).image(&seen);
//! assert_eq!((image.pixels.len(), image.pixels[12 * 24 + 12]), (24 * 24, [0, 0, 0]));
//! let edge = outline(&*hole, &camera, &Tracing::of(&camera), 8)?.unwrap();
//! assert!((edge.right().celestial[0] - 27f64.sqrt()).abs() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod camera;
mod central_coordinates;
mod dormand_prince;
#[cfg(feature = "training")]
mod drift;
mod error;
mod event;
mod image;
mod infall;
mod orbits;
mod outline;
#[cfg(feature = "training")]
mod parameters;
mod periastron;
mod rays;
#[cfg(feature = "training")]
mod readings;
mod shadow;
mod sky;
mod spheroidal;
mod stationary;

#[doc(hidden)]
pub use camera::MOST_PIXELS;
#[doc(hidden)]
pub use camera::Tetrad;
pub use camera::{Camera, Observer};
#[doc(hidden)]
pub use central_coordinates::CentralCoordinates;
pub use central_coordinates::Chart;
#[cfg(feature = "training")]
pub(crate) use drift::conserved_drift;
pub use error::RelativityError;
pub use image::Image;
pub use infall::{Infall, infall};
pub use orbits::{Orbit, orbits};
pub use outline::{Edge, Outline, outline};
#[cfg(feature = "training")]
#[doc(hidden)]
pub use parameters::nearest_parameters;
pub use periastron::{RadialPeriod, radial_period};
pub use rays::{Ray, RayOutcome, trace};
#[doc(hidden)]
pub use rays::{TOLERANCES, Tracing};
#[cfg(feature = "training")]
#[doc(hidden)]
pub use readings::{LearnedHole, Reading};
#[doc(hidden)]
pub use shadow::Difference;
pub use shadow::{Shadow, shadow};
#[doc(hidden)]
pub use sky::{Sky, difference_image};
pub(crate) use stationary::depends_on_time;

#[cfg(test)]
mod tests;
