//! Derivatives of a model together with a force.

use super::{Held, Products, Slopes};
use crate::lagrangian::{GeneralizedForce, MechanicsError};
use crate::scalar::{Real, Scalar, update};
use alloc::boxed::Box;
use alloc::vec::Vec;

/// Returns the derivatives of a model without the force plus those of the force.
pub(crate) fn with_force<'a, S: Scalar>(
    n: usize,
    model: Box<dyn Slopes<S> + 'a>,
    force: &'a dyn GeneralizedForce<S>,
) -> Box<dyn Slopes<S> + 'a> {
    let force = force.slopes(n).unwrap_or_else(|| Box::new(ForceSlopes { n, force, by: Default::default() }));
    Box::new(Sum(model, force))
}

/// The sum of two parts of the equations.
pub(crate) struct Sum<'a, S>(pub Box<dyn Slopes<S> + 'a>, pub Box<dyn Slopes<S> + 'a>);

impl<S: Scalar> Slopes<S> for Sum<'_, S> {
    fn add_matrices(&mut self, held: &Held<'_, S>, matrices: &mut [S]) -> Result<(), MechanicsError> {
        self.0.add_matrices(held, matrices)?;
        self.1.add_matrices(held, matrices)
    }

    fn add_products(
        &mut self,
        held: &Held<'_, S>,
        weights: &[S],
        products: &mut Products<'_, S>,
    ) -> Result<(), MechanicsError> {
        self.0.add_products(held, weights, products)?;
        self.1.add_products(held, weights, products)
    }
}

/// The derivatives of a force from its Jacobian.
struct ForceSlopes<'a, S> {
    n: usize,
    force: &'a dyn GeneralizedForce<S>,
    /// `dQ/dq` and `dQ/dv` of one state.
    by: [Vec<S>; 2],
}

impl<S: Scalar> ForceSlopes<'_, S> {
    /// Evaluates the Jacobian at a state of the batch.
    fn evaluate(&mut self, held: &Held<'_, S>, row: usize) {
        let (n, (q, v)) = (self.n, held.state);
        for by in &mut self.by {
            by.clear();
            by.resize(n * n, <S as Real>::zero());
        }
        let [by_q, by_v] = &mut self.by;
        self.force.jacobian(&q[row * n..][..n], &v[row * n..][..n], by_q, by_v);
    }
}

impl<S: Scalar> Slopes<S> for ForceSlopes<'_, S> {
    fn add_matrices(&mut self, held: &Held<'_, S>, matrices: &mut [S]) -> Result<(), MechanicsError> {
        let n = self.n;
        for (row, matrix) in matrices.chunks_exact_mut(((n + held.constraints) * 2 * n).max(1)).enumerate() {
            self.evaluate(held, row);
            for (i, to) in matrix.chunks_exact_mut(2 * n).take(n).enumerate() {
                let (by_q, by_v) = to.split_at_mut(n);
                update(by_q, &self.by[0][i * n..][..n], |sum, x| *sum += x);
                update(&mut by_v[..n], &self.by[1][i * n..][..n], |sum, x| *sum += x);
            }
        }
        Ok(())
    }
}
