//! SOAP: Adam in the eigenbasis of Shampoo's preconditioner (Vyas et al. 2024, arXiv:2409.11321).
//!
//! For a weight matrix `W` with gradient `G` the running means of `G G^T` and `G^T G` have eigenvectors `U`, `V` (as
//! rows); Adam works on `U G V^T`, where the curvature is closer to diagonal, and its step is turned back. The
//! eigenvectors follow by a step of subspace iteration every [`EVERY`] steps.

use crate::linalg::{MatMut, MatRef, Workspace, eigh, gemm};
use crate::optimizers::orthonormal::orthonormalize;
use crate::scalar::{Real, Scalar};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Steps between two looks at the eigenvectors.
const EVERY: u32 = 10;
/// Running means after a step.
const KEEP: f64 = 0.95;
/// Sides longer than this are not turned.
const LONGEST: usize = 1024;

/// A weight matrix within the flat parameters, row-major.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Block {
    /// Offset of its first element.
    pub start: usize,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub cols: usize,
}

impl Block {
    fn range(&self) -> std::ops::Range<usize> {
        self.start..self.start + self.rows * self.cols
    }

    /// Lengths of the sides that are turned.
    fn sides(&self) -> [usize; 2] {
        [self.rows, self.cols].map(|size| if (2..=LONGEST).contains(&size) { size } else { 0 })
    }

    /// Numbers that the eigenbases of these matrices keep; `None` if they cannot be counted.
    pub(crate) fn numbers(blocks: &[Self]) -> Option<usize> {
        let of = |block: &Self| block.sides().iter().map(|size| 2 * size * size).sum();
        blocks.iter().map(of).try_fold(0_usize, |sum, numbers: usize| sum.checked_add(numbers))
    }

    /// `true` if the matrices, in order, lie side by side within this many parameters.
    pub(crate) fn fit(blocks: &[Self], parameters: usize) -> bool {
        let end = blocks.iter().try_fold(0, |end, block| {
            let next = block.rows.checked_mul(block.cols).and_then(|size| block.start.checked_add(size));
            next.filter(|_| block.start >= end)
        });
        end.is_some_and(|end| end <= parameters)
    }
}

/// Running mean of `G G^T` or `G^T G` and its eigenvectors as rows, `(size, size)`; empty if this side is not turned.
#[derive(Clone, Debug)]
struct Side<S> {
    size: usize,
    covariance: Vec<S>,
    vectors: Vec<S>,
    /// The next eigenvectors, then how they are turned against the last.
    next: Vec<S>,
    turn: Vec<S>,
}

/// Equal in what a step leaves behind.
impl<S: PartialEq> PartialEq for Side<S> {
    fn eq(&self, other: &Self) -> bool {
        (&self.covariance, &self.vectors) == (&other.covariance, &other.vectors)
    }
}

impl<S: Scalar> Side<S> {
    fn new(size: usize) -> Self {
        let zeros = || vec![<S as Real>::zero(); size * size];
        Self { size, covariance: zeros(), vectors: zeros(), next: zeros(), turn: zeros() }
    }

    fn matrix<'a>(&self, data: &'a [S]) -> MatRef<'a, S> {
        MatRef::new(data, self.size, self.size)
    }

    /// Adds `g g^T` to the running mean.
    fn observe(&mut self, g: MatRef<'_, S>, first: bool) {
        if self.size == 0 {
            return;
        }
        let (keep, take) = if first { (0.0, 1.0) } else { (KEEP, 1.0 - KEEP) };
        let keep = S::of_f64(keep);
        self.covariance.iter_mut().for_each(|c| *c *= keep);
        let size = self.size;
        gemm(MatMut::new(&mut self.covariance, size, size), true, S::of_f64(take), g, g.t());
    }

    /// Eigenvectors of the first running mean, those of large eigenvalues first.
    fn begin(&mut self) {
        let size = self.size;
        if size == 0 {
            return;
        }
        let mut values = vec![<S as Real>::zero(); size];
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
    fn follow(&mut self) {
        let size = self.size;
        if size == 0 {
            return;
        }
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

/// The eigenbases of one weight matrix.
#[derive(Clone, Debug)]
pub(crate) struct Eigenbasis<S> {
    block: Block,
    left: Side<S>,
    right: Side<S>,
    /// The matrix that was turned, and half of the way.
    turned: Vec<S>,
    half: Vec<S>,
}

/// Equal in what a step leaves behind.
impl<S: PartialEq> PartialEq for Eigenbasis<S> {
    fn eq(&self, other: &Self) -> bool {
        (self.block, &self.left, &self.right) == (other.block, &other.left, &other.right)
    }
}

impl<S: Scalar> Eigenbasis<S> {
    pub fn new(block: Block) -> Self {
        let [rows, cols] = block.sides();
        let zeros = || vec![<S as Real>::zero(); block.rows * block.cols];
        Self { block, left: Side::new(rows), right: Side::new(cols), turned: zeros(), half: zeros() }
    }

    pub fn block(&self) -> Block {
        self.block
    }

    /// Appends what a step leaves behind, both running means and eigenvectors.
    pub fn store(&self, out: &mut Vec<S>) {
        for side in [&self.left, &self.right] {
            out.extend_from_slice(&side.covariance);
            out.extend_from_slice(&side.vectors);
        }
    }

    /// Takes what [`Eigenbasis::store`] appended; returns the rest.
    pub fn load<'a>(&mut self, mut numbers: &'a [S]) -> &'a [S] {
        for side in [&mut self.left, &mut self.right] {
            for target in [&mut side.covariance, &mut side.vectors] {
                let (mine, rest) = numbers.split_at(target.len());
                target.copy_from_slice(mine);
                numbers = rest;
            }
        }
        numbers
    }

    /// `turned = left X right^T` with square matrices, where a side is turned.
    fn apply(&mut self, matrix: Option<&[S]>, left: Choice, right: Choice) {
        let Block { rows, cols, .. } = self.block;
        let one = <S as Real>::one();
        if let Some(matrix) = matrix {
            self.turned.copy_from_slice(matrix);
        }
        if self.left.size > 0 {
            let by = left.of(&self.left);
            gemm(MatMut::new(&mut self.half, rows, cols), false, one, by, MatRef::new(&self.turned, rows, cols));
        } else {
            self.half.copy_from_slice(&self.turned);
        }
        if self.right.size > 0 {
            let by = right.of(&self.right);
            gemm(MatMut::new(&mut self.turned, rows, cols), false, one, MatRef::new(&self.half, rows, cols), by.t());
        } else {
            std::mem::swap(&mut self.turned, &mut self.half);
        }
    }

    /// Takes note of a gradient and turns it into the eigenbasis.
    fn enter(&mut self, gradient: &[S], first: bool) {
        let Block { rows, cols, .. } = self.block;
        let g = MatRef::new(&gradient[self.block.range()], rows, cols);
        self.left.observe(g, first);
        self.right.observe(g.t(), first);
        if first {
            self.left.begin();
            self.right.begin();
        }
        self.apply(Some(&gradient[self.block.range()]), Choice::Vectors, Choice::Vectors);
    }

    /// Turns a direction back.
    fn leave(&mut self, direction: &[S]) {
        self.apply(Some(&direction[self.block.range()]), Choice::Inverse, Choice::Inverse);
    }

    /// Follows the eigenvectors and turns the first moment along.
    fn follow(&mut self, first_moment: &[S]) {
        self.left.follow();
        self.right.follow();
        self.apply(Some(&first_moment[self.block.range()]), Choice::Turn, Choice::Turn);
    }
}

/// By which matrix of a side to turn.
#[derive(Clone, Copy)]
enum Choice {
    Vectors,
    Inverse,
    Turn,
}

impl Choice {
    fn of<S: Scalar>(self, side: &Side<S>) -> MatRef<'_, S> {
        match self {
            Self::Vectors => side.matrix(&side.vectors),
            Self::Inverse => side.matrix(&side.vectors).t(),
            Self::Turn => side.matrix(&side.turn),
        }
    }
}

/// Turns the matrices of a gradient into their eigenbases, in place.
pub(crate) fn enter<S: Scalar>(bases: &mut [Eigenbasis<S>], gradient: &mut [S], first: bool, pool: Threads<'_>) {
    turn(bases, gradient, pool, |basis, gradient| basis.enter(gradient, first));
}

/// Turns the matrices of a direction back, in place.
pub(crate) fn leave<S: Scalar>(bases: &mut [Eigenbasis<S>], direction: &mut [S], pool: Threads<'_>) {
    turn(bases, direction, pool, Eigenbasis::leave);
}

/// Follows the eigenbases where it is time, the first moments with them.
pub(crate) fn follow<S: Scalar>(bases: &mut [Eigenbasis<S>], first_moments: &mut [S], step: u32, pool: Threads<'_>) {
    if step.is_multiple_of(EVERY) {
        turn(bases, first_moments, pool, Eigenbasis::follow);
    }
}

/// The threads to work on: a pool, or the caller's own. Never rayon's global pool, which belongs to the application.
pub(crate) type Threads<'a> = Option<&'a rayon::ThreadPool>;

fn turn<S: Scalar>(
    bases: &mut [Eigenbasis<S>],
    numbers: &mut [S],
    pool: Threads<'_>,
    work: impl Fn(&mut Eigenbasis<S>, &[S]) + Sync,
) {
    let shared = &*numbers;
    match pool {
        Some(pool) => pool.install(|| bases.par_iter_mut().for_each(|basis| work(basis, shared))),
        None => bases.iter_mut().for_each(|basis| work(basis, shared)),
    }
    for basis in bases {
        numbers[basis.block.range()].copy_from_slice(&basis.turned);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimizers::orthonormal::tests::{defect, random};
    use crate::optimizers::{Method, Moments, Update};

    #[test]
    fn a_matrix_that_is_turned_comes_back_and_eigenvectors_stay_orthonormal() {
        let block = Block { start: 3, rows: 6, cols: 4 };
        let mut bases = [Eigenbasis::new(block)];
        for step in 0..40 {
            let original = random(30, step);
            let mut gradient = original.clone();
            enter(&mut bases, &mut gradient, step == 0, None);
            assert_ne!(gradient[3..27], original[3..27]);
            leave(&mut bases, &mut gradient, None);
            for (x, y) in gradient.iter().zip(&original) {
                assert!((x - y).abs() < 1e-14, "step {step}");
            }
            follow(&mut bases, &mut gradient, 10, None);
            assert!(defect(6, &bases[0].left.vectors) < 1e-14 && defect(4, &bases[0].right.vectors) < 1e-14);
        }
    }

    #[test]
    fn numbers_of_a_checkpoint_restore_everything() {
        let matrices = [(1, 3, 2), (7, 1, 4)];
        let mut moments = Moments::<f64>::for_method(Method::Soap, 12, matrices);
        let mut weights = random(12, 1);
        let update = Update { method: Method::Soap, rate: 0.1, weight_decay: 0.0, decaying: usize::MAX, clip: 1.0 };
        for step in 0..25 {
            moments.update(&mut weights, &mut random(12, step), &update);
        }
        let stored = moments.stored();
        let (first, second, step) = (stored.first.to_vec(), stored.second.to_vec(), stored.step);
        let mut other = Moments::restore(first, second, step, &stored.blocks, &stored.bases).unwrap();
        assert_eq!(moments, other);
        let mut same = weights.clone();
        moments.update(&mut weights, &mut random(12, 99), &update);
        other.update(&mut same, &mut random(12, 99), &update);
        assert_eq!((weights, moments), (same, other));
        let far = [Block { start: 10, rows: 2, cols: 2 }];
        assert_eq!(Moments::restore(vec![0.0; 12], vec![0.0; 12], 1, &far, &[0.0; 16]), None);
    }

    /// Least squares `|A W B - C|^2 / 2` with singular values from 1 to 1e-3 on both sides, in directions that are not the
    /// axes: what Adam, which knows axes alone, is slow at.
    #[test]
    fn a_valley_across_the_axes_is_descended_faster_than_by_adam() {
        const N: usize = 8;
        let matrix = |seed| {
            let (mut u, mut v) = (random(N * N, seed), random(N * N, seed + 1));
            let scratch = &mut [0.0; N * N];
            assert!(orthonormalize(N, &mut u, scratch) && orthonormalize(N, &mut v, scratch));
            let mut a = vec![0.0; N * N];
            for (k, (u, v)) in u.chunks_exact(N).zip(v.chunks_exact(N)).enumerate() {
                let sigma = 10f64.powf(-3.0 * k as f64 / (N - 1) as f64);
                (0..N * N).for_each(|e| a[e] += sigma * u[e / N] * v[e % N]);
            }
            a
        };
        let (a, b, c) = (matrix(1), matrix(3), random(N * N, 5));
        let product = |x: MatRef<'_, f64>, y: MatRef<'_, f64>| {
            let mut out = vec![0.0; N * N];
            gemm(MatMut::new(&mut out, N, N), false, 1.0, x, y);
            out
        };
        let view = |x: &'static [f64]| MatRef::new(x, N, N);
        let (a, b) = (view(a.leak()), view(b.leak()));
        let run = |method: Method| {
            let mut moments = Moments::for_method(method, N * N, [(0, N, N)]);
            let mut weights = vec![0.0; N * N];
            let mut loss = f64::INFINITY;
            for step in 0..2000 {
                let aw = product(a, MatRef::new(&weights, N, N));
                let mut residual = product(MatRef::new(&aw, N, N), b);
                // The target is reachable: A C B.
                let ac = product(a, MatRef::new(&c, N, N));
                let target = product(MatRef::new(&ac, N, N), b);
                residual.iter_mut().zip(&target).for_each(|(r, t)| *r -= t);
                loss = residual.iter().map(|r| r * r).sum::<f64>() / 2.0;
                let left = product(a.t(), MatRef::new(&residual, N, N));
                let mut gradient = product(MatRef::new(&left, N, N), b.t());
                let rate = 1e-2 * (1.0 - f64::from(step) / 2000.0);
                moments.update(
                    &mut weights,
                    &mut gradient,
                    &Update { method, rate, weight_decay: 0.0, decaying: usize::MAX, clip: f64::INFINITY },
                );
            }
            loss
        };
        let (adam, soap) = (run(Method::Radam), run(Method::Soap));
        println!("RAdam {adam:e}, SOAP {soap:e}");
        assert!(soap < 0.1 * adam);
    }
}
