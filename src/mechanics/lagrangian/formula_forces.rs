//! Generalized forces as formulas of state, time and parameters, as a system file states them.

use super::expression::Formula;
use super::linearization::{Held, Products};
use super::{EulerLagrange, GeneralizedForce, Manifold, MechanicsError, Request, Slopes, Terms};
use crate::forward::Dual;
use crate::scalar::{Real, Scalar};
use crate::tape::{Program, TapeError, Tracer};
use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Forces `Q_i(q, v, t)` on some of the coordinates; those on the others are 0.
#[derive(Clone, Debug)]
pub struct FormulaForces {
    /// Numbers of coordinates and of parameters.
    size: (usize, usize),
    /// Coordinates and their formulas, whose last parameter, behind those of the system, is the time.
    formulas: Arc<[(usize, Formula)]>,
    timed: bool,
}

impl FormulaForces {
    /// Formulas whose last parameter is the time; `timed` if one of them depends on it.
    pub(super) fn compiled(size: (usize, usize), formulas: Vec<(usize, Formula)>, timed: bool) -> Self {
        Self { size, formulas: formulas.into(), timed }
    }

    /// `true` if a formula depends on the time.
    pub fn is_timed(&self) -> bool {
        self.timed
    }

    /// Adds `Q` at a time and state to `force`.
    fn add<R: Real>(&self, parameters: &[R], t: R, (q, v): (&[R], &[R]), force: &mut [R]) {
        let parameters = [parameters, &[t]].concat();
        for (i, formula) in self.formulas.iter() {
            force[*i] += formula.evaluate(&parameters, q, v);
        }
    }

    /// The forces as programs of `q`, `v`, parameters and, if they depend on it, the time; each with its coordinate.
    ///
    /// # Errors
    /// [`TapeError`] for formulas that are too long.
    pub(super) fn programs(&self) -> Result<Vec<(usize, Program<f64>)>, TapeError> {
        let ((n, k), timed) = (self.size, usize::from(self.timed));
        let program = |(i, formula): &(usize, Formula)| {
            let recorded = Program::record(2 * n + k + timed, 0, |x, _| {
                let (state, rest) = x.split_at(2 * n);
                let parameters = if self.timed { rest.to_vec() } else { [rest, &[Tracer::zero()]].concat() };
                vec![formula.evaluate(&parameters, &state[..n], &state[n..])]
            });
            Ok((*i, recorded?))
        };
        self.formulas.iter().map(program).collect()
    }
}

/// Generalized forces `Q(q, v, t)` of a system file, with values of its parameters.
#[derive(Clone, Debug)]
pub struct GivenForces<S> {
    forces: FormulaForces,
    parameters: Vec<S>,
}

impl<S: Scalar> GivenForces<S> {
    /// The forces of these parameters.
    pub fn new(forces: FormulaForces, parameters: Vec<S>) -> Self {
        Self { forces, parameters }
    }

    /// Adds `Q` at a time and state, `(n)` each, to `force`.
    pub fn add(&self, t: S, (q, v): (&[S], &[S]), force: &mut [S]) {
        self.forces.add(&self.parameters, t, (q, v), force);
    }
}

/// The forces at the time 0.
impl<S: Scalar> GeneralizedForce<S> for GivenForces<S> {
    fn force(&self, q: &[S], v: &[S], force: &mut [S]) {
        force.fill(<S as Real>::zero());
        self.add(<S as Real>::zero(), (q, v), force);
    }

    fn slopes(&self, _: usize) -> Option<Box<dyn Slopes<S> + '_>> {
        Some(Box::new(ForceSlopes(self)))
    }
}

/// A system whose forces depend on the time: its states have no accelerations.
pub(super) struct NeedsTime<M>(pub M);

impl<S: Scalar, M: EulerLagrange<S>> EulerLagrange<S> for NeedsTime<M> {
    fn coordinates(&self) -> usize {
        self.0.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        if request.includes(Request::FORCE) {
            terms.clear();
            return Err(MechanicsError::Timed);
        }
        self.0.terms(q, v, request, terms)
    }

    fn manifold(&self) -> Option<&dyn Manifold<S>> {
        self.0.manifold()
    }

    fn conserves_energy(&self) -> bool {
        false
    }
}

/// Derivatives of the forces by forward numbers.
struct ForceSlopes<'a, S>(&'a GivenForces<S>);

impl<S: Scalar> ForceSlopes<'_, S> {
    /// Derivatives of a force at a state by the positions, the velocities and the parameters that it depends on: pairs of place and value.
    fn of(&self, formula: &Formula, (q, v): (&[S], &[S])) -> BTreeMap<usize, S> {
        let (n, zero) = (q.len(), <S as Real>::zero());
        let mut inputs: Vec<Dual<S>> =
            q.iter().chain(v).chain(&self.0.parameters).chain([&zero]).map(|x| Dual::lift(*x)).collect();
        let mut slopes = BTreeMap::new();
        for k in 0..inputs.len() - 1 {
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
