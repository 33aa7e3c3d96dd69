//! Variables of the eager tape.

use super::TapeError;
use super::eager::Tape;
use crate::forward::assign_operators;
use crate::ops::{Binary, Unary};
use crate::scalar::{Elementary, Real, Scalar};
use core::fmt;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number on a [`Tape`], or a constant.
///
/// A function of one variable is not recorded: the number carries its derivative by the last recorded node, so chains of such functions
/// (negation, constant factors and summands, sines, powers) cost a product and no memory.
#[derive(Clone, Copy)]
pub struct Var<'t, T> {
    value: T,
    /// Derivative of the value by the node `id`.
    slope: T,
    /// Node; 0 for constants. As wide as its neighbours, so that copies never load data that was stored in parts.
    id: usize,
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
        Self { value, slope: T::zero(), id: 0, tape: None }
    }
    #[inline(always)]
    pub(super) fn recorded(tape: &'t Tape<T>, id: u32, value: T) -> Self {
        Self { value, slope: T::one(), id: id as usize, tape: Some(tape) }
    }
    #[inline(always)]
    pub(super) fn not_a_number() -> Self {
        Self::lift(T::constant(T::Scalar::nan()))
    }
    /// The number; reading it is allowed on this tape.
    #[inline(always)]
    pub fn value(self) -> T {
        self.value
    }
    /// The node that it is a function of; 0 for a constant.
    #[inline(always)]
    pub fn id(self) -> u32 {
        self.id as u32
    }
    /// Derivative of the number by its node.
    #[inline(always)]
    pub(super) fn slope(self) -> T {
        self.slope
    }
    #[inline(always)]
    pub(super) fn tape(self) -> Option<&'t Tape<T>> {
        self.tape
    }
    /// Result of a function of this number alone, with the partial derivative by it.
    #[inline(always)]
    fn unary(self, value: T, partial: T) -> Self {
        Self { value, slope: chained(partial, self.slope), ..self }
    }
    /// Result of a function of two arguments; only the partial derivatives that are needed are computed.
    #[inline(always)]
    fn binary(self, other: Self, value: T, partials: impl FnOnce() -> (T, T)) -> Self {
        match (self.tape, other.tape) {
            (None, None) => Self::lift(value),
            (Some(_), None) => self.unary(value, partials().0),
            (None, Some(_)) => other.unary(value, partials().1),
            (Some(tape), Some(second)) => {
                if !core::ptr::eq(tape, second) {
                    mixed(tape, second);
                    return Self::not_a_number();
                }
                let (da, db) = partials();
                tape.push(value, (self.id(), chained(da, self.slope)), (other.id(), chained(db, other.slope)))
            }
        }
    }
    /// Product of a variable and a constant factor: a constant if the factor is exactly 0, unless the product is not 0
    /// (`0 * inf`).
    #[inline(always)]
    fn scaled(self, factor: T, value: T) -> Self {
        if factor.is_exact_zero() && value.is_exact_zero() { Self::lift(value) } else { self.unary(value, factor) }
    }
    #[inline(always)]
    fn table1(self, f: impl Elementary) -> Self {
        if self.tape.is_none() {
            return Self::lift(f.value(self.value));
        }
        let (value, partial) = f.value_first(self.value);
        self.unary(value, partial)
    }
    #[inline(always)]
    fn table2(self, other: Self, f: Binary) -> Self {
        let value = f.value(self.value, other.value);
        self.binary(
            other,
            value,
            #[inline(always)]
            || f.first(self.value, other.value, value),
        )
    }
}

/// Chain rule `partial * slope`; an exactly zero partial derivative stays so, whatever the slope: a branch not taken
/// contributes nothing.
#[inline(always)]
fn chained<T: Real>(partial: T, slope: T) -> T {
    let product = partial * slope;
    if partial.is_exact_zero() { T::zero() } else { product }
}

/// Numbers of two tapes were combined: both tapes report it.
#[cold]
#[inline(never)]
fn mixed<T: Real>(first: &Tape<T>, second: &Tape<T>) {
    second.latch(TapeError::MixedTapes);
    first.latch(TapeError::MixedTapes);
}

impl<T: Real> Neg for Var<'_, T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope, ..self }
    }
}
impl<T: Real> Add for Var<'_, T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.binary(
            other,
            self.value + other.value,
            #[inline(always)]
            || (T::one(), T::one()),
        )
    }
}
impl<T: Real> Sub for Var<'_, T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.binary(
            other,
            self.value - other.value,
            #[inline(always)]
            || (T::one(), -T::one()),
        )
    }
}
impl<T: Real> Mul for Var<'_, T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let value = self.value * other.value;
        match (self.tape, other.tape) {
            (Some(_), None) => self.scaled(other.value, value),
            (None, Some(_)) => other.scaled(self.value, value),
            _ => self.binary(
                other,
                value,
                #[inline(always)]
                || (other.value, self.value),
            ),
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
    #[inline(always)]
    fn may_be_finite(self) -> bool {
        self.value.may_be_finite()
    }
    #[inline]
    fn elementary<F: Elementary>(self, f: F) -> Self {
        self.table1(f)
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
            && !core::ptr::eq(tape, other)
        {
            mixed(tape, other);
            return Self::not_a_number();
        }
        let c = self.value;
        a.binary(
            b,
            c.select(a.value, b.value),
            #[inline(always)]
            || (c.select(T::one(), T::zero()), c.select(T::zero(), T::one())),
        )
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.unary(sin, cos), self.unary(cos, -sin))
    }
}
