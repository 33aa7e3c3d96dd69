//! The geometry of a Lagrangian: metric, connection, curvature at points.
//!
//! The metric is the mass matrix `g_ij = d2L/dv_i dv_j` itself: `g_ij` for `L = g_ij v_i v_j/2`, and `m g_ij` for `L = m g_ij v_i v_j/2`,
//! whose curvature scalar is that of `g_ij` over `m`. If a Lagrangian is not quadratic in the velocities, the metric is taken at a given
//! velocity, which derivatives hold fixed; for a quadratic one the velocity does not matter.
//!
//! Derivatives are exact to rounding, up to the fourth of `L`. Conventions are those of Misner, Thorne and Wheeler, signature
//! `-+++`:
//!
//! ```text
//! G^k_ij  = g^kl (d_i g_lj + d_j g_li - d_l g_ij)/2
//! R^a_bcd = d_c G^a_bd - d_d G^a_bc + G^a_ce G^e_bd - G^a_de G^e_bc
//! R_bd    = R^a_bad,   R = g^bd R_bd
//! ```
//!
//! so that the unit sphere has `R = 2`, anti-de Sitter space of unit radius in four dimensions `R = -12` and
//! `R_abcd R^abcd = 24`. Tensors are flat, row-major in the order of their indices: `R^a_bcd` stands at `[a][b][c][d]`.
//!
//! ```
//! use lnn::geometry::Geometry;
//! use lnn::lagrangian::SystemInstance;
//!
//! let space = SystemInstance::<f64>::named("ads4-geodesic", &[])?.build()?; // coordinates t, x, y, z
//! let point = Geometry::of(&*space, &[0.0, 0.3, -0.2, 1.5], &[0.0; 4])?.remove(0)?;
//! assert_eq!((point.metric.signature.negative, point.metric.signature.positive), (1, 3));
//! assert!((point.curvature.scalar + 12.0).abs() < 1e-13);
//! assert!((point.curvature.kretschmann - 24.0).abs() < 1e-13);
//! assert!((point.connection.symbols[0 * 16 + 0 * 4 + 3] + 1.0 / 1.5).abs() < 1e-15); // G^t_tz = -1/z
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod orbits;
#[cfg(feature = "data")]
mod point_report;
#[cfg(feature = "data")]
mod surface_report;
mod surfaces;
mod tensors;

pub use orbits::{CircularOrbit, Equator, Sense, Symmetric, Turn, TurningPoint};
pub use surfaces::{Change, Character, Surface};
pub use tensors::{Connection, Curvature, Metric};

// For the packages of this repository.
#[doc(hidden)]
pub use surfaces::{characters, grid};
#[cfg(feature = "data")]
#[doc(hidden)]
pub use {
    point_report::{PointReport, depends_on_velocity},
    surface_report::SurfaceReport,
};

use crate::lagrangian::{EulerLagrange, MechanicsError, MetricJet};
use crate::scalar::Scalar;
use alloc::vec::Vec;

/// Largest number of coordinates of a metric whose curvature is computed: a tensor has `n^4` numbers, a point takes 190 MB.
#[doc(hidden)]
pub const MOST_COORDINATES: usize = 32;

/// Number of points, for a number of coordinates, whose geometry is kept at a time: about a million numbers of a tensor.
#[doc(hidden)]
pub fn at_once(n: usize) -> usize {
    ((1 << 20) / n.pow(4).max(1)).max(1)
}

/// Metric, connection and curvature at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry<S> {
    /// Metric, inverse, determinant, signature.
    pub metric: Metric<S>,
    /// Christoffel symbols.
    pub connection: Connection<S>,
    /// Curvature tensors.
    pub curvature: Curvature<S>,
}

impl<S: Scalar> Geometry<S> {
    /// The geometry of a metric with first and second derivatives.
    ///
    /// # Errors
    /// [`GeometryError::Degenerate`] for a metric without inverse, [`GeometryError::NotFinite`], [`GeometryError::Shape`].
    pub(crate) fn new(jet: &MetricJet<S>) -> Result<Self, GeometryError> {
        let n = jet.coordinates();
        for (what, rank, found) in
            [("first derivatives", 3, jet.first.len()), ("second derivatives", 4, jet.second.len())]
        {
            expect_length(what, n.pow(rank), found)?;
        }
        let metric = Metric::new(n, &jet.metric)?;
        if jet.first.iter().chain(&jet.second).any(|x| !x.is_finite()) {
            return Err(GeometryError::NotFinite { what: "a derivative of the metric" });
        }
        let connection = Connection::new(jet, &metric);
        let curvature = Curvature::new(jet, &metric, &connection);
        if curvature.riemann.iter().any(|x| !x.is_finite()) {
            return Err(GeometryError::NotFinite { what: "the curvature" });
        }
        Ok(Self { metric, connection, curvature })
    }

    /// The geometry in another number type.
    ///
    /// # Errors
    /// [`GeometryError::NotFinite`] for numbers beyond its range.
    pub(crate) fn rounded<T: Scalar>(&self) -> Result<Geometry<T>, GeometryError> {
        let Self { metric, connection, curvature } = self;
        let rounded =
            Geometry { metric: metric.rounded(), connection: connection.rounded(), curvature: curvature.rounded() };
        let Geometry { metric, connection, curvature } = &rounded;
        let tensors: [&[T]; 4] = [&metric.components, &metric.inverse, &connection.symbols, &curvature.riemann];
        if tensors.into_iter().flatten().any(|x| !x.is_finite()) {
            return Err(GeometryError::NotFinite { what: "the geometry, rounded," });
        }
        Ok(rounded)
    }

    /// The geometry of a model at points `(batch, n)` in physical units, each with its own failure.
    ///
    /// `velocity`, `(n)`, is the one at which the mass matrix is taken: zeros unless `L` is more than quadratic in the velocities.
    /// Lagrangians that are written down are computed in double-double numbers and rounded at the end; networks in their own numbers.
    ///
    /// # Errors
    /// [`GeometryError::Shape`]; [`GeometryError::TooMany`] for more than 32 coordinates; what [`EulerLagrange::metric_jets`] refuses.
    #[allow(clippy::type_complexity)]
    pub fn of(
        model: &dyn EulerLagrange<S>,
        points: &[S],
        velocity: &[S],
    ) -> Result<Vec<Result<Self, GeometryError>>, GeometryError> {
        let n = model.coordinates();
        if n > MOST_COORDINATES {
            return Err(GeometryError::TooMany { found: n, most: MOST_COORDINATES });
        }
        expect_length("velocity", n, velocity.len())?;
        let velocities = velocity.repeat(points.len() / n.max(1));
        if let Some(jets) = model.wide_metric_jets(points, &velocities)? {
            return Ok(jets.iter().map(|jet| Geometry::new(jet)?.rounded()).collect());
        }
        Ok(model.metric_jets(points, &velocities)?.iter().map(Geometry::new).collect())
    }
}

/// Reason why the geometry is undefined at a point.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum GeometryError {
    /// The metric has no inverse to working precision.
    Degenerate {
        /// 2-norm condition number; infinite if exactly singular.
        condition: f64,
    },
    /// The metric, or a derivative of it, is infinite or not a number.
    NotFinite {
        /// Which quantity.
        what: &'static str,
    },
    /// A slice has the wrong length.
    Shape {
        /// Which argument.
        what: &'static str,
        /// Numbers expected.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// More coordinates than the curvature has memory for.
    TooMany {
        /// Coordinates of the model.
        found: usize,
        /// Largest number of coordinates.
        most: usize,
    },
    /// The model returned an error.
    Mechanics(MechanicsError),
}

impl core::fmt::Display for GeometryError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Degenerate { condition } => write!(f, "the metric is degenerate (condition number {condition:.3e})"),
            Self::NotFinite { what } => write!(f, "{what} is not finite"),
            Self::Shape { what, expected, found } => write!(f, "{what}: expected {expected} numbers, found {found}"),
            Self::TooMany { found, most } => {
                write!(f, "{found} coordinates are too many, at most {most}: curvature has n^4 components")
            }
            Self::Mechanics(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for GeometryError {}

impl From<MechanicsError> for GeometryError {
    fn from(error: MechanicsError) -> Self {
        Self::Mechanics(error)
    }
}

/// Refuses a slice of the wrong length.
fn expect_length(what: &'static str, expected: usize, found: usize) -> Result<(), GeometryError> {
    if expected == found { Ok(()) } else { Err(GeometryError::Shape { what, expected, found }) }
}
