//! Symmetries found in a Lagrangian, not imposed on it; their conserved quantities; a comparison of two Lagrangians.
//!
//! A point symmetry is a vector field `xi(q)` with `xi.dL/dq + (D xi v).dL/dv = dF/dt` for a gauge function `F(q)`: its flow maps motions
//! to motions, and its charge `p.xi - F` is conserved (Noether 1918). Of geodesics these are the Killing fields of the metric.
//! [`Symmetries::find`] finds them over a [`Basis`] of functions of the coordinates, as the null space of linear equations at sampled states,
//! names the Lie [`Algebra`] that they form, and reports if there is no gap between singular values that vanish and those that do not.
//! [`Quadratic::find`] finds conserved quantities of second degree in the momenta, such as Carter's constant and the vector of Runge and Lenz;
//! [`Charge::of`] follows charges along a motion; [`Comparison::of`] removes the freedom of a Lagrangian, its factor and gauge, before it compares,
//! and [`Canonical`] fixes both at a base state. All of them accept systems, descriptions in files and learned models.
//!
//! ```
//! use lnn::lagrangian::SystemInstance;
//! use lnn::symmetry::{Basis, Chart, Degrees, Region, Symmetries};
//!
//! let sphere = SystemInstance::<f64>::named("sphere-geodesic", &[])?.build()?;
//! let (names, charts) = (["theta", "phi"].map(String::from), [Chart::Polar, Chart::Circle]);
//! let basis = Basis::new(&names, &charts, Degrees::usual(&charts));
//! let region = Region { position: vec![[0.3, 2.8], [0.0, 6.3]], velocity: vec![[-1.0, 1.0]; 2] };
//! let (q, v) = region.states(200, 0, |_, _| true);
//! let found = Symmetries::find(&*sphere, &basis, (&q, &v), Some(Symmetries::EXACT))?;
//! assert_eq!(found.separation.count, Some(3));
//! assert_eq!(found.fields[2].text(&basis), "d_phi");
//! assert_eq!(found.fields[0].text(&basis), "sin(phi) d_theta + cot(theta)*cos(phi) d_phi");
//! assert_eq!(found.algebra.unwrap().name.as_deref(), Some("so(3)"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Measures
//!
//! Equations are taken relative to the size of the terms of `L` at each state; fields are measured by their length `|xi|_M` in an
//! orthonormal frame of the mass matrix, averaged over the states, never by their effect on `L`. Singular values are therefore the relative
//! change of `L` along a field of unit size, independent of the units, the basis and linear dependences between its functions. Numbers are
//! `f64`: a search is a fit over samples, whose errors come from the model or from rounding.

mod algebra;
mod basis;
mod canonical;
mod compare;
mod conserved;
mod field;
mod find;
mod null_space;
mod report;
mod sample;
mod thresholds;

pub use algebra::Algebra;
pub use basis::{Basis, Chart, Degrees};
pub use canonical::{Canonical, CanonicalForm};
pub use compare::Comparison;
pub use conserved::{Conserved, Quadratic};
pub use field::{Charge, Field};
pub use find::Symmetries;
pub use null_space::Separation;
pub use report::{ComparisonSummary, QuadraticSummary, SymmetrySummary};
pub use sample::{Invariant, Region};

// For the packages of this repository.
#[doc(hidden)]
pub use {
    basis::{most_states, unknowns},
    conserved::quadratic_unknowns,
    field::drifts,
    null_space::{bases, enough, most_symmetries},
    report::ChargeDrift,
    sample::middle,
    thresholds::{MOST_FIELDS, MOST_UNKNOWNS, TOLERANCES},
};

use crate::lagrangian::MechanicsError;

/// Why a search or a comparison failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SymmetryError {
    /// Slices of states of the wrong length.
    #[error("expected whole states of {coordinates} coordinates and as many velocities, found {q} and {v} numbers")]
    Shape {
        /// Number of coordinates of the model.
        coordinates: usize,
        /// Numbers of the coordinates found.
        q: usize,
        /// Numbers of the velocities found.
        v: usize,
    },
    /// Terms that are not finite.
    #[error("the terms of L are finite at only {found} of {states} states")]
    States {
        /// States requested.
        states: usize,
        /// States with finite terms.
        found: usize,
    },
    /// More unknowns than equations.
    #[error(
        "{unknowns} unknown coefficients need at least as many states, found {states}: use more states or a smaller basis"
    )]
    TooFew {
        /// Unknowns.
        unknowns: usize,
        /// States.
        states: usize,
    },
    /// A basis of too many functions.
    #[error("{unknowns} unknown coefficients are too many, at most {most}: use a smaller basis")]
    TooMany {
        /// Unknowns.
        unknowns: usize,
        /// Largest number of unknowns.
        most: usize,
    },
    /// More states than a search has room for.
    #[error("{states} states are too many for {unknowns} unknown coefficients, at most {most}")]
    TooManyStates {
        /// States.
        states: usize,
        /// Unknowns.
        unknowns: usize,
        /// Largest number of states.
        most: usize,
    },
    /// A tolerance out of range.
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
    #[error("no canonical form at this state: {}", .0.problem(&[]))]
    Base(MechanicsError),
    /// Numbers of a decomposition that are not finite.
    #[error("{what} is not finite")]
    NotFinite {
        /// Name of the quantity.
        what: &'static str,
    },
}
