//! Arithmetic and functions of Taylor polynomials.

use super::{Degrees, Place, Space, Taylor};
use crate::forward::{HyperDual, assign_operators};
use crate::linalg::{MatMut, MatRef, gemm};
use crate::ops::{Binary, Unary};
use crate::scalar::{Elementary, Real, Scalar};
use alloc::vec::Vec;
use core::ops::{Add, Div, Mul, Neg, Sub};

impl<'a, S: Scalar> Taylor<'a, S> {
    /// Computes `self * factor`; a factor 0 gives zero.
    fn scaled(self, factor: S) -> Self {
        let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
        match self.place {
            None => Self::constant(self.value * factor),
            Some(_) if factor == zero => Self::constant(zero),
            Some(_) if factor == one => self,
            Some(place) => self.each(place, |x| x * factor),
        }
    }

    /// Applies a linear map to every coefficient.
    fn each(self, place: Place<'a, S>, map: impl Fn(S) -> S) -> Self {
        place.space.number(place.degrees, |before, out| {
            out.iter_mut().zip(place.of(before).0).for_each(|(out, &x)| *out = map(x));
        })
    }

    /// Returns the same number with another value.
    fn with_value(self, value: S) -> Self {
        match self.place {
            None => Self::constant(value),
            Some(place) => place.space.number(place.degrees, |before, out| {
                out.copy_from_slice(place.of(before).0);
                out[0] = value;
            }),
        }
    }

    /// Computes `self + factor other`.
    fn plus(self, factor: S, other: Self) -> Self {
        let value = self.value + factor * other.value;
        match (self.place, other.place) {
            (None, None) => Self::constant(value),
            (Some(_), None) if other.value == <S as Real>::zero() => self,
            (Some(_), None) => self.with_value(value),
            (None, Some(_)) => other.scaled(factor).with_value(value),
            (Some(a), Some(b)) => {
                let degrees = a.degrees.of_sum(b.degrees);
                a.space.number(degrees, |before, out| {
                    a.space.variables.add_scaled(<S as Real>::one(), a.of(before), (&mut *out, degrees));
                    a.space.variables.add_scaled(factor, b.of(before), (out, degrees));
                })
            }
        }
    }

    /// Computes `f` of this number from the derivatives `f, f', .., f''''` at its value: `sum f^(k) h^k / k!`, where `h` is the number
    /// without its value.
    fn compose(self, derivatives: [S; 5]) -> Self {
        let Some(place) = self.place else { return Self::constant(derivatives[0]) };
        let (degrees, variables) = (place.degrees.of_series(), place.space.variables);
        let order = place.degrees.total();
        let factorial = [1.0, 1.0, 2.0, 6.0, 24.0].map(S::of_f64);
        let coefficient = |k: usize| derivatives[k] / factorial[k];
        let mut scratch = place.space.scratch.borrow_mut();
        let [rest, sum, next] = &mut *scratch;
        place.space.number(degrees, |before, out| {
            let zero = <S as Real>::zero();
            rest.clear();
            rest.extend_from_slice(place.of(before).0);
            rest[0] = zero;
            for buffer in [&mut *sum, &mut *next] {
                buffer.clear();
                buffer.resize(out.len(), zero);
            }
            // Horner's rule.
            variables.add_scaled(coefficient(order), (rest, place.degrees), (sum, degrees));
            sum[0] = coefficient(order - 1);
            for k in (0..order - 1).rev() {
                variables.multiply((sum, degrees), (rest, place.degrees), (next, degrees));
                next[0] = coefficient(k);
                core::mem::swap(sum, next);
            }
            out.copy_from_slice(sum);
        })
    }

    /// Applies a function of the table; its third and fourth derivatives are computed from its second one.
    fn chain(self, f: impl Elementary) -> Self {
        let zero = <S as Real>::zero();
        match self.place {
            None => Self::constant(f.value(self.value)),
            Some(place) if place.degrees.total() <= 2 => {
                let (y, d, s) = f.jet(self.value);
                self.compose([y, d, s, zero, zero])
            }
            Some(_) => {
                let one = <S as Real>::one();
                let (y, d, s) = f.jet(HyperDual::new(self.value, one, one, zero));
                self.compose([y.value, d.value, s.value, s.s, s.st])
            }
        }
    }

    /// Raises a number that is not constant to a constant power: `b (b - 1) .. a^(b - k)`.
    fn constant_power(self, exponent: S) -> Self {
        let (mut factor, mut power) = (<S as Real>::one(), exponent);
        let mut derivatives = [<S as Real>::zero(); 5];
        for derivative in &mut derivatives {
            if factor != <S as Real>::zero() {
                *derivative = factor * self.value.powf(power);
            }
            factor *= power;
            power -= <S as Real>::one();
        }
        self.compose(derivatives)
    }
}

impl<S: Scalar> Neg for Taylor<'_, S> {
    type Output = Self;
    fn neg(self) -> Self {
        match self.place {
            None => Self::constant(-self.value),
            Some(place) => self.each(place, |x| -x),
        }
    }
}
impl<S: Scalar> Add for Taylor<'_, S> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.plus(<S as Real>::one(), other)
    }
}
impl<S: Scalar> Sub for Taylor<'_, S> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.plus(-<S as Real>::one(), other)
    }
}
impl<S: Scalar> Mul for Taylor<'_, S> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        match (self.place, other.place) {
            (_, None) => self.scaled(other.value),
            (None, _) => other.scaled(self.value),
            (Some(a), Some(b)) => {
                let degrees = a.degrees.of_product(b.degrees);
                a.space.number(degrees, |before, out| {
                    a.space.variables.multiply(a.of(before), b.of(before), (out, degrees));
                })
            }
        }
    }
}
impl<S: Scalar> Div for Taylor<'_, S> {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl)]
    fn div(self, other: Self) -> Self {
        match (self.place, other.place) {
            (None, None) => Self::constant(self.value / other.value),
            (Some(place), None) => self.each(place, |x| x / other.value),
            (_, Some(_)) => self * other.chain(Unary::Recip),
        }
    }
}
assign_operators!([S: Scalar] Taylor<'_, S>);

/// Callback of `unary_methods`: defines one method of [`Real`] per row of the table.
macro_rules! taylor_unary {
    ($($name:ident $method:ident)*) => {$(
        fn $method(self) -> Self {
            self.chain(Unary::$name)
        }
    )*};
}

impl<S: Scalar> Real for Taylor<'_, S> {
    type Scalar = S;

    fn constant(value: S) -> Self {
        Self { value, place: None }
    }
    fn primal(self) -> S {
        self.value
    }
    fn is_exact_zero(self) -> bool {
        self.place.is_none() && self.value == <S as Real>::zero()
    }
    fn elementary<F: Elementary>(self, f: F) -> Self {
        self.chain(f)
    }
    crate::ops::unary_methods! { taylor_unary }
    fn powi(self, exponent: i32) -> Self {
        match exponent {
            1 => self,
            2 => self * self,
            _ => self.chain(Unary::Powi(exponent)),
        }
    }
    fn powf(self, exponent: Self) -> Self {
        match (self.place, exponent.place) {
            (None, None) => Self::constant(self.value.powf(exponent.value)),
            (Some(_), None) => self.constant_power(exponent.value),
            // `ln |a|` replaces `ln a`.
            (_, Some(_)) => {
                let growth = (exponent * self.abs().ln()).with_value(<S as Real>::zero());
                growth.exp().scaled(self.value.powf(exponent.value))
            }
        }
    }
    fn atan2(self, x: Self) -> Self {
        let angle = self.value.atan2(x.value);
        if self.place.is_none() && x.place.is_none() {
            return Self::constant(angle);
        }
        // The angle between the expansion point and the displaced number.
        let larger = self.value.abs().max(x.value.abs());
        let (cos, sin) = (x.value / larger, self.value / larger);
        let across = self.scaled(cos).plus(-<S as Real>::one(), x.scaled(sin));
        let along = self.scaled(sin) + x.scaled(cos);
        (across / along).with_value(<S as Real>::zero()).atan().with_value(angle)
    }
    fn max(self, other: Self) -> Self {
        let (own, others) = Binary::Max.first(self.value, other.value, self.value);
        self.scaled(own) + other.scaled(others)
    }
    fn min(self, other: Self) -> Self {
        let (own, others) = Binary::Min.first(self.value, other.value, self.value);
        self.scaled(own) + other.scaled(others)
    }
    fn select(self, if_positive: Self, otherwise: Self) -> Self {
        let zero = <S as Real>::zero();
        if self.value > zero {
            if_positive
        } else if self.value <= zero {
            otherwise
        } else {
            Self::constant(self.value)
        }
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.compose([sin, cos, -sin, -cos, sin]), self.compose([cos, -sin, -cos, sin, cos]))
    }

    /// A single matrix product, if the weights are constants.
    fn affine(weights: &[Self], bias: &[Self], x: &[Self]) -> Vec<Self> {
        assert!(!x.is_empty() && weights.len().is_multiple_of(x.len()), "a matrix of whole rows");
        assert!(bias.is_empty() || bias.len() == weights.len() / x.len(), "a bias for every row");
        let constant = |numbers: &[Self]| numbers.iter().all(|number| number.place.is_none());
        let places: Vec<Place<'_, S>> = x.iter().filter_map(|x| x.place).collect();
        let (Some(first), true) = (places.first(), constant(weights) && constant(bias)) else {
            let product = |row: &[Self]| row.iter().zip(x).fold(Self::zero(), |sum, (&w, &x)| sum + w * x);
            let rows = weights.chunks_exact(x.len()).map(product);
            return rows
                .zip(bias.iter().copied().chain(core::iter::repeat(Self::zero())))
                .map(|(y, b)| y + b)
                .collect();
        };
        let degrees = places.iter().fold(first.degrees, |all, place| all.of_sum(place.degrees));
        first.space.layer(degrees, weights, bias, x)
    }
}

impl<S: Scalar> Space<S> {
    /// Computes `W x + b` with constant `weights`, `(outputs, x.len())`, and `bias`, `(outputs)` or empty; `degrees` must be at least those
    /// of every `x`.
    pub(super) fn layer<'a>(
        &'a self,
        degrees: Degrees,
        weights: &[Taylor<'a, S>],
        bias: &[Taylor<'a, S>],
        x: &[Taylor<'a, S>],
    ) -> Vec<Taylor<'a, S>> {
        let (size, inputs, outputs) = (self.variables.size(degrees), x.len(), weights.len() / x.len());
        let values = |numbers: &[Taylor<'a, S>]| -> Vec<S> { numbers.iter().map(|number| number.value).collect() };
        let mut numbers = self.numbers.borrow_mut();
        let start = numbers.len();
        let mut rows = vec![<S as Real>::zero(); inputs * size];
        for (row, x) in rows.chunks_exact_mut(size).zip(x) {
            match x.place {
                None => row[0] = x.value,
                Some(place) => {
                    self.variables.add_scaled(<S as Real>::one(), place.of(&numbers), (row, degrees));
                }
            }
        }
        numbers.resize(start + outputs * size, <S as Real>::zero());
        let out = &mut numbers[start..];
        let weights = values(weights);
        let weights = MatRef::new(&weights, outputs, inputs);
        gemm(MatMut::new(out, outputs, size), false, <S as Real>::one(), weights, MatRef::new(&rows, inputs, size));
        for (row, b) in out.chunks_exact_mut(size).zip(bias) {
            row[0] += b.value;
        }
        let unit = |(k, row): (usize, &[S])| Taylor {
            value: row[0],
            place: Some(Place { space: self, start: start + k * size, degrees }),
        };
        out.chunks_exact(size).enumerate().map(unit).collect()
    }
}
