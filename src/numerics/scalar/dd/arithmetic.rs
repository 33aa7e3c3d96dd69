//! The operators: the arithmetic of `xprec`, completed at infinities and at the ends of the range.

use super::Dd;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};
use xprec::{CompensatedArithmetic, Df64};

impl Dd {
    /// Into the crate that does the arithmetic.
    #[inline(always)]
    fn df(self) -> Df64 {
        Df64::compensated_fast_sum(self.high, self.low)
    }
    /// Out of the crate that does the arithmetic; `plain` is the answer of `f64` where that one has none.
    #[inline(always)]
    fn finite_or(value: Df64, plain: f64) -> Self {
        let (high, low) = (value.hi(), value.lo());
        if high.is_finite() && low.is_finite() { Self { high, low } } else { Self::leading(plain) }
    }
    /// The exact sum of two `f64`.
    #[inline]
    pub(super) fn sum(a: f64, b: f64) -> Self {
        Self::finite_or(Df64::compensated_sum(a, b), a + b)
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
        Self::finite_or(Df64::compensated_fast_sum(first, rest / divisor), first)
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
        Self::finite_or(self.df() + other.df(), self.high + other.high)
    }
}
impl Sub for Dd {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::finite_or(self.df() - other.df(), self.high - other.high)
    }
}
impl Mul for Dd {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self::finite_or(self.df() * other.df(), self.high * other.high)
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
        let divisor = other.df();
        let rest = self.df() - divisor * first;
        let second = rest.hi() / other.high;
        let rest = rest - divisor * second;
        let third = rest.hi() / other.high;
        Self::finite_or(Df64::compensated_fast_sum(first, second) + third, first)
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
