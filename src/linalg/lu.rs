//! LU with partial pivoting on lanes, one step of iterative refinement.

use super::batch::Lane;
use crate::scalar::{Real, Scalar};

/// Factors `P A = L U` in place, lane by lane; `order[i]` is the row of `A` that became row `i`.
///
/// The diagonal of the result holds the reciprocal pivots. Returns the smallest pivot relative to the largest element,
/// not above 0 or `NaN` where the factorisation is of no use.
#[inline(always)]
pub(super) fn factor<S: Scalar, const W: usize>(
    n: usize,
    a: &mut [Lane<S, W>],
    order: &mut [Lane<S, W>],
) -> Lane<S, W> {
    let a = &mut a[..n * n];
    let order = &mut order[..n];
    let mut largest = [<S as Real>::zero(); W];
    for element in a.iter() {
        for l in 0..W {
            let size = element[l].abs();
            largest[l] = if size > largest[l] { size } else { largest[l] };
        }
    }
    for (i, lane) in order.iter_mut().enumerate() {
        *lane = [S::of_f64(i as f64); W];
    }
    let mut smallest = largest;
    for k in 0..n {
        for i in k + 1..n {
            // The running maximum moves to row k: the pivot is the largest, the order of the others does not matter.
            let (head, tail) = a.split_at_mut(i * n);
            let (row_k, row_i) = (&mut head[k * n..k * n + n], &mut tail[..n]);
            let mut swap = [false; W];
            for l in 0..W {
                swap[l] = row_i[k][l].abs() > row_k[k][l].abs();
            }
            for (x, y) in row_k.iter_mut().zip(row_i.iter_mut()) {
                exchange(&swap, x, y);
            }
            let (head, tail) = order.split_at_mut(i);
            exchange(&swap, &mut head[k], &mut tail[0]);
        }
        let pivot = &mut a[k * n + k];
        for l in 0..W {
            let size = pivot[l].abs();
            smallest[l] = if size >= smallest[l] { smallest[l] } else { size };
            pivot[l] = pivot[l].recip();
        }
        for i in k + 1..n {
            let (head, tail) = a.split_at_mut(i * n);
            let (row_k, row_i) = (&head[k * n..k * n + n], &mut tail[..n]);
            let mut factor = row_i[k];
            for l in 0..W {
                factor[l] *= row_k[k][l];
            }
            row_i[k] = factor;
            for j in k + 1..n {
                for l in 0..W {
                    row_i[j][l] = (-factor[l]).mul_add(row_k[j][l], row_i[j][l]);
                }
            }
        }
    }
    for l in 0..W {
        smallest[l] /= largest[l];
    }
    smallest
}

/// Exchanges two lanes where asked.
#[inline(always)]
fn exchange<S: Scalar, const W: usize>(swap: &[bool; W], x: &mut Lane<S, W>, y: &mut Lane<S, W>) {
    for l in 0..W {
        let (a, b) = (x[l], y[l]);
        x[l] = if swap[l] { b } else { a };
        y[l] = if swap[l] { a } else { b };
    }
}

/// Solves `L U x = P b` for factors of [`factor`].
#[inline(always)]
pub(super) fn substitute<S: Scalar, const W: usize>(
    n: usize,
    lu: &[Lane<S, W>],
    order: &[Lane<S, W>],
    b: &[Lane<S, W>],
    x: &mut [Lane<S, W>],
) {
    let (lu, order, b, x) = (&lu[..n * n], &order[..n], &b[..n], &mut x[..n]);
    for i in 0..n {
        let mut sum = [<S as Real>::zero(); W];
        for (j, b) in b.iter().enumerate() {
            let index = S::of_f64(j as f64);
            for l in 0..W {
                sum[l] = if order[i][l] == index { b[l] } else { sum[l] };
            }
        }
        for j in 0..i {
            for l in 0..W {
                sum[l] = (-lu[i * n + j][l]).mul_add(x[j][l], sum[l]);
            }
        }
        x[i] = sum;
    }
    for i in (0..n).rev() {
        let mut sum = x[i];
        for j in i + 1..n {
            for l in 0..W {
                sum[l] = (-lu[i * n + j][l]).mul_add(x[j][l], sum[l]);
            }
        }
        for l in 0..W {
            x[i][l] = sum[l] * lu[i * n + i][l];
        }
    }
}

/// One step of iterative refinement: `x += A^-1 (b - A x)`; `residual` is scratch of two vectors.
#[inline(always)]
pub(super) fn refine<S: Scalar, const W: usize>(
    n: usize,
    matrix: &[Lane<S, W>],
    lu: &[Lane<S, W>],
    order: &[Lane<S, W>],
    b: &mut [Lane<S, W>],
    x: &mut [Lane<S, W>],
    step: &mut [Lane<S, W>],
) {
    let (matrix, b, x, step) = (&matrix[..n * n], &mut b[..n], &mut x[..n], &mut step[..n]);
    for i in 0..n {
        let mut sum = b[i];
        for j in 0..n {
            for l in 0..W {
                sum[l] = (-matrix[i * n + j][l]).mul_add(x[j][l], sum[l]);
            }
        }
        b[i] = sum;
    }
    substitute(n, lu, order, b, step);
    for i in 0..n {
        for l in 0..W {
            x[i][l] += step[i][l];
        }
    }
}
