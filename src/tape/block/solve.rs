//! Batched solve `M a = r`.

use super::scratch::{Scratch, gather, scatter};
use crate::linalg;
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
    /// Numbers of working space: a matrix and two vectors for each lane.
    pub(super) fn scratch(&self) -> usize {
        LANES * self.n * (self.n + 2)
    }

    /// Solves for the matrices and right-hand sides that stand in the scratch; the solutions are left there.
    ///
    /// A lane that fails is `NaN`, which is its report: the others are right.
    fn solve<'s, S: Scalar>(&self, scratch: &'s mut Scratch<S>) -> &'s [S] {
        let Scratch { numbers, workspace } = scratch;
        let (matrices, rest) = numbers.split_at_mut(LANES * self.n * self.n);
        let (right, rest) = rest.split_at_mut(LANES * self.n);
        let solution = &mut rest[..LANES * self.n];
        if linalg::solve(self.n, matrices, right, solution, workspace).is_err() && workspace.failures().is_empty() {
            solution.fill(S::NAN);
        }
        solution
    }

    pub(super) fn forward<S: Scalar>(
        &self,
        matrix: &[Row<S>],
        right: &[Row<S>],
        out: &mut [Row<S>],
        scratch: &mut Scratch<S>,
    ) {
        let size = LANES * self.n * self.n;
        gather(matrix, &mut scratch.numbers[..size]);
        gather(right, &mut scratch.numbers[size..]);
        scatter(self.solve(scratch), out);
    }

    /// `lam = M^-T a'`, `r' += lam`, `M' -= lam a^T`; nothing in lanes whose `a'` is 0, and only what is asked for.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn reverse<S: Scalar>(
        &self,
        matrix: &[Row<S>],
        solution: &[Row<S>],
        adjoint: &[Row<S>],
        targets: &mut [Row<S>],
        [matrix_rows, right_rows]: [Range<usize>; 2],
        [by_matrix, by_right]: [bool; 2],
        scratch: &mut Scratch<S>,
    ) {
        let (n, zero) = (self.n, <S as Real>::zero());
        let silent = |lane: usize| adjoint.iter().all(|row| row[lane] == zero);
        if (0..LANES).all(silent) {
            return;
        }
        for (k, row) in matrix.iter().enumerate() {
            let transposed = (k % n) * n + k / n;
            for (l, &value) in row.iter().enumerate() {
                scratch.numbers[l * n * n + transposed] = value;
            }
        }
        gather(adjoint, &mut scratch.numbers[LANES * n * n..]);
        let lam = self.solve(scratch);
        for lane in (0..LANES).filter(|&lane| !silent(lane)) {
            for (i, &lam) in lam[lane * n..(lane + 1) * n].iter().enumerate() {
                if by_right {
                    targets[right_rows.start + i][lane] += lam;
                }
                for (j, a) in solution.iter().enumerate().filter(|_| by_matrix) {
                    targets[matrix_rows.start + i * n + j][lane] -= lam * a[lane];
                }
            }
        }
    }
}
