//! Double-double numbers: a precision of about 31 digits, against which results in `f32` and `f64` are checked.

mod arithmetic;
mod elementary;
mod text;
mod trigonometry;

pub use arithmetic::UnreadableNumber;

use super::{Real, Scalar};
use alloc::string::String;
use core::cmp::Ordering;
use core::fmt;

/// An unevaluated sum of two `f64`, about 31 decimal digits (unit round-off near `2^-104`), range of `f64`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dd {
    high: f64,
    low: f64,
}

impl Dd {
    /// `1 / sqrt(2)`.
    pub const SQRT_HALF: Self = Self { high: core::f64::consts::FRAC_1_SQRT_2, low: -4.833646656726457e-17 };

    /// The sum `high + low`, renormalised so that `high` is its nearest `f64`.
    #[inline]
    pub fn new(high: f64, low: f64) -> Self {
        Self::sum(high, low)
    }
    /// Leading part: the nearest `f64`.
    #[inline]
    pub(crate) fn high(self) -> f64 {
        self.high
    }
    /// Trailing part: the remainder after the leading part.
    #[inline]
    pub(crate) fn low(self) -> f64 {
        self.low
    }
    const fn leading(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl PartialEq for Dd {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.high() == other.high() && self.low() == other.low()
    }
}
impl PartialOrd for Dd {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        match self.high().partial_cmp(&other.high()) {
            Some(Ordering::Equal) => self.low().partial_cmp(&other.low()),
            order => order,
        }
    }
}
impl fmt::Display for Dd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.to_text())
    }
}
/// Methods of [`Real`] that call inherent methods of another name.
macro_rules! forward {
    ($($name:ident = $inner:ident;)*) => {$(
        #[inline]
        fn $name(self) -> Self {
            self.$inner()
        }
    )*};
}

impl Real for Dd {
    type Scalar = Self;

    #[inline]
    fn constant(value: Self) -> Self {
        value
    }
    #[inline]
    fn primal(self) -> Self {
        self
    }
    #[inline]
    fn may_be_finite(self) -> bool {
        Scalar::is_finite(self)
    }
    forward! {
        sqrt = square_root;
        exp = exponential;
        exp_m1 = exponential_minus_one;
        ln = logarithm;
        ln_1p = logarithm_one_plus;
        sinh = hyperbolic_sine;
        cosh = hyperbolic_cosine;
        tanh = hyperbolic_tangent;
        sin = sine;
        cos = cosine;
        tan = tangent;
        asin = arc_sine;
        acos = arc_cosine;
        atan = arc_tangent;
        erfc = complementary_error;
    }
    fn recip(self) -> Self {
        Self::leading(1.0) / self
    }
    fn sin_cos(self) -> (Self, Self) {
        self.sine_cosine()
    }
    fn abs(self) -> Self {
        if self.high.is_sign_negative() { -self } else { self }
    }
    fn logistic(self) -> Self {
        let one = <Self as Real>::one();
        let small = (-Real::abs(self)).exp();
        if self.high() >= 0.0 { one / (one + small) } else { small / (one + small) }
    }
    fn softplus(self) -> Self {
        Real::max(self, <Self as Real>::zero()) + (-Real::abs(self)).exp().ln_1p()
    }
    fn powi(self, exponent: i32) -> Self {
        self.integer_power(exponent)
    }
    fn powf(self, exponent: Self) -> Self {
        self.real_power(exponent)
    }
    fn atan2(self, x: Self) -> Self {
        self.arc_tangent_of(x)
    }
    fn max(self, other: Self) -> Self {
        if self >= other || self.is_nan() { self } else { other }
    }
    fn min(self, other: Self) -> Self {
        if self <= other || self.is_nan() { self } else { other }
    }
    fn select(self, if_positive: Self, otherwise: Self) -> Self {
        if self.high() > 0.0 {
            if_positive
        } else if self.high() <= 0.0 {
            otherwise
        } else {
            self
        }
    }
}

impl Scalar for Dd {
    const NAME: &'static str = "dd";
    #[inline]
    fn epsilon() -> Self {
        Self::leading(4.930380657631324e-32)
    }
    #[inline]
    fn min_positive() -> Self {
        Self::leading(f64::MIN_POSITIVE)
    }
    #[inline]
    fn max_value() -> Self {
        Self::leading(f64::MAX)
    }
    #[inline]
    fn infinity() -> Self {
        Self::leading(f64::INFINITY)
    }
    #[inline]
    fn nan() -> Self {
        Self::leading(f64::NAN)
    }
    #[inline]
    fn pi() -> Self {
        Self { high: core::f64::consts::PI, low: 1.2246467991473532e-16 }
    }

    #[inline]
    fn of_f64(value: f64) -> Self {
        Self::leading(value)
    }
    #[inline]
    fn to_f64(self) -> f64 {
        self.high()
    }
    #[inline]
    fn parts(self) -> (f64, f64) {
        (self.high(), self.low())
    }
    fn parse(text: &str) -> Option<Self> {
        text::parse(text)
    }
    fn to_text(self) -> String {
        text::print(self)
    }
    fn is_finite(self) -> bool {
        self.high().is_finite() && self.low().is_finite()
    }
    fn is_nan(self) -> bool {
        self.high().is_nan() || self.low().is_nan()
    }
    fn wrap_angle(self) -> Self {
        self.wrapped_angle()
    }
    fn floor(self) -> Self {
        let high = self.high.floor();
        if high == self.high { Self::new(high, self.low.floor()) } else { Self::leading(high) }
    }
    fn ldexp(self, exponent: i32) -> Self {
        Self::new(Scalar::ldexp(self.high, exponent), Scalar::ldexp(self.low, exponent))
    }
    fn ilogb(self) -> i32 {
        self.high().ilogb()
    }
}

#[cfg(test)]
mod tests;
