//! Full second order in `N` variables, first order in `F` more: value, gradients, Hessian.

use super::{assign_operators, forward_real, forward_unary};
use crate::ops::Binary;
use crate::scalar::{Elementary, Real};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number with its gradient in `N + F` variables and its Hessian in the first `N`.
///
/// The Hessian is symmetric and only its lower triangle `j <= i` is ever computed or read; the rest stays 0.
#[derive(Clone, Copy, Debug)]
pub struct Jet<T, const N: usize, const F: usize> {
    /// The number.
    pub value: T,
    /// First derivatives in the variables that have second ones.
    pub gradient: [T; N],
    /// First derivatives in the variables that have no others.
    pub linear: [T; F],
    /// Second derivatives, entries `[i][j]` with `j <= i`.
    lower: [[T; N]; N],
}

/// A number with its gradient and its Hessian in `N` variables.
pub type Jet2<T, const N: usize> = Jet<T, N, 0>;

/// An array by index, in a loop that is always inlined; with `std::array::from_fn` the terms of one state take up to 1.4 times as long.
#[inline(always)]
pub(crate) fn array<T: Real, const N: usize>(f: impl Fn(usize) -> T) -> [T; N] {
    let mut array = [T::zero(); N];
    for (i, number) in array.iter_mut().enumerate() {
        *number = f(i);
    }
    array
}

impl<T: Real, const N: usize, const F: usize> Jet<T, N, F> {
    /// A number of the base type, constant in every variable.
    #[inline(always)]
    pub fn lift(value: T) -> Self {
        let zero = T::zero();
        Self { value, gradient: [zero; N], linear: [zero; F], lower: [[zero; N]; N] }
    }
    /// The variable `index` at `value`: gradient the unit vector, Hessian 0; a constant if `index >= N + F`.
    #[inline(always)]
    pub fn variable(value: T, index: usize) -> Self {
        let unit = |at: usize| if at == index { T::one() } else { T::zero() };
        Self { gradient: array(unit), linear: array(|k| unit(N + k)), ..Self::lift(value) }
    }
    /// `d2/dx_i dx_j`, both below `N`.
    #[inline(always)]
    pub fn second(&self, i: usize, j: usize) -> T {
        if j <= i { self.lower[i][j] } else { self.lower[j][i] }
    }
    /// The symmetric Hessian, row by row.
    #[inline(always)]
    pub fn hessian(&self) -> [[T; N]; N] {
        let mut rows = [[T::zero(); N]; N];
        for (i, row) in rows.iter_mut().enumerate() {
            *row = array(|j| self.second(i, j));
        }
        rows
    }
    /// A number from a rule for first derivatives, given the operands' derivatives in one variable, and a rule for the lower triangle,
    /// given two indices and the gradient of the result.
    #[inline(always)]
    fn build(
        (a, b): (&Self, &Self),
        value: T,
        first: impl Fn(T, T) -> T,
        second: impl Fn(usize, usize, &[T; N]) -> T,
    ) -> Self {
        let mut jet = Self::lift(value);
        for k in 0..F {
            jet.linear[k] = first(a.linear[k], b.linear[k]);
        }
        for i in 0..N {
            jet.gradient[i] = first(a.gradient[i], b.gradient[i]);
        }
        for i in 0..N {
            for j in 0..=i {
                jet.lower[i][j] = second(i, j, &jet.gradient);
            }
        }
        jet
    }
    /// Chain rule from `f, f', f''` at the value.
    #[inline(always)]
    fn compose(&self, (value, first, second): (T, T, T)) -> Self {
        if !second.may_be_finite() {
            let g = &self.gradient;
            let rule = |i: usize, j: usize, _: &[T; N]| first * self.lower[i][j] + second.along(g[i] * g[j]);
            return Self::build((self, self), value, |x, _| first * x, rule);
        }
        let bent: [T; N] = array(|i| second * self.gradient[i]);
        let rule = |i: usize, j: usize, _: &[T; N]| first * self.lower[i][j] + bent[i] * self.gradient[j];
        Self::build((self, self), value, |x, _| first * x, rule)
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
        let (p, q) = (&a.gradient, &b.gradient);
        let known = daa.may_be_finite();
        Self::build(
            (a, b),
            value,
            |x, y| da * x + db * y,
            |i, j, _| {
                let product = p[i] * p[j];
                da * a.lower[i][j]
                    + db * b.lower[i][j]
                    + if known { daa * product } else { daa.along(product) }
                    + dab * (p[i] * q[j] + q[i] * p[j])
                    + dbb * (q[i] * q[j])
            },
        )
    }
    /// Applies an operation to every component.
    #[inline(always)]
    fn each(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self {
        let value = f(self.value, other.value);
        Self::build((self, other), value, f, |i, j, _| f(self.lower[i][j], other.lower[i][j]))
    }
}

impl<T: Real, const N: usize, const F: usize> Neg for Jet<T, N, F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::build((&self, &self), -self.value, |x, _| -x, |i, j, _| -self.lower[i][j])
    }
}
impl<T: Real, const N: usize, const F: usize> Add for Jet<T, N, F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.each(&other, |a, b| a + b)
    }
}
impl<T: Real, const N: usize, const F: usize> Sub for Jet<T, N, F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.each(&other, |a, b| a - b)
    }
}
impl<T: Real, const N: usize, const F: usize> Mul for Jet<T, N, F> {
    type Output = Self;
    // The product rule adds.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (&self, &other);
        let (p, q) = (&a.gradient, &b.gradient);
        Self::build(
            (a, b),
            a.value * b.value,
            |x, y| x * b.value + a.value * y,
            |i, j, _| a.lower[i][j] * b.value + p[i] * q[j] + q[i] * p[j] + a.value * b.lower[i][j],
        )
    }
}
impl<T: Real, const N: usize, const F: usize> Div for Jet<T, N, F> {
    type Output = Self;
    /// From `a = y b`: each order of the quotient solves the product rule.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let (a, b) = (&self, &other);
        let (value, q) = (a.value / b.value, &b.gradient);
        Self::build(
            (a, b),
            value,
            |x, y| (x - value * y) / b.value,
            |i, j, p| (a.lower[i][j] - p[i] * q[j] - q[i] * p[j] - value * b.lower[i][j]) / b.value,
        )
    }
}
assign_operators!([T: Real, const N: usize, const F: usize] Jet<T, N, F>);

impl<T: Real, const N: usize, const F: usize> Real for Jet<T, N, F> {
    forward_real!();

    #[inline(always)]
    fn is_exact_zero(self) -> bool {
        self.value.is_exact_zero()
            && self.linear.iter().all(|first| first.is_exact_zero())
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
