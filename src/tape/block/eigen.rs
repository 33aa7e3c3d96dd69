//! Batched symmetric eigendecomposition.

use super::scratch::{Scratch, scatter};
use crate::linalg;
use crate::scalar::{Real, Scalar};
use crate::tape::program::{LANES, Row};

/// Eigenvalues (ascending) and eigenvectors of the symmetric part of `M` `(n, n)`: `n` rows, then `(n, n)` rows whose
/// column `k` is the `k`-th vector.
#[derive(Clone, Copy, Debug)]
pub(in crate::tape) struct Eigen {
    pub(super) n: usize,
    pub(super) matrix: u32,
}

impl Eigen {
    /// Numbers of working space.
    pub(super) fn scratch(&self) -> usize {
        let square = self.n * self.n;
        (LANES * (2 * square + self.n)).max(3 * square)
    }

    /// Lanes whose matrix is not finite become `NaN`.
    pub(super) fn forward<S: Scalar>(&self, matrix: &[Row<S>], out: &mut [Row<S>], scratch: &mut Scratch<S>) {
        let n = self.n;
        let Scratch { numbers, workspace } = scratch;
        let (matrices, rest) = numbers.split_at_mut(LANES * n * n);
        let (vectors, rest) = rest.split_at_mut(LANES * n * n);
        let values = &mut rest[..LANES * n];
        for i in 0..n {
            for j in 0..n {
                for lane in 0..LANES {
                    let sum = matrix[i * n + j][lane] + matrix[j * n + i][lane];
                    matrices[lane * n * n + i * n + j] = sum * <S as Real>::half();
                }
            }
        }
        if linalg::eigh(n, matrices, values, vectors, workspace).is_err() && workspace.failures().is_empty() {
            values.fill(S::NAN);
            vectors.fill(S::NAN);
        }
        let (levels, columns) = out.split_at_mut(n);
        scatter(values, levels);
        for (lane, vectors) in vectors.chunks_exact(n * n).enumerate() {
            for (k, u) in vectors.chunks_exact(n).enumerate() {
                let largest =
                    u.iter().fold(<S as Real>::zero(), |most, &x| if x.abs() > most.abs() { x } else { most });
                let turned = largest < <S as Real>::zero();
                for (i, &x) in u.iter().enumerate() {
                    columns[i * n + k][lane] = if turned { -x } else { x };
                }
            }
        }
    }

    /// `M' += U (diag(w') + K) U^T` with `K_ij = (U^T U')_ij / (l_j - l_i)`, symmetrised.
    ///
    /// The eigenvalue part `sum_k w'_k u_k u_k^T` is right at repeated eigenvalues for every function that is
    /// symmetric in them, whatever basis the cluster got. `K_ij` is left out (0) where the gap is below
    /// `sqrt(eps) max|l|`: there the vectors themselves are not determined, and functions that have a derivative
    /// (those of the spanned subspace) have none across the cluster.
    pub(super) fn reverse<S: Scalar>(
        &self,
        value: &[Row<S>],
        adjoint: &[Row<S>],
        target: &mut [Row<S>],
        scratch: &mut Scratch<S>,
    ) {
        let (n, zero) = (self.n, <S as Real>::zero());
        let (u, rest) = scratch.numbers.split_at_mut(n * n);
        let (inner, rest) = rest.split_at_mut(n * n);
        let half_product = &mut rest[..n * n];
        for lane in 0..LANES {
            if adjoint.iter().all(|row| row[lane] == zero) {
                continue;
            }
            let level = |k: usize| value[k][lane];
            let largest = (0..n).fold(zero, |most, k| Real::max(most, level(k).abs()));
            let safe = S::EPSILON.sqrt() * largest;
            for (target, row) in u.iter_mut().zip(&value[n..]) {
                *target = row[lane];
            }
            let vectors = &adjoint[n..];
            for i in 0..n {
                for j in 0..n {
                    let gap = level(j) - level(i);
                    inner[i * n + j] = if i == j {
                        adjoint[i][lane]
                    } else if gap.abs() > safe {
                        (0..n).fold(zero, |sum, k| sum + u[k * n + i] * vectors[k * n + j][lane]) / gap
                    } else {
                        zero
                    };
                }
            }
            for i in 0..n {
                for j in 0..n {
                    half_product[i * n + j] = (0..n).fold(zero, |sum, k| sum + u[i * n + k] * inner[k * n + j]);
                }
            }
            // Row i, column j of `half_product U^T`, and its mirror image.
            let full = |i: usize, j: usize| (0..n).fold(zero, |sum, k| sum + half_product[i * n + k] * u[j * n + k]);
            for i in 0..n {
                for j in 0..n {
                    target[i * n + j][lane] += (full(i, j) + full(j, i)) * S::of_f64(0.5);
                }
            }
        }
    }
}
