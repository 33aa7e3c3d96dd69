//! Positive definite matrices, `M = L D L^T`: elimination without a search for pivots, in half the work.
//!
//! A matrix whose pivots are not all positive, or so small that digits are lost, is refused and left to the elimination with pivots. Every
//! element goes through the same steps in lanes and alone, so that a matrix gives the same bits at any position in a batch.

use super::Workspace;
use super::batch::{LANES, Lane};
use super::elimination::{self, Pivots};
use super::solve::{Systems, finish, is_harmless};
use super::thresholds::{ALONE_SIZE, LEAST_DEFINITE_SIZE};
use crate::scalar::{Real, Scalar, are_finite, in_lanes, vectorized};
use alloc::vec::Vec;

/// Pivots whose rows are subtracted together.
const BLOCK: usize = 4;
/// Numbers of a row that are treated together.
const CHUNK: usize = 8;

impl<S: Scalar> Systems<'_, S> {
    /// Solves all matrices that are safely positive definite; returns the remaining rows, `None` if it is not worth trying.
    pub(super) fn solve_definite(&self, solutions: &mut [S], workspace: &mut Workspace<S>) -> Option<Vec<usize>> {
        let n = self.n;
        let right = self.right.filter(|_| self.m == 1 && n >= LEAST_DEFINITE_SIZE)?;
        let batch = solutions.len() / n;
        let mut refused = Vec::new();
        let done = match const { size_of::<S>() < size_of::<f64>() } {
            _ if n >= ALONE_SIZE => 0,
            true => self.definite_blocks::<{ 2 * LANES }>(batch, solutions, workspace, &mut refused),
            false => self.definite_blocks::<LANES>(batch, solutions, workspace, &mut refused),
        };
        let (buffer, retry, _) = workspace.parts();
        let (system, factors) = (buffer.lanes::<CHUNK>(n * chunks(n + 1)), retry.block.lanes::<1>(n * n));
        for row in done..batch {
            let (matrix, right) = (&self.matrices[row * n * n..][..n * n], &right[row * n..][..n]);
            let x = &mut solutions[row * n..][..n];
            let safe = vectorized(
                #[inline(always)]
                || solve_alone(matrix, right, x, system, factors.as_flattened_mut()),
            );
            if !safe {
                refused.push(row);
            }
        }
        Some(refused)
    }

    /// Inverts all matrices that are safely positive definite, one after the other; returns the remaining rows, `None` if it is not worth
    /// trying.
    pub(super) fn invert_definite(&self, inverses: &mut [S], workspace: &mut Workspace<S>) -> Option<Vec<usize>> {
        let n = self.n;
        if n < LEAST_DEFINITE_SIZE {
            return None;
        }
        let (buffer, retry, _) = workspace.parts();
        let (system, factors) =
            (buffer.lanes::<CHUNK>(n * lines_of_inverse(n).0), retry.block.lanes::<1>(n * (n + 1)).as_flattened_mut());
        let matrices = self.matrices.chunks_exact(n * n).zip(inverses.chunks_exact_mut(n * n)).enumerate();
        let refused = matrices.filter_map(|(row, (matrix, inverse))| {
            let safe = vectorized(
                #[inline(always)]
                || invert_alone(n, matrix, inverse, system, factors),
            );
            (!safe).then_some(row)
        });
        Some(refused.collect())
    }

    /// Whole blocks of `W` rows, and a last one that is at least half full; returns the number of rows treated.
    fn definite_blocks<const W: usize>(
        &self,
        batch: usize,
        solutions: &mut [S],
        workspace: &mut Workspace<S>,
        refused: &mut Vec<usize>,
    ) -> usize {
        let together = if batch % W >= W / 2 { batch } else { batch - batch % W };
        let n = self.n;
        let system = workspace.parts().0.lanes::<W>(n * (n + 1));
        let done = in_lanes::<W, _>(
            #[inline(always)]
            || {
                for start in (0..together).step_by(W) {
                    let largest = elimination::load((n, 1), self.matrices, self.right, start, system);
                    let pivots = side_by_side(n, system);
                    let probe = finish((n, 1), system, false, solutions, start);
                    for l in 0..W.min(batch - start) {
                        let harmless = is_harmless(pivots.smallest[l], pivots.growth[l], largest[l]);
                        if !harmless || probe[l] != <S as Real>::zero() {
                            refused.push(start + l);
                        }
                    }
                }
            },
        );
        done.map_or(0, |()| together)
    }
}

/// Solves `M x = b` of `W` systems in place: the last column of `[M | b]`, `n` lines of `n + 1`, becomes `x`.
///
/// A pivot that is not positive counts as 0.
#[inline(always)]
fn side_by_side<S: Scalar, const W: usize>(n: usize, system: &mut [Lane<S, W>]) -> Pivots<S, W> {
    let (width, zero) = (n + 1, <S as Real>::zero());
    let mut pivots = Pivots { smallest: [S::infinity(); W], growth: [zero; W] };
    for k in 0..n {
        let (above, below) = system[..n * width].split_at_mut((k + 1) * width);
        let pivot_row = &mut above[k * width..];
        let mut inverse = [zero; W];
        for l in 0..W {
            let pivot = pivot_row[k][l];
            inverse[l] = pivot.recip();
            let size = if pivot > zero { pivot } else { zero };
            pivots.smallest[l] = if size >= pivots.smallest[l] { pivots.smallest[l] } else { size };
            pivots.growth[l] = if size > pivots.growth[l] { size } else { pivots.growth[l] };
        }
        for i in k + 1..n {
            let row = &mut below[(i - k - 1) * width..][..width];
            let mut factor = pivot_row[i];
            for l in 0..W {
                factor[l] *= inverse[l];
            }
            for j in i..width {
                for l in 0..W {
                    row[j][l] = (-factor[l]).lane_fused(pivot_row[j][l], row[j][l]);
                }
            }
            row[k] = factor;
        }
        for l in 0..W {
            pivot_row[n][l] *= inverse[l];
        }
    }
    // The factors are in the lower triangle, with those of a line side by side.
    for k in (1..n).rev() {
        let found = system[k * width + n];
        for i in 0..k {
            let factor = system[k * width + i];
            for l in 0..W {
                system[i * width + n][l] = (-factor[l]).lane_fused(found[l], system[i * width + n][l]);
            }
        }
    }
    pivots
}

/// Number of chunks for `numbers` numbers.
fn chunks(numbers: usize) -> usize {
    numbers.div_ceil(CHUNK)
}

/// Copies a matrix into lines of `stride` chunks; its largest element.
#[inline(always)]
fn load<S: Scalar>(n: usize, matrix: &[S], system: &mut [[S; CHUNK]], stride: usize) -> S {
    let zero = <S as Real>::zero();
    let mut largest = [zero; CHUNK];
    for i in 0..n {
        let row = &matrix[i * n..][..n];
        system[i * stride..][..stride].as_flattened_mut()[..n].copy_from_slice(row);
        let (parts, rest) = row.as_chunks::<CHUNK>();
        for part in parts {
            for l in 0..CHUNK {
                let size = part[l].abs();
                largest[l] = if size > largest[l] { size } else { largest[l] };
            }
        }
        for &element in rest {
            let size = element.abs();
            largest[0] = if size > largest[0] { size } else { largest[0] };
        }
    }
    let mut bound = zero;
    for size in largest {
        bound = if size > bound { size } else { bound };
    }
    bound
}

/// Eliminates below the diagonal of `[M | B]`, `n` lines of `stride` chunks, step by step as [`side_by_side`] does, along the lines. The
/// line of pivot `k` has `end(k)` chunks. Keeps the factors, row by row, with the inverse pivots on their diagonal. Returns the smallest
/// pivot, 0 if it ended at one that is not positive, and the largest.
#[inline(always)]
fn eliminate<S: Scalar>(
    n: usize,
    system: &mut [[S; CHUNK]],
    stride: usize,
    end: impl Fn(usize) -> usize,
    factors: &mut [S],
) -> (S, S) {
    let zero = <S as Real>::zero();
    let (mut smallest, mut growth) = (S::infinity(), zero);
    for first in (0..n).step_by(BLOCK) {
        let last = n.min(first + BLOCK);
        let end = end(last - 1);
        let mut inverse = [zero; BLOCK];
        for k in first..last {
            let (above, below) = system.split_at_mut((k + 1) * stride);
            let pivot_row = &above[k * stride..][..end];
            let pivot = pivot_row[k / CHUNK][k % CHUNK];
            let inverse = &mut inverse[k - first];
            *inverse = pivot.recip();
            factors[k * n + k] = *inverse;
            let size = if pivot > zero { pivot } else { zero };
            smallest = if size >= smallest { smallest } else { size };
            growth = if size > growth { size } else { growth };
            for i in k + 1..last {
                let row = &mut below[(i - k - 1) * stride..][..end];
                let factor = pivot_row[i / CHUNK][i % CHUNK] * *inverse;
                factors[i * n + k] = factor;
                for j in i / CHUNK..end {
                    for l in 0..CHUNK {
                        row[j][l] = (-factor).lane_fused(pivot_row[j][l], row[j][l]);
                    }
                }
            }
        }
        if smallest == zero {
            break;
        }
        // Rows remain only below a full block.
        if last < n {
            let (above, below) = system.split_at_mut(last * stride);
            let above = &above[first * stride..];
            let (a, b) = (&above[..end], &above[stride..][..end]);
            let (c, d) = (&above[2 * stride..][..end], &above[3 * stride..][..end]);
            for i in last..n {
                let row = &mut below[(i - last) * stride..][..end];
                let (at, lane) = (i / CHUNK, i % CHUNK);
                let f0 = a[at][lane] * inverse[0];
                let f1 = b[at][lane] * inverse[1];
                let f2 = c[at][lane] * inverse[2];
                let f3 = d[at][lane] * inverse[3];
                let kept = &mut factors[i * n + first..][..BLOCK];
                (kept[0], kept[1], kept[2], kept[3]) = (f0, f1, f2, f3);
                for j in at..end {
                    let (mut y, a, b, c, d) = (row[j], &a[j], &b[j], &c[j], &d[j]);
                    for l in 0..CHUNK {
                        y[l] = (-f0).lane_fused(a[l], y[l]);
                    }
                    for l in 0..CHUNK {
                        y[l] = (-f1).lane_fused(b[l], y[l]);
                    }
                    for l in 0..CHUNK {
                        y[l] = (-f2).lane_fused(c[l], y[l]);
                    }
                    for l in 0..CHUNK {
                        y[l] = (-f3).lane_fused(d[l], y[l]);
                    }
                    row[j] = y;
                }
            }
        }
    }
    (smallest, growth)
}

/// Solves one system; `false` if it is not safely positive definite.
#[inline(always)]
fn solve_alone<S: Scalar>(
    matrix: &[S],
    right: &[S],
    x: &mut [S],
    system: &mut [[S; CHUNK]],
    factors: &mut [S],
) -> bool {
    let (n, stride) = (x.len(), chunks(x.len() + 1));
    let largest = load(n, matrix, system, stride);
    for i in 0..n {
        system[i * stride + n / CHUNK][n % CHUNK] = right[i];
    }
    let (smallest, growth) = eliminate(n, system, stride, |_| stride, factors);
    for k in 0..n {
        x[k] = system[k * stride + n / CHUNK][n % CHUNK] * factors[k * n + k];
    }
    for k in (1..n).rev() {
        let (known, found) = x[..=k].split_at_mut(k);
        let factors = &factors[k * n..][..k];
        for i in 0..k {
            known[i] = (-factors[i]).lane_fused(found[0], known[i]);
        }
    }
    is_harmless(smallest, growth, largest) & are_finite(x)
}

/// Chunks of a line of `[M | I]`, and the one with which `I` begins.
fn lines_of_inverse(n: usize) -> (usize, usize) {
    (2 * chunks(n), chunks(n))
}

/// Inverts one matrix, `M^-1 = L^-T D^-1 L^-1`; `false` if it is not safely positive definite.
#[inline(always)]
fn invert_alone<S: Scalar>(
    n: usize,
    matrix: &[S],
    inverse: &mut [S],
    system: &mut [[S; CHUNK]],
    factors: &mut [S],
) -> bool {
    let (zero, (stride, middle)) = (<S as Real>::zero(), lines_of_inverse(n));
    system[..n * stride].as_flattened_mut().fill(zero);
    let largest = load(n, matrix, system, stride);
    for i in 0..n {
        system[i * stride + middle + i / CHUNK][i % CHUNK] = <S as Real>::one();
    }
    let (smallest, growth) = eliminate(n, system, stride, |k| middle + k / CHUNK + 1, factors);
    // The right half contains the lower triangle of L^-1.
    let (diagonal, weights) = factors.split_at_mut(n * n);
    for i in 0..n {
        for k in i..n {
            weights[k] = system[k * stride + middle + i / CHUNK][i % CHUNK] * diagonal[k * n + k];
        }
        for c in 0..=i / CHUNK {
            let mut sum = [zero; CHUNK];
            for k in i..n {
                let part = &system[k * stride + middle + c];
                for l in 0..CHUNK {
                    sum[l] = weights[k].lane_fused(part[l], sum[l]);
                }
            }
            for l in 0..CHUNK.min(i + 1 - c * CHUNK) {
                let j = c * CHUNK + l;
                inverse[i * n + j] = sum[l];
                inverse[j * n + i] = sum[l];
            }
        }
    }
    is_harmless(smallest, growth, largest) & are_finite(inverse)
}

#[cfg(test)]
mod tests {
    use super::super::{Failure, solve_symmetric};
    use super::*;

    /// `(batch, n, n)` positive definite matrices and right-hand sides.
    fn systems(n: usize, batch: usize) -> (Vec<f64>, Vec<f64>) {
        let mut state = 1u64;
        let mut draw = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let mut matrices = Vec::new();
        for _ in 0..batch {
            let root: Vec<f64> = (0..n * n).map(|_| draw()).collect();
            for k in 0..n * n {
                let product = (0..n).map(|m| root[k / n * n + m] * root[k % n * n + m]).sum::<f64>();
                matrices.push(product + if k % (n + 1) == 0 { 0.5 } else { 0.0 });
            }
        }
        (matrices, (0..n * batch).map(|_| draw()).collect())
    }

    #[test]
    fn a_matrix_gives_the_same_bits_alone_and_in_a_batch() {
        let mut workspace = Workspace::new();
        for n in [5, 6, 8, 9, 17, 40, 46, 47, 61] {
            let (matrices, right) = systems(n, 19);
            let (mut together, mut one) = (vec![0.0; right.len()], vec![0.0; n]);
            solve_symmetric(n, &matrices, &right, &mut together, &mut workspace).unwrap();
            for (row, right) in right.chunks_exact(n).enumerate() {
                let matrix = &matrices[row * n * n..][..n * n];
                solve_symmetric(n, matrix, right, &mut one, &mut workspace).unwrap();
                assert_eq!(one, together[row * n..][..n]);
                for (row, &b) in matrix.chunks_exact(n).zip(right) {
                    let product = row.iter().zip(&one).map(|(a, x)| a * x).sum::<f64>();
                    assert!((product - b).abs() < 1e-12, "{n}: {product} {b}");
                }
            }
        }
    }

    #[test]
    fn what_is_not_definite_is_left_to_pivots_row_by_row() {
        let (n, batch) = (6, 11);
        let (mut matrices, right) = systems(n, batch);
        matrices[3 * n * n] = -7.0;
        matrices[5 * n * n..6 * n * n].fill(1.0);
        matrices[9 * n * n + 8] = f64::NAN;
        let mut workspace = Workspace::new();
        let mut x = vec![0.0; n * batch];
        let systems = Systems { n, m: 1, matrices: &matrices, right: Some(&right) };
        assert_eq!(systems.solve_definite(&mut x, &mut workspace), Some(vec![3, 5, 9]));
        assert!(solve_symmetric(n, &matrices, &right, &mut x, &mut workspace).is_err());
        let failed: Vec<usize> = workspace.failures().iter().map(|(row, _)| *row).collect();
        assert_eq!(failed, [5, 9]);
        assert!(matches!(workspace.failures()[0].1, Failure::Singular { .. }));
        let product: f64 = matrices[3 * n * n..][..n].iter().zip(&x[3 * n..]).map(|(a, x)| a * x).sum();
        assert!((product - right[3 * n]).abs() < 1e-12);
    }
}
