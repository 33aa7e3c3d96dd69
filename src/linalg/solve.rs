//! Batched solution of symmetric, possibly indefinite systems.

use super::batch::{Buffers, LANES, Lane, Workspace, gather, scatter, with_size};
use super::condition;
use super::error::{Failure, LinalgError, expect_length};
use super::lu;
use crate::scalar::{Real, Scalar, vectorized};

/// Below this ratio of smallest pivot to largest element a matrix is looked at more closely.
fn suspicious<S: Scalar>(n: usize) -> S {
    S::EPSILON * S::of_f64(1024.0 * (n * n) as f64)
}

/// Solves `M_b x_b = r_b` for a batch of symmetric matrices, definite or not.
///
/// LU with partial pivoting and one step of iterative refinement. `matrices` is `(batch, n, n)`, `rhs` and `solution`
/// are `(batch, n)`.
///
/// # Errors
/// [`LinalgError::Shape`] for slices of the wrong length. Otherwise the error of the first row that is singular
/// (condition number of the matrix scaled to unit diagonal above `1/eps`, so that a choice of units never matters)
/// or not finite; [`Workspace::failures`] lists all such rows, their solutions are `NaN`, the other rows are right.
pub fn solve<S: Scalar>(
    n: usize,
    matrices: &[S],
    rhs: &[S],
    solution: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    workspace.clear_failures();
    let batch = rhs.len() / n.max(1);
    expect_length("right-hand sides", batch * n, rhs.len())?;
    expect_length("matrices", batch * n * n, matrices.len())?;
    expect_length("solutions", batch * n, solution.len())?;
    if batch == 0 {
        return Ok(());
    }
    let mut doubtful = [false; LANES];
    let mut start = 0;
    while start < batch {
        let count = (batch - start).min(LANES);
        if count == 1 {
            block(n, matrices, rhs, solution, start, &mut workspace.single, &mut doubtful[..1]);
        } else {
            block(n, matrices, rhs, solution, start, &mut workspace.wide, &mut doubtful);
        }
        for l in (0..count).filter(|&l| doubtful[l]) {
            let row = start + l;
            let (m, x) = (&matrices[row * n * n..(row + 1) * n * n], &mut solution[row * n..(row + 1) * n]);
            if let Some(failure) = examine(n, m, x, &mut workspace.dense) {
                x.fill(S::NAN);
                workspace.failures_mut().push((row, failure));
            }
        }
        start += count;
    }
    workspace.outcome()
}

/// Solves rows `start..start + W`; marks the lanes to be examined.
fn block<S: Scalar, const W: usize>(
    n: usize,
    matrices: &[S],
    rhs: &[S],
    solution: &mut [S],
    start: usize,
    buffers: &mut Buffers<S, W>,
    doubtful: &mut [bool],
) {
    buffers.reserve(n);
    let Buffers { matrix, factor, rhs: b, solution: x, residual, order } = buffers;
    let floor = suspicious::<S>(n);
    vectorized(
        #[inline(always)]
        || {
            with_size!(n, |n| {
                gather(matrices, n * n, start, matrix);
                gather(rhs, n, start, b);
                factor[..n * n].copy_from_slice(&matrix[..n * n]);
                let smallest = lu::factor(n, factor, order);
                lu::substitute(n, factor, order, b, x);
                lu::refine(n, matrix, factor, order, b, x, residual);
                scatter(x, solution, n, start);
                let probe = probe(&x[..n]);
                for l in 0..W {
                    doubtful[l] = !(smallest[l] > floor && probe[l] == <S as Real>::zero());
                }
            })
        },
    );
}

/// Zero where all of a vector is finite, `NaN` otherwise.
#[inline(always)]
fn probe<S: Scalar, const W: usize>(x: &[Lane<S, W>]) -> Lane<S, W> {
    let mut probe = [<S as Real>::zero(); W];
    for lane in x {
        for l in 0..W {
            probe[l] += lane[l] * <S as Real>::zero();
        }
    }
    probe
}

/// The verdict on a matrix with a small pivot or a solution that is not finite.
fn examine<S: Scalar>(n: usize, matrix: &[S], x: &[S], scratch: &mut super::batch::Dense<S>) -> Option<Failure> {
    if matrix.iter().any(|m| !m.is_finite()) {
        return Some(Failure::NotFinite);
    }
    if condition::is_singular(n, matrix, scratch) {
        return Some(Failure::Singular { condition: condition::condition_2(n, matrix, scratch) });
    }
    x.iter().any(|x| !x.is_finite()).then_some(Failure::NotFinite)
}
