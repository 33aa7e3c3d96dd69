//! `f32` and `f64` as [`Real`] and [`Scalar`].

use super::{Real, Scalar};
use crate::platform::float;
use alloc::string::String;

/// Beyond it angles are reduced by the portable library: system libraries lose digits next to multiples of `pi/2`.
const LARGE_ANGLE: f64 = 1048576.0;

macro_rules! impl_primitive {
    ($float:ident, $bits:ty, $erfc:path, $ldexp:path, $sin:path, $cos:path, $tan:path, $sin_cos:path) => {
        impl Real for $float {
            type Scalar = $float;

            #[inline(always)]
            fn constant(value: $float) -> Self {
                value
            }
            #[inline(always)]
            fn primal(self) -> $float {
                self
            }
            #[inline(always)]
            fn may_be_finite(self) -> bool {
                self.is_finite()
            }
            #[inline(always)]
            fn recip(self) -> Self {
                1.0 / self
            }
            impl_primitive!(@std $float: sqrt exp exp_m1 ln ln_1p asin acos atan sinh cosh tanh);
            #[inline]
            fn erfc(self) -> Self {
                $erfc(self)
            }
            #[inline]
            fn logistic(self) -> Self {
                let small = (-self.abs()).exp();
                if self >= 0.0 { 1.0 / (1.0 + small) } else { small / (1.0 + small) }
            }
            #[inline]
            fn softplus(self) -> Self {
                Real::max(self, 0.0) + (-self.abs()).exp().ln_1p()
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$float>::abs(self)
            }
            #[inline]
            fn powi(self, exponent: i32) -> Self {
                float!($float, powi(self, exponent))
            }
            #[inline]
            fn powf(self, exponent: Self) -> Self {
                float!($float, powf(self, exponent))
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                float!($float, atan2(self, x))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self >= other || self.is_nan() { self } else { other }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if self <= other || self.is_nan() { self } else { other }
            }
            #[inline(always)]
            fn select(self, if_positive: Self, otherwise: Self) -> Self {
                if self > 0.0 {
                    if_positive
                } else if self <= 0.0 {
                    otherwise
                } else {
                    self
                }
            }
            #[inline]
            fn sin(self) -> Self {
                if self.abs() <= LARGE_ANGLE as $float { float!($float, sin(self)) } else { $sin(self) }
            }
            #[inline]
            fn cos(self) -> Self {
                if self.abs() <= LARGE_ANGLE as $float { float!($float, cos(self)) } else { $cos(self) }
            }
            #[inline]
            fn tan(self) -> Self {
                if self.abs() <= LARGE_ANGLE as $float { float!($float, tan(self)) } else { $tan(self) }
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                if self.abs() <= LARGE_ANGLE as $float { float!($float, sin_cos(self)) } else { $sin_cos(self) }
            }
        }

        impl Scalar for $float {
            const NAME: &'static str = stringify!($float);
            #[inline(always)]
            fn epsilon() -> Self {
                <$float>::EPSILON
            }
            #[inline(always)]
            fn min_positive() -> Self {
                <$float>::MIN_POSITIVE
            }
            #[inline(always)]
            fn max_value() -> Self {
                <$float>::MAX
            }
            #[inline(always)]
            fn infinity() -> Self {
                <$float>::INFINITY
            }
            #[inline(always)]
            fn nan() -> Self {
                <$float>::NAN
            }
            #[inline(always)]
            fn pi() -> Self {
                core::$float::consts::PI
            }

            #[inline(always)]
            fn of_f64(value: f64) -> Self {
                value as $float
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn parts(self) -> (f64, f64) {
                (f64::from(self), 0.0)
            }
            fn parse(text: &str) -> Option<Self> {
                text.parse().ok()
            }
            fn to_text(self) -> String {
                format!("{self:?}")
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                <$float>::is_finite(self)
            }
            #[inline(always)]
            fn is_nan(self) -> bool {
                <$float>::is_nan(self)
            }
            fn wrap_angle(self) -> Self {
                let turn = 2.0 * <Self as Scalar>::pi();
                if (0.0..turn).contains(&self) {
                    return self;
                }
                // Sine and cosine reduce by an exact quotient; their angle is the remainder.
                let (sin, cos) = Real::sin_cos(self);
                let angle = sin.atan2(cos);
                let wrapped = if angle < 0.0 { angle + turn } else { angle };
                if wrapped >= turn { 0.0 } else { wrapped }
            }
            #[inline(always)]
            fn floor(self) -> Self {
                float!($float, floor(self))
            }
            fn ldexp(self, exponent: i32) -> Self {
                $ldexp(self, exponent)
            }
            fn ilogb(self) -> i32 {
                if self == 0.0 {
                    return i32::MIN;
                }
                const MANTISSA: u32 = <$float>::MANTISSA_DIGITS - 1;
                const BIAS: i32 = <$float>::MAX_EXP - 1;
                let bits = self.abs().to_bits();
                let biased = (bits >> MANTISSA) as i32;
                if biased == 0 {
                    // Subnormal: the exponent follows from the leading zeros of the fraction.
                    let lead = <$bits>::BITS as i32 - 1 - bits.leading_zeros() as i32;
                    1 - BIAS - MANTISSA as i32 + lead
                } else {
                    biased - BIAS
                }
            }
        }
    };
    (@std $float:ident: $($name:ident)*) => {
        $(
            #[inline]
            fn $name(self) -> Self {
                float!($float, $name(self))
            }
        )*
    };
}

impl_primitive!(f32, u32, libm::erfcf, libm::scalbnf, libm::sinf, libm::cosf, libm::tanf, libm::sincosf);
impl_primitive!(f64, u64, libm::erfc, libm::scalbn, libm::sin, libm::cos, libm::tan, libm::sincos);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::{AnyFloat, Dd};

    fn checks<S: Scalar>(smallest: S, lowest_exponent: i32) {
        let (one, zero) = (<S as Real>::one(), <S as Real>::zero());
        // Powers of two, subnormal ones included, and no detour through infinity or zero.
        assert_eq!(smallest.ilogb(), lowest_exponent);
        assert_eq!(one.ldexp(lowest_exponent), smallest);
        assert_eq!(smallest.ldexp(-lowest_exponent), one);
        assert_eq!(smallest.ldexp(i32::MAX), S::infinity());
        assert_eq!(zero.ldexp(i32::MAX), zero);
        assert_eq!(S::max_value().ldexp(i32::MIN), zero);
        assert_eq!(S::min_positive().ldexp(-1).ilogb() + 1, S::min_positive().ilogb());
        assert_eq!((-S::of_f64(6.5)).ilogb(), 2);
        assert_eq!(zero.ilogb(), i32::MIN);
        // NaN wins in every position.
        for (x, y) in [(S::nan(), one), (one, S::nan())] {
            assert!(Real::max(x, y).is_nan() && Real::min(x, y).is_nan());
        }
        assert!(S::nan().select(one, zero).is_nan() && S::nan().relu().is_nan());
        assert_eq!([one.select(one, zero), zero.select(one, zero), (-zero).select(one, zero)], [one, zero, zero]);
        assert_eq!([S::infinity().logistic(), (-S::infinity()).logistic()], [one, zero]);
        assert_eq!([S::infinity().softplus(), (-S::infinity()).softplus()], [S::infinity(), zero]);
        assert!(S::nan().logistic().is_nan() && S::nan().softplus().is_nan());
        // Both tails against double-double numbers.
        let floor = Dd::of_f64(2.0) * smallest.cast::<Dd>();
        for k in -760..=760 {
            let x = S::of_f64(f64::from(k) * 0.97);
            let wide = x.cast::<Dd>();
            let close = |found: S, exact: Dd, units: f64| {
                Real::abs(found.cast::<Dd>() - exact)
                    <= Dd::of_f64(units) * S::epsilon().cast() * Real::abs(exact) + floor
            };
            assert!(close(x.logistic(), wide.logistic(), 3.0), "{x:?}");
            assert!(close(x.softplus(), wide.softplus(), 3.0), "{x:?}");
            let base = one + S::of_f64(f64::from(k) * 1e-3);
            for exponent in [-5, -1, 0, 1, 2, 3, 7] {
                let exact = base.cast::<Dd>().powi(exponent);
                assert!(close(Real::powi(base, exponent), exact, 4.0), "{base:?}^{exponent}");
            }
        }
    }

    #[test]
    fn rules_and_tails() {
        checks::<f32>(f32::from_bits(1), -149);
        checks::<f64>(f64::from_bits(1), -1074);
        checks::<AnyFloat<f32>>(AnyFloat(f32::from_bits(1)), -149);
        checks::<AnyFloat<f64>>(AnyFloat(f64::from_bits(1)), -1074);
        checks::<Dd>(Dd::of_f64(f64::from_bits(1)), -1074);
    }

    #[test]
    fn angles_of_any_size() {
        let hard = 6381956970095103.0 * 2.0_f64.powi(797);
        for x in (0..=1000).map(|k| 2.0_f64.powi(k)).chain([hard]) {
            let exact = Dd::of_f64(x).sin_cos();
            let (s, c) = Real::sin_cos(x);
            for (found, exact) in [(s, exact.0), (c, exact.1), (Real::sin(x), exact.0), (Real::cos(x), exact.1)] {
                let error = Real::abs(Dd::of_f64(found) - exact).to_f64();
                assert!(error <= f64::EPSILON * exact.to_f64().abs(), "{x}: {found} {exact}");
            }
        }
        assert!(Real::cos(hard).abs() < 1e-17 && Real::cos(hard) != 0.0);
    }
}
