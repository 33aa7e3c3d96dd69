//! Loops over planes.

use crate::scalar::{Real, Scalar, update, update2, update3, vectorized};

/// Runs a loop over `count` numbers for the widest vector instructions, as it is where that is not worth a call.
#[inline(always)]
fn dispatched(count: usize, kernel: impl FnOnce()) {
    if count < 8 { kernel() } else { vectorized(kernel) }
}

/// `out += a x`.
pub(super) fn add_scaled<S: Scalar>(out: &mut [S], a: S, x: &[S]) {
    dispatched(
        out.len(),
        #[inline(always)]
        || update(out, x, |out, x| *out += a * x),
    );
}

/// `out += x y`.
pub(super) fn add_product<S: Scalar>(out: &mut [S], x: &[S], y: &[S]) {
    dispatched(
        out.len(),
        #[inline(always)]
        || update2(out, x, y, |out, x, y| *out += x * y),
    );
}

/// `out += x y z`.
pub(super) fn add_product3<S: Scalar>(out: &mut [S], x: &[S], y: &[S], z: &[S]) {
    dispatched(
        out.len(),
        #[inline(always)]
        || update3(out, x, y, z, |out, x, y, z| *out += x * y * z),
    );
}

/// Sum of a plane of one unit, in partial sums of fixed order.
pub(super) fn sum<S: Scalar>(x: &[S]) -> S {
    let zero = <S as Real>::zero();
    x.chunks(16).fold(zero, |total, part| total + part.iter().fold(zero, |sum, &x| sum + x))
}

/// Adds the sum of the rows of a plane to `total`.
pub(super) fn add_rows<S: Scalar>(plane: &[S], total: &mut [S]) {
    vectorized(
        #[inline(always)]
        || {
            let units = total.len();
            for row in 0..plane.len() / units.max(1) {
                update(total, &plane[row * units..][..units], |sum, x| *sum += x);
            }
        },
    );
}

/// Sets the length; new numbers are zero, old ones stay.
pub(super) fn resize<S: Scalar>(buffer: &mut Vec<S>, length: usize) {
    if buffer.len() < length {
        buffer.resize(length, <S as Real>::zero());
    }
}
