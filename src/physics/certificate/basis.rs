//! The monomials of the axes of a box, up to a degree.

/// Largest degree of the polynomials that enclose functions.
pub const MOST_DEGREE: usize = 3;

/// Monomials in the axes `e_1, .., e_m` up to a degree, in the order of their degrees: 1, then the axes, then their products.
#[derive(Debug)]
pub struct Basis {
    degree: usize,
    /// The first monomial of each degree, and behind the last degree the number of all.
    starts: Vec<usize>,
    /// The axes of each monomial, ascending, as often as each is a factor.
    factors: Vec<Vec<usize>>,
    /// `[i, j, k]`: monomial `i` times monomial `j` is monomial `k`.
    products: Vec<[u16; 3]>,
}

impl Basis {
    /// The degree that decides boxes of so many axes soonest: the distance from a polynomial shrinks with one power of the sides more than
    /// its degree, and the number of its coefficients grows with the axes.
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

    /// All monomials of a degree from 1 to [`MOST_DEGREE`] at most.
    pub fn new(axes: usize, degree: usize) -> Self {
        let (mut factors, mut starts) = (vec![Vec::new()], vec![0]);
        for _ in 0..degree.clamp(1, MOST_DEGREE) {
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
            // At a place whose powers are all different numbers.
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
