//! Batched solve `M a = r`.

use super::dense;
use crate::scalar::{Real, Scalar};
use crate::tape::program::{LANES, Row};
use std::ops::Range;

/// `a = M^-1 r`, `M` `(n, n)`.
#[derive(Clone, Copy, Debug)]
pub(in crate::tape) struct Solve {
    pub(super) n: usize,
    pub(super) matrix: u32,
    pub(super) right: u32,
}

impl Solve {
    /// One lane of the matrix.
    fn gather<S: Scalar>(matrix: &[Row<S>], lane: usize, a: &mut [S]) {
        for (target, row) in a.iter_mut().zip(matrix) {
            *target = row[lane];
        }
    }

    pub(super) fn forward<S: Scalar>(
        &self,
        matrix: &[Row<S>],
        right: &[Row<S>],
        out: &mut [Row<S>],
        scratch: &mut [S],
    ) {
        let (a, x) = scratch.split_at_mut(self.n * self.n);
        let x = &mut x[..self.n];
        for lane in 0..LANES {
            Self::gather(matrix, lane, a);
            Self::gather(right, lane, x);
            dense::solve(a, x, false);
            for (row, &value) in out.iter_mut().zip(x.iter()) {
                row[lane] = value;
            }
        }
    }

    /// `lam = M^-T a'`, `r' += lam`, `M' -= lam a^T`; nothing in lanes whose `a'` is 0.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn reverse<S: Scalar>(
        &self,
        matrix: &[Row<S>],
        solution: &[Row<S>],
        adjoint: &[Row<S>],
        targets: &mut [Row<S>],
        matrix_rows: Range<usize>,
        right_rows: Range<usize>,
        scratch: &mut [S],
    ) {
        let n = self.n;
        let (a, rest) = scratch.split_at_mut(n * n);
        let x = &mut rest[..n];
        for lane in 0..LANES {
            Self::gather(adjoint, lane, x);
            if x.iter().all(|&w| w == <S as Real>::zero()) {
                continue;
            }
            Self::gather(matrix, lane, a);
            dense::solve(a, x, true);
            for (i, &lam) in x.iter().enumerate() {
                targets[right_rows.start + i][lane] += lam;
                for (j, a) in solution.iter().enumerate() {
                    targets[matrix_rows.start + i * n + j][lane] -= lam * a[lane];
                }
            }
        }
    }
}
