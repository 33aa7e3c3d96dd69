//! The motion of a model as a first-order system, for solvers of other crates.

use super::{Accelerations, EulerLagrange, Linearizer, MechanicsError};
use crate::platform::{Mutex, MutexGuard, lock};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// The right-hand side of `dy/dt = f(y)` with `y = (q, v)` and `f = (v, a)`, `2 n` numbers, for solvers of differential equations.
///
/// Solvers do not allow a right-hand side to fail. Therefore the first error is stored, and `dy` is `NaN` from then on, which stops them.
/// Nothing is allocated after the first call.
///
/// ```
/// use lnn::lagrangian::{EulerLagrange, SystemInstance};
///
/// let pendulum = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
/// let f = pendulum.rhs();
/// let (mut y, mut dy) = ([1.0, 1.0, 0.0, 0.0], [0.0; 4]);
/// for _ in 0..100 {
///     f.evaluate(&y, &mut dy); // Euler's method, for want of a better one
///     y.iter_mut().zip(dy).for_each(|(y, dy)| *y += 0.001 * dy);
/// }
/// f.outcome()?;
/// assert!(y[0] < 1.0 && y[2] < 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct RightHandSide<'a, S: Scalar> {
    model: &'a dyn EulerLagrange<S>,
    buffers: Mutex<Buffers<'a, S>>,
}

struct Buffers<'a, S: Scalar> {
    accelerations: Accelerations<'a, S>,
    /// Created on first use.
    linearizer: Option<Linearizer<'a, S>>,
    /// State of the last linearization, which is reused, since solvers request several products at one state.
    place: Vec<S>,
    error: Option<MechanicsError>,
}

impl<'a, S: Scalar> RightHandSide<'a, S> {
    /// Wraps a model; [`EulerLagrange::rhs`] does the same.
    pub fn new(model: &'a dyn EulerLagrange<S>) -> Self {
        let buffers =
            Buffers { accelerations: Accelerations::new(model), linearizer: None, place: Vec::new(), error: None };
        Self { model, buffers: Mutex::new(buffers) }
    }

    fn lock(&self) -> MutexGuard<'_, Buffers<'a, S>> {
        lock(&self.buffers)
    }

    /// Writes `f(y)`.
    pub fn evaluate(&self, y: &[S], dy: &mut [S]) {
        let (mut buffers, n) = (self.lock(), self.model.coordinates());
        if buffers.error.is_none() && y.len() == 2 * n && dy.len() == 2 * n {
            let (q, v) = y.split_at(n);
            let (speed, a) = dy.split_at_mut(n);
            speed.copy_from_slice(v);
            match buffers.accelerations.at(q, v, a) {
                Ok(()) => return,
                Err(error) => buffers.error = Some(error),
            }
        } else if buffers.error.is_none() {
            let found = if y.len() == 2 * n { dy.len() } else { y.len() };
            buffers.error = Some(MechanicsError::Shape { what: "state", expected: 2 * n, found });
        }
        dy.fill(S::nan());
    }

    /// Writes `df/dy`, `(2 n, 2 n)` row by row.
    pub fn jacobian(&self, y: &[S], jacobian: &mut [S]) {
        let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
        jacobian.fill(S::nan());
        self.linearized(y, |n, by_q, by_v| {
            if jacobian.len() != 4 * n * n {
                return Err(MechanicsError::Shape { what: "Jacobian", expected: 4 * n * n, found: jacobian.len() });
            }
            jacobian.fill(zero);
            for i in 0..n {
                jacobian[i * 2 * n + n + i] = one;
                let row = &mut jacobian[(n + i) * 2 * n..][..2 * n];
                row[..n].copy_from_slice(&by_q[i * n..][..n]);
                row[n..].copy_from_slice(&by_v[i * n..][..n]);
            }
            Ok(())
        });
    }

    /// Writes the product `df/dy x` with a vector of `2 n` numbers.
    pub fn jacobian_product(&self, y: &[S], x: &[S], product: &mut [S]) {
        product.fill(S::nan());
        self.linearized(y, |n, by_q, by_v| {
            if let Some(found) = [x.len(), product.len()].into_iter().find(|&found| found != 2 * n) {
                return Err(MechanicsError::Shape { what: "vector", expected: 2 * n, found });
            }
            product[..n].copy_from_slice(&x[n..]);
            for i in 0..n {
                let row = by_q[i * n..][..n].iter().chain(&by_v[i * n..][..n]);
                product[n + i] = row.zip(x).fold(<S as Real>::zero(), |sum, (&a, &x)| sum + a * x);
            }
            Ok(())
        });
    }

    /// Calls `take` with `n`, `da/dq` and `da/dv`; stores an error.
    fn linearized(&self, y: &[S], take: impl FnOnce(usize, &[S], &[S]) -> Result<(), MechanicsError>) {
        let (mut buffers, n) = (self.lock(), self.model.coordinates());
        if buffers.error.is_some() {
            return;
        }
        let found = if y.len() == 2 * n {
            let Buffers { linearizer, place, .. } = &mut *buffers;
            let linearizer = linearizer.get_or_insert_with(|| Linearizer::new(self.model));
            let known = if place == y {
                Ok(())
            } else {
                place.clear();
                linearizer.at(&y[..n], &y[n..]).map(|_| place.extend_from_slice(y))
            };
            known.and_then(|()| take(n, &linearizer.last().by_q, &linearizer.last().by_v))
        } else {
            Err(MechanicsError::Shape { what: "state", expected: 2 * n, found: y.len() })
        };
        buffers.error = found.err();
    }

    /// Reports whether all calls have succeeded since the last call of this method, and clears the error.
    ///
    /// # Errors
    /// The first error.
    pub fn outcome(&self) -> Result<(), MechanicsError> {
        self.lock().error.take().map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;

    #[test]
    fn a_right_hand_side_keeps_its_first_error() {
        let model = SystemInstance::<f64>::named("kepler", &[]).unwrap().build().unwrap();
        let f = model.rhs();
        let (mut dy, mut jacobian, mut product) = ([0.0; 4], [0.0; 16], [0.0; 4]);
        let y = [1.0, 0.5, 0.2, 0.9];
        f.evaluate(&y, &mut dy);
        let a = model.acceleration(&y[..2], &y[2..]).unwrap();
        assert_eq!(dy, [0.2, 0.9, a[0], a[1]]);
        f.jacobian(&[0.9, 0.5, 0.2, 0.9], &mut jacobian);
        f.jacobian(&y, &mut jacobian);
        let x = [0.3, -0.1, 0.7, 1.1];
        f.jacobian_product(&y, &x, &mut product);
        for i in 0..4 {
            let sum: f64 = (0..4).map(|j| jacobian[i * 4 + j] * x[j]).sum();
            assert!((product[i] - sum).abs() < 1e-15);
        }
        assert_eq!(f.outcome(), Ok(()));
        f.evaluate(&[0.0; 4], &mut dy);
        f.jacobian(&y, &mut jacobian[..3]);
        assert!(dy[3].is_nan() && f.outcome().unwrap_err().row() == Some(0));
        f.evaluate(&y[..3], &mut dy);
        assert!(matches!(f.outcome(), Err(MechanicsError::Shape { expected: 4, found: 3, .. })));
        f.jacobian(&y, &mut jacobian[..3]);
        assert!(matches!(f.outcome(), Err(MechanicsError::Shape { expected: 16, found: 3, .. })));
        f.evaluate(&y, &mut dy);
        assert!(f.outcome().is_ok() && dy[3] == a[1]);
    }
}
