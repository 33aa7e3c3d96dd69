//! Rows of small matrices: independent rows and orthogonal complements.

use crate::lagrangian::thresholds::RANK_ROUNDINGS;
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Subtracts the projection of `x` onto orthonormal rows, `(k, n)`; twice, because one pass leaves rounding errors.
pub fn take_out<S: Scalar>(x: &mut [S], basis: &[S]) {
    for _ in 0..2 {
        for u in basis.chunks_exact(x.len()) {
            let along = dot(u, x);
            x.iter_mut().zip(u).for_each(|(x, &u)| *x -= along * u);
        }
    }
}

/// Computes the scalar product.
pub fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    a.iter().zip(b).fold(<S as Real>::zero(), |sum, (&a, &b)| a.mul_add(b, sum))
}

/// Computes the Euclidean length without overflow or underflow.
pub(in crate::mechanics::lagrangian) fn length<S: Scalar>(x: &[S]) -> S {
    let size = largest(x);
    if size > <S as Real>::zero() && size.is_finite() {
        let unit = size.ilogb();
        let scaled = x.iter().map(|x| x.ldexp(-unit));
        Real::sqrt(scaled.fold(<S as Real>::zero(), |sum, x| x.mul_add(x, sum))).ldexp(unit)
    } else {
        size
    }
}

/// Returns the largest magnitude; `NaN` if any number is `NaN`.
pub(super) fn largest<S: Scalar>(x: &[S]) -> S {
    x.iter().fold(<S as Real>::zero(), |most, x| Real::max(most, x.abs()))
}

/// Selects rows of an `(m, n)` matrix that, after normalization, have a component above `tolerance` outside the span of the rows kept
/// before. Returns their indices and an orthonormal basis of their span.
pub(super) fn independent<S: Scalar>(n: usize, matrix: &[S], tolerance: f64) -> (Vec<usize>, Vec<S>) {
    let (mut kept, mut basis) = (Vec::new(), Vec::new());
    for (i, row) in matrix.chunks_exact(n).enumerate() {
        let size = length(row);
        if !(size > <S as Real>::zero() && size.is_finite()) {
            continue;
        }
        let mut rest: Vec<S> = row.iter().map(|&x| x / size).collect();
        take_out(&mut rest, &basis);
        let left = length(&rest);
        if left.to_f64() > tolerance {
            kept.push(i);
            basis.extend(rest.iter().map(|&x| x / left));
        }
    }
    (kept, basis)
}

/// Selects independent rows up to rounding.
pub fn independent_rows<S: Scalar>(n: usize, matrix: &[S]) -> (Vec<usize>, Vec<S>) {
    independent(n, matrix, RANK_ROUNDINGS * S::epsilon().to_f64().sqrt())
}

/// Returns an orthonormal basis, `(n - k, n)`, of the orthogonal complement of orthonormal rows, `(k, n)`.
pub(in crate::mechanics::lagrangian) fn complement<S: Scalar>(n: usize, rows: &[S]) -> Vec<S> {
    let mut all = rows.to_vec();
    while all.len() < n * n {
        // Choose the axis with the largest component outside the current span.
        let outside = |i: usize| {
            let mut axis = vec![<S as Real>::zero(); n];
            axis[i] = <S as Real>::one();
            take_out(&mut axis, &all);
            axis
        };
        let candidates = (0..n).map(|i| {
            let axis = outside(i);
            (length(&axis), axis)
        });
        let (size, axis) =
            candidates.fold((<S as Real>::zero(), vec![]), |best, next| if next.0 > best.0 { next } else { best });
        if axis.is_empty() {
            break;
        }
        all.extend(axis.iter().map(|&x| x / size));
    }
    all.split_off(rows.len())
}
