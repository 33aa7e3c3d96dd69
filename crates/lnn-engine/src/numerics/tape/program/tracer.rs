//! Numbers of a program that is being recorded: rows, or constants.

use super::recorder::{Node, Recorder};
use crate::forward::assign_operators;
use crate::ops::{Binary, Unary};
use crate::scalar::{Elementary, Real, Scalar};
use crate::tape::TapeError;
use alloc::vec::Vec;
use core::fmt;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number of a program while it is recorded: it has no value yet, unless it is a constant.
///
/// Reading its value latches [`TapeError::DataDependentBranch`]. Constants fold: operations between them, `x + 0`,
/// `x * 1`, and `x * 0`, which becomes the constant 0 whatever `x` will be (a constant 0 is structural here: a term
/// that was left out).
#[derive(Clone, Copy)]
pub struct Tracer<'t, S> {
    /// Value of a constant.
    value: S,
    row: u32,
    recorder: Option<&'t Recorder<S>>,
}

impl<S: fmt::Debug> fmt::Debug for Tracer<'_, S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.recorder {
            None => write!(f, "Tracer({:?})", self.value),
            Some(_) => write!(f, "Tracer(row {})", self.row),
        }
    }
}

impl<'t, S: Scalar> Tracer<'t, S> {
    #[inline(always)]
    pub(super) fn recorded(recorder: &'t Recorder<S>, row: u32) -> Self {
        Self { value: S::nan(), row, recorder: Some(recorder) }
    }
    pub(super) fn recorder(self) -> Option<&'t Recorder<S>> {
        self.recorder
    }
    pub(super) fn row(self) -> u32 {
        self.row
    }
    pub(super) fn constant_value(self) -> S {
        self.value
    }
    /// `true` if it is the constant `value`.
    fn is(self, value: f64) -> bool {
        self.recorder.is_none() && self.value == S::of_f64(value)
    }
    fn table1(self, f: Unary) -> Self {
        match self.recorder {
            None => Self::constant(f.evaluate(self.value)),
            Some(recorder) => recorder.tracer(recorder.row(Node::Unary(f, recorder.row_of(self)))),
        }
    }
    fn table2(self, other: Self, f: Binary) -> Self {
        match self.recorder.or(other.recorder) {
            None => Self::constant(f.evaluate(self.value, other.value)),
            Some(recorder) => {
                let (a, b) = (recorder.row_of(self), recorder.row_of(other));
                recorder.tracer(recorder.row(Node::Binary(f, a, b)))
            }
        }
    }
    /// The product of this constant with `b`, if `b` has a constant factor with which this one can be joined without a rounding.
    fn joined(self, b: Self) -> Option<Self> {
        let factors = |x: Self| x.recorder?.factors(x.row);
        let constant = |c: Self| {
            let exact = c.recorder.is_none() && (is_power_of_two(c.value) || is_power_of_two(self.value));
            exact.then(|| Self::constant(c.value * self.value))
        };
        let [x, y] = factors(b)?;
        for (x, y) in [(x, y), (y, x)] {
            if let Some(c) = constant(x) {
                return Some(c * y);
            }
            // Half of `(2 u) y` is `u y`.
            if let Some([u, w]) = factors(x) {
                for (u, w) in [(u, w), (w, u)] {
                    if let Some(c) = constant(u).filter(|c| c.is(1.0)) {
                        return Some(c * (w * y));
                    }
                }
            }
        }
        None
    }
    /// `Some(x)` if this is `-x`.
    fn negated(self) -> Option<Self> {
        let recorder = self.recorder?;
        recorder.negated(self.row).map(|row| recorder.tracer(row))
    }
}

/// `true` for numbers whose products are exact, far from the largest and the smallest ones.
fn is_power_of_two<S: Scalar>(x: S) -> bool {
    let x = x.to_f64().abs();
    x.to_bits() & ((1 << 52) - 1) == 0 && (1e-6..1e6).contains(&x)
}

impl<S: Scalar> Neg for Tracer<'_, S> {
    type Output = Self;
    fn neg(self) -> Self {
        self.negated().unwrap_or_else(|| self.table1(Unary::Neg))
    }
}
impl<S: Scalar> Add for Tracer<'_, S> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        if self.is(0.0) {
            return other;
        }
        if other.is(0.0) {
            return self;
        }
        match (self.negated(), other.negated()) {
            (_, Some(b)) => self.table2(b, Binary::Sub),
            (Some(a), None) => other.table2(a, Binary::Sub),
            _ => self.table2(other, Binary::Add),
        }
    }
}
impl<S: Scalar> Sub for Tracer<'_, S> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        if other.is(0.0) {
            return self;
        }
        if self.is(0.0) {
            return -other;
        }
        match other.negated() {
            Some(b) => self.table2(b, Binary::Add),
            None => self.table2(other, Binary::Sub),
        }
    }
}
impl<S: Scalar> Mul for Tracer<'_, S> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        for (a, b) in [(self, other), (other, self)] {
            if a.recorder.is_none() && b.recorder.is_some() {
                if a.is(0.0) {
                    return a;
                }
                if a.is(1.0) {
                    return b;
                }
                if a.is(-1.0) {
                    return -b;
                }
                if let Some(x) = b.negated() {
                    return -a * x;
                }
                if let Some(product) = a.joined(b) {
                    return product;
                }
            }
        }
        self.table2(other, Binary::Mul)
    }
}
impl<S: Scalar> Div for Tracer<'_, S> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if other.is(1.0) || (self.is(0.0) && other.recorder.is_some()) {
            return self;
        }
        self.table2(other, Binary::Div)
    }
}
assign_operators!([S: Scalar] Tracer<'_, S>);

/// Operators between numbers and floats, on either side.
macro_rules! float_operators {
    ($float:ty: $($operator:ident $method:ident)*) => {$(
        impl $operator<$float> for Tracer<'_, $float> {
            type Output = Self;
            fn $method(self, other: $float) -> Self {
                $operator::$method(self, Self::constant(other))
            }
        }
        impl<'t> $operator<Tracer<'t, $float>> for $float {
            type Output = Tracer<'t, $float>;
            fn $method(self, other: Tracer<'t, $float>) -> Tracer<'t, $float> {
                $operator::$method(Tracer::constant(self), other)
            }
        }
    )*};
}
float_operators!(f32: Add add Sub sub Mul mul Div div);
float_operators!(f64: Add add Sub sub Mul mul Div div);

/// Callback of `unary_methods`: one method of [`Real`] per row of the table; sine and cosine are overridden below.
macro_rules! tracer_unary {
    ($($name:ident $method:ident)*) => {$(
        fn $method(self) -> Self {
            match (Unary::$name, self.recorder) {
                (Unary::Sin, Some(_)) => self.sin_cos().0,
                (Unary::Cos, Some(_)) => self.sin_cos().1,
                _ => self.table1(Unary::$name),
            }
        }
    )*};
}

impl<S: Scalar> Real for Tracer<'_, S> {
    type Scalar = S;

    #[inline(always)]
    fn constant(value: S) -> Self {
        Self { value, row: 0, recorder: None }
    }
    fn primal(self) -> S {
        if let Some(recorder) = self.recorder {
            recorder.latch(TapeError::DataDependentBranch);
        }
        self.value
    }
    #[inline(always)]
    fn is_exact_zero(self) -> bool {
        self.is(0.0)
    }
    fn elementary<F: Elementary>(self, f: F) -> Self {
        match Unary::made(f) {
            Some(f) => self.table1(f),
            None => f.value(self),
        }
    }
    crate::ops::unary_methods! { tracer_unary }
    fn powi(self, exponent: i32) -> Self {
        match exponent {
            0 => Self::one(),
            1 => self,
            _ => self.table1(Unary::Powi(exponent)),
        }
    }
    fn powf(self, exponent: Self) -> Self {
        self.table2(exponent, Binary::Powf)
    }
    fn atan2(self, x: Self) -> Self {
        self.table2(x, Binary::Atan2)
    }
    fn max(self, other: Self) -> Self {
        self.table2(other, Binary::Max)
    }
    fn min(self, other: Self) -> Self {
        self.table2(other, Binary::Min)
    }
    fn select(self, a: Self, b: Self) -> Self {
        match self.recorder {
            None => match a.recorder.or(b.recorder) {
                None => Self::constant(self.value.select(a.value, b.value)),
                Some(_) if self.value.is_nan() => self,
                Some(_) if self.value > S::of_f64(0.0) => a,
                Some(_) => b,
            },
            Some(recorder) => {
                let (c, a, b) = (recorder.row_of(self), recorder.row_of(a), recorder.row_of(b));
                recorder.tracer(recorder.row(Node::Select(c, a, b)))
            }
        }
    }
    fn sin_cos(self) -> (Self, Self) {
        match self.recorder {
            None => {
                let (sin, cos) = self.value.sin_cos();
                (Self::constant(sin), Self::constant(cos))
            }
            Some(recorder) => {
                let row = recorder.row(Node::SinCos(recorder.row_of(self)));
                (recorder.tracer(row), recorder.tracer(row + 1))
            }
        }
    }
    fn affine(weights: &[Self], bias: &[Self], x: &[Self]) -> Vec<Self> {
        assert!(!x.is_empty() && weights.len().is_multiple_of(x.len()), "a matrix of whole rows");
        assert!(bias.is_empty() || bias.len() == weights.len() / x.len(), "a bias for every row");
        let block = weights.first().and_then(|first| first.recorder?.dense(weights, bias, x));
        block.unwrap_or_else(|| {
            let product = |row: &[Self]| row.iter().zip(x).fold(Self::zero(), |sum, (&w, &x)| sum + w * x);
            let bias = bias.iter().copied().chain(core::iter::repeat(Self::zero()));
            weights.chunks_exact(x.len()).zip(bias).map(|(row, b)| product(row) + b).collect()
        })
    }
}
