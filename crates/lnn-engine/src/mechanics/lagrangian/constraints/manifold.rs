//! The manifold of states that satisfy the constraints.

use super::programs::RowPrograms;
use crate::scalar::Scalar;
use alloc::string::String;
use alloc::vec::Vec;

/// Constraints at one state, `m` rows of `n` coordinates.
#[derive(Clone, Debug, Default)]
pub struct ManifoldRows<S> {
    /// `phi(q)`, `(m)`; 0 for a row that is linear in the velocities.
    pub values: Vec<S>,
    /// `A`, `(m, n)`.
    pub matrix: Vec<S>,
    /// `A v - b`, `(m)`.
    pub rates: Vec<S>,
    /// `gamma = (dA/dt) v - db/dt`, `(m)`: motion has `A a = -gamma`.
    pub drift: Vec<S>,
}

impl ManifoldRows<f64> {
    /// Returns the distance of the state from constraint `c` and the length of its gradient or row. The distance is `phi` divided by the
    /// length of its gradient, or `A v - b` divided by the length of its row.
    pub fn distance(&self, manifold: &(impl Manifold<f64> + ?Sized), c: usize) -> (f64, f64) {
        let n = manifold.coordinates();
        let length = self.matrix[c * n..(c + 1) * n]
            .iter()
            .fold(0.0, |length: f64, x| crate::platform::float!(f64, hypot(length, *x)));
        let off = if manifold.is_holonomic(c) { self.values[c] } else { self.rates[c] };
        (off / length, length)
    }
}

/// The states that satisfy the constraints of a model: `phi(q) = 0` and `A v = b`.
pub trait Manifold<S: Scalar>: Send + Sync {
    /// Number of coordinates `n`.
    fn coordinates(&self) -> usize;

    /// Returns the names of the `m` active constraints.
    fn names(&self) -> &[String];

    /// Returns the names of redundant constraints, which are not among the rows.
    fn redundant(&self) -> &[String];

    /// Returns `true` if a row is a function `phi(q)` of the coordinates alone.
    fn is_holonomic(&self, row: usize) -> bool;

    /// Evaluates the rows at one state; the buffers are reused.
    fn rows(&self, q: &[S], v: &[S], rows: &mut ManifoldRows<S>);

    /// Returns the sparse programs of the rows, recorded on first use; `None` if they cannot be recorded.
    #[doc(hidden)]
    fn programs(&self) -> Option<&RowPrograms<S>> {
        None
    }

    /// Writes the derivatives of the rates by the coordinates, `d(A v - b)/dq`, `(m, n)`.
    fn rate_gradients(&self, q: &[S], v: &[S], gradients: &mut Vec<S>);

    /// Adds the derivatives by `q` and `v` of `load.(A x) - pull.(A a + gamma)` at fixed `x`, `a`, `(n)`, and `load`, `pull`, `(m)`. This
    /// propagates the effect of a change of the rows to a function of the accelerations.
    fn pull_back(&self, state: (&[S], &[S]), along: RowAdjoint<'_, S>, derivatives: (&mut [S], &mut [S]));
}

/// Arguments of [`Manifold::pull_back`].
#[derive(Clone, Copy, Debug)]
pub struct RowAdjoint<'a, S> {
    /// The direction `x`, `(n)`.
    pub x: &'a [S],
    /// The acceleration `a`, `(n)`.
    pub a: &'a [S],
    /// Weights of `A x`, `(m)`.
    pub load: &'a [S],
    /// Weights of `A a + gamma`, `(m)`.
    pub pull: &'a [S],
}
