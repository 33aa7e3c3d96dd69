//! Full second order in `N` variables: value, gradient, Hessian.

use super::{assign_operators, forward_real, forward_unary};
use crate::ops::Binary;
use crate::scalar::{Elementary, Real};
use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number with its gradient and its Hessian in `N` variables.
///
/// The Hessian is symmetric and only its lower triangle `j <= i` is ever computed or read; the rest stays 0.
#[derive(Clone, Copy, Debug)]
pub struct Jet2<T, const N: usize> {
    /// The number.
    pub value: T,
    /// First derivatives.
    pub gradient: [T; N],
    /// Second derivatives, entries `[i][j]` with `j <= i`.
    lower: [[T; N]; N],
}

impl<T: Real, const N: usize> Jet2<T, N> {
    /// A number of the base type, constant in every variable.
    #[inline(always)]
    pub fn lift(value: T) -> Self {
        Self { value, gradient: [T::zero(); N], lower: [[T::zero(); N]; N] }
    }
    /// The variable `index` at `value`: gradient the unit vector, Hessian 0; a constant if `index >= N`.
    #[inline(always)]
    pub fn variable(value: T, index: usize) -> Self {
        Self { gradient: from_fn(|i| if i == index { T::one() } else { T::zero() }), ..Self::lift(value) }
    }
    /// `d2/dx_i dx_j`, both below `N`.
    #[inline(always)]
    pub fn second(&self, i: usize, j: usize) -> T {
        if j <= i { self.lower[i][j] } else { self.lower[j][i] }
    }
    /// The symmetric Hessian, row by row.
    #[inline(always)]
    pub fn hessian(&self) -> [[T; N]; N] {
        from_fn(|i| from_fn(|j| self.second(i, j)))
    }
    /// Builds a number from rules for the gradient and for the lower triangle.
    #[inline(always)]
    fn build(value: T, gradient: impl Fn(usize) -> T, second: impl Fn(usize, usize) -> T) -> Self {
        let mut jet = Self::lift(value);
        for i in 0..N {
            jet.gradient[i] = gradient(i);
            for j in 0..=i {
                jet.lower[i][j] = second(i, j);
            }
        }
        jet
    }
    /// Chain rule from `f, f', f''` at the value.
    #[inline(always)]
    fn compose(&self, (value, first, second): (T, T, T)) -> Self {
        let bent: [T; N] = from_fn(|i| second * self.gradient[i]);
        Self::build(value, |i| first * self.gradient[i], |i, j| first * self.lower[i][j] + bent[i] * self.gradient[j])
    }
    /// Chain rule.
    #[inline(always)]
    fn chain1(self, f: impl Elementary) -> Self {
        self.compose(f.jet(self.value))
    }
    /// Chain rule in two arguments.
    #[inline(always)]
    fn chain2(self, other: Self, f: Binary) -> Self {
        let (a, b) = (&self, &other);
        let value = f.value(a.value, b.value);
        let (da, db) = f.first(a.value, b.value, value);
        let (daa, dab, dbb) = f.second(a.value, b.value, value, (da, db));
        Self::build(
            value,
            |i| da * a.gradient[i] + db * b.gradient[i],
            |i, j| {
                let (p, q) = (&a.gradient, &b.gradient);
                da * a.lower[i][j]
                    + db * b.lower[i][j]
                    + daa * (p[i] * p[j])
                    + dab * (p[i] * q[j] + q[i] * p[j])
                    + dbb * (q[i] * q[j])
            },
        )
    }
    /// The same operation on every component.
    #[inline(always)]
    fn each(&self, other: &Self, f: impl Fn(T, T) -> T) -> Self {
        Self::build(
            f(self.value, other.value),
            |i| f(self.gradient[i], other.gradient[i]),
            |i, j| f(self.lower[i][j], other.lower[i][j]),
        )
    }
}

impl<T: Real, const N: usize> Neg for Jet2<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::build(-self.value, |i| -self.gradient[i], |i, j| -self.lower[i][j])
    }
}
impl<T: Real, const N: usize> Add for Jet2<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.each(&other, |a, b| a + b)
    }
}
impl<T: Real, const N: usize> Sub for Jet2<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.each(&other, |a, b| a - b)
    }
}
impl<T: Real, const N: usize> Mul for Jet2<T, N> {
    type Output = Self;
    // The product rule adds.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (&self, &other);
        let (p, q) = (&a.gradient, &b.gradient);
        Self::build(
            a.value * b.value,
            |i| p[i] * b.value + a.value * q[i],
            |i, j| a.lower[i][j] * b.value + p[i] * q[j] + q[i] * p[j] + a.value * b.lower[i][j],
        )
    }
}
impl<T: Real, const N: usize> Div for Jet2<T, N> {
    type Output = Self;
    /// From `a = y b`: each order of the quotient solves the product rule.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let (a, b) = (&self, &other);
        let value = a.value / b.value;
        let p: [T; N] = from_fn(|i| (a.gradient[i] - value * b.gradient[i]) / b.value);
        let q = &b.gradient;
        Self::build(
            value,
            |i| p[i],
            |i, j| (a.lower[i][j] - p[i] * q[j] - q[i] * p[j] - value * b.lower[i][j]) / b.value,
        )
    }
}
assign_operators!([T: Real, const N: usize] Jet2<T, N>);

impl<T: Real, const N: usize> Real for Jet2<T, N> {
    forward_real!();

    #[inline(always)]
    fn is_exact_zero(self) -> bool {
        self.value.is_exact_zero()
            && (0..N).all(|i| {
                self.gradient[i].is_exact_zero() && self.lower[i][..=i].iter().all(|second| second.is_exact_zero())
            })
    }
    #[inline(always)]
    fn select(self, if_positive: Self, otherwise: Self) -> Self {
        if_positive.each(&otherwise, |a, b| self.value.select(a, b))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.compose((sin, cos, -sin)), self.compose((cos, -sin, -cos)))
    }
}
