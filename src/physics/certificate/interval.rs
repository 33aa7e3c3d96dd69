//! Closed intervals of `f64` with outward rounding, and their elementary functions.
//!
//! The functions of the standard library and of `libm` are not correctly rounded. What they return is moved outward by [`FUNCTION_ERROR`], 8
//! units in the last place: the C library of GNU states 2 at most for the functions used here ("Known Maximum Errors in Math
//! Functions"), `libm` one for `erfc`, and this crate's logistic function and softplus keep 3.

use super::thresholds::{FUNCTION_ERROR, MOST_REDUCED_ANGLE};
use crate::scalar::Real;
use std::f64::consts::PI;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// All numbers from `low` to `high`. The result of an operation contains every result for numbers in its operands.
///
/// Sums, products, quotients and roots are rounded to nearest by the hardware and then moved outward by one number, which bounds their
/// error. Where a result is not defined for every number of an operand (a quotient by an interval that contains 0, the root of one with
/// negative numbers), it is [`Interval::ENTIRE`], which proves nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

impl Interval {
    /// The unbounded interval (top).
    pub const ENTIRE: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
    /// 0 alone.
    pub const ZERO: Self = Self::point(0.0);

    /// From `low` to `high`; everything if the two are out of order or `NaN`.
    #[inline]
    pub fn new(low: f64, high: f64) -> Self {
        if low <= high { Self { low, high } } else { Self::ENTIRE }
    }
    /// A single number; for `NaN`, see [`Interval::new`].
    #[inline]
    pub const fn point(x: f64) -> Self {
        if x.is_nan() { Self::ENTIRE } else { Self { low: x, high: x } }
    }
    /// The interval from `-radius` to `radius`.
    #[inline]
    pub fn symmetric(radius: f64) -> Self {
        Self::new(-radius, radius)
    }
    /// The same ends moved outward by one number each.
    #[inline]
    pub(super) fn outward(low: f64, high: f64) -> Self {
        if low <= high { Self { low: low.next_down(), high: high.next_up() } } else { Self::ENTIRE }
    }
    /// A number near the middle that lies in the interval; 0 if the interval has no end on both sides.
    #[inline]
    pub fn middle(self) -> f64 {
        let middle = 0.5 * self.low + 0.5 * self.high;
        if middle.is_finite() { middle.clamp(self.low, self.high) } else { 0.0 }
    }
    /// Largest distance of a number of the interval from its [`Interval::middle`], rounded up.
    #[inline]
    pub fn radius(self) -> f64 {
        if self.low == self.high {
            return 0.0;
        }
        let middle = self.middle();
        (self.high - middle).max(middle - self.low).next_up()
    }
    /// Largest absolute value.
    #[inline]
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
    /// Smallest absolute value.
    #[inline]
    pub fn mignitude(self) -> f64 {
        if self.contains(0.0) { 0.0 } else { self.low.abs().min(self.high.abs()) }
    }
    /// `true` if `x` is in it.
    #[inline]
    pub fn contains(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }
    /// `true` for a single number.
    #[inline]
    pub fn is_point(self) -> bool {
        self.low == self.high
    }
    /// `true` if both ends are finite.
    #[inline]
    pub fn is_bounded(self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }
    /// The intersection. If rounding left nothing, one of the two, since each contains the truth.
    #[inline]
    pub fn meet(self, other: Self) -> Self {
        let (low, high) = (self.low.max(other.low), self.high.min(other.high));
        if low <= high { Self { low, high } } else { self }
    }
    /// The smallest interval that contains both.
    #[inline]
    pub fn hull(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
    /// The squares.
    #[inline]
    pub fn square(self) -> Self {
        let (low, high) = (self.mignitude(), self.magnitude());
        Self { low: (low * low).next_down().max(0.0), high: (high * high).next_up() }
    }
    /// The integer powers.
    pub fn power(self, exponent: i32) -> Self {
        if exponent < 0 {
            return Self::point(1.0) / self.power_of(exponent.unsigned_abs());
        }
        self.power_of(exponent.unsigned_abs())
    }
    fn power_of(self, exponent: u32) -> Self {
        match exponent {
            0 => Self::point(1.0),
            1 => self,
            // An even power has the ends of the power of the absolute value.
            even if even % 2 == 0 => self.square().power_of(even / 2),
            // An odd power increases.
            odd => {
                let at = |x: f64| Self::point(x) * Self::point(x).square().power_of(odd / 2);
                Self { low: at(self.low).low, high: at(self.high).high }
            }
        }
    }
}

impl Neg for Interval {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}
impl Add for Interval {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::outward(self.low + other.low, self.high + other.high)
    }
}
impl Sub for Interval {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

/// A product of ends, where 0 times infinity is 0: an infinite end stands for large finite numbers.
#[inline]
fn product(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

/// The interval from the smallest to the largest of four numbers.
#[inline]
fn spanned([a, b, c, d]: [f64; 4]) -> Interval {
    Interval { low: a.min(b).min(c.min(d)), high: a.max(b).max(c.max(d)) }
}

impl Mul for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let ends = [
            product(self.low, other.low),
            product(self.low, other.high),
            product(self.high, other.low),
            product(self.high, other.high),
        ];
        let found = spanned(ends);
        // Exact, unless a product underflowed.
        let exact = found == Self::ZERO && (self == Self::ZERO || other == Self::ZERO);
        if exact { Self::ZERO } else { Self::outward(found.low, found.high) }
    }
}
impl Div for Interval {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        if other.contains(0.0) {
            return Self::ENTIRE;
        }
        let (low, high) = (1.0 / other.high, 1.0 / other.low);
        if self.is_point() && self.low == 1.0 {
            return Self::outward(low, high);
        }
        let ends = [self.low / other.low, self.low / other.high, self.high / other.low, self.high / other.high];
        if ends.iter().any(|x| x.is_nan()) {
            return Self::ENTIRE;
        }
        let Self { low, high } = spanned(ends);
        Self::outward(low, high)
    }
}

macro_rules! assign {
    ($($name:ident $method:ident $sign:tt)*) => {$(
        impl $name for Interval {
            #[inline]
            fn $method(&mut self, other: Self) {
                *self = *self $sign other;
            }
        }
    )*};
}
assign! { AddAssign add_assign + SubAssign sub_assign - MulAssign mul_assign * DivAssign div_assign / }

/// Ends as a function returned them, widened by its error.
#[inline]
fn widened(low: f64, high: f64) -> Interval {
    // Products with the margin are themselves rounded, which the last step covers; the tiny summand covers subnormal results.
    let wide = |x: f64| x.abs() * FUNCTION_ERROR + f64::MIN_POSITIVE;
    let (low, high) =
        (low - if low.is_finite() { wide(low) } else { 0.0 }, high + if high.is_finite() { wide(high) } else { 0.0 });
    // An infinite end that came from overflow stands for numbers beyond the largest.
    let low = if low == f64::INFINITY { f64::MAX } else { low };
    let high = if high == f64::NEG_INFINITY { f64::MIN } else { high };
    Interval::outward(low, high)
}

/// Limits that a function keeps whatever its rounding.
#[inline]
fn within(found: Interval, low: f64, high: f64) -> Interval {
    Interval { low: found.low.clamp(low, high), high: found.high.clamp(low, high) }
}

impl Interval {
    #[inline]
    fn increasing(self, f: impl Fn(f64) -> f64) -> Self {
        widened(f(self.low), f(self.high))
    }
    #[inline]
    fn decreasing(self, f: impl Fn(f64) -> f64) -> Self {
        widened(f(self.high), f(self.low))
    }
    /// `true` if every number of it lies between `low` and `high`, both excluded.
    #[inline]
    fn inside(self, low: f64, high: f64) -> bool {
        self.low > low && self.high < high
    }

    /// Circle constant.
    pub fn pi() -> Self {
        Self { low: PI, high: PI.next_up() }
    }
    /// Square roots; everything if it reaches below 0.
    pub fn sqrt(self) -> Self {
        if self.low < 0.0 {
            return Self::ENTIRE;
        }
        Self { low: self.low.sqrt().next_down().max(0.0), high: self.high.sqrt().next_up() }
    }
    /// `e^x`.
    pub fn exp(self) -> Self {
        within(self.increasing(f64::exp), 0.0, f64::INFINITY)
    }
    /// `e^x - 1`.
    pub fn exp_m1(self) -> Self {
        within(self.increasing(f64::exp_m1), -1.0, f64::INFINITY)
    }
    /// Natural logarithm; everything if it reaches 0.
    pub fn ln(self) -> Self {
        if self.low > 0.0 { self.increasing(f64::ln) } else { Self::ENTIRE }
    }
    /// `ln(1 + x)`; everything if it reaches -1.
    pub fn ln_1p(self) -> Self {
        if self.low > -1.0 { self.increasing(f64::ln_1p) } else { Self::ENTIRE }
    }
    /// Sine and cosine.
    pub fn sin_cos(self) -> (Self, Self) {
        (self.wave(f64::sin, 0.5), self.wave(f64::cos, 0.0))
    }
    /// A wave that is 1 at `crest * pi` and once every turn from there.
    fn wave(self, f: impl Fn(f64) -> f64, crest: f64) -> Self {
        if !self.inside(-MOST_REDUCED_ANGLE, MOST_REDUCED_ANGLE) || self.high - self.low > 6.0 {
            return Self { low: -1.0, high: 1.0 };
        }
        let (a, b) = (f(self.low), f(self.high));
        let mut found = widened(a.min(b), a.max(b));
        // Half turns from the crest, even for crests and odd for troughs. One that may be inside, by rounding, is counted as inside, which
        // only widens the result.
        let (first, last) = (self.low / PI - crest, self.high / PI - crest);
        let (first, last) = ((first - 1e-8).ceil() as i64, (last + 1e-8).floor() as i64);
        for half_turn in first..=last {
            if half_turn.rem_euclid(2) == 0 {
                found.high = 1.0;
            } else {
                found.low = -1.0;
            }
        }
        within(found, -1.0, 1.0)
    }
    /// Tangent; everything if it may hold a pole.
    pub fn tan(self) -> Self {
        let cosine = self.sin_cos().1;
        if cosine.contains(0.0) || self.high - self.low > 3.0 { Self::ENTIRE } else { self.increasing(f64::tan) }
    }
    /// Inverse sine; everything if it reaches beyond 1 on a side.
    pub fn asin(self) -> Self {
        if self.low < -1.0 || self.high > 1.0 { Self::ENTIRE } else { self.increasing(f64::asin) }
    }
    /// Inverse cosine; everything if it reaches beyond 1 on a side.
    pub fn acos(self) -> Self {
        if self.low < -1.0 || self.high > 1.0 { Self::ENTIRE } else { self.decreasing(f64::acos) }
    }
    /// Inverse tangent.
    pub fn atan(self) -> Self {
        self.increasing(f64::atan)
    }
    /// Hyperbolic sine.
    pub fn sinh(self) -> Self {
        self.increasing(f64::sinh)
    }
    /// Hyperbolic cosine.
    pub fn cosh(self) -> Self {
        let found = widened(self.mignitude().cosh(), self.magnitude().cosh());
        within(found, 1.0, f64::INFINITY)
    }
    /// Hyperbolic tangent.
    pub fn tanh(self) -> Self {
        within(self.increasing(f64::tanh), -1.0, 1.0)
    }
    /// Complementary error function.
    pub fn erfc(self) -> Self {
        within(self.decreasing(Real::erfc), 0.0, 2.0)
    }
    /// `1 / (1 + e^-x)`.
    pub fn logistic(self) -> Self {
        within(self.increasing(Real::logistic), 0.0, 1.0)
    }
    /// `ln(1 + e^x)`.
    pub fn softplus(self) -> Self {
        within(self.increasing(Real::softplus), 0.0, f64::INFINITY)
    }
    /// Absolute values.
    pub fn abs(self) -> Self {
        Self { low: self.mignitude(), high: self.magnitude() }
    }
    /// `x^exponent` of positive numbers; everything if it reaches 0.
    pub fn real_power(self, exponent: f64) -> Self {
        if self.low <= 0.0 {
            return Self::ENTIRE;
        }
        let power = |x: f64| x.powf(exponent);
        let found = if exponent < 0.0 { self.decreasing(power) } else { self.increasing(power) };
        within(found, 0.0, f64::INFINITY)
    }
}
