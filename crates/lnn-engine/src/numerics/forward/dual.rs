//! Dual numbers: value and one tangent; hyper-dual numbers for mixed second derivatives.

use super::{assign_operators, forward_real, forward_unary};
use crate::ops::Binary;
use crate::scalar::{Elementary, Real};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `value + tangent * t` modulo `t^2`: a number and its derivative along one direction.
#[derive(Clone, Copy, Debug)]
pub struct Dual<T> {
    /// The number.
    pub value: T,
    /// Derivative along the direction.
    pub tangent: T,
}

impl<T: Real> Dual<T> {
    /// A number with a given tangent.
    #[inline(always)]
    pub fn new(value: T, tangent: T) -> Self {
        Self { value, tangent }
    }
    /// A number of the base type, constant along the direction.
    #[inline(always)]
    pub fn lift(value: T) -> Self {
        Self { value, tangent: T::zero() }
    }
    /// Chain rule.
    #[inline(always)]
    fn chain1(self, f: impl Elementary) -> Self {
        let (value, first) = f.value_first(self.value);
        Self { value, tangent: first * self.tangent }
    }
    /// Chain rule in two arguments.
    #[inline(always)]
    fn chain2(self, other: Self, f: Binary) -> Self {
        let value = f.value(self.value, other.value);
        let (da, db) = f.first(self.value, other.value, value);
        Self { value, tangent: da * self.tangent + db * other.tangent }
    }
}

impl<T: Real> Neg for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, tangent: -self.tangent }
    }
}
impl<T: Real> Add for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, tangent: self.tangent + other.tangent }
    }
}
impl<T: Real> Sub for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, tangent: self.tangent - other.tangent }
    }
}
impl<T: Real> Mul for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { value: self.value * other.value, tangent: self.tangent * other.value + self.value * other.tangent }
    }
}
impl<T: Real> Div for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, tangent: (self.tangent - value * other.tangent) / other.value }
    }
}
assign_operators!([T: Real] Dual<T>);

impl<T: Real> Real for Dual<T> {
    forward_real!();

    #[inline(always)]
    fn is_exact_zero(self) -> bool {
        self.value.is_exact_zero() && self.tangent.is_exact_zero()
    }
    #[inline(always)]
    fn select(self, a: Self, b: Self) -> Self {
        let c = self.value;
        Self { value: c.select(a.value, b.value), tangent: c.select(a.tangent, b.tangent) }
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (Self { value: sin, tangent: cos * self.tangent }, Self { value: cos, tangent: -(sin * self.tangent) })
    }
}

/// Hyper-dual number for mixed second derivatives.
///
/// `value + s S + t T + st S T` modulo `S^2`, `T^2`: seeded with the directions `s` and `t`, a function returns its value, both first
/// derivatives, and the mixed second derivative `st` along them.
#[derive(Clone, Copy, Debug)]
pub struct HyperDual<T> {
    /// The number.
    pub value: T,
    /// Derivative along the first direction.
    pub s: T,
    /// Derivative along the second direction.
    pub t: T,
    /// Mixed second derivative.
    pub st: T,
}

impl<T: Real> HyperDual<T> {
    /// A number with given coefficients.
    #[inline(always)]
    pub fn new(value: T, s: T, t: T, st: T) -> Self {
        Self { value, s, t, st }
    }
    /// A number of the base type, constant along both directions.
    #[inline(always)]
    pub fn lift(value: T) -> Self {
        Self { value, s: T::zero(), t: T::zero(), st: T::zero() }
    }
    /// Chain rule from `f, f', f''` at the value.
    #[inline(always)]
    fn compose(self, (value, first, second): (T, T, T)) -> Self {
        let (s, t, product) = (first * self.s, first * self.t, self.s * self.t);
        let bent = if second.may_be_finite() { second * product } else { second.along(product) };
        Self { value, s, t, st: first * self.st + bent }
    }
    /// Chain rule.
    #[inline(always)]
    fn chain1(self, f: impl Elementary) -> Self {
        self.compose(f.jet(self.value))
    }
    /// Chain rule in two arguments.
    #[inline(always)]
    fn chain2(self, other: Self, f: Binary) -> Self {
        let (a, b) = (self, other);
        let value = f.value(a.value, b.value);
        let (da, db) = f.first(a.value, b.value, value);
        let (daa, dab, dbb) = f.second(a.value, b.value, value, (da, db));
        let product = a.s * a.t;
        let bent = if daa.may_be_finite() { daa * product } else { daa.along(product) };
        Self {
            value,
            s: da * a.s + db * b.s,
            t: da * a.t + db * b.t,
            st: da * a.st + db * b.st + bent + dab * (a.s * b.t + b.s * a.t) + dbb * (b.s * b.t),
        }
    }
    /// Applies an operation to every component.
    #[inline(always)]
    fn each(self, other: Self, f: impl Fn(T, T) -> T) -> Self {
        Self {
            value: f(self.value, other.value),
            s: f(self.s, other.s),
            t: f(self.t, other.t),
            st: f(self.st, other.st),
        }
    }
}

impl<T: Real> Neg for HyperDual<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, s: -self.s, t: -self.t, st: -self.st }
    }
}
impl<T: Real> Add for HyperDual<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.each(other, |a, b| a + b)
    }
}
impl<T: Real> Sub for HyperDual<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.each(other, |a, b| a - b)
    }
}
impl<T: Real> Mul for HyperDual<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let a = self;
        Self {
            value: a.value * b.value,
            s: a.s * b.value + a.value * b.s,
            t: a.t * b.value + a.value * b.t,
            st: a.st * b.value + a.s * b.t + a.t * b.s + a.value * b.st,
        }
    }
}
impl<T: Real> Div for HyperDual<T> {
    type Output = Self;
    /// From `a = y b`: each order of the quotient solves the product rule.
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let a = self;
        let value = a.value / b.value;
        let s = (a.s - value * b.s) / b.value;
        let t = (a.t - value * b.t) / b.value;
        Self { value, s, t, st: (a.st - s * b.t - t * b.s - value * b.st) / b.value }
    }
}
assign_operators!([T: Real] HyperDual<T>);

impl<T: Real> Real for HyperDual<T> {
    forward_real!();

    #[inline(always)]
    fn is_exact_zero(self) -> bool {
        self.value.is_exact_zero() && self.s.is_exact_zero() && self.t.is_exact_zero() && self.st.is_exact_zero()
    }
    #[inline(always)]
    fn select(self, if_positive: Self, otherwise: Self) -> Self {
        if_positive.each(otherwise, |a, b| self.value.select(a, b))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.compose((sin, cos, -sin)), self.compose((cos, -sin, -cos)))
    }
}
