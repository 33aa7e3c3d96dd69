//! Elementary functions over slices, and the branch-free pieces that vectorised formulas are put together from.

mod pieces;

use super::{Real, Scalar, update, vectorized};
use crate::scalar::Dd;

/// `e^y` in pieces, so that a product with it is rounded only once even if it underflows.
///
/// `e^y = mantissa * first * second`: first multiply the other factors with `mantissa`, then call [`Exponential::scale`].
#[derive(Clone, Copy, Debug)]
pub struct Exponential<S> {
    /// The part of moderate size.
    pub mantissa: S,
    /// First factor.
    pub first: S,
    /// Second factor.
    pub second: S,
    /// `e^y - 1`, accurate near `y = 0`.
    pub minus_one: S,
}

impl<S: Copy + core::ops::Mul<Output = S>> Exponential<S> {
    /// `factor * first * second`, where `factor` contains the mantissa already.
    #[inline(always)]
    pub fn scale(self, factor: S) -> S {
        factor * self.first * self.second
    }
    /// `e^y`.
    #[inline(always)]
    pub fn value(self) -> S {
        self.scale(self.mantissa)
    }
}

/// Functions of a scalar, applied to slices.
///
/// The `lane_*` functions have no branch and no call: a loop over them inside [`crate::scalar::vectorized`] becomes
/// vector instructions for `f32` and `f64`. Outside of it they are right but slow (a fused multiply-add without
/// hardware support is a library call). `Dd` answers with its ordinary functions.
pub trait Lanes: Sized + Copy + PartialOrd {
    /// `self * factor + summand`, rounded once for `f32` and `f64`.
    fn lane_fused(self, factor: Self, summand: Self) -> Self;
    /// `e^self` in pieces; 0 far below the range, infinite far above, `NaN` for `NaN`. `minus_one` needs `self <= 700`.
    fn lane_exp(self) -> Exponential<Self>;
    /// `ln(1 + self) / self` for `0 <= self <= 1`; 1 at 0.
    fn lane_log1p_ratio(self) -> Self;
    /// `e^(a^2/2) * Phi(-a)` for `a = self >= 0`, with `Phi` the normal distribution function: half the scaled
    /// complementary error function of `a / sqrt(2)`.
    ///
    /// A polynomial in `(a - K) / (a + K)` over `a + K`, fitted at Chebyshev points with 50 digits (the substitution is
    /// that of M. M. Shepherd and J. G. Laframboise, Math. Comp. 36, 1981).
    fn lane_normal_tail(self) -> Self;
    /// Natural logarithm.
    fn lane_ln(self) -> Self;
    /// Largest size of an angle that [`Lanes::lane_sin_cos`] reduces.
    fn fast_angle() -> Self;
    /// Sine and cosine for `|self| <= fast_angle()`; meaningless numbers beyond.
    fn lane_sin_cos(self) -> (Self, Self);
}

/// `out = f(x)`, elementwise.
#[inline(always)]
fn map<S: Scalar>(x: &[S], out: &mut [S], f: impl Fn(S) -> S) {
    debug_assert_eq!(x.len(), out.len());
    update(out, x, |out, x| *out = f(x));
}

/// `out = e^x`, elementwise; all slices of these functions have the same length.
pub fn exp_lanes<S: Scalar>(x: &[S], out: &mut [S]) {
    vectorized(
        #[inline(always)]
        || map(x, out, |x| x.lane_exp().value()),
    );
}

/// `out = tanh(x)`, elementwise.
pub fn tanh_lanes<S: Scalar>(x: &[S], out: &mut [S]) {
    let (one, two) = (S::of_f64(1.0), S::of_f64(2.0));
    vectorized(
        #[inline(always)]
        || {
            map(x, out, |x| {
                let decay = (-two * Real::abs(x)).lane_exp();
                // tanh a = -m / (2 + m) with m = e^(-2a) - 1, the rounding of sum and quotient made good.
                let m = decay.minus_one;
                let sum = two + m;
                let lost = (two - sum) + m;
                let inverse = one / sum;
                let quotient = m * inverse;
                let rest = lost.lane_fused(-quotient, sum.lane_fused(-quotient, m));
                let size = rest.lane_fused(inverse, quotient);
                if x > S::of_f64(0.0) { -size } else { size }
            });
        },
    );
}

/// `out = ln(x)`, elementwise.
pub fn ln_lanes<S: Scalar>(x: &[S], out: &mut [S]) {
    vectorized(
        #[inline(always)]
        || map(x, out, |x| x.lane_ln()),
    );
}

/// `out = sqrt(x)`, elementwise.
pub fn sqrt_lanes<S: Scalar>(x: &[S], out: &mut [S]) {
    vectorized(
        #[inline(always)]
        || map(x, out, |x| Real::sqrt(x)),
    );
}

/// `true` if the fast reduction serves an angle.
#[inline(always)]
fn is_fast<S: Scalar>(x: S) -> bool {
    Real::abs(x) <= S::fast_angle()
}

/// `true` if some angle needs the scalar function: too large, infinite or `NaN`.
#[inline(always)]
fn any_large<S: Scalar>(x: &[S]) -> bool {
    let mut any = false;
    for &x in x {
        any |= !is_fast(x);
    }
    any
}

/// Sine and cosine of one angle in radians of any size, with the bits of [`sin_cos_lanes`].
#[inline(always)]
pub(crate) fn sin_cos_lane<S: Scalar>(x: S) -> (S, S) {
    if is_fast(x) { x.lane_sin_cos() } else { Real::sin_cos(x) }
}

/// `sin = sin(x)`, `cos = cos(x)`, elementwise, angles in radians of any size.
pub fn sin_cos_lanes<S: Scalar>(x: &[S], sin: &mut [S], cos: &mut [S]) {
    let large = vectorized(
        #[inline(always)]
        || {
            let n = x.len();
            let (sin, cos) = (&mut sin[..n], &mut cos[..n]);
            for k in 0..n {
                (sin[k], cos[k]) = x[k].lane_sin_cos();
            }
            any_large(x)
        },
    );
    if large {
        for ((&x, sin), cos) in x.iter().zip(sin).zip(cos) {
            if !is_fast(x) {
                (*sin, *cos) = Real::sin_cos(x);
            }
        }
    }
}

/// `out = sin(x)`, elementwise, angles in radians of any size.
pub fn sin_lanes<S: Scalar>(x: &[S], out: &mut [S]) {
    angles(
        x,
        out,
        #[inline(always)]
        |x| x.lane_sin_cos().0,
        Real::sin,
    );
}

/// `out = cos(x)`, elementwise, angles in radians of any size.
pub fn cos_lanes<S: Scalar>(x: &[S], out: &mut [S]) {
    angles(
        x,
        out,
        #[inline(always)]
        |x| x.lane_sin_cos().1,
        Real::cos,
    );
}

#[inline(always)]
fn angles<S: Scalar>(x: &[S], out: &mut [S], fast: impl Fn(S) -> S, any_size: impl Fn(S) -> S) {
    let large = vectorized(
        #[inline(always)]
        || {
            map(x, out, fast);
            any_large(x)
        },
    );
    if large {
        for (&x, out) in x.iter().zip(out) {
            if !is_fast(x) {
                *out = any_size(x);
            }
        }
    }
}

impl Lanes for Dd {
    #[inline]
    fn lane_fused(self, factor: Self, summand: Self) -> Self {
        self * factor + summand
    }
    fn lane_exp(self) -> Exponential<Self> {
        // Three equal thirds reach below the smallest number together and are normal alone.
        let limit = Dd::of_f64(1600.0);
        let y = if self < -limit { -limit } else { self };
        let y = if y > limit { limit } else { y };
        let third = (y / Dd::of_f64(3.0)).exp();
        Exponential { mantissa: third, first: third, second: third, minus_one: y.exp_m1() }
    }
    fn lane_log1p_ratio(self) -> Self {
        if Real::abs(self).high() < 1e-200 { <Dd as Real>::one() } else { self.ln_1p() / self }
    }
    fn lane_normal_tail(self) -> Self {
        (self * Dd::SQRT_HALF).erfcx() * <Dd as Real>::half()
    }
    #[inline]
    fn lane_ln(self) -> Self {
        self.ln()
    }
    #[inline]
    fn fast_angle() -> Self {
        Dd::max_value()
    }
    #[inline]
    fn lane_sin_cos(self) -> (Self, Self) {
        self.sin_cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

    /// Test arguments of all magnitudes and both signs, including special values.
    fn arguments<S: Scalar>() -> Vec<S> {
        let mut x = 0.37_f64;
        let mut list: Vec<S> = (0..20_003)
            .map(|k| {
                x = 3.97 * x * (1.0 - x);
                S::of_f64((x - 0.47) * 2.0_f64.powi(k % 34 - 20))
            })
            .collect();
        list.extend((1..400).map(|k| S::of_f64(f64::from(k) * std::f64::consts::FRAC_PI_4)));
        list.extend(
            [0.0, -0.0, 1.0, 5e-324, 1e-310, 1e-45, 1e-40, 1e30, -1e30, 1e300, 88.7, -103.5, 709.7, -745.0, -720.0]
                .map(S::of_f64),
        );
        list.extend([
            S::infinity(),
            -S::infinity(),
            S::nan(),
            S::max_value(),
            S::min_positive(),
            S::of_f64(1048576.5),
            S::of_f64(8192.5),
        ]);
        list
    }

    /// Largest error in units in the last place against double-double numbers.
    fn worst<S: Scalar>(name: &str, x: &[S], found: &[S], exact: impl Fn(Dd) -> Dd) -> f64 {
        let smallest =
            S::min_positive().to_f64() * if S::NAME == "f32" { f64::from(f32::EPSILON) } else { f64::EPSILON };
        let mut worst = 0.0_f64;
        for (&x, &found) in x.iter().zip(found) {
            let exact = exact(x.cast());
            let nearest: S = exact.cast();
            if nearest.is_nan() || !nearest.is_finite() {
                assert!(
                    found.is_nan() == nearest.is_nan() && (found == nearest || found.is_nan()),
                    "{name}({x:?}) = {found:?}"
                );
                continue;
            }
            // One unit in the last place of the nearest number.
            let unit = Real::abs(nearest).ilogb().max(-2000);
            let unit = (S::epsilon().to_f64() * 2.0_f64.powi(unit)).max(smallest);
            let error = (found.cast::<Dd>() - exact).to_f64().abs() / unit;
            assert!(error <= 2.0, "{name}({x:?}) = {found:?}, not {nearest:?}: {error} units");
            worst = worst.max(error);
        }
        worst
    }

    fn accurate<S: Scalar>() {
        let x = arguments::<S>();
        let blank = || vec![S::nan(); x.len()];
        let (mut out, mut other) = (blank(), blank());
        let mut report = Vec::new();
        exp_lanes(&x, &mut out);
        report.push(("exp", worst("exp", &x, &out, Real::exp)));
        tanh_lanes(&x, &mut out);
        report.push(("tanh", worst("tanh", &x, &out, Real::tanh)));
        ln_lanes(&x, &mut out);
        report.push(("ln", worst("ln", &x, &out, Real::ln)));
        sqrt_lanes(&x, &mut out);
        report.push(("sqrt", worst("sqrt", &x, &out, Real::sqrt)));
        sin_cos_lanes(&x, &mut out, &mut other);
        report.push(("sin", worst("sin", &x, &out, Real::sin)));
        report.push(("cos", worst("cos", &x, &other, Real::cos)));
        let same = |a: &[S], b: &[S]| a.iter().zip(b).all(|(&a, &b)| a == b || (a.is_nan() && b.is_nan()));
        let mut single = blank();
        sin_lanes(&x, &mut single);
        assert!(same(&single, &out));
        cos_lanes(&x, &mut single);
        assert!(same(&single, &other));
        println!("{}: largest errors in units in the last place {report:?}", S::NAME);
    }

    #[test]
    fn slices_are_accurate() {
        accurate::<f32>();
        accurate::<f64>();
    }

    #[test]
    fn double_double_slices_are_the_functions() {
        let x = [Dd::pi(), Dd::of_f64(-0.3), Dd::of_f64(1e22)];
        let (mut sin, mut cos) = (x, x);
        sin_cos_lanes(&x, &mut sin, &mut cos);
        for ((x, sin), cos) in x.into_iter().zip(sin).zip(cos) {
            assert_eq!((sin, cos), Real::sin_cos(x));
        }
    }
}
