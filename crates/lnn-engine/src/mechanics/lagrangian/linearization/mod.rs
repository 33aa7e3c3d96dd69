//! Derivatives of the accelerations of a model by its state, by forces on it, and by its parameters.

mod differences;
mod forces;
mod programs;
mod rate;
mod whole;

pub(super) use differences::add_jacobian;
pub(super) use forces::{Sum, with_force};
pub(super) use programs::{ProgramSlopes, SlopePrograms};
pub(super) use rate::{Rate, SparseRows, add};
pub(super) use whole::Linearized;

use super::constraints::Bordered;
use super::{EulerLagrange, MechanicsError, Request, Solved, Terms};
use crate::linalg::{self, Workspace};
use crate::scalar::{MatMut, MatRef, Real, Scalar, product_by_loops, update, vectorized};
use crate::tape::Replay;
use alloc::boxed::Box;
use alloc::vec::Vec;
use differences::Differences;

/// A batch of states with their accelerations and multipliers, which are held fixed.
#[derive(Clone, Copy, Debug)]
pub struct Held<'a, S> {
    /// Number of coordinates `n`.
    pub n: usize,
    /// Coordinates and velocities, `(batch, n)`.
    pub state: (&'a [S], &'a [S]),
    /// Accelerations, `(batch, n)`.
    pub a: &'a [S],
    /// Number of constraints `m`.
    pub constraints: usize,
    /// Multipliers of the constraints, `(batch, m)`.
    pub multipliers: &'a [S],
}

/// Accumulators for [`Slopes::add_products`].
#[derive(Debug)]
pub struct Products<'a, S> {
    /// Derivatives by the coordinates, `(batch, n)`.
    pub by_q: &'a mut [S],
    /// Derivatives by the velocities, `(batch, n)`.
    pub by_v: &'a mut [S],
    /// Derivatives by the parameters, summed over the batch; a part without parameters does not change them.
    pub by_parameters: &'a mut Vec<S>,
}

impl<S: Scalar> Products<'_, S> {
    /// Adds the products of `weights`, `(batch, n + m)`, with matrices `(batch, n + m, 2 n)`.
    fn add(&mut self, held: &Held<'_, S>, matrices: &[S], weights: &[S]) {
        let (n, rows) = (held.n, held.n + held.constraints);
        for (k, (row, &weight)) in matrices.chunks_exact((2 * n).max(1)).zip(weights).enumerate() {
            let at = k / rows * n;
            update(&mut self.by_q[at..at + n], row, |sum, x| *sum += weight * x);
            update(&mut self.by_v[at..at + n], &row[n..], |sum, x| *sum += weight * x);
        }
    }

    /// Adds the derivatives by the parameters at one state.
    pub(crate) fn add_parameters(&mut self, by_parameters: &[S]) {
        if self.by_parameters.is_empty() {
            self.by_parameters.resize(by_parameters.len(), <S as Real>::zero());
        }
        update(self.by_parameters, by_parameters, |sum, x| *sum += x);
    }
}

/// Derivatives of the `n + m` equations of motion `f = [g - c + Q - M a + A^T lambda; -(A a + gamma)]` by the state and the parameters, at
/// fixed `a` and `lambda`. Buffers are reused.
pub trait Slopes<S: Scalar> {
    /// Adds `df/d(q, v)` to matrices `(batch, n + m, 2 n)`.
    ///
    /// # Errors
    /// Those of [`EulerLagrange::terms`].
    fn add_matrices(&mut self, held: &Held<'_, S>, matrices: &mut [S]) -> Result<(), MechanicsError>;

    /// Adds the derivatives of `weights.f`, with weights `(batch, n + m)`; the default implementation computes the matrices.
    ///
    /// # Errors
    /// Those of [`EulerLagrange::terms`].
    fn add_products(
        &mut self,
        held: &Held<'_, S>,
        weights: &[S],
        products: &mut Products<'_, S>,
    ) -> Result<(), MechanicsError> {
        let mut matrices = vec![<S as Real>::zero(); weights.len() * 2 * held.n];
        self.add_matrices(held, &mut matrices)?;
        products.add(held, &matrices, weights);
        Ok(())
    }
}

/// The accelerations of a batch of states and their derivatives; matrices are row-major, with one row for each acceleration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linearization<S> {
    /// `a`, `(batch, n)`.
    pub acceleration: Vec<S>,
    /// `da/dq`, `(batch, n, n)`.
    pub by_q: Vec<S>,
    /// `da/dv`, `(batch, n, n)`.
    pub by_v: Vec<S>,
    /// `da/dF` by a generalized force, `M^-1` without constraints, `(batch, n, n)`.
    pub by_force: Vec<S>,
}

/// Derivatives of `w.a` for a batch of states, with weights `w`, `(batch, n)`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradient<S> {
    /// Derivatives by the coordinates, `(batch, n)`.
    pub by_q: Vec<S>,
    /// Derivatives by the velocities, `(batch, n)`.
    pub by_v: Vec<S>,
    /// Derivatives by a generalized force, `(batch, n)`.
    pub by_force: Vec<S>,
    /// Derivatives by the parameters of the Lagrangian, summed over the batch; empty for a model without parameters, and for your own
    /// types. A system from a file has one list of parameters for its Lagrangian, its friction and its constraints; parameters of other
    /// forces and constraints are held fixed.
    pub by_parameters: Vec<S>,
}

/// Linearizes a model about given states with preallocated buffers, for an implicit integrator, a filter, or a controller.
///
/// With `f = g - c + Q` the motion is `M a = f`, so that `da/dx = M^-1 (df/dx - dM/dx a)`: the inverse times the derivatives of the
/// equations at fixed accelerations. These derivatives are exact. For a Lagrangian written by hand they come from a sparse program of its
/// third derivatives, recorded on first use; for `[[links]]` from a recursion; for a network from the same sweeps as in its training.
/// Forces given as a closure, and your own types that implement [`EulerLagrange`], are differentiated numerically, with errors of about
/// `eps^(4/5)`.
///
/// ```
/// use lnn::lagrangian::{Linearizer, SystemInstance};
///
/// // A pendulum of 1 m and 1 kg near its lowest point: a = -g q.
/// let pendulum = SystemInstance::<f64>::named("n-pendulum", &[("n".into(), "1".into())])?.build()?;
/// let mut linearizer = Linearizer::new(&*pendulum);
/// let motion = linearizer.at(&[0.0], &[0.0])?;
/// assert!((motion.by_q[0] + 9.8).abs() < 1e-14 && motion.by_v == [0.0] && motion.by_force == [1.0]);
/// // The derivative of its acceleration at 0.5 rad by mass, length and gravity: a = -g sin(q)/l.
/// let gradient = linearizer.gradient(&[0.5], &[0.0], &[1.0])?;
/// let exact = [0.0, 9.8 * 0.5f64.sin(), -0.5f64.sin()];
/// assert!(gradient.by_parameters.iter().zip(exact).all(|(x, exact)| (x - exact).abs() < 1e-14));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Linearizer<'a, S: Scalar> {
    model: &'a dyn EulerLagrange<S>,
    /// The single program for a small model.
    whole: Option<(Solved<'a, S>, Linearized<S>, Replay<S>)>,
    slopes: Option<Box<dyn Slopes<S> + 'a>>,
    terms: Terms<S>,
    bordered: Bordered<S>,
    /// Right sides: derivatives of the equations, or weights.
    right: Vec<S>,
    /// The solution: inverse matrices, or weights.
    solution: Vec<S>,
    workspace: Workspace<S>,
    linearization: Linearization<S>,
    gradient: Gradient<S>,
}

impl<'a, S: Scalar> Linearizer<'a, S> {
    /// Allocates the buffers for a model.
    pub fn new(model: &'a dyn EulerLagrange<S>) -> Self {
        Self {
            model,
            whole: model.solved().and_then(|solved| {
                let whole = solved.linearized()?;
                let replay = whole.replay();
                Some((solved, whole, replay))
            }),
            slopes: None,
            terms: Terms::default(),
            bordered: Bordered::default(),
            right: Vec::new(),
            solution: Vec::new(),
            workspace: Workspace::new(),
            linearization: Linearization::default(),
            gradient: Gradient::default(),
        }
    }

    /// Computes accelerations and their derivatives at states `q`, `v`, `(batch, n)` in physical units.
    ///
    /// # Errors
    /// Those of [`EulerLagrange::terms`], for the first state that fails.
    pub fn at(&mut self, q: &[S], v: &[S]) -> Result<&Linearization<S>, MechanicsError> {
        self.under(q, v, None)
    }

    /// Returns the result of the last call.
    pub(super) fn last(&self) -> &Linearization<S> {
        &self.linearization
    }

    /// Does the same as [`at`](Self::at) with optional external generalized forces, `(batch, n)`.
    ///
    /// # Errors
    /// Those of [`EulerLagrange::terms`]; also if the forces have the wrong length.
    pub fn under(&mut self, q: &[S], v: &[S], force: Option<&[S]>) -> Result<&Linearization<S>, MechanicsError> {
        let n = self.model.coordinates();
        if force.is_none()
            && let Some((solved, whole, replay)) = &mut self.whole
            && !solved.is_interrupted()
            && whole.evaluate(replay, (q, v), &mut self.linearization, &mut self.right)
        {
            return Ok(&self.linearization);
        }
        let (m, batch) = (self.solve_motion(q, v, force)?, q.len() / n.max(1));
        let (size, zero) = (n + m, <S as Real>::zero());
        self.right.clear();
        self.right.resize(batch * size * 2 * n, zero);
        let slopes = self.slopes.get_or_insert_with(|| slopes(self.model));
        slopes.add_matrices(&held(n, (q, v), &self.terms), &mut self.right)?;
        self.solution.resize(batch * size * size, zero);
        let matrices = if m == 0 { &self.terms.mass_matrix } else { self.bordered.matrices() };
        let inverted = linalg::inverse(size, matrices, &mut self.solution, &mut self.workspace);
        self.check(inverted.is_ok())?;
        let Linearization { acceleration, by_q, by_v, by_force } = &mut self.linearization;
        acceleration.clear();
        acceleration.extend_from_slice(&self.terms.acceleration);
        for field in [&mut *by_q, &mut *by_v, by_force] {
            field.clear();
        }
        let mut rows = vec![zero; n * 2 * n];
        let states =
            self.solution.chunks_exact((size * size).max(1)).zip(self.right.chunks_exact((size * 2 * n).max(1)));
        for (inverse, slopes) in states {
            let (c, a) = (MatMut::new(&mut rows, n, 2 * n), MatRef::new(&inverse[..n * size], n, size));
            vectorized(
                #[inline(always)]
                || product_by_loops(c, false, <S as Real>::one(), a, MatRef::new(slopes, size, 2 * n)),
            );
            for (row, inverse) in rows.chunks_exact(2 * n).zip(inverse.chunks_exact(size)) {
                by_q.extend_from_slice(&row[..n]);
                by_v.extend_from_slice(&row[n..]);
                by_force.extend_from_slice(&inverse[..n]);
            }
        }
        Ok(&self.linearization)
    }

    /// Computes the derivatives of `w.a` by all arguments of the accelerations, that is, the product of `w`, `(batch, n)`, with the
    /// linearization from the left. This takes one sweep instead of `n`.
    ///
    /// # Errors
    /// Those of [`EulerLagrange::terms`]; also if `w` has the wrong length.
    pub fn gradient(&mut self, q: &[S], v: &[S], w: &[S]) -> Result<&Gradient<S>, MechanicsError> {
        if w.len() != q.len() {
            return Err(MechanicsError::Shape { what: "weights", expected: q.len(), found: w.len() });
        }
        let n = self.model.coordinates();
        let (m, zero) = (self.solve_motion(q, v, None)?, <S as Real>::zero());
        self.right.clear();
        for w in w.chunks_exact(n.max(1)) {
            self.right.extend_from_slice(w);
            self.right.resize(self.right.len() + m, zero);
        }
        // The bordered matrix `[M A^T; A 0]` is symmetric, and its second unknown is `-lambda`.
        self.solution.resize(self.right.len(), zero);
        let (right, solution, workspace) = (&self.right, &mut self.solution, &mut self.workspace);
        let solved = match m {
            0 => linalg::solve_symmetric(n, &self.terms.mass_matrix, right, solution, workspace),
            _ => linalg::solve(n + m, self.bordered.matrices(), right, solution, workspace),
        };
        self.check(solved.is_ok())?;
        let Gradient { by_q, by_v, by_force, by_parameters } = &mut self.gradient;
        by_force.clear();
        self.solution.chunks_exact((n + m).max(1)).for_each(|weights| by_force.extend_from_slice(&weights[..n]));
        by_parameters.clear();
        for field in [&mut *by_q, &mut *by_v] {
            field.clear();
            field.resize(q.len(), zero);
        }
        let mut products = Products { by_q, by_v, by_parameters };
        let slopes = self.slopes.get_or_insert_with(|| slopes(self.model));
        slopes.add_products(&held(n, (q, v), &self.terms), &self.solution, &mut products)?;
        Ok(&self.gradient)
    }

    /// Computes the terms of the states and the matrices of the equations of motion; returns the number of constraints.
    fn solve_motion(&mut self, q: &[S], v: &[S], force: Option<&[S]>) -> Result<usize, MechanicsError> {
        self.model.terms(q, v, Request::ACCELERATION, &mut self.terms)?;
        let (n, m) = (self.model.coordinates(), self.terms.constraints);
        if let Some(force) = force {
            self.terms.add_force(n, v, force, &mut self.workspace)?;
        }
        if m > 0 {
            self.bordered.set((n, m), &self.terms.mass_matrix, &self.terms.constraint_matrix);
        }
        Ok(m)
    }

    /// Returns the first failure of the workspace.
    fn check(&self, solved: bool) -> Result<(), MechanicsError> {
        match self.workspace.failures().first() {
            Some(&(row, failure)) if !solved => Err(MechanicsError::unsolved(row, failure)),
            _ => Ok(()),
        }
    }
}

/// Returns the derivatives of the equations of motion, computed with differences if the model does not provide them.
fn slopes<'a, S: Scalar>(model: &'a dyn EulerLagrange<S>) -> Box<dyn Slopes<S> + 'a> {
    model.slopes().unwrap_or_else(|| Box::new(Differences::new(model)))
}

/// Collects states and their accelerations.
fn held<'a, S>(n: usize, (q, v): (&'a [S], &'a [S]), terms: &'a Terms<S>) -> Held<'a, S> {
    Held { n, state: (q, v), a: &terms.acceleration, constraints: terms.constraints, multipliers: &terms.multipliers }
}

#[cfg(test)]
mod tests;
