//! Any number type of the `num-traits` world as [`Real`] and [`Scalar`].

use super::{Dd, Exponential, Lanes, Real, Scalar};
use alloc::string::{String, ToString};
use core::cmp::Ordering;
use core::fmt::{Debug, Display, Formatter};
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use num_traits::{Float, FloatConst};

/// A number of any type `F` that implements `num_traits::Float`; the only number type of the engine that is not its own.
///
/// Besides `Float` it needs `FloatConst` (the circle constant), `Debug`, `Display` (text that `Num::from_str_radix` reads back), `Send`,
/// `Sync` and `'static`; numbers and constants enter by `NumCast::from(f64)` and leave by `ToPrimitive::to_f64`, and
/// `Float::integer_decode` gives the exponent. Comparisons are those of IEEE 754, whatever `F` does with `NaN`: it is neither equal to, nor
/// above or below, any number.
///
/// Functions that `Float` lacks (`erfc` and functions based on it) are computed in double-double numbers, to the precision of `F` if that
/// is no finer. Loops over an `AnyFloat` have no vector instructions of their own: measure `f32` and `f64` by themselves.
#[derive(Clone, Copy)]
pub struct AnyFloat<F>(pub F);

impl<F: Debug> Debug for AnyFloat<F> {
    fn fmt(&self, f: &mut Formatter<'_>) -> core::fmt::Result {
        self.0.fmt(f)
    }
}
impl<F: Display> Display for AnyFloat<F> {
    fn fmt(&self, f: &mut Formatter<'_>) -> core::fmt::Result {
        self.0.fmt(f)
    }
}
impl<F: Float> Default for AnyFloat<F> {
    fn default() -> Self {
        Self(F::zero())
    }
}
impl<F: Float> PartialEq for AnyFloat<F> {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}
impl<F: Float> PartialOrd for AnyFloat<F> {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        if self.0.is_nan() || other.0.is_nan() { None } else { self.0.partial_cmp(&other.0) }
    }
}

macro_rules! impl_operators {
    ($($operator:ident $name:ident $assign:ident $assign_name:ident;)*) => {$(
        impl<F: Float> $operator for AnyFloat<F> {
            type Output = Self;

            #[inline]
            fn $name(self, other: Self) -> Self {
                Self(self.0.$name(other.0))
            }
        }
        impl<F: Float> $assign for AnyFloat<F> {
            #[inline]
            fn $assign_name(&mut self, other: Self) {
                *self = self.$name(other);
            }
        }
    )*};
}
impl_operators! {
    Add add AddAssign add_assign;
    Sub sub SubAssign sub_assign;
    Mul mul MulAssign mul_assign;
    Div div DivAssign div_assign;
}
impl<F: Float> Neg for AnyFloat<F> {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
impl<F: Float> num_traits::Zero for AnyFloat<F> {
    fn zero() -> Self {
        Self(F::zero())
    }
    fn is_zero(&self) -> bool {
        self.0.is_zero()
    }
}
impl<F: Float> num_traits::One for AnyFloat<F> {
    fn one() -> Self {
        Self(F::one())
    }
}

/// Requirements of the engine for a foreign number type.
pub trait Foreign: Float + FloatConst + Debug + Display + Send + Sync + 'static {}
impl<F: Float + FloatConst + Debug + Display + Send + Sync + 'static> Foreign for F {}

/// Methods that `Float` has under the same name.
macro_rules! same {
    ($($name:ident)*) => {$(
        #[inline]
        fn $name(self) -> Self {
            Self(self.0.$name())
        }
    )*};
}

impl<F: Foreign> Real for AnyFloat<F> {
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
    same!(recip sqrt exp exp_m1 ln ln_1p sin cos tan asin acos atan sinh cosh tanh abs);
    fn erfc(self) -> Self {
        self.cast::<Dd>().erfc().cast()
    }
    fn logistic(self) -> Self {
        let one = <Self as Real>::one();
        let small = (-self.abs()).exp();
        if self >= <Self as Real>::zero() { one / (one + small) } else { small / (one + small) }
    }
    fn softplus(self) -> Self {
        self.max(<Self as Real>::zero()) + (-self.abs()).exp().ln_1p()
    }
    #[inline]
    fn powi(self, exponent: i32) -> Self {
        Self(self.0.powi(exponent))
    }
    #[inline]
    fn powf(self, exponent: Self) -> Self {
        Self(self.0.powf(exponent.0))
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        Self(self.0.atan2(x.0))
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        if self >= other || self.is_nan() { self } else { other }
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        if self <= other || self.is_nan() { self } else { other }
    }
    #[inline]
    fn select(self, if_positive: Self, otherwise: Self) -> Self {
        let zero = <Self as Real>::zero();
        if self > zero {
            if_positive
        } else if self <= zero {
            otherwise
        } else {
            self
        }
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }
}

impl<F: Foreign> Scalar for AnyFloat<F> {
    const NAME: &'static str = "another float";

    fn epsilon() -> Self {
        Self(F::epsilon())
    }
    fn min_positive() -> Self {
        Self(F::min_positive_value())
    }
    fn max_value() -> Self {
        Self(F::max_value())
    }
    fn infinity() -> Self {
        Self(F::infinity())
    }
    fn nan() -> Self {
        Self(F::nan())
    }
    fn pi() -> Self {
        Self(F::PI())
    }

    /// `NaN` if `F` has no such number.
    #[inline]
    fn of_f64(value: f64) -> Self {
        Self(<F as num_traits::NumCast>::from(value).unwrap_or_else(F::nan))
    }
    #[inline]
    fn to_f64(self) -> f64 {
        self.0.to_f64().unwrap_or(f64::NAN)
    }
    fn parse(text: &str) -> Option<Self> {
        F::from_str_radix(text, 10).ok().map(Self)
    }
    fn to_text(self) -> String {
        self.0.to_string()
    }
    #[inline]
    fn is_finite(self) -> bool {
        self.0.is_finite()
    }
    #[inline]
    fn is_nan(self) -> bool {
        self.0.is_nan()
    }
    fn wrap_angle(self) -> Self {
        let (zero, turn) = (<Self as Real>::zero(), Self::pi() + Self::pi());
        if self >= zero && self < turn {
            return self;
        }
        // Sine and cosine reduce by an exact quotient; their angle is the remainder.
        let (sin, cos) = Real::sin_cos(self);
        let angle = sin.atan2(cos);
        let wrapped = if angle < zero { angle + turn } else { angle };
        if wrapped >= turn { zero } else { wrapped }
    }
    #[inline]
    fn floor(self) -> Self {
        Self(self.0.floor())
    }
    fn ldexp(self, exponent: i32) -> Self {
        let ends = |x: F| x.is_zero() || !x.is_finite();
        let (highest, lowest) = (Self::max_value().ilogb(), Self::min_positive().ilogb());
        // A number on its way down must not be rounded twice: as in the C library of FreeBSD, `s_scalbn.c`.
        let down = lowest + 1 - Self::epsilon().ilogb();
        let (mut x, mut left) = (self.0, exponent);
        while !ends(x) && (left > highest || left < lowest) {
            let step = if left > 0 { highest } else { down };
            x = x * power_of_two(step);
            left -= step;
        }
        Self(if ends(x) { x } else { x * power_of_two(left) })
    }
    fn ilogb(self) -> i32 {
        if self.0.is_zero() {
            return i32::MIN;
        }
        let (mantissa, exponent, _) = self.0.integer_decode();
        i32::from(exponent) + mantissa.checked_ilog2().map_or(0, |e| e as i32)
    }
    fn parts(self) -> (f64, f64) {
        let high = self.to_f64();
        let rest = self - Self::of_f64(high);
        (high, if rest.is_finite() { rest.to_f64() } else { 0.0 })
    }
}

/// `2^exponent` by squaring, exact as long as it is normal.
fn power_of_two<F: Float>(exponent: i32) -> F {
    let two = F::one() + F::one();
    num_traits::pow(if exponent < 0 { two.recip() } else { two }, exponent.unsigned_abs() as usize)
}

impl<F: Foreign> Lanes for AnyFloat<F> {
    #[inline]
    fn lane_fused(self, factor: Self, summand: Self) -> Self {
        Self(self.0.mul_add(factor.0, summand.0))
    }
    fn lane_exp(self) -> Exponential<Self> {
        // The product of three equal factors reaches below the smallest number while each factor is normal.
        let limit = Self::of_f64(2.25) * Self::max_value().ln();
        let y = if self < -limit { -limit } else { self };
        let y = if y > limit { limit } else { y };
        let third = (y / Self::of_f64(3.0)).exp();
        Exponential { mantissa: third, first: third, second: third, minus_one: y.exp_m1() }
    }
    fn lane_log1p_ratio(self) -> Self {
        if self.abs() < Self::min_positive() { <Self as Real>::one() } else { self.ln_1p() / self }
    }
    fn lane_normal_tail(self) -> Self {
        self.cast::<Dd>().lane_normal_tail().cast()
    }
    #[inline]
    fn lane_ln(self) -> Self {
        self.ln()
    }
    fn fast_angle() -> Self {
        Self::max_value()
    }
    #[inline]
    fn lane_sin_cos(self) -> (Self, Self) {
        Real::sin_cos(self)
    }
}
