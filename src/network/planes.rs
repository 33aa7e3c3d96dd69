//! Buffers of planes `(channel, state, unit)`: the channels of a layer lie side by side, so that one product serves all.

use crate::scalar::{Real, Scalar};

/// Plane `k` of a buffer of planes of `size` numbers.
#[inline(always)]
pub(super) fn plane<S>(planes: &[S], k: usize, size: usize) -> &[S] {
    &planes[k * size..(k + 1) * size]
}

/// Sets the length; new numbers are zero, old ones stay.
pub(super) fn resize<S: Scalar>(buffer: &mut Vec<S>, length: usize) {
    buffer.resize(length, <S as Real>::zero());
}

/// Adds `row` to every row of a plane.
#[inline(always)]
pub(super) fn add_to_rows<S: Scalar>(plane: &mut [S], row: &[S]) {
    for to in plane.chunks_exact_mut(row.len()) {
        for (x, &b) in to.iter_mut().zip(row) {
            *x += b;
        }
    }
}

/// Sum of the rows of a plane, added to `total`.
#[inline(always)]
pub(super) fn add_rows<S: Scalar>(plane: &[S], total: &mut [S]) {
    for row in plane.chunks_exact(total.len()) {
        for (sum, &x) in total.iter_mut().zip(row) {
            *sum += x;
        }
    }
}

/// Dot product in independent partial sums of fixed order: vectorises, and errs less than a running sum.
#[inline(always)]
pub(super) fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    const LANES: usize = 16;
    let zero = <S as Real>::zero();
    let mut sums = [zero; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let mut rest = zero;
    for (&x, &y) in a_chunks.remainder().iter().zip(b_chunks.remainder()) {
        rest += x * y;
    }
    for (a, b) in a_chunks.zip(b_chunks) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    let mut width = LANES / 2;
    while width > 0 {
        for k in 0..width {
            sums[k] += sums[k + width];
        }
        width /= 2;
    }
    sums[0] + rest
}
