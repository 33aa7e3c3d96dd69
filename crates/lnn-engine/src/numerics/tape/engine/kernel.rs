//! Loops over planes: sums of products, and values and derivatives of functions of one or two numbers.

use crate::forward::Dual;
use crate::ops::{Activation, Binary, Unary};
use crate::scalar::{Real, Scalar, exp_lanes, sin_cos_lanes, update, update2, update3, vectorized};
use alloc::vec::Vec;

/// Runs a loop over `count` numbers with the widest vector instructions, or directly if a call does not pay.
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

/// `y = f(x)` and its first `order` derivatives, up to three. All slices that are written have the length of `x`.
pub(super) fn jets<S: Scalar>(f: Unary, order: usize, x: &[S], y: &mut [S], [d1, d2, d3]: [&mut [S]; 3]) {
    if let Some(activation) = Activation::of(f) {
        return match order {
            0 => activation.value(x, y),
            1 => activation.jet1(x, y, d1),
            2 => activation.jet2(x, y, d1, d2),
            _ => activation.jet3(x, y, d1, d2, d3),
        };
    }
    match f {
        _ if order == 0 => update(y, x, |y, x| *y = f.value(x)),
        Unary::Sin | Unary::Cos => {
            let (other, sign) = (d1, if f == Unary::Sin { S::of_f64(1.0) } else { S::of_f64(-1.0) });
            if f == Unary::Sin {
                sin_cos_lanes(x, y, other)
            } else {
                sin_cos_lanes(x, other, y)
            }
            for (k, &y) in y.iter().enumerate() {
                other[k] = sign * other[k];
                if order > 1 {
                    d2[k] = -y;
                }
                if order > 2 {
                    d3[k] = -other[k];
                }
            }
        }
        Unary::Exp => {
            exp_lanes(x, y);
            [d1, d2, d3].into_iter().take(order).for_each(|d| d.copy_from_slice(y));
        }
        // The derivatives are those of tanh.
        Unary::LnCosh => {
            update(y, x, |y, x| *y = x.ln_cosh());
            match order {
                1 => Activation::Tanh.value(x, d1),
                2 => Activation::Tanh.jet1(x, d1, d2),
                _ => Activation::Tanh.jet2(x, d1, d2, d3),
            }
        }
        Unary::Recip => each(order, x, y, [d1, d2, d3], |x| {
            let y = Real::recip(x);
            let first = -(y * y);
            let second = -(y * first + y * first);
            [y, first, second, -(y * second) * S::of_f64(3.0)]
        }),
        Unary::Sqrt => each(order, x, y, [d1, d2, d3], |x| {
            let y = Real::sqrt(x);
            let first = S::of_f64(0.5) / y;
            let second = -S::of_f64(0.5) * first / x;
            [y, first, second, -S::of_f64(1.5) * second / x]
        }),
        _ => {
            for (k, &x) in x.iter().enumerate() {
                let (value, first, second) = f.jet(x);
                (y[k], d1[k]) = (value, first);
                if order > 1 {
                    d2[k] = second;
                }
                if order > 2 {
                    d3[k] = third(f, x, (value, first, second));
                }
            }
        }
    }
}

/// The third derivative: the table's second one on numbers that carry their derivatives.
fn third<S: Scalar>(f: Unary, x: S, (y, first, second): (S, S, S)) -> S {
    let one = <S as Real>::one();
    f.second(Dual::new(x, one), Dual::new(y, first), Dual::new(first, second)).tangent
}

#[inline(always)]
fn each<S: Scalar>(order: usize, x: &[S], y: &mut [S], [d1, d2, d3]: [&mut [S]; 3], f: impl Fn(S) -> [S; 4]) {
    vectorized(
        #[inline(always)]
        || {
            for (k, &x) in x.iter().enumerate() {
                let [value, first, second, third] = f(x);
                (y[k], d1[k]) = (value, first);
                if order > 1 {
                    d2[k] = second;
                }
                if order > 2 {
                    d3[k] = third;
                }
            }
        },
    );
}

/// Partial derivatives of a function of two numbers: first `(a, b)`, second `(aa, ab, bb)`, third `(aaa, aab, abb, bbb)`.
pub(super) fn partials<S: Scalar>(f: Binary, a: S, b: S) -> (S, [S; 9]) {
    let y = f.value(a, b);
    let (fa, fb) = f.first(a, b, y);
    let (aa, ab, bb) = f.second(a, b, y, (fa, fb));
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let along = |da: S, db: S, dy: S, first: (S, S)| {
        let first = (Dual::new(fa, first.0), Dual::new(fb, first.1));
        f.second(Dual::new(a, da), Dual::new(b, db), Dual::new(y, dy), first)
    };
    let (aaa, aab, abb) = along(one, zero, fa, (aa, ab));
    let (_, _, bbb) = along(zero, one, fb, (ab, bb));
    (y, [fa, fb, aa, ab, bb, aaa.tangent, aab.tangent, abb.tangent, bbb.tangent])
}
