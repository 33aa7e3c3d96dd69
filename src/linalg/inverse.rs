//! Batched inverses.

use super::error::{LinalgError, expect_length};
use super::{Workspace, solve};
use crate::scalar::{Real, Scalar};

/// Inverses of a batch of symmetric matrices, `(batch, n, n)`, symmetric by construction.
///
/// Column `k` of each solves `M x = e_k`; the mean of the two triangles is returned.
///
/// # Errors
/// As [`solve`]; inverses of failed rows are `NaN`.
pub fn inverse<S: Scalar>(
    n: usize,
    matrices: &[S],
    inverses: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    let size = n * n;
    let batch = matrices.len() / size.max(1);
    expect_length("matrices", batch * size, matrices.len())?;
    expect_length("inverses", batch * size, inverses.len())?;
    let mut columns = std::mem::take(&mut workspace.columns);
    columns.resize(2 * batch * n, <S as Real>::zero());
    let (unit, column) = columns.split_at_mut(batch * n);
    let mut outcome = Ok(());
    for k in 0..n {
        for (i, u) in unit.iter_mut().enumerate() {
            *u = if i % n == k { <S as Real>::one() } else { <S as Real>::zero() };
        }
        outcome = solve(n, matrices, unit, column, workspace);
        for (inverse, x) in inverses.chunks_exact_mut(size).zip(column.chunks_exact(n)) {
            inverse[k * n..(k + 1) * n].copy_from_slice(x);
        }
    }
    workspace.columns = columns;
    for inverse in inverses.chunks_exact_mut(size.max(1)) {
        for i in 0..n {
            for j in 0..i {
                let mean = (inverse[i * n + j] + inverse[j * n + i]) * S::half();
                inverse[i * n + j] = mean;
                inverse[j * n + i] = mean;
            }
        }
    }
    outcome
}
