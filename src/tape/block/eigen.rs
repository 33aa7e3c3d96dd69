//! Batched symmetric eigendecomposition.

use super::dense;
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
    pub(super) fn forward<S: Scalar>(&self, matrix: &[Row<S>], out: &mut [Row<S>], scratch: &mut [S]) {
        let n = self.n;
        let (a, u) = scratch.split_at_mut(n * n);
        let u = &mut u[..n * n];
        for lane in 0..LANES {
            for i in 0..n {
                for j in 0..n {
                    let sum = matrix[i * n + j][lane] + matrix[j * n + i][lane];
                    a[i * n + j] = sum * S::of_f64(0.5);
                }
            }
            dense::jacobi(n, a, u);
            for k in 0..n {
                out[k][lane] = a[k * n + k];
                for i in 0..n {
                    out[n + i * n + k][lane] = u[i * n + k];
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
        scratch: &mut [S],
    ) {
        let (n, zero) = (self.n, <S as Real>::zero());
        let (u, rest) = scratch.split_at_mut(n * n);
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
