//! Constraints in addition to a Lagrangian: `phi(q) = 0`, and rows `A(q) v = b(q)` linear in the velocities.
//!
//! A holonomic constraint enters the motion by `A = dphi/dq`, `b = 0`. With `gamma = (dA/dt) v - db/dt` along the motion and
//! multipliers `lambda`
//!
//! ```text
//! [ M  A^T ] [    a    ]   [ g - c + Q ]
//! [ A   0  ] [ -lambda ] = [  -gamma   ]
//! ```
//!
//! The solution is unique where the rows of `A` are independent and no allowed direction `z` has `M z = 0` within the constraints; `M`
//! itself may be singular. `A^T lambda` is the force of constraint, such as the tension of a rod.

mod constrained;
mod described;
mod equations;
mod formulas;
mod kkt;
mod least_norm;
mod manifold;
mod programs;
mod projection;
mod reduced;
mod rows;
#[cfg(test)]
mod tests;

pub use constrained::{Constrained, ConstraintError};
pub use described::ExpressionConstraints;
pub use equations::{RowEquations, Tangent};
pub use formulas::{ConstraintFormulaError, FormulaConstraints};
pub use kkt::Bordered;
pub(super) use kkt::{Motion, accelerate};
pub use least_norm::LeastNorm;
pub use manifold::{Manifold, ManifoldRows, RowAdjoint};
pub(super) use projection::along_rows;
pub use projection::{OffManifold, project, project_acceleration};
pub use reduced::ReducedMass;
pub use rows::take_out;
pub(super) use rows::{complement, length};
pub use rows::{dot, independent_rows};

use crate::scalar::Real;
use alloc::string::String;
use alloc::vec::Vec;

/// Constraints written once over [`Real`], like a [`Lagrangian`](super::Lagrangian); their derivatives are computed.
pub trait Constraints: Send + Sync {
    /// Number of coordinates `n`.
    fn coordinates(&self) -> usize;

    /// Returns the names of the rows for messages, one for each constraint.
    fn names(&self) -> Vec<String>;

    /// Returns `true` if a row is a function `phi(q)` of the coordinates alone, `false` if it is `A(q) v - b(q)`.
    fn is_holonomic(&self, row: usize) -> bool;

    /// Returns the number of parameters that [`Constraints::values`] takes.
    fn parameter_count(&self) -> Option<usize> {
        None
    }

    /// Writes one number per row, which must vanish: `phi(q)`, or `A(q) v - b(q)`, linear in `v`.
    fn values<R: Real>(&self, parameters: &[R], q: &[R], v: &[R], values: &mut [R]);
}
