//! Generalized forces given as formulas of state and parameters in a system file.

use super::expression::Formula;
use super::linearization::{Held, Products};
use super::{GeneralizedForce, MechanicsError, Slopes};
use crate::forward::Dual;
use crate::scalar::{Real, Scalar};
use crate::tape::{Program, TapeError};
use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Forces `Q_i(q, v)` on some of the coordinates; other forces are 0. If they depend on the time, it is the last coordinate.
#[derive(Clone, Debug)]
pub struct FormulaForces {
    /// Numbers of coordinates and parameters.
    size: (usize, usize),
    /// Coordinates and their formulas.
    formulas: Arc<[(usize, Formula)]>,
}

impl FormulaForces {
    /// Wraps compiled formulas of the coordinates and parameters.
    pub(super) fn compiled(size: (usize, usize), formulas: Vec<(usize, Formula)>) -> Self {
        Self { size, formulas: formulas.into() }
    }

    /// Records the forces as programs of `q`, `v` and parameters, each with its coordinate.
    ///
    /// # Errors
    /// [`TapeError`] for formulas that are too long.
    pub(super) fn programs(&self) -> Result<Vec<(usize, Program<f64>)>, TapeError> {
        let (n, k) = self.size;
        let program = |(i, formula): &(usize, Formula)| {
            let recorded = Program::record(2 * n + k, 0, |x, _| {
                let (state, parameters) = x.split_at(2 * n);
                vec![formula.evaluate(parameters, &state[..n], &state[n..])]
            });
            Ok((*i, recorded?))
        };
        self.formulas.iter().map(program).collect()
    }
}

/// Generalized forces `Q(q, v)` of a system file, with values of its parameters.
#[derive(Clone, Debug)]
pub(super) struct GivenForces<S> {
    pub(super) forces: FormulaForces,
    pub(super) parameters: Vec<S>,
}

impl<S: Scalar> GeneralizedForce<S> for GivenForces<S> {
    fn force(&self, q: &[S], v: &[S], force: &mut [S]) {
        force.fill(<S as Real>::zero());
        for (i, formula) in self.forces.formulas.iter() {
            force[*i] += formula.evaluate(&self.parameters, q, v);
        }
    }

    fn slopes(&self, _: usize) -> Option<Box<dyn Slopes<S> + '_>> {
        Some(Box::new(ForceSlopes(self)))
    }
}

/// Computes derivatives of the forces with forward-mode numbers.
struct ForceSlopes<'a, S>(&'a GivenForces<S>);

impl<S: Scalar> ForceSlopes<'_, S> {
    /// Returns the derivatives of a force at a state by the positions, velocities and parameters that it depends on, as pairs of index and
    /// value.
    fn of(&self, formula: &Formula, (q, v): (&[S], &[S])) -> BTreeMap<usize, S> {
        let (n, zero) = (q.len(), <S as Real>::zero());
        let mut inputs: Vec<Dual<S>> = q.iter().chain(v).chain(&self.0.parameters).map(|x| Dual::lift(*x)).collect();
        let mut slopes = BTreeMap::new();
        for k in 0..inputs.len() {
            inputs[k].tangent = <S as Real>::one();
            let value = formula.evaluate(&inputs[2 * n..], &inputs[..n], &inputs[n..2 * n]).tangent;
            inputs[k].tangent = zero;
            if value != zero {
                slopes.insert(k, value);
            }
        }
        slopes
    }
}

impl<S: Scalar> Slopes<S> for ForceSlopes<'_, S> {
    fn add_matrices(&mut self, held: &Held<'_, S>, matrices: &mut [S]) -> Result<(), MechanicsError> {
        let n = self.0.forces.size.0;
        let states = held.state.0.chunks_exact(n).zip(held.state.1.chunks_exact(n));
        for (state, matrix) in states.zip(matrices.chunks_exact_mut((n + held.constraints) * 2 * n)) {
            for (i, formula) in self.0.forces.formulas.iter() {
                for (k, slope) in self.of(formula, state).range(..2 * n) {
                    matrix[i * 2 * n + k] += *slope;
                }
            }
        }
        Ok(())
    }

    fn add_products(
        &mut self,
        held: &Held<'_, S>,
        weights: &[S],
        products: &mut Products<'_, S>,
    ) -> Result<(), MechanicsError> {
        let (n, k) = self.0.forces.size;
        let states = held.state.0.chunks_exact(n).zip(held.state.1.chunks_exact(n));
        for (at, (state, weights)) in states.zip(weights.chunks_exact(n + held.constraints)).enumerate() {
            let mut by_parameters = vec![<S as Real>::zero(); k];
            for (i, formula) in self.0.forces.formulas.iter() {
                for (place, slope) in self.of(formula, state) {
                    let x = weights[*i] * slope;
                    match place {
                        place if place < n => products.by_q[at * n + place] += x,
                        place if place < 2 * n => products.by_v[at * n + place - n] += x,
                        place => by_parameters[place - 2 * n] += x,
                    }
                }
            }
            products.add_parameters(&by_parameters);
        }
        Ok(())
    }
}
