//! Forms: functions on a box as a polynomial and a bound of the distance from it (Taylor models, Makino and Berz 2003).
//!
//! A form over a box with the axes `e_k` from -1 to 1 is a slice `[c_0, .., c_m, r]`, one coefficient per monomial of a [`Basis`]:
//! everywhere on the box the function lies within `r` of the polynomial. Numbers are rounded to nearest, and a bound of the rounding error
//! is added to `r`: a sum or product `x` is off by at most `EPSILON |x| / 2`, and at least twice that is added to `r`, which also covers the
//! rounding of this addition itself.
//!
//! The forms of `W` functions lie side by side, so that vector instructions work on all of them.

use super::function::Derivatives;
use super::interval::Interval;
use super::thresholds::{MOST_POLYNOMIAL_DEGREE, MOST_POLYNOMIAL_DISTANCE, UNDERFLOW};

const EPSILON: f64 = f64::EPSILON;

/// A sum of numbers that are not negative, rounded up by more than its own rounding lost.
#[inline(always)]
fn raised(x: f64) -> f64 {
    x * (1.0 + 256.0 * EPSILON) + UNDERFLOW
}

/// Sums of the absolute values, side by side.
#[inline(always)]
fn size<const W: usize>(a: &[[f64; W]]) -> [f64; W] {
    let mut sum = [0.0; W];
    for a in a {
        for l in 0..W {
            sum[l] += a[l].abs();
        }
    }
    sum
}

/// `true` for functions that are all 0.
#[inline(always)]
pub fn is_zero<const W: usize>(a: &[[f64; W]]) -> bool {
    a.iter().all(|a| a.iter().all(|x| *x == 0.0))
}

/// Largest distances from the values in the middle of the box, rounded up.
#[inline(always)]
pub fn deviation<const W: usize>(a: &[[f64; W]]) -> [f64; W] {
    size(&a[1..]).map(|sum| sum * (1.0 + (a.len() as f64 + 2.0) * EPSILON))
}

/// An interval of all values of one of the functions on the box.
#[inline]
pub fn range<const W: usize>(basis: &Basis, a: &[[f64; W]], lane: usize) -> Interval {
    let distance = a[a.len() - 1][lane];
    let (mut below, mut above) = (distance, distance);
    for (k, c) in (1..basis.count()).map(|k| (k, a[k][lane])) {
        // `NaN` goes to `above`, and the ends then have no order.
        if !basis.is_square(k) {
            below += c.abs();
            above += c.abs();
        } else if c < 0.0 {
            below -= c;
        } else {
            above += c;
        }
    }
    let grown = |x: f64| x * (1.0 + (a.len() as f64 + 2.0) * EPSILON);
    Interval::outward(a[0][lane] - grown(below), a[0][lane] + grown(above))
}

/// Makes one of the functions a constant within the interval.
#[inline]
pub fn set_constant<const W: usize>(out: &mut [[f64; W]], lane: usize, value: Interval) {
    out.iter_mut().for_each(|c| c[lane] = 0.0);
    out[0][lane] = value.middle();
    out[out.len() - 1][lane] = value.radius();
}

/// `out += s a`.
#[inline(always)]
pub fn add_scaled<const W: usize>(out: &mut [[f64; W]], s: f64, a: &[[f64; W]]) {
    if is_zero(a) {
        return;
    }
    let m = a.len() - 1;
    let mut charge = [0.0; W];
    for (out, a) in out[..m].iter_mut().zip(&a[..m]) {
        for l in 0..W {
            let term = s * a[l];
            out[l] += term;
            charge[l] += term.abs() + out[l].abs();
        }
    }
    for l in 0..W {
        out[m][l] = raised(out[m][l] + s.abs() * a[m][l] + EPSILON * charge[l]);
    }
}

/// `out += s a` for a factor that is known to lie in an interval.
#[inline(always)]
pub fn add_multiple<const W: usize>(out: &mut [[f64; W]], s: Interval, a: &[[f64; W]]) {
    add_scaled(out, s.middle(), a);
    let spread = s.radius();
    if spread != 0.0 && !is_zero(a) {
        let (m, distance) = (a.len() - 1, deviation(a));
        for l in 0..W {
            out[m][l] = raised(out[m][l] + spread * (a[0][l].abs() + distance[l]));
        }
    }
}

/// `out += a b`; the products of monomials above the degree, each at most 1, are added to the distance.
///
/// A coefficient is a sum of at most as many products as there are monomials, which charges for all of them together.
#[inline(always)]
pub fn add_product<const W: usize>(basis: &Basis, out: &mut [[f64; W]], a: &[[f64; W]], b: &[[f64; W]]) {
    if is_zero(a) || is_zero(b) {
        return;
    }
    let (m, degree) = (basis.count(), basis.degree());
    let (mut of_a, mut of_b) = ([[0.0; W]; MOST_POLYNOMIAL_DEGREE + 1], [[0.0; W]; MOST_POLYNOMIAL_DEGREE + 1]);
    for p in 0..=degree {
        of_a[p] = size(&a[basis.of_degree(p)]);
        of_b[p] = size(&b[basis.of_degree(p)]);
    }
    let before = size(&out[..m]);
    for &[i, j, k] in basis.products() {
        let (a, b, out) = (&a[usize::from(i)], &b[usize::from(j)], &mut out[usize::from(k)]);
        for l in 0..W {
            out[l] += a[l] * b[l];
        }
    }
    let share = (m as f64 + 8.0) * EPSILON;
    for l in 0..W {
        let mut above = 0.0;
        let (mut all_a, mut all_b) = (0.0, 0.0);
        for p in 0..=degree {
            all_a += of_a[p][l];
            all_b += of_b[p][l];
            // Degrees of `b` that make more than the degree of the basis with `p`.
            for q in degree + 1 - p..=degree {
                above += of_a[p][l] * of_b[q][l];
            }
        }
        let (ra, rb) = (a[m][l], b[m][l]);
        let spread = above + all_a * rb + ra * all_b + ra * rb;
        out[m][l] = raised(out[m][l] + spread + share * (before[l] + all_a * all_b));
    }
}

/// Taylor's formula for functions side by side: `sum_p c_p w^p`, where `w` is the deviation of the argument from its value in the middle.
pub struct Expansion<const W: usize> {
    /// Coefficients.
    value: [[f64; W]; MOST_POLYNOMIAL_DEGREE + 1],
    /// Bounds of the errors of the coefficients.
    spread: [[f64; W]; MOST_POLYNOMIAL_DEGREE + 1],
    /// Everything that the functions can be on the box.
    whole: [Interval; W],
}

impl<const W: usize> Expansion<W> {
    /// Functions that are 0.
    pub const ZERO: Self = Self {
        value: [[0.0; W]; MOST_POLYNOMIAL_DEGREE + 1],
        spread: [[0.0; W]; MOST_POLYNOMIAL_DEGREE + 1],
        whole: [Interval::ZERO; W],
    };

    /// The `order`-th derivative of a function for one of the arguments: `at` are the derivatives in the middle, `over` those over the range of
    /// the argument, which is at most `distance` away from there.
    pub fn set(
        &mut self,
        lane: usize,
        (at, over): (&Derivatives, &Derivatives),
        distance: f64,
        (order, degree): (usize, usize),
    ) {
        let power = Interval::point(distance).power(degree as i32 + 1).high;
        // For an even degree the remainder has the sign of an odd power.
        let power = if degree % 2 == 0 { Interval::symmetric(power) } else { Interval::new(0.0, power) };
        // Exact where nothing is to be rounded.
        let divided = |x: Interval, by: f64| if by == 1.0 || x == Interval::ZERO { x } else { x / Interval::point(by) };
        let mut factorial = 1.0;
        for p in 0..=degree {
            factorial *= p.max(1) as f64;
            let mut coefficient = divided(at[order + p], factorial);
            if p == 0 {
                let below: f64 = (1..=degree + 1).map(|p| p as f64).product();
                let rest = divided(over[order + degree + 1] * power, below);
                coefficient = if rest == Interval::ZERO { at[order] } else { at[order] + rest };
            }
            (self.value[p][lane], self.spread[p][lane]) = (coefficient.middle(), coefficient.radius());
        }
        self.whole[lane] = over[order];
    }

    /// Writes the forms, given the forms of the powers `w`, `w^2`, .. of the argument. Writes a constant with the range of a function where
    /// that is not much wider than the distance from the polynomial.
    #[inline(always)]
    pub fn write(&self, basis: &Basis, out: &mut [[f64; W]], powers: &[[f64; W]]) {
        let m = basis.count();
        let (mut spread, mut charge) = (self.spread[0], [0.0; W]);
        out[0] = self.value[0];
        for (p, power) in (1..).zip(powers.chunks_exact(m + 1)) {
            let (c, off) = (&self.value[p], &self.spread[p]);
            // The power has no monomials of a lower degree.
            let first = basis.of_degree(p).start;
            for (out, power) in out[first..m].iter_mut().zip(&power[first..m]) {
                for l in 0..W {
                    out[l] += c[l] * power[l];
                }
            }
            let sizes = size(&power[first..m]);
            for l in 0..W {
                spread[l] += c[l].abs() * power[m][l] + off[l] * (sizes[l] + power[m][l]);
                charge[l] += c[l].abs() * sizes[l];
            }
        }
        for l in 0..W {
            out[m][l] = raised(spread[l] + 8.0 * EPSILON * charge[l]);
            // A polynomial keeps the dependences between functions, as long as the distance from it is small relative to the range; `NaN`
            // never is.
            let whole = self.whole[l];
            let worthwhile = out[m][l] <= MOST_POLYNOMIAL_DISTANCE * whole.radius();
            if whole.is_bounded() && !worthwhile {
                set_constant(out, l, whole);
            }
        }
    }
}

/// Monomials in the axes `e_1, .., e_m` up to a degree, in the order of their degrees: 1, then the axes, then their products.
#[derive(Debug)]
pub struct Basis {
    degree: usize,
    /// The first monomial of each degree, followed by the number of all monomials.
    starts: Vec<usize>,
    /// The axes of each monomial, ascending, as often as each is a factor.
    factors: Vec<Vec<usize>>,
    /// `[i, j, k]`: monomial `i` times monomial `j` is monomial `k`.
    products: Vec<[u16; 3]>,
}

impl Basis {
    /// The degree that decides boxes with this number of axes soonest: the distance from a polynomial shrinks with one power of the sides
    /// more than its degree, and the number of its coefficients grows with the axes.
    pub fn for_axes(axes: usize) -> Self {
        Self::new(
            axes,
            if axes <= 4 {
                3
            } else if axes <= 8 {
                2
            } else {
                1
            },
        )
    }

    /// All monomials of a degree from 1 to [`MOST_POLYNOMIAL_DEGREE`] at most.
    pub fn new(axes: usize, degree: usize) -> Self {
        let (mut factors, mut starts) = (vec![Vec::new()], vec![0]);
        for _ in 0..degree.clamp(1, MOST_POLYNOMIAL_DEGREE) {
            let first = starts[starts.len() - 1];
            starts.push(factors.len());
            for k in first..factors.len() {
                let longer = |axis: usize| factors[k].iter().copied().chain([axis]).collect::<Vec<usize>>();
                let next: Vec<Vec<usize>> = (factors[k].last().copied().unwrap_or(0)..axes).map(longer).collect();
                factors.extend(next);
            }
        }
        starts.push(factors.len());
        let mut found = Self { degree: starts.len() - 2, starts, factors, products: Vec::new() };
        found.products = (0..found.count()).flat_map(|i| found.products_with(i)).collect();
        found
    }

    /// The products of monomial `i` that are not above the degree.
    fn products_with(&self, i: usize) -> Vec<[u16; 3]> {
        let room = self.starts[self.degree - self.factors[i].len() + 1];
        let product = |j: usize| {
            let mut both = [self.factors[i].as_slice(), &self.factors[j]].concat();
            both.sort_unstable();
            let k = self.factors.iter().position(|factors| *factors == both)?;
            Some([i, j, k].map(|index| index as u16))
        };
        (0..room).filter_map(product).collect()
    }

    /// Degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.degree
    }
    /// Number of monomials.
    pub fn count(&self) -> usize {
        self.factors.len()
    }
    /// Numbers of a form: its coefficients and its distance.
    pub fn stride(&self) -> usize {
        self.count() + 1
    }
    /// The monomials of a degree.
    pub fn of_degree(&self, degree: usize) -> std::ops::Range<usize> {
        self.starts[degree]..self.starts[degree + 1]
    }
    /// The axes of a monomial, ascending, as often as each is a factor.
    pub fn factors(&self, monomial: usize) -> &[usize] {
        &self.factors[monomial]
    }
    /// `[i, j, k]`: monomial `i` times monomial `j` is monomial `k`; all products that are not above the degree.
    pub fn products(&self) -> &[[u16; 3]] {
        &self.products
    }
    /// `true` for a monomial of even powers alone, which is nowhere negative.
    pub fn is_square(&self, monomial: usize) -> bool {
        self.factors[monomial].chunk_by(|a, b| a == b).all(|power| power.len() % 2 == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn monomials_are_complete_and_their_products_are_right() {
        for (axes, degree, count) in [(0, 1, 1), (4, 1, 5), (4, 2, 15), (4, 3, 35), (8, 2, 45), (2, 3, 10)] {
            let basis = Basis::new(axes, degree);
            assert_eq!((basis.count(), basis.stride(), basis.degree()), (count, count + 1, degree));
            for axis in 0..axes {
                assert_eq!(basis.factors(1 + axis), [axis]);
            }
            // At a position where all monomials differ.
            let place: Vec<f64> = (0..axes).map(|axis| [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0][axis]).collect();
            let value = |k: u16| basis.factors(usize::from(k)).iter().map(|&axis| place[axis]).product::<f64>();
            assert!(basis.products().iter().all(|&[i, j, k]| value(i) * value(j) == value(k)));
            let pairs = (0..=degree).flat_map(|p| (0..=degree - p).map(move |q| (p, q)));
            let expected: usize = pairs.map(|(p, q)| basis.of_degree(p).len() * basis.of_degree(q).len()).sum();
            assert_eq!(basis.products().len(), expected);
            let even = |k: usize| {
                basis.factors(k).iter().all(|a| basis.factors(k).iter().filter(|b| *b == a).count() % 2 == 0)
            };
            assert!((0..count).all(|k| basis.is_square(k) == even(k)));
        }
        assert_eq!(Basis::for_axes(64).count(), 65);
    }
}
