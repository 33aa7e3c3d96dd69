//! Variables of the eager tape.

use super::eager::Tape;
use super::error::TapeError;
use crate::forward::assign_operators;
use crate::ops::{Binary, Unary};
use crate::scalar::{Real, Scalar};
use std::fmt;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number on a [`Tape`], or a constant.
#[derive(Clone, Copy)]
pub struct Var<'t, T> {
    value: T,
    id: u32,
    tape: Option<&'t Tape<T>>,
}

impl<T: fmt::Debug> fmt::Debug for Var<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Var").field("value", &self.value).field("id", &self.id).finish()
    }
}

impl<'t, T: Real> Var<'t, T> {
    /// A number without a tape.
    #[inline(always)]
    pub fn lift(value: T) -> Self {
        Self { value, id: 0, tape: None }
    }
    #[inline(always)]
    pub(super) fn recorded(tape: &'t Tape<T>, id: u32, value: T) -> Self {
        Self { value, id, tape: Some(tape) }
    }
    pub(super) fn not_a_number() -> Self {
        Self::lift(T::constant(T::Scalar::NAN))
    }
    /// The number; reading it is allowed on this tape.
    #[inline(always)]
    pub fn value(self) -> T {
        self.value
    }
    /// 0 for a constant.
    #[inline(always)]
    pub fn id(self) -> u32 {
        self.id
    }
    #[inline(always)]
    pub(super) fn tape(self) -> Option<&'t Tape<T>> {
        self.tape
    }
    /// Result of a function of one argument.
    #[inline(always)]
    fn unary(self, value: T, partial: T) -> Self {
        match self.tape {
            None => Self::lift(value),
            Some(tape) => tape.push(value, (self.id, partial), (0, T::zero())),
        }
    }
    /// Result of a function of two arguments.
    #[inline(always)]
    fn binary(self, other: Self, value: T, partials: (T, T)) -> Self {
        let (da, db) = partials;
        match (self.tape, other.tape) {
            (Some(tape), Some(second)) if std::ptr::eq(tape, second) => tape.push(value, (self.id, da), (other.id, db)),
            (Some(tape), Some(second)) => mixed(tape, second),
            (Some(tape), None) => tape.push(value, (self.id, da), (0, T::zero())),
            (None, Some(tape)) => tape.push(value, (other.id, db), (0, T::zero())),
            (None, None) => Self::lift(value),
        }
    }
    /// Product of a variable and a constant factor.
    #[inline(always)]
    fn scaled(self, factor: T, value: T) -> Self {
        if factor.is_exact_zero() && value.is_exact_zero() { Self::lift(value) } else { self.unary(value, factor) }
    }
    /// The same variable with a value that a rounding-free operation gave it.
    #[inline(always)]
    fn renamed(self, value: T) -> Self {
        Self { value, ..self }
    }
    #[inline(always)]
    fn table1(self, f: Unary) -> Self {
        if self.tape.is_none() {
            return Self::lift(f.value(self.value));
        }
        let (value, partial) = f.value_first(self.value);
        self.unary(value, partial)
    }
    #[inline(always)]
    fn table2(self, other: Self, f: Binary) -> Self {
        let value = f.value(self.value, other.value);
        if self.tape.is_none() && other.tape.is_none() {
            return Self::lift(value);
        }
        self.binary(other, value, f.first(self.value, other.value, value))
    }
}

/// Two tapes met: both report it.
#[cold]
fn mixed<'t, T: Real>(first: &Tape<T>, second: &Tape<T>) -> Var<'t, T> {
    second.fail(TapeError::MixedTapes);
    first.fail(TapeError::MixedTapes)
}

impl<T: Real> Neg for Var<'_, T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.unary(-self.value, -T::one())
    }
}
impl<T: Real> Add for Var<'_, T> {
    type Output = Self;
    /// A constant summand records nothing: the derivatives of the sum are those of the variable.
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let value = self.value + other.value;
        match (self.tape, other.tape) {
            (_, None) => self.renamed(value),
            (None, _) => other.renamed(value),
            _ => self.binary(other, value, (T::one(), T::one())),
        }
    }
}
impl<T: Real> Sub for Var<'_, T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let value = self.value - other.value;
        match other.tape {
            None => self.renamed(value),
            _ => self.binary(other, value, (T::one(), -T::one())),
        }
    }
}
impl<T: Real> Mul for Var<'_, T> {
    type Output = Self;
    /// A constant factor that is exactly 0 makes a constant, unless the product is not 0 (`0 * inf`).
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let value = self.value * other.value;
        match (self.tape, other.tape) {
            (Some(_), None) => self.scaled(other.value, value),
            (None, Some(_)) => other.scaled(self.value, value),
            _ => self.binary(other, value, (other.value, self.value)),
        }
    }
}
impl<T: Real> Div for Var<'_, T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        if self.id == 0 && self.value.is_exact_zero() {
            let value = self.value / other.value;
            if value.is_exact_zero() {
                return Self::lift(value);
            }
        }
        self.table2(other, Binary::Div)
    }
}
assign_operators!([T: Real] Var<'_, T>);

/// Callback of `unary_methods`: one method of [`Real`] per row of the table.
macro_rules! var_unary {
    ($($name:ident $method:ident)*) => {$(
        #[inline]
        fn $method(self) -> Self {
            self.table1(Unary::$name)
        }
    )*};
}

impl<T: Real> Real for Var<'_, T> {
    type Scalar = T::Scalar;

    #[inline(always)]
    fn constant(value: T::Scalar) -> Self {
        Self::lift(T::constant(value))
    }
    #[inline(always)]
    fn primal(self) -> T::Scalar {
        self.value.primal()
    }
    #[inline(always)]
    fn is_exact_zero(self) -> bool {
        self.id == 0 && self.value.is_exact_zero()
    }
    crate::ops::unary_methods! { var_unary }
    #[inline]
    fn powi(self, exponent: i32) -> Self {
        self.table1(Unary::Powi(exponent))
    }
    /// One argument, where `self * self` has two.
    #[inline(always)]
    fn sqr(self) -> Self {
        self.unary(self.value * self.value, self.value + self.value)
    }
    #[inline]
    fn powf(self, exponent: Self) -> Self {
        self.table2(exponent, Binary::Powf)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        self.table2(x, Binary::Atan2)
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        self.table2(other, Binary::Max)
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        self.table2(other, Binary::Min)
    }
    #[inline]
    fn select(self, a: Self, b: Self) -> Self {
        if let (Some(tape), Some(other)) = (self.tape, a.tape.or(b.tape))
            && !std::ptr::eq(tape, other)
        {
            return mixed(tape, other);
        }
        let c = self.value;
        let share = |yes: T, no: T| c.select(yes, no);
        let partials = (share(T::one(), T::zero()), share(T::zero(), T::one()));
        a.binary(b, c.select(a.value, b.value), partials)
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.unary(sin, cos), self.unary(cos, -sin))
    }
}
