//! Batched solution of symmetric, possibly indefinite systems.

use super::Workspace;
use super::error::{LinalgError, expect_length};
use super::linear_systems::Systems;
use crate::scalar::Scalar;

/// Solves `M_b x_b = r_b` for a batch of symmetric matrices, definite or not.
///
/// Gaussian elimination with partial pivoting, on lanes or, for large matrices of `f32` and `f64`, faer's; one step of
/// iterative refinement where a pivot is small or elements grow. `matrices` is `(batch, n, n)`, `rhs` and `solution` are
/// `(batch, n)`.
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
    let batch = rhs.len() / n.max(1);
    expect_length("right-hand sides", batch * n, rhs.len())?;
    expect_length("matrices", batch * n * n, matrices.len())?;
    expect_length("solutions", batch * n, solution.len())?;
    Systems { n, m: 1, matrices, right: Some(rhs) }.solve(solution, workspace);
    workspace.outcome()
}

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
