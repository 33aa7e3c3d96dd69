//! Enclosure of the mass matrices of a box of states, and proofs about the eigenvalues of all of them.

use super::arena::Arena;
use super::form;
use super::form::Basis;
use super::interval::Interval;
use super::number::Number;
use super::thresholds::MOST_POLYNOMIAL_DEGREE;
use crate::lagrangian::Lagrangian;
use crate::linalg::{Workspace, eigh};
use crate::scalar::Scalar;
use std::sync::Arc;

/// A symmetric matrix `(n, n)` whose elements are forms over a box.
pub struct MatrixForms {
    pub n: usize,
    pub basis: Arc<Basis>,
    pub forms: Vec<[f64; 1]>,
    /// Bits of the axes along which to cut a box so that what is unknown may become known.
    pub blamed: u64,
}

/// Proven facts about the eigenvalues of every matrix of an enclosure.
#[derive(Clone, Debug, Default)]
pub struct Spectrum {
    /// Numbers of positive and negative eigenvalues, if they are the same everywhere and none is 0.
    pub inertia: Option<(usize, usize)>,
    /// The condition number `max |eigenvalue| / min |eigenvalue|` is nowhere below the first and nowhere above the second; `(1, inf)` if
    /// nothing is known.
    pub condition: (f64, f64),
    /// Eigenvalues in the middle, ascending, as computed: not an enclosure. Empty if the middle is not finite.
    pub middle: Vec<f64>,
    /// For every axis of the box, how much the matrix changes along it, relative to its eigenvalues.
    pub influence: Vec<f64>,
    /// The change through the distance from the polynomial; infinite if the matrix is not known.
    pub remainder: f64,
    /// Number of halvings of the box until the signs of the eigenvalues are proven in every part, as far as its polynomial can say; 0 if they
    /// are proven, infinite if the matrix is not known.
    pub halvings: f64,
    /// The axes responsible for that, see [`MatrixForms::blamed`].
    pub blamed: u64,
}

impl MatrixForms {
    /// The form of an element.
    pub fn element(&self, i: usize, j: usize) -> &[[f64; 1]] {
        let stride = self.basis.stride();
        &self.forms[(i * self.n + j) * stride..(i * self.n + j + 1) * stride]
    }

    /// Proves as much as possible.
    ///
    /// With the computed eigenvectors `u_k` of the middle as rows of `U`, `B = U M U^T` is nearly diagonal if the box is small. Where every
    /// row `k` is dominated by its diagonal, `d_k |B_kk| > sum_l d_l |B_kl|` for some `d > 0`, no matrix on the way from `B` to its
    /// diagonal is singular: the diagonal has the signs of the eigenvalues (Gershgorin), which by Sylvester's law are also those of `M`.
    /// The rounding of `U` does not affect that; for the condition number Ostrowski's theorem bounds its effect: with `|U U^T - 1| <=
    /// delta` every eigenvalue of `B` is one of `M` times a factor from `1 - delta` to `1 + delta`.
    pub fn spectrum(&self) -> Spectrum {
        let (n, stride, basis) = (self.n, self.basis.stride(), &*self.basis);
        let axes = basis.of_degree(1).len();
        let nothing = || Spectrum {
            condition: (1.0, f64::INFINITY),
            influence: vec![0.0; axes],
            remainder: f64::INFINITY,
            halvings: f64::INFINITY,
            blamed: self.blamed,
            ..Spectrum::default()
        };
        let centre: Vec<f64> = self.forms.iter().step_by(stride).map(|x| x[0]).collect();
        let (mut values, mut vectors) = (vec![0.0; n], vec![0.0; n * n]);
        let found = eigh(n, &centre, &mut values, &mut vectors, &mut Workspace::new());
        if found.is_err() || values.iter().chain(&vectors).any(|x| !x.is_finite()) {
            return nothing();
        }
        let defect = orthogonality_defect(n, &vectors);
        let mut spectrum = Spectrum { middle: values, remainder: 0.0, ..nothing() };
        if defect.is_nan() || defect >= 0.5 {
            return spectrum;
        }
        let values = &spectrum.middle;
        let largest = values.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        let weight = |k: usize| values[k].abs().max(1e-14 * largest).max(f64::MIN_POSITIVE).sqrt().recip();
        let weights: Vec<f64> = (0..n).map(weight).collect();
        let (polynomials, distance) = self.split();
        let whole = self.rotated(&vectors);
        // Growth with the sides, by degree, in the row in which it is largest.
        let mut growth = [0.0; MOST_POLYNOMIAL_DEGREE + 2];
        for k in 0..n {
            let mut row = [0.0; MOST_POLYNOMIAL_DEGREE + 2];
            for l in 0..n {
                let (element, scale) = (whole.element(k, l), weights[k] * weights[l]);
                for monomial in 1..basis.count() {
                    let (size, factors) = (scale * element[monomial][0].abs(), basis.factors(monomial));
                    row[factors.len()] += size;
                    factors.chunk_by(|a, b| a == b).for_each(|same| spectrum.influence[same[0]] += size);
                }
                let size = scale * element[stride - 1][0];
                row[basis.degree() + 1] += size;
                spectrum.remainder += size;
            }
            if row.iter().sum::<f64>() > growth.iter().sum::<f64>() {
                growth = row;
            }
        }
        // The distances element by element, or all together by their norm, which a rotation does not change.
        let turned = Interval::point(distance) * (Interval::point(1.0) + Interval::point(defect));
        let ranges = |rotated: &Self| {
            rotated.forms.chunks_exact(stride).map(|form| form::range(basis, form, 0)).collect::<Vec<_>>()
        };
        spectrum.conclude(n, &ranges(&whole), &weights, 0.0, defect);
        spectrum.conclude(n, &ranges(&polynomials.rotated(&vectors)), &weights, turned.high, defect);
        let active = spectrum.influence.iter().filter(|x| **x > 0.0).count();
        spectrum.halvings = if spectrum.inertia.is_some() { 0.0 } else { active.max(1) as f64 * halvings(&growth) };
        spectrum
    }

    /// The polynomials alone, and a bound of the norm of all matrices that remain: the largest sum of a row of distances.
    fn split(&self) -> (Self, f64) {
        let (n, stride) = (self.n, self.basis.stride());
        let mut polynomials = Self { n, basis: Arc::clone(&self.basis), forms: self.forms.clone(), blamed: 0 };
        let mut norm = 0.0;
        for row in polynomials.forms.chunks_exact_mut(n * stride) {
            let distances = row.iter_mut().skip(stride - 1).step_by(stride).map(std::mem::take);
            let sum = distances.fold(Interval::ZERO, |sum, [r]| sum + Interval::point(r)).high;
            // `NaN` counts as the largest.
            norm = if sum <= norm { norm } else { sum };
        }
        (polynomials, norm)
    }

    /// `U M U^T`.
    fn rotated(&self, u: &[f64]) -> Self {
        let (n, stride) = (self.n, self.basis.stride());
        let empty = || Self { n, basis: Arc::clone(&self.basis), forms: vec![[0.0]; n * n * stride], blamed: 0 };
        let (mut half, mut whole) = (empty(), empty());
        for k in 0..n {
            for j in 0..n {
                let out = &mut half.forms[(k * n + j) * stride..(k * n + j + 1) * stride];
                (0..n).for_each(|i| form::add_scaled(out, u[k * n + i], self.element(i, j)));
            }
        }
        for k in 0..n {
            for l in 0..n {
                let out = &mut whole.forms[(k * n + l) * stride..(k * n + l + 1) * stride];
                (0..n).for_each(|j| form::add_scaled(out, u[l * n + j], half.element(k, j)));
            }
        }
        whole
    }
}

/// Number of halvings of every side of a box until `sum_p growth_p` is below 1, if the summands shrink with their powers of the sides.
fn halvings(growth: &[f64]) -> f64 {
    let at = |side: f64| growth.iter().rev().fold(0.0, |sum, x| sum * side + x);
    // `NaN` is not below 1.
    let below = |side: f64| at(side) < 1.0;
    let (mut small, mut large) = (0.0_f64, 64.0_f64);
    if !below((-large).exp2()) {
        return f64::INFINITY;
    }
    while large - small > 0.01 {
        let middle = 0.5 * (small + large);
        *if below((-middle).exp2()) { &mut large } else { &mut small } = middle;
    }
    large
}

/// A bound of `|U U^T - 1|`, rows of `U` one after the other.
fn orthogonality_defect(n: usize, u: &[f64]) -> f64 {
    let row = |k: usize| {
        let sum = (0..n).fold(Interval::ZERO, |sum, l| {
            let start = Interval::point(if k == l { -1.0 } else { 0.0 });
            let product = (0..n).fold(start, |s, i| s + Interval::point(u[k * n + i]) * Interval::point(u[l * n + i]));
            sum + product.abs()
        });
        sum.high
    };
    (0..n).map(row).fold(0.0, f64::max)
}

impl Spectrum {
    /// Draws conclusions from the ranges of the elements of a matrix, `(n, n)`, that differs from `B` by a matrix of norm at most
    /// `distance`, and from weights `d`. Earlier conclusions are kept.
    fn conclude(&mut self, n: usize, ranges: &[Interval], weights: &[f64], distance: f64, defect: f64) {
        let diagonal = |k: usize| ranges[k * n + k];
        let distance = Interval::new(0.0, distance);
        // sum_l d_l |B_kl| / d_k is also the radius of a disc about B_kk: D^-1 B D has the eigenvalues of B.
        let disc = |k: usize| {
            let sum = (0..n).filter(|&l| l != k).fold(Interval::ZERO, |sum, l| {
                sum + Interval::point(weights[l]) * Interval::point(ranges[k * n + l].magnitude())
            });
            let radius = sum / Interval::point(weights[k]) + distance;
            diagonal(k).abs() + Interval::symmetric(radius.magnitude())
        };
        let discs: Vec<Interval> = (0..n).map(disc).collect();
        // Comparisons with `NaN` fail.
        if !discs.iter().all(|disc| disc.low > 0.0) {
            return;
        }
        let positive = (0..n).filter(|&k| diagonal(k).low > 0.0).count();
        self.inertia = Some((positive, n - positive));
        let least = discs.iter().fold(f64::INFINITY, |a, disc| a.min(disc.low));
        let most = discs.iter().fold(0.0, |a: f64, disc| a.max(disc.high));
        let one = Interval::point(1.0);
        let factor = (one + Interval::point(defect)) / (one - Interval::point(defect));
        let above = Interval::point(most) / Interval::point(least) * factor;
        // Rayleigh's quotient of u_k bounds the largest from below, |M u_k| / |u_k| the smallest from above.
        let largest = (0..n).fold(0.0, |a: f64, k| a.max((diagonal(k).abs() - distance).low));
        let column = |k: usize| (0..n).fold(distance, |sum, l| sum + ranges[k * n + l].abs()).high;
        let smallest = (0..n).map(column).fold(f64::INFINITY, f64::min);
        let below = Interval::point(largest) / Interval::point(smallest) / factor;
        self.condition = (self.condition.0.max(below.low), self.condition.1.min(above.high));
    }
}

/// A Lagrangian with its parameters, ready to be evaluated over boxes by any thread.
pub struct Source<'l, L> {
    pub lagrangian: &'l L,
    /// Intervals that contain the parameters.
    pub parameters: Vec<Interval>,
    /// Monomials of the polynomials that enclose the results.
    pub basis: Arc<Basis>,
}

/// What the search needs of a Lagrangian.
pub trait Enclose: Sync {
    /// Number of coordinates `n`.
    fn coordinates(&self) -> usize;
    /// Evaluates boxes, given as `(low, high)` of every coordinate and every velocity, one after the other.
    fn each(&self, boxes: &[&[(f64, f64)]], take: &mut dyn FnMut(usize, MatrixForms) -> bool);
}

impl<'l, L: Lagrangian> Source<'l, L> {
    /// Accepts numbers of any precision; a number that no `f64` equals is enclosed.
    pub fn new<S: Scalar>(lagrangian: &'l L, parameters: &[S]) -> Self {
        let enclosed = |x: &S| match x.parts() {
            (high, 0.0) => Interval::point(high),
            (high, low) => Interval::point(high) + Interval::point(low),
        };
        let basis = Arc::new(Basis::for_axes(2 * lagrangian.coordinates()));
        Self { lagrangian, parameters: parameters.iter().map(enclosed).collect(), basis }
    }
}

impl<L: Lagrangian> Enclose for Source<'_, L> {
    fn coordinates(&self) -> usize {
        self.lagrangian.coordinates()
    }

    fn each(&self, boxes: &[&[(f64, f64)]], take: &mut dyn FnMut(usize, MatrixForms) -> bool) {
        let n = self.lagrangian.coordinates();
        let arena = Arena::new(n, &self.basis);
        let parameters: Vec<Number<'_>> = self.parameters.iter().map(|x| Number::Constant(*x)).collect();
        for (index, bounds) in boxes.iter().enumerate() {
            arena.clear();
            if !take(index, mass_matrix(self.lagrangian, &arena, &parameters, bounds)) {
                return;
            }
        }
    }
}

/// `d2L/dv dv` over a box.
fn mass_matrix<'a, L: Lagrangian>(
    lagrangian: &L,
    arena: &'a Arena,
    parameters: &[Number<'a>],
    bounds: &[(f64, f64)],
) -> MatrixForms {
    let (n, stride) = (bounds.len() / 2, arena.basis.stride());
    let side = |(axis, &(low, high)): (usize, &(f64, f64))| {
        Number::Variable(arena, arena.variable(axis, Interval::new(low, high), axis.checked_sub(n)))
    };
    let state: Vec<Number<'a>> = bounds.iter().enumerate().map(side).collect();
    let found = lagrangian.lagrangian(parameters, &state[..n], &state[n..]);
    let mut forms = vec![[0.0]; n * n * stride];
    // The Lagrangian may be undefined in the box, or branch on a value.
    let known = found.range().is_bounded() && !arena.was_read();
    for (k, out) in forms.chunks_exact_mut(stride).enumerate() {
        match found {
            Number::Variable(arena, place) if known => {
                out.copy_from_slice(&arena.form(place, arena.second(k / n, k % n)));
            }
            Number::Constant(_) if known => {}
            _ => out.fill([f64::NAN]),
        }
    }
    MatrixForms { n, basis: Arc::clone(&arena.basis), forms, blamed: arena.blamed() }
}

/// Intervals `(n, n)` that contain the elements of the mass matrix `d2L/dv dv` of every state of a box, `(low, high)` of every coordinate
/// and every velocity; everything where the Lagrangian is not defined in the whole box, or not differentiable, such as `|v|` at 0.
///
/// Parameters are enclosed; constants in the Lagrangian's own code are the `f64` numbers that it names.
///
/// # Panics
/// Panics unless both contain `n` pairs.
#[cfg(test)]
pub(crate) fn mass_matrix_enclosure<L: Lagrangian, S: Scalar>(
    lagrangian: &L,
    parameters: &[S],
    positions: &[(f64, f64)],
    velocities: &[(f64, f64)],
) -> Vec<Interval> {
    let n = lagrangian.coordinates();
    assert!(positions.len() == n && velocities.len() == n, "expected {n} pairs of bounds for positions and velocities");
    let bounds = [positions, velocities].concat();
    let mut found = Vec::new();
    Source::new(lagrangian, parameters).each(&[&bounds], &mut |_, matrix| {
        let forms = matrix.forms.chunks_exact(matrix.basis.stride());
        found = forms.map(|form| super::form::range(&matrix.basis, form, 0)).collect();
        true
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Constant matrices, with a distance on every element.
    fn matrix(elements: &[f64], distance: f64) -> MatrixForms {
        let n = elements.len().isqrt();
        let basis = Arc::new(Basis::new(0, 1));
        MatrixForms { n, basis, forms: elements.iter().flat_map(|&x| [[x], [distance]]).collect(), blamed: 0 }
    }

    #[test]
    fn signs_and_condition_numbers_are_proven_as_far_as_they_go() {
        // Eigenvalues 1 and 3.
        let sharp = matrix(&[2.0, 1.0, 1.0, 2.0], 0.0).spectrum();
        assert_eq!(sharp.inertia, Some((2, 0)));
        assert!(sharp.condition.0 <= 3.0 && sharp.condition.1 >= 3.0, "{:?}", sharp.condition);
        assert!(sharp.condition.1 - sharp.condition.0 < 1e-13);
        // A disturbance of norm 2 * 0.45 keeps 1 positive, one of norm 2 * 0.55 does not.
        let near = matrix(&[2.0, 1.0, 1.0, 2.0], 0.45).spectrum();
        assert_eq!(near.inertia, Some((2, 0)));
        // The worst: eigenvalues 1 - 0.9 and 3.9.
        assert!(near.condition.0 <= 3.0 && near.condition.1 >= 39.0 * (1.0 - 1e-12), "{:?}", near.condition);
        assert_eq!(matrix(&[2.0, 1.0, 1.0, 2.0], 0.55).spectrum().inertia, None);
        // Eigenvalues 3 and -1; elements of very different size.
        assert_eq!(matrix(&[1.0, 2.0, 2.0, 1.0], 0.1).spectrum().inertia, Some((1, 1)));
        assert_eq!(matrix(&[1e12, 0.0, 0.0, -1e-12], 0.0).spectrum().inertia, Some((1, 1)));
        for lost in [f64::NAN, f64::INFINITY] {
            let unknown = matrix(&[2.0, 1.0, 1.0, 2.0], lost).spectrum();
            assert_eq!((unknown.inertia, unknown.condition), (None, (1.0, f64::INFINITY)));
            assert_eq!(matrix(&[lost, 0.0, 0.0, 1.0], 0.0).spectrum().inertia, None);
        }
        assert_eq!(matrix(&[0.0, 0.0, 0.0, 0.0], 0.0).spectrum().inertia, None);
    }
}
