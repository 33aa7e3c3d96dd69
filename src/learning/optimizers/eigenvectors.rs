//! Eigenvectors of a running mean of squares, as SOAP turns one side of a weight matrix by them.

use crate::linalg::{MatMut, MatRef, Workspace, eigh, gemm};
use crate::optimizers::orthonormal::orthonormalize;
use crate::scalar::{Real, Scalar};
use crate::storage::container::state::numbers;
use serde::{Deserialize, Serialize};

/// Running means after a step.
const KEEP: f64 = 0.95;
/// Rows of a square that are multiplied at once, up to the last column that lies on the diagonal.
const ROWS: usize = 32;

/// Running mean of `G G^T` or `G^T G` and its eigenvectors as rows, `(size, size)`; empty if this side is not turned.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
pub(super) struct Side<S> {
    pub size: usize,
    /// Up to its diagonal; beyond it lie numbers of the last look at the eigenvectors.
    #[serde(with = "numbers")]
    pub covariance: Vec<S>,
    #[serde(with = "numbers")]
    pub vectors: Vec<S>,
    /// The next eigenvectors, then how they are turned against the last; empty after they were read, until they are looked for.
    #[serde(skip)]
    next: Vec<S>,
    #[serde(skip)]
    pub turn: Vec<S>,
}

/// Equal in what a step leaves behind.
impl<S: PartialEq> PartialEq for Side<S> {
    fn eq(&self, other: &Self) -> bool {
        (&self.covariance, &self.vectors) == (&other.covariance, &other.vectors)
    }
}

impl<S: Scalar> Side<S> {
    pub fn new(size: usize) -> Self {
        let zeros = || vec![<S as Real>::zero(); size * size];
        Self { size, covariance: zeros(), vectors: zeros(), next: zeros(), turn: zeros() }
    }

    /// `true` if this is a side of `size`, with all its numbers.
    pub fn is_of(&self, size: usize) -> bool {
        self.size == size && [&self.covariance, &self.vectors].iter().all(|numbers| numbers.len() == size * size)
    }

    pub fn matrix<'a>(&self, data: &'a [S]) -> MatRef<'a, S> {
        MatRef::new(data, self.size, self.size)
    }

    /// Adds `g g^T` to the running mean; the first one gives the first eigenvectors.
    pub fn observe(&mut self, g: MatRef<'_, S>, first: bool) {
        if self.size == 0 {
            return;
        }
        let (keep, take) = if first { (0.0, 1.0) } else { (KEEP, 1.0 - KEEP) };
        let keep = S::of_f64(keep);
        self.covariance.iter_mut().for_each(|c| *c *= keep);
        let size = self.size;
        for start in (0..size).step_by(ROWS) {
            let end = (start + ROWS).min(size);
            let rows = MatMut::with_stride(&mut self.covariance[start * size..], end - start, end, size);
            gemm(rows, true, S::of_f64(take), g.row_range(start, end), g.row_range(0, end).t());
        }
        if first {
            self.begin();
        }
    }

    /// Completes the running mean beyond its diagonal.
    fn complete(&mut self) {
        let size = self.size;
        for i in 0..size {
            for j in 0..i {
                self.covariance[j * size + i] = self.covariance[i * size + j];
            }
        }
    }

    /// Eigenvectors of the first running mean, those of large eigenvalues first.
    fn begin(&mut self) {
        let size = self.size;
        self.complete();
        let mut values = vec![<S as Real>::zero(); size];
        self.next.resize(size * size, <S as Real>::zero());
        let done = eigh(size, &self.covariance, &mut values, &mut self.next, &mut Workspace::new());
        for (k, vector) in self.vectors.chunks_exact_mut(size).enumerate() {
            match done {
                Ok(()) => vector.copy_from_slice(&self.next[(size - 1 - k) * size..][..size]),
                Err(_) => (0..size).for_each(|i| vector[i] = S::of_f64(f64::from(u8::from(i == k)))),
            }
        }
    }

    /// One step of subspace iteration; `turn` becomes new vectors times old ones transposed. Nothing changes where the
    /// mean is not finite.
    pub fn update_basis(&mut self) {
        let size = self.size;
        if size == 0 {
            return;
        }
        self.next.resize(size * size, <S as Real>::zero());
        self.turn.resize(size * size, <S as Real>::zero());
        self.complete();
        let trace = self.covariance.iter().step_by(size + 1).fold(<S as Real>::zero(), |sum, &c| sum + c);
        // Vectors of eigenvalues that are lost in rounding stay where they are.
        let shift = S::epsilon() * trace + S::min_positive();
        product(size, &mut self.next, &self.vectors, MatRef::new(&self.covariance, size, size));
        for (next, &vector) in self.next.iter_mut().zip(&self.vectors) {
            *next += shift * vector;
        }
        if !orthonormalize(size, &mut self.next, &mut self.turn) {
            self.next.copy_from_slice(&self.vectors);
        }
        product(size, &mut self.turn, &self.next, MatRef::new(&self.vectors, size, size).t());
        std::mem::swap(&mut self.vectors, &mut self.next);
    }
}

/// `out = a b` of square matrices.
fn product<S: Scalar>(size: usize, out: &mut [S], a: &[S], b: MatRef<'_, S>) {
    gemm(MatMut::new(out, size, size), false, <S as Real>::one(), MatRef::new(a, size, size), b);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimizers::orthonormal::tests::random;

    #[test]
    fn a_running_mean_of_squares_is_made_by_half() {
        let (size, other) = (70, 5);
        let mut side = Side::new(size);
        let mut mean = vec![0.0; size * size];
        for step in 0..3 {
            let numbers = random(size * other, step);
            let g = MatRef::new(&numbers, size, other);
            side.observe(g, step == 0);
            let keep = if step == 0 { 0.0 } else { KEEP };
            mean.iter_mut().for_each(|c| *c *= keep);
            gemm(MatMut::new(&mut mean, size, size), true, 1.0 - keep, g, g.t());
        }
        // What lies beyond the diagonal is not made at every step.
        assert_ne!(side.covariance[size - 1], side.covariance[(size - 1) * size]);
        side.complete();
        assert!(side.covariance.iter().zip(&mean).all(|(a, b)| (a - b).abs() < 1e-14));
    }
}
