//! The operators: the arithmetic of pairs of M. Joldes, J.-M. Muller and V. Popescu (ACM Trans. Math. Softw. 44, 2018), completed at infinities and at
//! the ends of the range; the traits of `num-traits` that make sense for a number of the library.

use super::Dd;
use super::elementary::LN_2;
use super::trigonometry::HALF_PI;
use crate::scalar::Scalar;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;
use num_traits::{FloatConst, FromPrimitive, Num, NumCast, One, ToPrimitive, Zero};

/// Pairs as the algorithms make them, not a number at infinities and at the ends of the range.
impl Dd {
    /// The exact sum of two `f64`, the first not the smaller (Algorithm 1).
    #[inline(always)]
    fn fast_sum(a: f64, b: f64) -> Self {
        let high = a + b;
        Self { high, low: b - (high - a) }
    }
    /// The exact sum of two `f64` (Algorithm 2).
    #[inline(always)]
    fn exact_sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let first = high - b;
        let second = high - first;
        Self { high, low: (a - first) + (b - second) }
    }
    /// Normalises the number: its leading part is rounded to nearest.
    #[inline(always)]
    fn normal(self) -> Self {
        Self::fast_sum(self.high, self.low)
    }
    /// The sum (Algorithm 6: error below `3 u^2 + 13 u^3`).
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let (high, low) = (Self::exact_sum(self.high, other.high), Self::exact_sum(self.low, other.low));
        let sum = Self::fast_sum(high.high, high.low + low.high);
        Self::fast_sum(sum.high, low.low + sum.low)
    }
    /// The sum with an `f64` (Algorithm 4: error below `2 u^2`).
    #[inline(always)]
    fn plus_leading(self, other: f64) -> Self {
        let sum = Self::exact_sum(self.high, other);
        Self::fast_sum(sum.high, self.low + sum.low)
    }
    /// The product (Algorithm 12: error below `4 u^2`).
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let high = self.high * other.high;
        let rest = self.high.mul_add(other.high, -high);
        let cross = self.low.mul_add(other.high, self.high.mul_add(other.low, self.low * other.low));
        Self::fast_sum(high, rest + cross)
    }
    /// The product with an `f64` (Algorithm 9: error below `2 u^2`).
    #[inline(always)]
    fn times_leading(self, other: f64) -> Self {
        let high = self.high * other;
        let rest = self.high.mul_add(other, -high);
        Self::fast_sum(high, self.low.mul_add(other, rest))
    }
}

impl Dd {
    /// The result of an algorithm, or `plain`, the result of `f64`, if it is not finite.
    #[inline(always)]
    fn finite_or(self, plain: f64) -> Self {
        if self.high.is_finite() && self.low.is_finite() { self } else { Self::leading(plain) }
    }
    /// The exact sum of two `f64`.
    #[inline]
    pub(super) fn sum(a: f64, b: f64) -> Self {
        Self::exact_sum(a, b).finite_or(a + b)
    }
    /// The exact product of two `f64`, barring underflow.
    #[inline]
    pub(super) fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        let low = a.mul_add(b, -high);
        if low.is_finite() { Self { high, low } } else { Self::leading(high) }
    }
    /// The quotient by an `f64` of moderate size.
    #[inline]
    pub(super) fn over(self, divisor: f64) -> Self {
        let first = self.high / divisor;
        let rest = (-first).mul_add(divisor, self.high) + self.low;
        Self::fast_sum(first, rest / divisor).finite_or(first)
    }
}

impl Neg for Dd {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}
impl Add for Dd {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        self.normal().plus(other.normal()).finite_or(self.high + other.high)
    }
}
impl Sub for Dd {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.normal().plus(-other.normal()).finite_or(self.high - other.high)
    }
}
impl Mul for Dd {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        self.normal().times(other.normal()).finite_or(self.high * other.high)
    }
}
impl Div for Dd {
    type Output = Self;
    /// Long division with three quotient digits of 53 bits each.
    #[inline]
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        if !first.is_finite() || first == 0.0 || !other.high.is_finite() {
            return Self::leading(first);
        }
        let divisor = other.normal();
        let rest = self.normal().plus(-divisor.times_leading(first));
        let second = rest.high / other.high;
        let rest = rest.plus(-divisor.times_leading(second));
        let third = rest.high / other.high;
        Self::fast_sum(first, second).plus_leading(third).finite_or(first)
    }
}
impl Rem for Dd {
    type Output = Self;
    /// `self - other * trunc(self / other)`; exact enough while the quotient has less than 53 bits.
    fn rem(self, other: Self) -> Self {
        use crate::scalar::Scalar;
        if !other.is_finite() && !other.is_nan() && self.is_finite() {
            return self;
        }
        let quotient = self / other;
        let whole = if quotient.high < 0.0 { -(-quotient).floor() } else { quotient.floor() };
        self - other * whole
    }
}

macro_rules! impl_assign {
    ($($op:ident $method:ident $operator:tt;)*) => {$(
        impl $op for Dd {
            #[inline]
            fn $method(&mut self, other: Self) {
                *self = *self $operator other;
            }
        }
    )*};
}
impl_assign! {
    AddAssign add_assign +;
    SubAssign sub_assign -;
    MulAssign mul_assign *;
    DivAssign div_assign /;
    RemAssign rem_assign %;
}

impl Zero for Dd {
    fn zero() -> Self {
        Self::leading(0.0)
    }
    fn is_zero(&self) -> bool {
        self.high == 0.0
    }
}
impl One for Dd {
    fn one() -> Self {
        Self::leading(1.0)
    }
}

impl Num for Dd {
    type FromStrRadixErr = UnreadableNumber;

    /// Radix 10 only.
    fn from_str_radix(text: &str, radix: u32) -> Result<Self, UnreadableNumber> {
        let number = if radix == 10 { Self::parse(text) } else { None };
        number.ok_or(UnreadableNumber)
    }
}

/// Text that is not a decimal number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnreadableNumber;

impl core::fmt::Display for UnreadableNumber {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("not a decimal number")
    }
}

impl core::error::Error for UnreadableNumber {}

impl core::str::FromStr for Dd {
    type Err = UnreadableNumber;

    fn from_str(text: &str) -> Result<Self, UnreadableNumber> {
        Self::parse(text).ok_or(UnreadableNumber)
    }
}

impl From<f64> for Dd {
    fn from(value: f64) -> Self {
        Self::leading(value)
    }
}

impl FromPrimitive for Dd {
    fn from_i64(value: i64) -> Option<Self> {
        Self::from_i128(value.into())
    }
    fn from_u64(value: u64) -> Option<Self> {
        Self::from_i128(value.into())
    }
    /// Exact below `2^106`, then rounded.
    fn from_i128(value: i128) -> Option<Self> {
        let high = value as f64;
        // The remainder is small: the leading part is the nearest `f64` (one step down if it exceeded the integer type).
        let rest = value.wrapping_sub(if high >= 2.0_f64.powi(127) { i128::MIN } else { high as i128 });
        Some(Self::new(high, rest as f64))
    }
    fn from_f64(value: f64) -> Option<Self> {
        Some(Self::leading(value))
    }
}

impl ToPrimitive for Dd {
    fn to_i64(&self) -> Option<i64> {
        self.to_i128().and_then(|value| i64::try_from(value).ok())
    }
    fn to_u64(&self) -> Option<u64> {
        self.to_i128().and_then(|value| u64::try_from(value).ok())
    }
    /// Rounded towards zero; `None` outside the range.
    fn to_i128(&self) -> Option<i128> {
        let whole = if self.high < 0.0 { -(-*self).floor() } else { self.floor() };
        // Strictly inside the range, so that the sum of the parts cannot leave it.
        (whole.high.abs() < 2.0_f64.powi(126)).then(|| whole.high as i128 + whole.low as i128)
    }
    fn to_f64(&self) -> Option<f64> {
        Some(self.high)
    }
}

impl NumCast for Dd {
    fn from<T: ToPrimitive>(value: T) -> Option<Self> {
        value.to_f64().map(Self::leading)
    }
}

macro_rules! constants {
    ($($name:ident = $value:expr;)*) => {$(
        fn $name() -> Self {
            $value
        }
    )*};
}

const fn pair(high: f64, low: f64) -> Dd {
    Dd { high, low }
}

#[allow(non_snake_case, clippy::approx_constant)]
impl FloatConst for Dd {
    constants! {
        E = pair(core::f64::consts::E, 1.4456468917292502e-16);
        PI = <Self as Scalar>::pi();
        TAU = <Self as Scalar>::pi().ldexp(1);
        FRAC_PI_2 = HALF_PI;
        FRAC_PI_3 = pair(core::f64::consts::FRAC_PI_3, -1.072081766451091e-16);
        FRAC_PI_4 = HALF_PI.ldexp(-1);
        FRAC_PI_6 = pair(core::f64::consts::FRAC_PI_6, -5.360408832255455e-17);
        FRAC_PI_8 = HALF_PI.ldexp(-2);
        FRAC_1_PI = pair(core::f64::consts::FRAC_1_PI, -1.9678676675182486e-17);
        FRAC_2_PI = pair(core::f64::consts::FRAC_2_PI, -3.935735335036497e-17);
        FRAC_2_SQRT_PI = pair(core::f64::consts::FRAC_2_SQRT_PI, 1.533545961316588e-17);
        FRAC_1_SQRT_2 = Self::SQRT_HALF;
        SQRT_2 = Self::SQRT_HALF.ldexp(1);
        LN_2 = LN_2;
        LN_10 = pair(core::f64::consts::LN_10, -2.1707562233822494e-16);
        LOG2_E = pair(core::f64::consts::LOG2_E, 2.0355273740931033e-17);
        LOG10_E = pair(core::f64::consts::LOG10_E, 1.098319650216765e-17);
        LOG2_10 = pair(core::f64::consts::LOG2_10, 1.661617516973592e-16);
        LOG10_2 = pair(core::f64::consts::LOG10_2, -2.8037281277851704e-18);
    }
}
