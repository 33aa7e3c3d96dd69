//! Taylor polynomials of a function of positions and velocities, of the second degree in each: the number that a Lagrangian is
//! evaluated on for the second derivatives of its mass matrix.
//!
//! A number holds no more than its own degrees: a constant one coefficient, a function of the positions those of the
//! positions, and what is linear in the velocities no squares of them. With `n` positions and velocities the largest numbers
//! have `((n + 1)(n + 2)/2)^2` coefficients, and all of them come out of one evaluation.

mod number;
mod polynomials;
#[cfg(test)]
mod tests;

use crate::scalar::{Real, Scalar};
use polynomials::{DEGREE, Degrees, Variables, pair};
use std::cell::RefCell;
use std::fmt;

/// Variables at a point, and the coefficients of all numbers made of them.
#[derive(Debug)]
pub(crate) struct Space<S> {
    variables: Variables,
    numbers: RefCell<Vec<S>>,
    scratch: RefCell<[Vec<S>; 3]>,
}

/// Taylor polynomial about a point: `sum c x^a`, `x` the displacements of positions and velocities.
#[derive(Clone, Copy)]
pub(crate) struct Taylor<'a, S> {
    /// Value at the point.
    value: S,
    /// The coefficients, the value first; a constant has none.
    place: Option<Place<'a, S>>,
}

#[derive(Clone, Copy)]
struct Place<'a, S> {
    space: &'a Space<S>,
    start: usize,
    degrees: Degrees,
}

impl<S: fmt::Debug> fmt::Debug for Taylor<'_, S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Taylor({:?}, {:?})", self.value, self.place.as_ref().map(|place| place.degrees))
    }
}

impl<S: Scalar> Space<S> {
    /// A space without numbers.
    pub(crate) fn new(positions: usize, velocities: usize) -> Self {
        let variables = Variables { velocities, positions };
        Self { variables, numbers: RefCell::default(), scratch: RefCell::default() }
    }

    /// Forgets all numbers but constants; keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.numbers.get_mut().clear();
    }

    /// The position `index` at `value`.
    pub(crate) fn position(&self, index: usize, value: S) -> Taylor<'_, S> {
        self.variable(Degrees { velocities: 0, positions: 1 }, 1 + index, value)
    }

    /// The velocity `index` at `value`.
    pub(crate) fn velocity(&self, index: usize, value: S) -> Taylor<'_, S> {
        self.variable(Degrees { velocities: 1, positions: 0 }, 1 + index, value)
    }

    fn variable(&self, degrees: Degrees, coefficient: usize, value: S) -> Taylor<'_, S> {
        self.number(degrees, |_, out| {
            out[0] = value;
            out[coefficient] = <S as Real>::one();
        })
    }

    /// A number whose coefficients, 0 at first, are filled in, given those of all numbers before it.
    fn number(&self, degrees: Degrees, fill: impl FnOnce(&[S], &mut [S])) -> Taylor<'_, S> {
        let mut numbers = self.numbers.borrow_mut();
        let start = numbers.len();
        numbers.resize(start + self.variables.size(degrees), <S as Real>::zero());
        let (before, out) = numbers.split_at_mut(start);
        fill(before, out);
        Taylor { value: out[0], place: Some(Place { space: self, start, degrees }) }
    }

    /// The derivative `d2/dv_i dv_j` of a number and its derivatives by the positions, into `value`, `first` `(n)` and
    /// `second` `(n, n)`.
    pub(crate) fn velocity_hessian(
        &self,
        number: Taylor<'_, S>,
        (i, j): (usize, usize),
        value: &mut S,
        first: &mut [S],
        second: &mut [S],
    ) {
        let (zero, n) = (<S as Real>::zero(), self.variables.positions);
        *value = zero;
        first.fill(zero);
        second.fill(zero);
        let Some(place) = number.place.filter(|place| place.degrees.velocities == DEGREE) else { return };
        let twice = |same: bool| if same { <S as Real>::two() } else { <S as Real>::one() };
        let factor = twice(i == j);
        let wide = self.variables.block(place.degrees);
        let numbers = self.numbers.borrow();
        let block = &numbers[place.start + pair(self.variables.velocities, i, j) * wide..][..wide];
        *value = factor * block[0];
        if wide > 1 {
            first.iter_mut().zip(&block[1..]).for_each(|(to, &c)| *to = factor * c);
        }
        if wide > 1 + n {
            for k in 0..n {
                for l in 0..=k {
                    let derivative = factor * twice(k == l) * block[pair(n, k, l)];
                    (second[k * n + l], second[l * n + k]) = (derivative, derivative);
                }
            }
        }
    }
}

impl<'a, S> Place<'a, S> {
    /// The coefficients among those of all numbers.
    fn of(self, numbers: &[S]) -> (&[S], Degrees)
    where
        S: Scalar,
    {
        (&numbers[self.start..self.start + self.space.variables.size(self.degrees)], self.degrees)
    }
}
