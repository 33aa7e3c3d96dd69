//! Batched symmetric eigendecomposition.

use super::batch::{Buffer, LANES, Workspace};
use super::error::{Failure, LinalgError, expect_length};
use super::{jacobi, large_systems};
use crate::scalar::Scalar;

/// Eigenvalues, ascending, and eigenvectors of a batch of symmetric matrices: `M = sum_k w_k u_k u_k^T`.
///
/// `matrices` is `(batch, n, n)` (the upper triangle is read), `values` `(batch, n)`, `vectors` `(batch, n, n)` with
/// `u_k` as ROW `k`.
///
/// # Errors
/// [`LinalgError::Shape`]; [`LinalgError::NotFinite`] names the first matrix with an infinity or a `NaN`, its results
/// are `NaN`, the others are right.
pub fn eigh<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    expect_length("eigenvectors", matrices.len(), vectors.len())?;
    run(n, matrices, values, vectors, workspace)
}

/// Eigenvalues alone, ascending; arguments and errors as in [`eigh`].
///
/// # Errors
/// As [`eigh`].
pub fn eigenvalues<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    run(n, matrices, values, &mut [], workspace)
}

/// Both; `vectors` may be empty.
fn run<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    workspace.clear_failures();
    let size = n * n;
    let batch = matrices.len() / size.max(1);
    expect_length("matrices", batch * size, matrices.len())?;
    expect_length("eigenvalues", batch * n, values.len())?;
    if batch == 0 {
        return Ok(());
    }
    let finite = if large_systems::serves::<S>(n) {
        for (row, (m, w)) in matrices.chunks_exact(size).zip(values.chunks_exact_mut(n)).enumerate() {
            let u = if vectors.is_empty() { &mut [][..] } else { &mut vectors[row * size..(row + 1) * size] };
            large_systems::eigh(n, m, w, u);
        }
        false
    } else if const { size_of::<S>() < size_of::<f64>() } {
        split::<S, { 2 * LANES }>(n, matrices, values, vectors, &mut workspace.block)
    } else {
        split::<S, LANES>(n, matrices, values, vectors, &mut workspace.block)
    };
    if finite {
        return Ok(());
    }
    for (row, m) in matrices.chunks_exact(size).enumerate() {
        let values = &mut values[row * n..(row + 1) * n];
        if m.iter().any(|m| !m.is_finite()) || values.iter().any(|w| !w.is_finite()) {
            values.fill(S::nan());
            if !vectors.is_empty() {
                vectors[row * size..(row + 1) * size].fill(S::nan());
            }
            workspace.failures_mut().push((row, Failure::NotFinite));
        }
    }
    workspace.outcome()
}

/// In blocks of `W`, a single matrix at the end alone; whether all is finite.
fn split<S: Scalar, const W: usize>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    buffer: &mut Buffer<S>,
) -> bool {
    let batch = values.len() / n;
    let together = batch - usize::from(batch % W == 1);
    let finite = jacobi::decompose::<S, W>(n, matrices, values, vectors, (0, together), buffer);
    let done = if finite.is_some() { together } else { 0 };
    let rest = jacobi::decompose::<S, 1>(n, matrices, values, vectors, (done, batch), buffer);
    finite != Some(false) && rest != Some(false)
}
