//! The tape: reverse mode, and recorded programs.
//!
//! Ways to derivatives, all generic over the number:
//!
//! - [`Function`] records a function of several numbers once and gives its values, gradients, Hessians, dense or by their pattern, and
//!   products of Hessians with vectors, of single points and of batches. It is the one to start with.
//! - [`Tape`] records while it computes; one reverse sweep gives the gradient at those very numbers. The code under
//!   it may branch on values. Elements are any [`Real`](crate::scalar::Real): a tape over forward numbers gives
//!   Hessians.
//! - [`Program`] records once, without numbers, and is replayed on many states side by side (lanes) by a [`Replay`],
//!   without allocating; recorded over forward numbers, it computes their derivatives. A branch on a value cannot be recorded
//!   and is refused; [`Real::select`](crate::scalar::Real::select) can.
//! - [`Recorded`] holds a function `L(q, v)` of numbers and dense layers ([`Real::affine`](crate::scalar::Real::affine)), and
//!   an [`Evaluation`] evaluates all terms of a Lagrangian: `p`, `g`, `M`, `c`, and gradients of losses of the
//!   accelerations by parameters and state.
//!
//! Memory of a [`Tape`] over numbers of `s` bytes: `8 + 2 s` bytes per node (24 for `f64`), of which there is one per variable and one per
//! operation on two variables; functions of one variable, constant factors and constant summands need none. In addition the sweep holds `s`
//! bytes per node, in [`Adjoints`]. A reset keeps the memory and costs nothing per node (after a recording that outgrew the memory, it
//! allocates more); the next sweep clears one adjoint per node recorded, not per node held. A [`Replay`] holds `s` bytes per row and lane
//! of one chunk of 64 states, of 8 for large programs and of one for a single state.
//!
//! In all of them constants are never recorded and variables of two recordings never mix silently. On the [`Tape`] a zero
//! adjoint times an infinite partial derivative contributes 0, so that a branch not taken leaves no `NaN`; a [`Recorded`]
//! Lagrangian needs finite slopes in both branches.
//!
//! ```
//! use lnn::scalar::Real;
//! use lnn::tape::{Depth, Evaluation, Recorded, TapeError};
//! use std::sync::Arc;
//!
//! // A bead on a rotating hoop, L = v^2/2 + w^2 sin^2 q / 2 + cos q, recorded once with w as parameter.
//! let hoop = Recorded::new(vec![1.0], 1, |w, q, v| {
//!     0.5 * v[0].sqr() + 0.5 * (w[0] * q[0].sin()).sqr() + q[0].cos()
//! })?;
//! let mut evaluation = Evaluation::new(Arc::new(hoop));
//! evaluation.evaluate(&[2.0], &[0.5], &[1.0], Depth::Motion);
//! let (sin, cos) = 0.5_f64.sin_cos();
//! assert!((evaluation.dl_dq[0] - sin * (4.0 * cos - 1.0)).abs() < 1e-15);
//! assert_eq!((evaluation.momentum[0], evaluation.mass_matrix[0]), (1.0, 1.0));
//! # Ok::<(), TapeError>(())
//! ```

#[cfg(test)]
mod accuracy;
mod eager;
mod engine;
mod function;
mod program;
mod var;

pub use engine::{Depth, Evaluation, MixedDirections, Recorded, STATES};
pub use function::Function;
pub(crate) use program::Directions;
pub use program::Tracer;

// For the packages of this repository, and for its tests.
#[doc(hidden)]
pub use {
    eager::{Adjoints, Tape},
    function::{ROWS, TANGENTS},
    program::{Listing, Operation, Program, Replay},
    var::Var,
};

use crate::forward::Dual;
use crate::scalar::Real;
use alloc::vec::Vec;

/// Why a recording or a sweep gave no result.
///
/// Operators cannot fail, so the tape keeps the first error, the number becomes `NaN`, and the call that requests a result returns the
/// error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TapeError {
    /// An operation joined variables of two tapes.
    MixedTapes,
    /// A program for replay read a value while it was recorded.
    DataDependentBranch,
    /// The tape is full.
    Full {
        /// Largest number of nodes.
        limit: u32,
    },
    /// A result was requested from a tape for a variable that it did not record.
    Foreign,
    /// A slice has the wrong length.
    Shape {
        /// Which argument.
        what: &'static str,
        /// Numbers expected.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
}

impl core::fmt::Display for TapeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::MixedTapes => f.write_str("an operation mixes variables of two tapes"),
            Self::DataDependentBranch => f.write_str(
                "the recorded program reads a value (a data-dependent branch); express the branch by `select`",
            ),
            Self::Full { limit } => write!(f, "the tape is full: {limit} nodes"),
            Self::Foreign => f.write_str("the variable was not recorded on this tape"),
            Self::Shape { what, expected, found } => write!(f, "{what}: expected {expected} numbers, found {found}"),
        }
    }
}

impl core::error::Error for TapeError {}

/// `Ok` if a slice has the expected length.
fn check_length(what: &'static str, expected: usize, found: usize) -> Result<(), TapeError> {
    if expected == found { Ok(()) } else { Err(TapeError::Shape { what, expected, found }) }
}

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
fn gradient_on<T: Real>(
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
/// The errors of the tape: see [`TapeError`].
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
