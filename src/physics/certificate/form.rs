//! First-order forms: functions on a box as a plane and a distance from it.
//!
//! A form over a box with the axes `e_k` from -1 to 1 is a slice `[c, s_1, .., s_m, r]`: everywhere on the box the function lies within
//! `r` of `c + sum_k s_k e_k`. Numbers are rounded to nearest, and what that may have lost is added to `r`: a sum or product `x` is off by
//! at most `EPSILON |x| / 2`, and `r` is charged twice that, which also covers the rounding of the charge itself.

use super::function::Derivatives;
use super::interval::Interval;

const EPSILON: f64 = f64::EPSILON;
/// Largest share of the radius of a range that the distance from a plane may have.
const WORTHWHILE: f64 = 0.7;
/// Covers what underflow loses.
const TINY: f64 = 1e-290;

/// A sum of a few numbers that are not negative, moved above whatever its own rounding lost.
#[inline(always)]
fn raised(x: f64) -> f64 {
    x * (1.0 + 64.0 * EPSILON) + TINY
}

/// `true` for the function 0.
#[inline]
pub fn is_zero(a: &[f64]) -> bool {
    a.iter().all(|x| *x == 0.0)
}

/// Largest distance from the centre, rounded up.
#[inline]
pub fn deviation(a: &[f64]) -> f64 {
    let sum: f64 = a[1..].iter().map(|x| x.abs()).sum();
    sum * (1.0 + (a.len() as f64 + 2.0) * EPSILON)
}

/// Every value on the box.
#[inline]
pub fn range(a: &[f64]) -> Interval {
    let deviation = deviation(a);
    Interval::outward(a[0] - deviation, a[0] + deviation)
}

/// The constant function with a value of the interval.
#[inline]
pub fn set_constant(out: &mut [f64], value: Interval) {
    out.fill(0.0);
    out[0] = value.middle();
    out[out.len() - 1] = value.radius();
}

/// `out += s a`.
#[inline]
pub fn add_scaled(out: &mut [f64], s: f64, a: &[f64]) {
    if is_zero(a) {
        return;
    }
    let m = a.len() - 1;
    let mut charge = 0.0;
    for (out, a) in out[..m].iter_mut().zip(&a[..m]) {
        let term = s * a;
        *out += term;
        charge += term.abs() + out.abs();
    }
    out[m] = raised(out[m] + s.abs() * a[m] + EPSILON * charge);
}

/// `out += s a` for a factor that is known to lie in an interval.
#[inline]
pub fn add_multiple(out: &mut [f64], s: Interval, a: &[f64]) {
    add_scaled(out, s.middle(), a);
    let spread = s.radius();
    if spread != 0.0 && !is_zero(a) {
        let m = a.len() - 1;
        out[m] = raised(out[m] + spread * (a[0].abs() + deviation(a)));
    }
}

/// `out += a b`. Of the products `e_k e_l` squares lie between 0 and 1, the others between -1 and 1.
pub fn add_product(out: &mut [f64], a: &[f64], b: &[f64]) {
    if is_zero(a) || is_zero(b) {
        return;
    }
    let m = a.len() - 1;
    let ([a0, b0], [ra, rb]) = ([a[0], b[0]], [a[m], b[m]]);
    let (sa, sb) = (&a[1..m], &b[1..m]);
    let (mut square, mut squares, mut along_a, mut along_b, mut charge) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ((out, &x), &y) in out[1..m].iter_mut().zip(sa).zip(sb) {
        let (first, second) = (a0 * y, b0 * x);
        let sum = first + second;
        *out += sum;
        charge += first.abs() + second.abs() + sum.abs() + out.abs();
        let product = x * y;
        square += product;
        squares += product.abs();
        along_a += x.abs();
        along_b += y.abs();
    }
    // Pairs of different axes, sign by sign where they are few.
    let mixed = if m <= 9 {
        let mut mixed = 0.0;
        for k in 1..sa.len() {
            for l in 0..k {
                let (first, second) = (sa[k] * sb[l], sa[l] * sb[k]);
                mixed += (first + second).abs();
                charge += first.abs() + second.abs();
            }
        }
        mixed
    } else {
        charge += along_a * along_b * m as f64;
        (along_a * along_b - squares).abs()
    };
    let product = a0 * b0;
    let centre = product + 0.5 * square;
    out[0] += centre;
    charge += product.abs() + centre.abs() + out[0].abs() + squares * m as f64;
    let spread = a0.abs() * rb + b0.abs() * ra + ra * rb + ra * along_b + rb * along_a;
    out[m] = raised(out[m] + spread + 0.5 * squares + mixed + EPSILON * charge);
}

/// `f(z)` or one of its first two derivatives, the `order`-th, by Taylor's formula about the centre of `z`; `at` are the derivatives of
/// `f` there and `over` those over the range of `z`. Where the range is not much wider than the distance from the plane, the range.
pub fn set_function(out: &mut [f64], z: &[f64], at: &Derivatives, over: &Derivatives, order: usize) {
    let m = z.len() - 1;
    let distance = deviation(z);
    let squares = Interval::new(0.0, Interval::point(distance).square().high);
    let bent = over[order + 2] * squares * Interval::point(0.5);
    let start = at[order] + bent;
    let (slope, spread) = (at[order + 1].middle(), at[order + 1].radius());
    out[0] = start.middle();
    let mut charge = 0.0;
    for (out, z) in out[1..m].iter_mut().zip(&z[1..m]) {
        *out = slope * z;
        charge += out.abs();
    }
    out[m] = raised(start.radius() + slope.abs() * z[m] + spread * distance + EPSILON * charge);
    let whole = over[order];
    // A plane keeps what functions have in common, as long as the distance from it is small beside the range; not a number is not.
    let worthwhile = out[m] <= WORTHWHILE * whole.radius();
    if whole.is_bounded() && !worthwhile {
        set_constant(out, whole);
    }
}
