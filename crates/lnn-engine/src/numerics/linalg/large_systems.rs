//! Systems too large for lanes: from which sizes the routines of the scalar take one matrix after the other.

use super::Failure;
use super::batch::{Retry, Workspace};
use super::solve::{Systems, examine};
use super::thresholds::{BLOCKED_INVERSE_SIZE, BLOCKED_SIZE, TRIDIAGONAL_SIZE};
use crate::scalar::Scalar;
use alloc::vec::Vec;

impl<S: Scalar> Systems<'_, S> {
    /// Solves all systems by the routine of the scalar, faer's, as [`Systems::solve`] does by lanes, if there is one and the size is large
    /// enough; `true` if it did.
    pub(super) fn solve_large(&self, solutions: &mut [S], workspace: &mut Workspace<S>) -> bool {
        if self.n < if self.m == 1 { BLOCKED_SIZE } else { BLOCKED_INVERSE_SIZE } {
            return false;
        }
        let (_, second, failures) = workspace.parts();
        let judge = |row: usize, x: &mut [S], failures: &mut Vec<(usize, Failure)>, second: &mut Retry<S>| {
            let size = self.n * self.n;
            if let Some(failure) = examine(self.n, &self.matrices[row * size..][..size], x, &mut second.dense) {
                x.fill(S::nan());
                failures.push((row, failure));
            }
        };
        let Some(doubtful) = S::eliminate(self.n, self.m, self.matrices, self.right, solutions) else { return false };
        for row in doubtful {
            judge(row, &mut solutions[row * self.n * self.m..][..self.n * self.m], failures, second);
        }
        true
    }
}

/// Eigenvalues, ascending, and eigenvectors as rows (if requested) of one symmetric matrix, `NaN` if faer gives up; `false` if lanes are
/// faster, or this scalar has no routine.
pub(super) fn eigh<S: Scalar>(n: usize, matrix: &[S], values: &mut [S], vectors: &mut [S]) -> bool {
    n > TRIDIAGONAL_SIZE && S::eigh(n, matrix, values, vectors)
}
