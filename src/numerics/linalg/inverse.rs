//! Batched inverses.

use super::Workspace;
use super::error::{LinalgError, expect_length};
use super::linear_systems::Systems;
use crate::scalar::Scalar;

/// Inverses of a batch of symmetric matrices, `(batch, n, n)`, symmetric by construction.
///
/// Column `k` of each solves `M x = e_k`; the mean of the two triangles is returned.
///
/// # Errors
/// As [`solve`](fn@super::solve); inverses of failed rows are `NaN`.
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
    Systems { n, m: n, matrices, right: None }.solve(inverses, workspace);
    workspace.outcome()
}
