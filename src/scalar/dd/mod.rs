//! Double-double numbers: the judge of `f32` and `f64`.

mod error_function;

use super::{Real, Scalar};
use std::cmp::Ordering;
use std::fmt;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use xprec::{CompensatedArithmetic, Df64};

/// An unevaluated sum of two `f64`, about 31 decimal digits (unit round-off near `2^-104`), range of `f64`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dd {
    high: f64,
    low: f64,
}

impl Dd {
    /// `1 / sqrt(2)`.
    pub const SQRT_HALF: Self = Self { high: std::f64::consts::FRAC_1_SQRT_2, low: -4.833646656726457e-17 };

    /// The sum `high + low`, renormalised so that `high` is its nearest `f64`.
    #[inline]
    pub fn new(high: f64, low: f64) -> Self {
        Self::wrap(Df64::compensated_sum(high, low))
    }
    /// Leading part: the nearest `f64`.
    #[inline]
    pub fn high(self) -> f64 {
        self.high
    }
    /// Trailing part: what the leading part leaves.
    #[inline]
    pub fn low(self) -> f64 {
        self.low
    }
    /// Into the crate that does the arithmetic.
    #[inline(always)]
    fn df(self) -> Df64 {
        Df64::compensated_fast_sum(self.high, self.low)
    }
    /// Out of the crate that does the arithmetic.
    #[inline(always)]
    fn wrap(value: Df64) -> Self {
        Self { high: value.hi(), low: value.lo() }
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
impl Neg for Dd {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::wrap(-self.df())
    }
}

macro_rules! impl_operator {
    ($($op:ident $method:ident $assign:ident $assign_method:ident;)*) => {$(
        impl $op for Dd {
            type Output = Self;
            #[inline]
            fn $method(self, other: Self) -> Self {
                Self::wrap(self.df().$method(other.df()))
            }
        }
        impl $assign for Dd {
            #[inline]
            fn $assign_method(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    )*};
}
impl_operator! {
    Add add AddAssign add_assign;
    Sub sub SubAssign sub_assign;
    Mul mul MulAssign mul_assign;
    Div div DivAssign div_assign;
}

impl num_traits::Zero for Dd {
    fn zero() -> Self {
        Self::new(0.0, 0.0)
    }
    fn is_zero(&self) -> bool {
        self.high() == 0.0
    }
}
impl num_traits::One for Dd {
    fn one() -> Self {
        Self::new(1.0, 0.0)
    }
}

macro_rules! through_float {
    ($($name:ident)*) => {$(
        #[inline]
        fn $name(self) -> Self {
            Self::wrap(num_traits::Float::$name(self.df()))
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
    through_float! { recip sqrt exp exp_m1 ln ln_1p sin cos tan asin acos atan sinh cosh tanh abs }
    fn erfc(self) -> Self {
        self.erfc_accurate()
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
        Self::wrap(num_traits::Float::powi(self.df(), exponent))
    }
    fn powf(self, exponent: Self) -> Self {
        Self::wrap(num_traits::Float::powf(self.df(), exponent.df()))
    }
    fn atan2(self, x: Self) -> Self {
        Self::wrap(num_traits::Float::atan2(self.df(), x.df()))
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
    const EPSILON: Self = Self::leading(4.930380657631324e-32);
    const MIN_POSITIVE: Self = Self::leading(f64::MIN_POSITIVE);
    const MAX: Self = Self::leading(f64::MAX);
    const INFINITY: Self = Self::leading(f64::INFINITY);
    const NAN: Self = Self::leading(f64::NAN);
    const PI: Self = Self { high: std::f64::consts::PI, low: 1.2246467991473532e-16 };

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
        text.parse().ok().map(Self::of_f64)
    }
    fn to_text(self) -> String {
        format!("{:?}", self.high())
    }
    fn is_finite(self) -> bool {
        self.high().is_finite() && self.low().is_finite()
    }
    fn is_nan(self) -> bool {
        self.high().is_nan() || self.low().is_nan()
    }
    fn wrap_angle(self) -> Self {
        let turn = Self::PI + Self::PI;
        self - turn * (self / turn).floor()
    }
    fn floor(self) -> Self {
        Self::wrap(num_traits::Float::floor(self.df()))
    }
    fn ldexp(self, exponent: i32) -> Self {
        Self::new(Scalar::ldexp(self.high(), exponent), Scalar::ldexp(self.low(), exponent))
    }
    fn ilogb(self) -> i32 {
        self.high().ilogb()
    }
}
