//! Taylor polynomials of a function of positions and velocities, of second degree in each. A Lagrangian is evaluated with such numbers to
//! get the second derivatives of its mass matrix.
//!
//! A number only stores the degrees it has: a constant has one coefficient, a function of the positions only has coefficients of the
//! positions, and a number linear in the velocities has no squares of them. With `n` positions and velocities the largest numbers have `((n
//! + 1)(n + 2)/2)^2` coefficients, and one evaluation gives all of them.

mod number;

use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;

/// Variables at a point, and the coefficients of all numbers computed from them.
#[derive(Debug)]
pub(crate) struct Space<S> {
    variables: Variables,
    numbers: RefCell<Vec<S>>,
    scratch: RefCell<[Vec<S>; 3]>,
}

/// A Taylor polynomial about a point: `sum c x^a`, where `x` are the displacements of positions and velocities.
#[derive(Clone, Copy)]
pub struct Taylor<'a, S> {
    /// Value at the point.
    value: S,
    /// The location of the coefficients, the first of which is the value; `None` for a constant.
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
    /// Returns a space without numbers.
    pub(crate) fn new(positions: usize, velocities: usize) -> Self {
        let variables = Variables { velocities, positions };
        Self { variables, numbers: RefCell::default(), scratch: RefCell::default() }
    }

    /// Deletes all numbers except constants, but keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.numbers.get_mut().clear();
    }

    /// Returns the position with this index at `value`.
    pub(crate) fn position(&self, index: usize, value: S) -> Taylor<'_, S> {
        self.variable(Degrees { velocities: 0, positions: 1 }, 1 + index, value)
    }

    /// Returns the velocity with this index at `value`.
    pub(crate) fn velocity(&self, index: usize, value: S) -> Taylor<'_, S> {
        self.variable(Degrees { velocities: 1, positions: 0 }, 1 + index, value)
    }

    fn variable(&self, degrees: Degrees, coefficient: usize, value: S) -> Taylor<'_, S> {
        self.number(degrees, |_, out| {
            out[0] = value;
            out[coefficient] = <S as Real>::one();
        })
    }

    /// Adds a number; `fill` computes its coefficients, which are 0 at first, from those of all earlier numbers.
    fn number(&self, degrees: Degrees, fill: impl FnOnce(&[S], &mut [S])) -> Taylor<'_, S> {
        let mut numbers = self.numbers.borrow_mut();
        let start = numbers.len();
        numbers.resize(start + self.variables.size(degrees), <S as Real>::zero());
        let (before, out) = numbers.split_at_mut(start);
        fill(before, out);
        Taylor { value: out[0], place: Some(Place { space: self, start, degrees }) }
    }

    /// Writes the derivative `d2/dv_i dv_j` of a number and its derivatives by the positions to `value`, `first`, `(n)`, and `second`, `(n,
    /// n)`.
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
    /// Returns the coefficients of this number from those of all numbers.
    fn of(self, numbers: &[S]) -> (&[S], Degrees)
    where
        S: Scalar,
    {
        (&numbers[self.start..self.start + self.space.variables.size(self.degrees)], self.degrees)
    }
}

/// Largest degree that is kept.
const DEGREE: usize = 2;

/// Returns the number of monomials of `n` variables up to a degree of at most 2, in the order `1`, `x_i`, `x_i x_j` with `j <= i`.
fn count(n: usize, degree: usize) -> usize {
    match degree {
        0 => 1,
        1 => 1 + n,
        _ => (n + 1) * (n + 2) / 2,
    }
}

/// Returns the index of `x_i x_j`.
fn pair(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.max(j), i.min(j));
    1 + n + i * (i + 1) / 2 + j
}

/// Degrees of a polynomial in velocities and in positions, each at most 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Degrees {
    pub velocities: usize,
    pub positions: usize,
}

impl Degrees {
    /// Returns the degrees of a sum.
    pub fn of_sum(self, other: Self) -> Self {
        Self { velocities: self.velocities.max(other.velocities), positions: self.positions.max(other.positions) }
    }
    /// Returns the degrees of a product.
    pub fn of_product(self, other: Self) -> Self {
        Self {
            velocities: DEGREE.min(self.velocities + other.velocities),
            positions: DEGREE.min(self.positions + other.positions),
        }
    }
    /// Returns the degrees of a power series in this number.
    pub fn of_series(self) -> Self {
        let all = |degree: usize| if degree > 0 { DEGREE } else { 0 };
        Self { velocities: all(self.velocities), positions: all(self.positions) }
    }
    /// Returns the largest total degree of its powers that is kept.
    pub fn total(self) -> usize {
        let all = self.of_series();
        all.velocities + all.positions
    }
}

/// Numbers of variables. A polynomial consists of one block of position coefficients for each monomial of the velocities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Variables {
    pub velocities: usize,
    pub positions: usize,
}

impl Variables {
    /// Returns the number of coefficients of a polynomial.
    pub fn size(self, degrees: Degrees) -> usize {
        count(self.velocities, degrees.velocities) * self.block(degrees)
    }
    /// Returns the number of coefficients of a block.
    pub fn block(self, degrees: Degrees) -> usize {
        count(self.positions, degrees.positions)
    }

    /// Computes `out += factor a`, where `out` has at least the degrees of `a`.
    pub fn add_scaled<S: Scalar>(self, factor: S, (a, from): (&[S], Degrees), (out, to): (&mut [S], Degrees)) {
        let blocks = a.chunks_exact(self.block(from)).zip(out.chunks_exact_mut(self.block(to)));
        for (a, out) in blocks {
            out.iter_mut().zip(a).for_each(|(out, &a)| *out += factor * a);
        }
    }

    /// Computes `out = a b`, truncated to the degrees of `out`, which are at least [`Degrees::of_product`].
    pub fn multiply<S: Scalar>(
        self,
        (a, of_a): (&[S], Degrees),
        (b, of_b): (&[S], Degrees),
        (out, to): (&mut [S], Degrees),
    ) {
        out.fill(<S as Real>::zero());
        let (wide_a, wide_b, wide) = (self.block(of_a), self.block(of_b), self.block(to));
        let empty = |block: &[S]| block.iter().all(|&x| x == <S as Real>::zero());
        let n = self.velocities;
        for (p, a) in a.chunks_exact(wide_a).enumerate() {
            if empty(a) {
                continue;
            }
            // The monomials by which `p` is multiplied.
            let others = match p {
                0 => count(n, of_b.velocities),
                _ if p <= n => count(n, of_b.velocities.min(1)),
                _ => 1,
            };
            for (r, b) in b.chunks_exact(wide_b).enumerate().take(others) {
                if empty(b) {
                    continue;
                }
                let place = match (p, r) {
                    (0, place) | (place, 0) => place,
                    _ => pair(n, p - 1, r - 1),
                };
                accumulate(self.positions, a, b, &mut out[place * wide..(place + 1) * wide]);
            }
        }
    }
}

/// Computes `out += a b` for position coefficients.
fn accumulate<S: Scalar>(n: usize, a: &[S], b: &[S], out: &mut [S]) {
    let (first, second) = (a[0], b[0]);
    out.iter_mut().zip(b).for_each(|(out, &b)| *out += first * b);
    out.iter_mut().zip(a).skip(1).for_each(|(out, &a)| *out += a * second);
    if a.len() == 1 || b.len() == 1 {
        return;
    }
    let (a, b) = (&a[1..=n], &b[1..=n]);
    let mut rest = &mut out[1 + n..];
    for i in 0..n {
        let (row, after) = rest.split_at_mut(i + 1);
        for ((out, &aj), &bj) in row[..i].iter_mut().zip(a).zip(b) {
            *out += a[i] * bj + aj * b[i];
        }
        row[i] += a[i] * b[i];
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    //! Compares every function of the table with twice nested forward-mode numbers in double-double precision.

    use super::Space;
    use crate::forward::HyperDual;
    use crate::ops::{Binary, Unary};
    use crate::scalar::{Dd, Real, Scalar};

    type Nested = HyperDual<HyperDual<Dd>>;

    fn dd(x: f64) -> Dd {
        Dd::of_f64(x)
    }

    /// A function of two positions and two velocities.
    trait Function {
        fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R;
    }

    /// Returns a number near `base` that contains every kind of term.
    fn mixed<R: Real>(base: f64, q: &[R], v: &[R]) -> R {
        let c = R::of;
        c(base) + c(0.3) * q[0] + c(0.2) * q[1] * q[1] + c(0.5) * v[0] * (q[1] + c(1.0)) + c(0.1) * v[1] * v[0]
            - q[0] * q[1] * v[1]
    }

    /// A function of one mixed number.
    struct One(Unary, f64);
    impl Function for One {
        fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R {
            self.0.value(mixed(self.1, q, v))
        }
    }

    /// A function of two mixed numbers.
    struct Two(Binary);
    impl Function for Two {
        fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R {
            self.0.value(mixed(0.4, q, v), mixed(1.3, v, q))
        }
    }

    /// Functions whose arguments are of one kind, or constant.
    struct Sparse;
    impl Function for Sparse {
        fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R {
            let c = R::of;
            let (sin, cos) = (q[0] * q[1]).sin_cos();
            let powers = (c(2.0) + q[0]).powf(c(1.5)) + c(2.0).powf(v[0] + q[1]) + (c(1.0) + v[1]).powf(c(3.0));
            let branches = q[0].select(v[0] * cos, v[1]) + (c(1.0) - sin).atan2(c(2.0)) + c(2.0).atan2(v[0] - q[1]);
            let weights = [0.3, -0.2, 0.7, 0.1, 0.5, 0.4].map(c);
            let layer = R::affine(&weights, &[c(0.1), c(0.2)], &[q[0] * v[1], c(0.5), v[0].exp()]);
            let free = R::affine(&[q[0], v[1]], &[], &[v[0], q[1]]);
            powers * v[0] + branches * v[1] * v[0] + layer[0] * layer[1].tanh() + free[0] / (c(2.0) + cos)
                - c(3.0) / (c(2.0) + v[0])
        }
    }

    /// Compares derivatives by two velocities and two positions, for all pairs.
    fn check(what: &str, f: &impl Function) {
        let (q, v) = ([dd(0.25), dd(-0.125)], [dd(0.375), dd(0.5)]);
        let mut space = Space::new(2, 2);
        // Earlier numbers must not affect the result.
        f.of(&[space.position(0, q[0]), space.position(1, q[1])], &[space.velocity(0, v[0]), space.velocity(1, v[1])]);
        space.clear();
        let found = f.of(&[0, 1].map(|i| space.position(i, q[i])), &[0, 1].map(|i| space.velocity(i, v[i])));
        let unit = |on: bool| dd(if on { 1.0 } else { 0.0 });
        for (i, j) in [(0, 0), (1, 0), (1, 1)] {
            let (mut value, mut first, mut second) = (dd(0.0), [dd(0.0); 2], [dd(0.0); 4]);
            space.velocity_hessian(found, (i, j), &mut value, &mut first, &mut second);
            for (k, l) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let zero = HyperDual::lift(dd(0.0));
                let velocity = |m: usize| {
                    let [s, t] = [i, j].map(|i| HyperDual::lift(unit(m == i)));
                    Nested::new(HyperDual::lift(v[m]), s, t, zero)
                };
                let position = |m: usize| Nested::lift(HyperDual::new(q[m], unit(m == k), unit(m == l), dd(0.0)));
                let exact = f.of(&[0, 1].map(position), &[0, 1].map(velocity)).st;
                for (found, exact) in [(value, exact.value), (first[k], exact.s), (second[2 * k + l], exact.st)] {
                    let error = (found - exact).abs().to_f64();
                    assert!(error < 1e-26 * (1.0 + exact.abs().to_f64()), "{what} {i}{j} {k}{l}: {found} {exact}");
                }
            }
        }
    }

    macro_rules! rows {
        ($($name:ident $method:ident)*) => { [$(Unary::$name),*] };
    }

    #[test]
    fn functions_of_the_table_have_their_fourth_derivatives() {
        for f in crate::ops::unary_methods!(rows).into_iter().chain(Unary::MADE.iter().copied()) {
            check(&format!("{f:?}"), &One(f, 0.25));
        }
        for n in [-3, -1, 0, 1, 2, 3, 5] {
            check(&format!("power {n}"), &One(Unary::Powi(n), 0.4));
            check(&format!("power {n} of a negative number"), &One(Unary::Powi(n), -1.5));
        }
        for f in
            [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Powf, Binary::Atan2, Binary::Max, Binary::Min]
        {
            check(&format!("{f:?}"), &Two(f));
        }
        check("sparse", &Sparse);
    }

    #[test]
    fn integer_powers_are_differentiated_at_zero() {
        let space = Space::<f64>::new(1, 1);
        let v = space.velocity(0, 0.0);
        let (mut value, mut first, mut second) = (0.0, [0.0], [0.0]);
        for (power, exact) in [(v * v, 2.0), (v.powi(3), 0.0), (v.powf(Real::constant(2.0)), 2.0), (v.powi(0), 0.0)] {
            space.velocity_hessian(power * space.position(0, 3.0), (0, 0), &mut value, &mut first, &mut second);
            assert_eq!((value, first[0]), (3.0 * exact, exact));
        }
    }
}
