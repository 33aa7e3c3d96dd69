//! Lagrangian mechanics: one trait for a Lagrangian, one place for the Euler-Lagrange terms.
//!
//! State `x = (q, v)`, `v = dq/dt`, both in `R^n`. `p = dL/dv`, `g = dL/dq`, `M = d2L/dv dv`, `c = (d2L/dv dq) v`,
//! `a = M^-1 (g - c + Q)`, `E = p.v - L`; `Q` are forces that do not follow from `L`, such as friction. Batches are row-major: `(batch, n)` and `(batch, n, n)`.

mod accelerations;
mod configure;
mod constrained_systems;
mod constraints;
mod derivatives;
mod description;
mod drives;
mod elimination;
mod equations;
mod error;
mod euler_lagrange;
mod expression;
mod formula_events;
mod formula_forces;
mod formula_readings;
#[cfg(feature = "rollout")]
mod groups;
mod in_time;
mod linearization;
mod mechanics;
mod pattern;
mod programs;
mod recursion;
mod right_hand_side;
pub(crate) mod system;
#[doc(hidden)]
pub mod systems;
mod taylor;
mod terms;
mod torques;
mod wrappers;

pub use accelerations::Accelerations;
pub(crate) use accelerations::Solved;
pub(crate) use configure::{LagrangianVisitor, resolve};
pub use configure::{SystemError, SystemInstance, build, configure, configure_system, configure_values, find, systems};
#[doc(hidden)]
pub use constrained_systems::constrained_systems;
pub(crate) use constraints::RowEquations;
#[cfg(feature = "training")]
pub(crate) use constraints::Tangent;
pub(crate) use constraints::dot;
pub(crate) use constraints::project_acceleration;
#[cfg(feature = "data")]
pub(crate) use constraints::take_out;
#[cfg(feature = "training")]
pub(crate) use constraints::{Bordered, independent_rows};
pub use constraints::{Constrained, ConstraintError, Constraints, FormulaError};
#[doc(hidden)]
pub use constraints::{ExpressionConstraints, FormulaConstraints, LeastNorm, OffManifold, ReducedMass, project};
pub use constraints::{Manifold, ManifoldRows, RowAdjoint};
pub use derivatives::MetricJet;
pub(crate) use derivatives::metric_jets;
#[cfg(feature = "training")]
pub(crate) use description::PerTrajectory;
#[cfg(feature = "serde")]
pub(crate) use description::pair;
pub use description::{Description, DescriptionError};
pub(crate) use description::{inertia_symbols, loss_symbols};
#[cfg(feature = "pipeline")]
pub(crate) use description::{is_free_name, turned};
#[cfg(feature = "training")]
pub(crate) use equations::{EquationPart, Equations};
pub use error::MechanicsError;
pub use euler_lagrange::{ForceParts, InverseDynamics, force_parts, inverse_dynamics};
#[cfg(feature = "cli")]
pub(crate) use euler_lagrange::{force_parts_by_rows, inverse_dynamics_by_rows};
#[cfg(feature = "data")]
pub(crate) use expression::NamedFormula;
#[cfg(feature = "cli")]
pub(crate) use expression::quantity;
pub use expression::{ExpressionError, ExpressionLagrangian};
pub use formula_events::GivenEvent;
pub use formula_readings::FormulaReading;
#[cfg(feature = "rollout")]
pub(crate) use groups::{Regrouped, acting_groups};
#[cfg(feature = "training")]
pub(crate) use groups::{group_factors, groups};
pub use in_time::{InTime, Inputs};
pub use linearization::{Gradient, Linearization, Linearizer};
pub(crate) use linearization::{Held, Products, Slopes};
pub use mechanics::Mechanics;
pub use pattern::{Element, Pattern};
pub(crate) use recursion::Chain;
#[cfg(feature = "pipeline")]
pub(crate) use recursion::{Matrix, Vector, applied, product, transposed};
pub use right_hand_side::RightHandSide;
pub use system::{Bounds, ClosedForm, Coordinate, Layout, Parameter, Range, Size, System, TrajectoryTest};
pub(crate) use taylor::Taylor;
pub use terms::{EulerLagrange, Request, Terms};
pub use torques::Torques;
#[doc(hidden)]
pub use wrappers::Interruptible;
pub use wrappers::{Dissipation, Frictionless, GeneralizedForce, Rayleigh, WithForces};

use crate::scalar::Real;
use constrained_systems::{constrained_description, constrained_descriptions};

/// A Lagrangian `L(q, v; parameters)` written once over [`Real`].
///
/// The same code then gives values, first and second derivatives with respect to `q`, `v` and the parameters
/// (masses, lengths, ...), in every precision, for one state or a recorded batch.
pub trait Lagrangian: Send + Sync {
    /// The number that [`Lagrangian::coordinates`] returns, where it is known when the code is compiled: derivatives of single
    /// states are then compiled for this number alone.
    const COORDINATES: Option<usize> = None;

    /// Number of coordinates `n`.
    fn coordinates(&self) -> usize;

    /// Number of parameters that [`Lagrangian::lagrangian`] takes. If `Some`, a parameter vector of another length is refused with
    /// [`MechanicsError::Shape`].
    fn parameter_count(&self) -> Option<usize> {
        None
    }

    /// `L(q, v)` in joules (or the unit of action per unit of the evolution parameter).
    ///
    /// `parameters` in the order the system declares, `q` and `v` of length `n`.
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R;
}
