//! The number that a Lagrangian is evaluated with: its value, its first and its second derivatives along the velocities, each as a
//! form over a box of states.

use super::affine;
use super::arena::{Arena, Place};
use super::function::Function;
use super::interval::Interval;
use crate::ops::Unary;
use crate::scalar::{Elementary, Real};
use std::fmt::{Debug, Formatter};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A constant that lies in an interval, or a number of an [`Arena`].
#[derive(Clone, Copy)]
pub enum Number<'a> {
    Constant(Interval),
    Variable(&'a Arena, Place),
}
use Number::{Constant, Variable};

impl Debug for Number<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.range())
    }
}

impl<'a> Number<'a> {
    /// Every value on the box.
    pub fn range(self) -> Interval {
        match self {
            Constant(x) => x,
            Variable(arena, place) => arena.range(place),
        }
    }

    /// A function of one number.
    fn apply(self, f: Function) -> Self {
        match self {
            Constant(x) => Constant(f.value(x)),
            Variable(arena, place) => Variable(arena, arena.function(f, place)),
        }
    }

    /// `constant + sum_k s_k x_k` of a few numbers of an arena.
    fn combine(arena: &'a Arena, terms: &[(Interval, Place)], constant: Interval) -> Self {
        Variable(arena, arena.combine(terms, constant))
    }

    /// The sign, if it is the same on the whole box: `Some(true)` above 0, `Some(false)` at or below.
    fn positive(self) -> Option<bool> {
        let range = self.range();
        if range.low > 0.0 {
            Some(true)
        } else if range.high <= 0.0 {
            Some(false)
        } else {
            None
        }
    }

    /// The unbounded value (top): a branch that the box does not decide.
    fn undecided(by: &[Self]) -> Self {
        let mut found = Constant(Interval::ENTIRE);
        for x in by {
            if let Variable(arena, place) = x {
                arena.blame(*place);
                found = Variable(arena, arena.unknown());
            }
        }
        found
    }
}

const ONE: Interval = Interval::point(1.0);

impl Neg for Number<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        match self {
            Constant(x) => Constant(-x),
            Variable(arena, index) => Self::combine(arena, &[(-ONE, index)], Interval::ZERO),
        }
    }
}
impl Add for Number<'_> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        match (self, other) {
            (Constant(a), Constant(b)) => Constant(sum(a, b)),
            (Constant(c), x) | (x, Constant(c)) if c == Interval::ZERO => x,
            (Constant(c), Variable(arena, x)) | (Variable(arena, x), Constant(c)) => {
                Self::combine(arena, &[(ONE, x)], c)
            }
            (Variable(arena, a), Variable(_, b)) => Self::combine(arena, &[(ONE, a), (ONE, b)], Interval::ZERO),
        }
    }
}
/// Exact where one of the two is 0.
fn sum(a: Interval, b: Interval) -> Interval {
    if a == Interval::ZERO {
        b
    } else if b == Interval::ZERO {
        a
    } else {
        a + b
    }
}
impl Sub for Number<'_> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        match (self, other) {
            (Variable(arena, a), Variable(_, b)) => Self::combine(arena, &[(ONE, a), (-ONE, b)], Interval::ZERO),
            (Constant(c), Variable(arena, b)) => Self::combine(arena, &[(-ONE, b)], c),
            (a, Constant(c)) => a + Constant(-c),
        }
    }
}
impl Mul for Number<'_> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        match (self, other) {
            (Constant(a), Constant(b)) if a == ONE => Constant(b),
            (Constant(a), Constant(b)) if b == ONE => Constant(a),
            (Constant(a), Constant(b)) => Constant(a * b),
            (Constant(c), x) | (x, Constant(c)) if c == ONE => x,
            (Constant(c), Variable(arena, x)) | (Variable(arena, x), Constant(c)) => {
                Self::combine(arena, &[(c, x)], Interval::ZERO)
            }
            (Variable(arena, a), Variable(_, b)) => Variable(arena, arena.product(a, b)),
        }
    }
}
impl Div for Number<'_> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        match (self, other) {
            (Constant(a), Constant(b)) => Constant(a / b),
            (a, b) => a * b.recip(),
        }
    }
}
macro_rules! assign {
    ($($name:ident $method:ident $sign:tt)*) => {$(
        impl $name for Number<'_> {
            fn $method(&mut self, other: Self) {
                *self = *self $sign other;
            }
        }
    )*};
}
assign! { AddAssign add_assign + SubAssign sub_assign - MulAssign mul_assign * DivAssign div_assign / }

/// One method of `Real` per row of the table of operations.
macro_rules! methods {
    ($($name:ident $method:ident)*) => {$(
        fn $method(self) -> Self {
            self.apply(Function::Table(Unary::$name))
        }
    )*};
}

impl Real for Number<'_> {
    type Scalar = f64;

    fn constant(value: f64) -> Self {
        Constant(Interval::point(value))
    }
    /// A value of the box; that it was read is remembered, for nothing is proven of a Lagrangian that may branch on it.
    fn primal(self) -> f64 {
        if let Variable(arena, _) = self {
            arena.note_read();
        }
        self.range().middle()
    }
    fn is_exact_zero(self) -> bool {
        match self {
            Constant(x) => x == Interval::ZERO,
            Variable(arena, place) => arena.is_zero(place),
        }
    }
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self::of(f64::from(numerator)) / Self::of(f64::from(denominator))
    }
    fn elementary<F: Elementary>(self, f: F) -> Self {
        match Unary::made(f) {
            Some(f @ (Unary::Gelu | Unary::XTanh)) => self.apply(Function::Table(f)),
            _ => f.value(self),
        }
    }
    crate::ops::unary_methods! { methods }
    fn powi(self, exponent: i32) -> Self {
        self.apply(Function::Table(Unary::Powi(exponent)))
    }
    fn powf(self, exponent: Self) -> Self {
        match exponent {
            Constant(p) if p.is_point() && p.low.fract() == 0.0 && p.low.abs() < 1e9 => self.powi(p.low as i32),
            Constant(p) if p.is_point() => self.apply(Function::Power(p.low)),
            _ => (exponent * self.ln()).exp(),
        }
    }
    fn atan2(self, x: Self) -> Self {
        let (rise, run) = (self.range(), x.range());
        let quarter = Constant(Interval::pi() * Interval::point(0.5));
        if run.low > 0.0 {
            (self / x).atan()
        } else if rise.low > 0.0 {
            quarter - (x / self).atan()
        } else if rise.high < 0.0 {
            -quarter - (x / self).atan()
        } else {
            Self::undecided(&[self, x])
        }
    }
    fn max(self, other: Self) -> Self {
        match (self - other).positive() {
            Some(true) => self,
            Some(false) => other,
            None => Self::undecided(&[self, other]),
        }
    }
    fn min(self, other: Self) -> Self {
        match (self - other).positive() {
            Some(true) => other,
            Some(false) => self,
            None => Self::undecided(&[self, other]),
        }
    }
    fn select(self, if_positive: Self, otherwise: Self) -> Self {
        match self.positive() {
            Some(true) => if_positive,
            Some(false) => otherwise,
            None => Self::undecided(&[self]),
        }
    }
    fn affine(weights: &[Self], bias: &[Self], x: &[Self]) -> Vec<Self> {
        affine::map(weights, bias, x)
    }
}
