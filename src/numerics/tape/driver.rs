//! Derivatives of any function written over [`Real`]: function in, value and derivatives out.

use super::eager::{Adjoints, Tape};
use super::error::{TapeError, check_length};
use super::var::Var;
use crate::forward::Dual;
use crate::scalar::Real;

/// `f: R^n -> R`, written once over [`Real`].
pub trait ScalarFunction {
    /// `f(x)`.
    fn eval<R: Real>(&self, x: &[R]) -> R;
}

/// `f: R^n -> R^m`, written once over [`Real`].
pub trait VectorFunction {
    /// Number of outputs `m`.
    fn outputs(&self) -> usize;
    /// `out = f(x)`, `out` of length `m`.
    fn eval<R: Real>(&self, x: &[R], out: &mut [R]);
}

/// Value and gradient `(f, df/dx)` by one reverse sweep.
///
/// # Errors
/// The tape's: see [`TapeError`].
pub fn gradient<T: Real>(f: &impl ScalarFunction, x: &[T]) -> Result<(T, Vec<T>), TapeError> {
    let mut out = vec![T::zero(); x.len()];
    let value = gradient_on(&mut Tape::new(), &mut Adjoints::new(), f, x, &mut out)?;
    Ok((value, out))
}

/// [`gradient`] with buffers of the caller, to be reused; the tape is reset first.
///
/// # Errors
/// The tape's, and [`TapeError::Shape`] if `out` is not as long as `x`.
pub fn gradient_on<T: Real>(
    tape: &mut Tape<T>,
    adjoints: &mut Adjoints<T>,
    f: &impl ScalarFunction,
    x: &[T],
    out: &mut [T],
) -> Result<T, TapeError> {
    check_length("gradient", x.len(), out.len())?;
    tape.reset();
    let variables: Vec<Var<'_, T>> = x.iter().map(|&value| tape.variable(value)).collect();
    let y = f.eval(&variables);
    tape.reverse(y, adjoints)?;
    for (target, variable) in out.iter_mut().zip(variables) {
        *target = adjoints.of(variable);
    }
    Ok(y.value())
}

/// Value and directional derivative `(f, df/dx . direction)` by one forward pass.
///
/// # Errors
/// [`TapeError::Shape`] if `direction` is not as long as `x`.
pub fn derivative<T: Real>(f: &impl ScalarFunction, x: &[T], direction: &[T]) -> Result<(T, T), TapeError> {
    check_length("direction", x.len(), direction.len())?;
    let y = f.eval(&seeded(x, direction));
    Ok((y.value, y.tangent))
}

/// Values and Jacobian `(f, df_i/dx_j)`, `(m)` and `(m, n)` row-major.
///
/// Forward mode (`n` passes) where `n <= m`, reverse mode (one recording, `m` sweeps) otherwise.
///
/// # Errors
/// The tape's: see [`TapeError`].
pub fn jacobian<T: Real>(f: &impl VectorFunction, x: &[T]) -> Result<(Vec<T>, Vec<T>), TapeError> {
    let (n, m) = (x.len(), f.outputs());
    let mut matrix = vec![T::zero(); m * n];
    if n <= m && n > 0 {
        let mut out = vec![Dual::lift(T::zero()); m];
        let mut point: Vec<Dual<T>> = x.iter().map(|&value| Dual::lift(value)).collect();
        for j in 0..n {
            point[j].tangent = T::one();
            f.eval(&point, &mut out);
            point[j].tangent = T::zero();
            for (i, y) in out.iter().enumerate() {
                matrix[i * n + j] = y.tangent;
            }
        }
        return Ok((out.iter().map(|y| y.value).collect(), matrix));
    }
    let tape = Tape::new();
    let variables: Vec<Var<'_, T>> = x.iter().map(|&value| tape.variable(value)).collect();
    let mut out = vec![Var::lift(T::zero()); m];
    f.eval(&variables, &mut out);
    let mut adjoints = Adjoints::new();
    for (i, &y) in out.iter().enumerate() {
        tape.reverse(y, &mut adjoints)?;
        for (j, &variable) in variables.iter().enumerate() {
            matrix[i * n + j] = adjoints.of(variable);
        }
    }
    tape.check()?;
    Ok((out.iter().map(|y| y.value()).collect(), matrix))
}

/// Value, gradient and Hessian-vector product `(f, df/dx, (d2f/dx dx) direction)`: reverse over forward, one sweep.
///
/// # Errors
/// The tape's, and [`TapeError::Shape`] if `direction` is not as long as `x`.
pub fn hessian_vector<T: Real>(
    f: &impl ScalarFunction,
    x: &[T],
    direction: &[T],
) -> Result<(T, Vec<T>, Vec<T>), TapeError> {
    check_length("direction", x.len(), direction.len())?;
    let (value, row) = gradient(f, &seeded(x, direction))?;
    Ok((value.value, row.iter().map(|d| d.value).collect(), row.iter().map(|d| d.tangent).collect()))
}

/// Value, gradient and Hessian `(f, df/dx, d2f/dx_i dx_j)`, the last `(n, n)`: reverse over forward, `n` sweeps.
///
/// The lower triangle is computed and mirrored, so the matrix is symmetric to the bit.
///
/// # Errors
/// The tape's: see [`TapeError`].
pub fn hessian<T: Real>(f: &impl ScalarFunction, x: &[T]) -> Result<(T, Vec<T>, Vec<T>), TapeError> {
    let n = x.len();
    let (mut tape, mut adjoints) = (Tape::new(), Adjoints::new());
    let mut point: Vec<Dual<T>> = x.iter().map(|&value| Dual::lift(value)).collect();
    let mut row = point.clone();
    let mut value = gradient_on(&mut tape, &mut adjoints, f, &point, &mut row)?.value;
    let first = row.iter().map(|d| d.value).collect();
    let mut matrix = vec![T::zero(); n * n];
    for i in 0..n {
        point[i].tangent = T::one();
        value = gradient_on(&mut tape, &mut adjoints, f, &point, &mut row)?.value;
        point[i].tangent = T::zero();
        for j in 0..=i {
            matrix[i * n + j] = row[j].tangent;
            matrix[j * n + i] = row[j].tangent;
        }
    }
    Ok((value, first, matrix))
}

/// `x` with tangents `direction`.
fn seeded<T: Real>(x: &[T], direction: &[T]) -> Vec<Dual<T>> {
    x.iter().zip(direction).map(|(&value, &tangent)| Dual::new(value, tangent)).collect()
}
