//! Small dense kernels behind the block operations, one matrix at a time.

use crate::scalar::{Real, Scalar};

/// Solves `A x = b` (or `A^T x = b`) in place by LU with partial pivoting; `a` `(n, n)` row-major is destroyed.
///
/// A singular matrix gives infinities or `NaN`; it is the caller's to detect.
pub(super) fn solve<S: Scalar>(a: &mut [S], x: &mut [S], transposed: bool) {
    let n = x.len();
    if transposed {
        for i in 0..n {
            for j in 0..i {
                a.swap(i * n + j, j * n + i);
            }
        }
    }
    for k in 0..n {
        let mut pivot = k;
        for i in k + 1..n {
            if a[i * n + k].abs() > a[pivot * n + k].abs() {
                pivot = i;
            }
        }
        if pivot != k {
            for j in 0..n {
                a.swap(k * n + j, pivot * n + j);
            }
            x.swap(k, pivot);
        }
        for i in k + 1..n {
            let factor = a[i * n + k] / a[k * n + k];
            for j in k + 1..n {
                let row = a[k * n + j];
                a[i * n + j] -= factor * row;
            }
            let head = x[k];
            x[i] -= factor * head;
        }
    }
    for i in (0..n).rev() {
        let mut sum = x[i];
        for j in i + 1..n {
            sum -= a[i * n + j] * x[j];
        }
        x[i] = sum / a[i * n + i];
    }
}

/// Eigenvalues (ascending, on the diagonal of `a`) and eigenvectors (columns of `u`) of the symmetric `a` by cyclic
/// Jacobi rotations (Golub and Van Loan, 8.5). Each eigenvector's component of largest size is positive.
pub(super) fn jacobi<S: Scalar>(n: usize, a: &mut [S], u: &mut [S]) {
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    for i in 0..n {
        for j in 0..n {
            u[i * n + j] = if i == j { one } else { zero };
        }
    }
    for _ in 0..60 {
        let mut quiet = true;
        for p in 0..n {
            for q in p + 1..n {
                let (off, x, y) = (a[p * n + q], a[p * n + p], a[q * n + q]);
                // Absent beside both diagonal entries; `NaN` counts as absent so that the loop ends.
                let small = off.abs() <= S::EPSILON * S::of_f64(0.125) * (x.abs() * y.abs()).sqrt();
                if off == zero || small || off.is_nan() || x.is_nan() || y.is_nan() {
                    continue;
                }
                quiet = false;
                let tau = (y - x) / (off + off);
                let root = (one + tau * tau).sqrt();
                let t = if tau >= zero { one / (tau + root) } else { one / (tau - root) };
                let c = one / (one + t * t).sqrt();
                rotate(n, a, u, (p, q), (c, t * c, t));
            }
        }
        if quiet {
            break;
        }
    }
    order(n, a, u);
}

/// One rotation in the plane `(p, q)` that annihilates `a_pq`.
fn rotate<S: Scalar>(n: usize, a: &mut [S], u: &mut [S], (p, q): (usize, usize), (c, s, t): (S, S, S)) {
    let off = a[p * n + q];
    a[p * n + p] -= t * off;
    a[q * n + q] += t * off;
    a[p * n + q] = <S as Real>::zero();
    a[q * n + p] = <S as Real>::zero();
    for k in (0..n).filter(|&k| k != p && k != q) {
        let (x, y) = (a[k * n + p], a[k * n + q]);
        let (x, y) = (c * x - s * y, s * x + c * y);
        a[k * n + p] = x;
        a[p * n + k] = x;
        a[k * n + q] = y;
        a[q * n + k] = y;
    }
    for k in 0..n {
        let (x, y) = (u[k * n + p], u[k * n + q]);
        u[k * n + p] = c * x - s * y;
        u[k * n + q] = s * x + c * y;
    }
}

/// Sorts by eigenvalue and fixes the signs of the vectors.
fn order<S: Scalar>(n: usize, a: &mut [S], u: &mut [S]) {
    for i in 0..n {
        let mut least = i;
        for j in i + 1..n {
            if a[j * n + j] < a[least * n + least] {
                least = j;
            }
        }
        a.swap(i * n + i, least * n + least);
        let mut largest = <S as Real>::zero();
        for k in 0..n {
            u.swap(k * n + i, k * n + least);
            if u[k * n + i].abs() > largest.abs() {
                largest = u[k * n + i];
            }
        }
        if largest < <S as Real>::zero() {
            for k in 0..n {
                u[k * n + i] = -u[k * n + i];
            }
        }
    }
}
