//! First order: value and one tangent.

use super::{assign_operators, forward_real, forward_unary};
use crate::ops::Binary;
use crate::scalar::{Elementary, Real};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// `value + tangent * t` modulo `t^2`: a number and its derivative along one direction.
#[derive(Clone, Copy, Debug)]
pub struct Dual<T> {
    /// The number.
    pub value: T,
    /// Its derivative along the direction.
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
