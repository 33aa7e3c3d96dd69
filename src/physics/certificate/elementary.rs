//! Elementary functions of intervals.
//!
//! The functions of the standard library and of `libm` are not correctly rounded. What they return is moved outward by [`MARGIN`], 8
//! units in the last place: the C library of GNU states 2 at most for the functions used here ("Known Maximum Errors in Math
//! Functions"), `libm` one for `erfc`, and this crate's logistic function and softplus keep 3.

use super::interval::Interval;
use crate::scalar::Real;
use std::f64::consts::PI;

/// Relative error that a function is granted: 8 units in the last place.
const MARGIN: f64 = 8.0 * f64::EPSILON;
/// Angles beyond it are not reduced: every sine is between -1 and 1.
const LARGE_ANGLE: f64 = 1e6;

/// Ends as a function returned them, widened by its error.
#[inline]
fn widened(low: f64, high: f64) -> Interval {
    // Products with the margin are themselves rounded, which the last step covers; the tiny summand covers subnormal results.
    let wide = |x: f64| x.abs() * MARGIN + f64::MIN_POSITIVE;
    let (low, high) =
        (low - if low.is_finite() { wide(low) } else { 0.0 }, high + if high.is_finite() { wide(high) } else { 0.0 });
    // An infinite end that overflow gave stands for numbers beyond the largest.
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
    /// A wave that is 1 at `crest * pi` and each turn from there.
    fn wave(self, f: impl Fn(f64) -> f64, crest: f64) -> Self {
        if !self.inside(-LARGE_ANGLE, LARGE_ANGLE) || self.high - self.low > 6.0 {
            return Self { low: -1.0, high: 1.0 };
        }
        let (a, b) = (f(self.low), f(self.high));
        let mut found = widened(a.min(b), a.max(b));
        // Half turns from the crest, even for crests and odd for troughs. Where rounding leaves open whether one is inside, it is
        // taken to be: that only widens.
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
