//! Lagrangian mechanics: the trait for Lagrangians and the Euler-Lagrange terms computed from it.
//!
//! A state is `x = (q, v)` with `v = dq/dt`, both in `R^n`. The terms are `p = dL/dv`, `g = dL/dq`, `M = d2L/dv dv`, `c = (d2L/dv dq) v`,
//! `a = M^-1 (g - c + Q)`, `E = p.v - L`, where `Q` are forces that do not follow from `L`, such as friction. Batches are row-major:
//! `(batch, n)` and `(batch, n, n)`.

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
#[doc(hidden)]
pub mod system;
#[doc(hidden)]
pub mod systems;
mod taylor;
mod terms;
mod thresholds;
mod torques;
mod wrappers;

pub use accelerations::Accelerations;
pub(crate) use accelerations::Solved;
pub use configure::{SystemError, SystemInstance};
pub use constraints::{
    Constrained, ConstraintError, ConstraintFormulaError, Constraints, Manifold, ManifoldRows, RowAdjoint,
};
pub use derivatives::MetricJet;
pub use description::{Description, DescriptionError};
pub use error::MechanicsError;
pub use euler_lagrange::{ForceParts, InverseDynamics};
pub use expression::{ExpressionError, ExpressionLagrangian};
pub use formula_events::GivenEvent;
pub use formula_readings::FormulaReading;
pub use in_time::{InTime, Inputs};
pub use linearization::{Gradient, Linearization, Linearizer};
pub use mechanics::Mechanics;
pub use pattern::{Element, Pattern};
pub use right_hand_side::RightHandSide;
pub use system::{Bounds, ClosedForm, Coordinate, Layout, Parameter, Range, Size, System, TrajectoryTest};
pub(crate) use taylor::Taylor;
pub use terms::{EulerLagrange, Request, Terms};
pub use torques::Torques;
pub use wrappers::{Dissipation, Frictionless, GeneralizedForce, Rayleigh, WithForces};

// These are for the other packages of this repository.
#[cfg(feature = "rollout")]
#[doc(hidden)]
pub use groups::{Regrouped, acting_groups, group_factors, groups};
#[doc(hidden)]
pub use {
    configure::{LagrangianVisitor, resolve},
    constrained_systems::constrained_systems,
    constraints::{
        Bordered, ExpressionConstraints, FormulaConstraints, LeastNorm, OffManifold, ReducedMass, RowEquations,
        Tangent, dot, independent_rows, project, project_acceleration, take_out,
    },
    derivatives::metric_jets,
    description::{inertia_symbols, is_free_name, loss_symbols, turned},
    equations::{EquationPart, Equations},
    euler_lagrange::{force_parts_by_rows, inverse_dynamics_by_rows},
    expression::NamedFormula,
    linearization::{Held, Products, Slopes},
    recursion::{Chain, Matrix, Vector, applied, product, transposed},
    wrappers::Interruptible,
};
#[cfg(feature = "serde")]
#[doc(hidden)]
pub use {
    description::{PerTrajectory, ShownLink, pair},
    expression::quantity,
};

use crate::scalar::Real;
use constrained_systems::{constrained_description, constrained_descriptions};

/// A Lagrangian `L(q, v; parameters)` written once over [`Real`].
///
/// The same code then gives values, first and second derivatives with respect to `q`, `v` and the parameters
/// (masses, lengths, ...), in every precision, for one state or a recorded batch.
pub trait Lagrangian: Send + Sync {
    /// The value of [`Lagrangian::coordinates`], if it is known at compile time; derivatives of single states are then compiled only for
    /// this number.
    const COORDINATES: Option<usize> = None;

    /// Returns the number of coordinates `n`.
    fn coordinates(&self) -> usize;

    /// Returns the number of parameters that [`Lagrangian::lagrangian`] takes. If it is `Some`, a parameter vector of another length is
    /// rejected with [`MechanicsError::Shape`].
    fn parameter_count(&self) -> Option<usize> {
        None
    }

    /// Computes `L(q, v)` in joules (or the unit of action per unit of the evolution parameter).
    ///
    /// `parameters` are in the order that the system declares; `q` and `v` have length `n`.
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R;
}
