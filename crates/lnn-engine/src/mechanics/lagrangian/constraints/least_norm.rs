//! Accelerations of least norm where a degenerate Lagrangian does not determine the motion.

use super::rows::dot;
use super::{ReducedMass, along_rows};
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::linalg::{Workspace, minimum_norm};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Wraps a model whose mass matrix may be singular within its constraints, and chooses accelerations of least norm: they are 0 in the null
/// directions, which the equations do not determine.
///
/// States with contradictory equations, that is, with a force in a null direction, still fail.
#[derive(Clone, Debug)]
pub struct LeastNorm<M>(
    /// The wrapped model.
    pub M,
);

/// The chosen motion at one state.
#[derive(Clone, Debug, PartialEq)]
pub struct LeastNormMotion<S> {
    /// `a`, `(n)`.
    pub acceleration: Vec<S>,
    /// Multipliers of the constraints, `(m)`.
    pub multipliers: Vec<S>,
    /// Number of undetermined directions.
    pub open: usize,
    /// Magnitude of the unbalanced force in these directions: 0, up to rounding, if a motion exists.
    pub unbalanced: S,
}

impl<S: Scalar> LeastNormMotion<S> {
    /// Computes the shortest `a` with `A a = -gamma` that satisfies `M a = f` within the constraints.
    fn of(n: usize, mass: &[S], rows: &[S], drift: &[S], force: &[S]) -> Option<Self> {
        let reduced = ReducedMass::of(n, mass, rows).ok()?;
        let mut a: Vec<S> = along_rows(n, rows, drift).0.into_iter().map(|x| -x).collect();
        let rest =
            |a: &[S]| -> Vec<S> { force.iter().zip(mass.chunks_exact(n)).map(|(&f, row)| f - dot(row, a)).collect() };
        let start = rest(&a);
        let right: Vec<S> = reduced.basis.chunks_exact(n).map(|z| dot(z, &start)).collect();
        let found = minimum_norm(right.len(), &reduced.matrix, &right, &mut Workspace::new()).ok()?;
        for (z, &u) in reduced.basis.chunks_exact(n).zip(&found.solution) {
            a.iter_mut().zip(z).for_each(|(a, &z)| *a += u * z);
        }
        // A^T lambda = M a - f.
        let balance = rest(&a);
        let right_of_rows: Vec<S> = rows.chunks_exact(n).map(|row| -dot(row, &balance)).collect();
        let multipliers = along_rows(n, rows, &right_of_rows).1;
        Some(Self { acceleration: a, multipliers, open: right.len() - found.rank, unbalanced: found.outside })
    }
}

impl<M> LeastNorm<M> {
    /// The number of directions within the constraints in which the mass matrix of a state is singular, so that the equations do not
    /// determine the motion; 0 where the model fails.
    pub fn open_directions<S: Scalar>(&self, t: S, q: &[S], v: &[S]) -> usize
    where
        M: EulerLagrange<S>,
    {
        let mut terms = Terms::default();
        match self.0.terms_at(&[t], q, v, Request::MASS_MATRIX | Request::CONSTRAINTS, &mut terms) {
            Ok(()) => ReducedMass::of(q.len(), &terms.mass_matrix, &terms.constraint_matrix)
                .map_or(0, |reduced| reduced.null_directions().len()),
            Err(_) => 0,
        }
    }
}

impl<M: EulerLagrange<S>, S: Scalar> EulerLagrange<S> for LeastNorm<M> {
    fn coordinates(&self) -> usize {
        self.0.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        self.terms_at(&[], q, v, request, terms)
    }

    fn terms_at(
        &self,
        t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        let outcome = self.0.terms_at(t, q, v, request, terms);
        if outcome.is_ok() || !request.includes(Request::ACCELERATION) {
            return outcome;
        }
        let (n, m) = (self.coordinates(), terms.constraints);
        let found = terms.drain_failures(outcome)?;
        for error in found {
            let MechanicsError::Singular { row, .. } = error else {
                terms.failures.push(error);
                continue;
            };
            let at = row * n..(row + 1) * n;
            let force = |i: usize| terms.force.get(i).copied().unwrap_or_else(<S as Real>::zero);
            let right: Vec<S> = at.clone().map(|i| terms.dl_dq[i] - terms.coriolis[i] + force(i)).collect();
            let rows = &terms.constraint_matrix[row * m * n..(row + 1) * m * n];
            let drift = &terms.constraint_drift[row * m..(row + 1) * m];
            let size = super::rows::length(&right);
            match LeastNormMotion::of(n, &terms.mass_matrix[row * n * n..(row + 1) * n * n], rows, drift, &right) {
                Some(motion) if motion.unbalanced <= Real::sqrt(S::epsilon()) * size => {
                    terms.acceleration[at].copy_from_slice(&motion.acceleration);
                    terms.multipliers[row * m..(row + 1) * m].copy_from_slice(&motion.multipliers);
                }
                _ => terms.failures.push(error),
            }
        }
        terms.sum_constraint_forces(n);
        terms.outcome()
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(&self.0)
    }
}
