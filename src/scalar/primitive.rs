//! `f32` and `f64` as [`Real`] and [`Scalar`].

use super::{Real, Scalar, Slice, SliceMut};

macro_rules! impl_primitive {
    ($float:ident, $bits:ty, $erfc:path, $ldexp:path) => {
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
            fn recip(self) -> Self {
                1.0 / self
            }
            impl_primitive!(@std $float: sqrt exp exp_m1 ln ln_1p sin cos tan asin acos atan sinh cosh tanh);
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
                <$float>::powi(self, exponent)
            }
            #[inline]
            fn powf(self, exponent: Self) -> Self {
                <$float>::powf(self, exponent)
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                <$float>::atan2(self, x)
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
            fn sin_cos(self) -> (Self, Self) {
                <$float>::sin_cos(self)
            }
        }

        impl Scalar for $float {
            const NAME: &'static str = stringify!($float);
            const EPSILON: Self = <$float>::EPSILON;
            const MIN_POSITIVE: Self = <$float>::MIN_POSITIVE;
            const MAX: Self = <$float>::MAX;
            const INFINITY: Self = <$float>::INFINITY;
            const NAN: Self = <$float>::NAN;
            const PI: Self = std::$float::consts::PI;

            #[inline(always)]
            fn of_f64(value: f64) -> Self {
                value as $float
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn slice(values: &[Self]) -> Slice<'_, Self> {
                values.into()
            }
            #[inline(always)]
            fn slice_mut(values: &mut [Self]) -> SliceMut<'_, Self> {
                values.into()
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
                let turn = 2.0 * <Self as Scalar>::PI;
                if (0.0..turn).contains(&self) {
                    return self;
                }
                // The hardware-independent sine and cosine reduce by an exact quotient; their angle is the remainder.
                let (sin, cos) = <$float>::sin_cos(self);
                let angle = sin.atan2(cos);
                let wrapped = if angle < 0.0 { angle + turn } else { angle };
                if wrapped >= turn { 0.0 } else { wrapped }
            }
            #[inline(always)]
            fn floor(self) -> Self {
                <$float>::floor(self)
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
                    // Subnormal: the exponent sits in the leading zeros of the fraction.
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
                <$float>::$name(self)
            }
        )*
    };
}

impl_primitive!(f32, u32, libm::erfcf, libm::scalbnf);
impl_primitive!(f64, u64, libm::erfc, libm::scalbn);
