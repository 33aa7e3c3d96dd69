//! Derivatives of models and forces that only provide values: central differences of the fourth order.

use super::{Held, Slopes};
use crate::lagrangian::{EulerLagrange, GeneralizedForce, MechanicsError, Request, Terms};
use crate::scalar::{Real, Scalar, update};
use alloc::vec::Vec;

/// Multiples of the step, and the weights of the function values there: `12 h f' = f(-2h) - 8 f(-h) + 8 f(h) - f(2h)`.
const STENCIL: [(f64, f64); 4] = [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)];

/// Returns the step that balances rounding against the truncation error, `h^4`, for functions that vary over the size of their arguments.
fn step<S: Scalar>(x: S) -> S {
    let size = x.abs();
    let h = S::epsilon().powf(S::of_f64(0.2)) * if size > <S as Real>::one() { size } else { <S as Real>::one() };
    // Make the step exactly representable in the sum.
    (x + h) - x
}

/// Calls `f` with every displaced state, `(q, v)` in one vector, the displaced column and the weight of its value.
fn displaced<S: Scalar>(
    (q, v): (&[S], &[S]),
    mut f: impl FnMut(&[S], usize, S) -> Result<(), MechanicsError>,
) -> Result<(), MechanicsError> {
    let mut state = [q, v].concat();
    for column in 0..state.len() {
        let (x, h) = (state[column], step(state[column]));
        for (multiple, weight) in STENCIL {
            state[column] = x + S::of_f64(multiple) * h;
            f(&state, column, S::of_f64(weight) / (S::of_f64(12.0) * h))?;
        }
        state[column] = x;
    }
    Ok(())
}

/// Computes the [`Slopes`] of a model with differences of its terms.
pub(crate) struct Differences<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    terms: Terms<S>,
    equations: Vec<S>,
}

impl<'a, S: Scalar> Differences<'a, S> {
    /// Allocates the buffers for a model.
    pub fn new(model: &'a dyn EulerLagrange<S>) -> Self {
        Self { model, terms: Terms::default(), equations: Vec::new() }
    }

    /// Evaluates the equations of motion at one state with fixed `a` and `lambda`.
    fn evaluate(&mut self, state: &[S], a: &[S], multipliers: &[S]) -> Result<(), MechanicsError> {
        let (n, terms) = (a.len(), &mut self.terms);
        self.model.terms(&state[..n], &state[n..], Request::ACCELERATION.without_solution(), terms)?;
        self.equations.clear();
        self.equations.extend_from_slice(&terms.dl_dq);
        update(&mut self.equations, &terms.coriolis, |f, c| *f -= c);
        update(&mut self.equations, &terms.force, |f, force| *f += force);
        for (f, row) in self.equations.iter_mut().zip(terms.mass_matrix.chunks_exact(n)) {
            row.iter().zip(a).for_each(|(&m, &a)| *f -= m * a);
        }
        for (row, &multiplier) in terms.constraint_matrix.chunks_exact(n).zip(multipliers) {
            update(&mut self.equations, row, |f, element| *f += multiplier * element);
        }
        for (row, &drift) in terms.constraint_matrix.chunks_exact(n).zip(&terms.constraint_drift) {
            self.equations.push(row.iter().zip(a).fold(-drift, |f, (&element, &a)| f - element * a));
        }
        Ok(())
    }
}

impl<S: Scalar> Slopes<S> for Differences<'_, S> {
    fn add_matrices(&mut self, held: &Held<'_, S>, matrices: &mut [S]) -> Result<(), MechanicsError> {
        let (n, m) = (self.model.coordinates(), held.constraints);
        for row in 0..held.a.len() / n.max(1) {
            let (at, width) = (row * n..(row + 1) * n, (n + m) * 2 * n);
            let matrix = &mut matrices[row * width..][..width];
            let multipliers = &held.multipliers[row * m..][..m];
            let moved = displaced((&held.state.0[at.clone()], &held.state.1[at.clone()]), |state, column, factor| {
                self.evaluate(state, &held.a[at.clone()], multipliers)?;
                for (i, &f) in self.equations.iter().enumerate() {
                    matrix[i * 2 * n + column] += factor * f;
                }
                Ok(())
            });
            moved.map_err(|error| error.at_row(row))?;
        }
        Ok(())
    }
}

/// Adds the derivatives of a force at one state to `by_q` and `by_v`, `(n, n)`.
pub(crate) fn add_jacobian<S: Scalar>(
    force: &(impl GeneralizedForce<S> + ?Sized),
    (q, v): (&[S], &[S]),
    by_q: &mut [S],
    by_v: &mut [S],
) {
    let n = q.len();
    let mut value = vec![<S as Real>::zero(); n];
    let done = displaced((q, v), |state, column, factor| {
        force.force(&state[..n], &state[n..], &mut value);
        let (by, column) = if column < n { (&mut *by_q, column) } else { (&mut *by_v, column - n) };
        value.iter().enumerate().for_each(|(i, &f)| by[i * n + column] += factor * f);
        Ok(())
    });
    debug_assert!(done.is_ok());
}
