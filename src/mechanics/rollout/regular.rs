//! Constraints along a motion: where a row vanishes or comes to depend on the others, a second branch begins, and nothing says which of
//! the two the motion takes.

use super::StepFailure;
use crate::lagrangian::{Manifold, ManifoldRows, dot};
use crate::linalg::{Workspace, eigh};
use crate::scalar::{Real, Scalar};

/// The smallest singular value of the rows over the largest that it had, below which it counts as 0. Where it passes through 0 the minimum
/// is met to the rounding of the search, far below; a motion that keeps away from its branches by a thousandth has one way to go.
const BRANCH: f64 = 1e-3;
/// A step is looked into if a row turns by more than this cosine, or the singular value is below this share of the largest.
const LOOKED_INTO: (f64, f64) = (0.9, 0.3);
/// Parts of a step between which rows are compared: adaptive methods take steps in which wheels turn around.
const PARTS: usize = 8;
/// Places of a step that are looked at first, and divisions of the interval around the least of them.
const PLACES: usize = 16;
const DIVISIONS: usize = 40;

/// What is known of the rows so far.
pub(super) struct Regularity<'a, S> {
    manifold: &'a dyn Manifold<S>,
    /// 1, or -1 for a motion backwards in time.
    direction: S,
    /// Largest length of every row, and the largest of the smallest singular values of the rows in these units.
    sizes: Vec<S>,
    largest: S,
    /// State and rows at the end of the last step.
    q: Vec<S>,
    v: Vec<S>,
    matrix: Vec<S>,
    rows: ManifoldRows<S>,
}

impl<'a, S: Scalar> Regularity<'a, S> {
    /// From a start.
    pub fn new(manifold: &'a dyn Manifold<S>, (q, v): (&[S], &[S]), backwards: bool) -> Self {
        let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
        let mut known = Self {
            manifold,
            direction: if backwards { -one } else { one },
            sizes: vec![zero; manifold.names().len()],
            largest: zero,
            q: q.to_vec(),
            v: v.to_vec(),
            matrix: Vec::new(),
            rows: ManifoldRows::default(),
        };
        known.matrix = known.matrix_at(q);
        known.grow();
        known.largest = known.least(&known.matrix).0;
        known
    }

    fn matrix_at(&mut self, q: &[S]) -> Vec<S> {
        self.manifold.rows(q, &self.v, &mut self.rows);
        self.rows.matrix.clone()
    }

    fn grow(&mut self) {
        for (size, row) in self.sizes.iter_mut().zip(self.matrix.chunks_exact(self.q.len())) {
            *size = S::max(*size, Real::sqrt(dot(row, row)));
        }
    }

    /// The smallest singular value of rows over their sizes, and the row that has most part in its direction.
    fn least(&self, matrix: &[S]) -> (S, usize) {
        let (n, m, zero) = (self.q.len(), self.sizes.len(), <S as Real>::zero());
        let row = |i: usize| &matrix[i * n..(i + 1) * n];
        let unit = |i: usize| if self.sizes[i] > zero { self.sizes[i].recip() } else { zero };
        let gram: Vec<S> = (0..m * m).map(|at| dot(row(at / m), row(at % m)) * unit(at / m) * unit(at % m)).collect();
        let (mut squares, mut directions) = (vec![zero; m], vec![zero; m * m]);
        if eigh(m, &gram, &mut squares, &mut directions, &mut Workspace::new()).is_err() {
            return (S::nan(), 0);
        }
        let most = (0..m).fold(0, |most, i| if directions[i].abs() > directions[most].abs() { i } else { most });
        (Real::sqrt(S::max(squares.first().copied().unwrap_or(zero), zero)), most)
    }

    /// Takes the state at the end of a step of length `h`.
    ///
    /// # Errors
    /// [`StepFailure::Branch`] if the rows were not regular on the way.
    pub fn step(&mut self, h: S, q: &[S], v: &[S]) -> Result<(), StepFailure> {
        let n = q.len();
        let matrix = self.matrix_at(q);
        let turns = |before: &[S], after: &[S]| {
            let mut rows = before.chunks_exact(n).zip(after.chunks_exact(n));
            rows.any(|(a, b)| dot(a, b) < S::of_f64(LOOKED_INTO.0) * Real::sqrt(dot(a, a) * dot(b, b)))
        };
        let mut last = self.matrix.clone();
        let mut turned = false;
        for k in 1..PARTS {
            let place = self.place(k as f64 / PARTS as f64, h, q, v);
            let next = self.matrix_at(&place);
            turned |= turns(&last, &next);
            last = next;
        }
        turned |= turns(&last, &matrix);
        let (value, _) = self.least(&matrix);
        if turned || value < S::of_f64(LOOKED_INTO.1) * self.largest {
            self.look_into(h, q, v)?;
        }
        self.matrix = matrix;
        self.grow();
        self.largest = S::max(self.largest, value);
        self.q.copy_from_slice(q);
        self.v.copy_from_slice(v);
        Ok(())
    }

    /// Coordinates at the share `x` of a step of length `h` that ends at `(q, v)`, by Hermite's polynomial.
    fn place(&self, x: f64, h: S, q: &[S], v: &[S]) -> Vec<S> {
        let (x, one, two, signed) = (S::of_f64(x), <S as Real>::one(), S::of_f64(2.0), h * self.direction);
        let (y, all) = (one - x, x * x * (S::of_f64(3.0) - two * x));
        let at = |i: usize| self.q[i] * (one - all) + q[i] * all + signed * x * y * (self.v[i] * y - v[i] * x);
        (0..q.len()).map(at).collect()
    }

    /// Looks for the least singular value within a step.
    fn look_into(&mut self, h: S, q: &[S], v: &[S]) -> Result<(), StepFailure> {
        let signed = h * self.direction;
        let mut at = |x: f64| {
            let place = self.place(x, h, q, v);
            let matrix = self.matrix_at(&place);
            self.least(&matrix)
        };
        let width = 1.0 / PLACES as f64;
        let values: Vec<S> = (0..=PLACES).map(|k| at(k as f64 * width).0).collect();
        let lowest = (0..=PLACES).fold(0, |low, k| if values[k] < values[low] { k } else { low }) as f64 * width;
        let (mut low, mut high) = ((lowest - width).max(0.0), (lowest + width).min(1.0));
        for _ in 0..DIVISIONS {
            let third = (high - low) / 3.0;
            if at(low + third).0 < at(high - third).0 { high -= third } else { low += third }
        }
        let share = 0.5 * (low + high);
        let (value, constraint) = at(share);
        if value < S::of_f64(BRANCH) * self.largest {
            return Err(StepFailure::Branch { constraint, ahead: share * signed.to_f64() });
        }
        Ok(())
    }
}
