//! Functions of the table over all lanes: vector code where the number has it, calls otherwise.

use super::{LANES, Row};
use crate::ops::{Binary, Unary};
use crate::scalar::{Scalar, cos_lanes, exp_lanes, ln_lanes, sin_cos_lanes, sin_lanes, sqrt_lanes, tanh_lanes};

/// `out = f(x)`.
#[inline(never)]
pub(super) fn value<S: Scalar>(f: Unary, x: &Row<S>, out: &mut Row<S>) {
    match f {
        Unary::Exp => exp_lanes(x, out),
        Unary::Ln => ln_lanes(x, out),
        Unary::Sqrt => sqrt_lanes(x, out),
        Unary::Sin => sin_lanes(x, out),
        Unary::Cos => cos_lanes(x, out),
        Unary::Tanh => tanh_lanes(x, out),
        _ => (0..LANES).for_each(|l| out[l] = f.value(x[l])),
    }
}

/// Sine and cosine.
#[inline(never)]
pub(super) fn sin_cos<S: Scalar>(x: &Row<S>, sin: &mut Row<S>, cos: &mut Row<S>) {
    sin_cos_lanes(x, sin, cos);
}

/// `out = f(a, b)`.
#[inline(never)]
pub(super) fn value_of_two<S: Scalar>(f: Binary, a: &Row<S>, b: &Row<S>, out: &mut Row<S>) {
    (0..LANES).for_each(|l| out[l] = f.value(a[l], b[l]));
}
