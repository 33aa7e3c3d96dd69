//! Gaussian elimination with partial pivoting on lanes, right-hand sides carried along.

use super::batch::{Lane, across, rows, select};
use crate::scalar::{Real, Scalar};

/// Pivots of the elimination of each matrix.
pub(super) struct Pivots<S, const W: usize> {
    /// Smallest pivot, absolutely.
    pub smallest: Lane<S, W>,
    /// Largest absolute value of an element of the upper triangular factor.
    pub growth: Lane<S, W>,
}

/// Loads `[A | B]` of the rows `start..start + W`, `n` lines of `n + m`; without right-hand sides `B` is the identity.
///
/// Returns the largest absolute element of each `A`.
#[inline(always)]
pub(super) fn load<S: Scalar, const W: usize>(
    (n, m): (usize, usize),
    matrices: &[S],
    right: Option<&[S]>,
    start: usize,
    system: &mut [Lane<S, W>],
) -> Lane<S, W> {
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let width = n + m;
    let system = &mut system[..n * width];
    let a = rows::<S, W>(matrices, n * n, start);
    let mut largest = [zero; W];
    for i in 0..n {
        for j in 0..n {
            let x = across(&a, i * n + j);
            system[i * width + j] = x;
            larger(&mut largest, &x);
        }
    }
    if let Some(right) = right {
        let b = rows::<S, W>(right, n * m, start);
        for i in 0..n {
            for c in 0..m {
                system[i * width + n + c] = across(&b, i * m + c);
            }
        }
    } else {
        for i in 0..n {
            for c in 0..m {
                system[i * width + n + c] = [if i == c { one } else { zero }; W];
            }
        }
    }
    largest
}

/// `bound = max(bound, |x|)`.
#[inline(always)]
pub(super) fn larger<S: Scalar, const W: usize>(bound: &mut Lane<S, W>, x: &Lane<S, W>) {
    for l in 0..W {
        let size = x[l].abs();
        bound[l] = select(size > bound[l], size, bound[l]);
    }
}

/// `otherwise` with `chosen` where the pivot is row `index`.
#[inline(always)]
fn where_pivot<S: Scalar, const W: usize>(
    pivot: &Lane<S, W>,
    index: S,
    chosen: &Lane<S, W>,
    otherwise: &Lane<S, W>,
) -> Lane<S, W> {
    let mut out = *otherwise;
    for l in 0..W {
        out[l] = select(pivot[l] == index, chosen[l], otherwise[l]);
    }
    out
}

/// Solves `A X = B` in place: the last `m` columns of `[A | B]` become `X`.
///
/// The pivot of a step is the first of the largest elements of its column. Every lane goes through the same steps.
#[inline(always)]
pub(super) fn solve<S: Scalar, const W: usize>((n, m): (usize, usize), system: &mut [Lane<S, W>]) -> Pivots<S, W> {
    let width = n + m;
    let a = &mut system[..n * width];
    let mut pivots = Pivots { smallest: [S::infinity(); W], growth: [<S as Real>::zero(); W] };
    for k in 0..n {
        let first = a[k * width + k];
        let (mut pivot, mut best, mut row) = (first, first, [S::of_f64(k as f64); W]);
        for l in 0..W {
            best[l] = first[l].abs();
        }
        for i in k + 1..n {
            let x = a[i * width + k];
            let index = S::of_f64(i as f64);
            for l in 0..W {
                let size = x[l].abs();
                row[l] = select(size > best[l], index, row[l]);
                pivot[l] = select(size > best[l], x[l], pivot[l]);
                best[l] = select(size > best[l], size, best[l]);
            }
        }
        let mut inverse = pivot;
        for l in 0..W {
            inverse[l] = pivot[l].recip();
            pivots.smallest[l] = select(best[l] >= pivots.smallest[l], pivots.smallest[l], best[l]);
        }
        larger(&mut pivots.growth, &best);
        a[k * width + k] = inverse;
        // The factors, negative.
        for i in k + 1..n {
            let mut x = where_pivot(&row, S::of_f64(i as f64), &first, &a[i * width + k]);
            for l in 0..W {
                x[l] *= -inverse[l];
            }
            a[i * width + k] = x;
        }
        for j in k + 1..width {
            let first = a[k * width + j];
            let mut pivot = first;
            for i in k + 1..n {
                pivot = where_pivot(&row, S::of_f64(i as f64), &a[i * width + j], &pivot);
            }
            a[k * width + j] = pivot;
            if j < n {
                larger(&mut pivots.growth, &pivot);
            }
            for i in k + 1..n {
                let factor = a[i * width + k];
                let mut x = where_pivot(&row, S::of_f64(i as f64), &first, &a[i * width + j]);
                for l in 0..W {
                    x[l] = factor[l].lane_fused(pivot[l], x[l]);
                }
                a[i * width + j] = x;
            }
        }
    }
    for c in n..width {
        for k in (0..n).rev() {
            let (mut x, inverse) = (a[k * width + c], a[k * width + k]);
            for l in 0..W {
                x[l] *= inverse[l];
            }
            a[k * width + c] = x;
            for i in 0..k {
                let (mut y, u) = (a[i * width + c], a[i * width + k]);
                for l in 0..W {
                    y[l] = (-u[l]).lane_fused(x[l], y[l]);
                }
                a[i * width + c] = y;
            }
        }
    }
    pivots
}

/// Subtracts `A X` from the right-hand sides of `[A | B]`, `X` in `n` lines of `m`.
#[inline(always)]
pub(super) fn residual<S: Scalar, const W: usize>((n, m): (usize, usize), system: &mut [Lane<S, W>], x: &[Lane<S, W>]) {
    let width = n + m;
    for i in 0..n {
        for c in 0..m {
            let mut sum = system[i * width + n + c];
            for j in 0..n {
                let (a, x) = (system[i * width + j], x[j * m + c]);
                for l in 0..W {
                    sum[l] = (-a[l]).lane_fused(x[l], sum[l]);
                }
            }
            system[i * width + n + c] = sum;
        }
    }
}
