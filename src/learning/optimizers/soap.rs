//! SOAP: Adam in the eigenbasis of Shampoo's preconditioner (Vyas et al. 2024, arXiv:2409.11321).
//!
//! For a weight matrix `W` with gradient `G` the running means of `G G^T` and `G^T G` have eigenvectors `U`, `V` (as rows); Adam works on
//! `U G V^T`, where the curvature is closer to diagonal, and its step is rotated back. The eigenvectors are updated by a step of subspace
//! iteration every [`STEPS_PER_UPDATE`] steps.

use crate::learning::state::numbers;
use crate::linalg::{MatMut, MatRef, Workspace, eigh, gemm};
use crate::optimizers::{Part, Rule, Update};
use crate::scalar::{Real, Scalar, vectorized};
use serde::{Deserialize, Serialize};

/// Steps between two updates of the eigenvectors (called the preconditioning frequency by Vyas et al. 2024).
const STEPS_PER_UPDATE: u32 = 10;
/// Longest side of a matrix that is rotated; longer sides have no eigenvectors.
const LONGEST_SIDE: usize = 1024;

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

    /// Lengths of the sides that are rotated.
    fn sides(&self) -> [usize; 2] {
        [self.rows, self.cols].map(|size| if (2..=LONGEST_SIDE).contains(&size) { size } else { 0 })
    }

    /// Counts the numbers that the eigenbases of these matrices store; `None` if the count overflows.
    pub(crate) fn numbers(blocks: &[Self]) -> Option<usize> {
        let of = |block: &Self| block.sides().iter().map(|size| 2 * size * size).sum();
        blocks.iter().map(of).try_fold(0_usize, |sum, numbers: usize| sum.checked_add(numbers))
    }

    /// `true` if the matrices are in order, do not overlap and end within this many parameters.
    pub(crate) fn fit(blocks: &[Self], parameters: usize) -> bool {
        let end = blocks.iter().try_fold(0, |end, block| {
            let next = block.rows.checked_mul(block.cols).and_then(|size| block.start.checked_add(size));
            next.filter(|_| block.start >= end)
        });
        end.is_some_and(|end| end <= parameters)
    }
}

/// The eigenbases of one weight matrix.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
pub(crate) struct Eigenbasis<S> {
    block: Block,
    /// The side of the rows and the side of the columns.
    sides: [Side<S>; 2],
    /// Buffer for the intermediate product of a rotation; empty after deserialization, until its first use.
    #[serde(skip)]
    half: Vec<S>,
}

/// Ignores the buffers, which carry nothing from step to step.
impl<S: PartialEq> PartialEq for Eigenbasis<S> {
    fn eq(&self, other: &Self) -> bool {
        (self.block, &self.sides) == (other.block, &other.sides)
    }
}

impl<S: Scalar> Eigenbasis<S> {
    pub fn new(block: Block) -> Self {
        let half = vec![<S as Real>::zero(); block.rows * block.cols];
        Self { block, sides: block.sides().map(Side::new), half }
    }

    pub fn block(&self) -> Block {
        self.block
    }

    /// `true` if the sides match the matrix and are complete.
    pub fn is_whole(&self) -> bool {
        self.sides.iter().zip(self.block.sides()).all(|(side, size)| side.is_of(size))
    }

    /// Updates the matrix, its moments and its eigenbases.
    fn advance(&mut self, mut part: Part<'_, S>, step: &Step<S>, parallel: bool) {
        let Self { block, sides, half } = self;
        half.resize(block.rows * block.cols, <S as Real>::zero());
        let [left, right] = &mut *sides;
        let (g, first) = (MatRef::new(part.gradient, block.rows, block.cols), step.number == 1);
        both(parallel, || left.observe(g, first), || right.observe(g.t(), first));
        rotate(*block, sides, Choice::Vectors, part.gradient, half);
        part.advance(&step.rule);
        rotate(*block, sides, Choice::Inverse, part.gradient, half);
        if step.number.is_multiple_of(STEPS_PER_UPDATE) {
            let [left, right] = &mut *sides;
            both(parallel, || left.update_basis(), || right.update_basis());
            rotate(*block, sides, Choice::Turn, part.first, half);
        }
        part.apply();
    }
}

/// The matrices that rotate a side.
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

/// Computes `X = L X R^T`, with a square matrix for each side that is rotated; the buffer `half` is as long as `X`.
fn rotate<S: Scalar>(block: Block, [left, right]: &[Side<S>; 2], choice: Choice, x: &mut [S], half: &mut [S]) {
    let Block { rows, cols, .. } = block;
    let one = <S as Real>::one();
    if left.size > 0 {
        gemm(MatMut::new(half, rows, cols), false, one, choice.of(left), MatRef::new(x, rows, cols));
    } else {
        half.copy_from_slice(x);
    }
    if right.size > 0 {
        gemm(MatMut::new(x, rows, cols), false, one, MatRef::new(half, rows, cols), choice.of(right).t());
    } else {
        x.copy_from_slice(half);
    }
}

/// The thread pool to work on, or `None` for the caller's thread. Never rayon's global pool, which belongs to the application.
pub(crate) type Threads<'a> = Option<&'a rayon::ThreadPool>;

/// Runs both closures, in parallel if the caller runs in a pool.
fn both(parallel: bool, a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if parallel {
        rayon::join(a, b);
    } else {
        a();
        b();
    }
}

/// One step of all parameters.
pub(super) struct Step<S> {
    /// Number of the step, counted from 1.
    number: u32,
    rule: Rule<S>,
}

impl<S: Scalar> Step<S> {
    pub fn new(update: &Update, number: u32) -> Self {
        Self { number, rule: Rule::new(update, number) }
    }

    /// Updates all parameters: matrices in their `bases`, all others element by element.
    ///
    /// The result does not depend on the threads.
    pub fn take(&self, mut part: Part<'_, S>, bases: &mut [Eigenbasis<S>], parallel: bool) {
        match bases {
            [] => {
                part.advance(&self.rule);
                part.apply();
            }
            [basis] => {
                let range = basis.block.range();
                let (before, rest) = part.split(range.start);
                let (matrix, after) = rest.split(range.end);
                self.take(before, &mut [], parallel);
                basis.advance(matrix, self, parallel);
                self.take(after, &mut [], parallel);
            }
            _ => {
                let (bases, more) = bases.split_at_mut(bases.len() / 2);
                let (part, rest) = part.split(more[0].block.start);
                both(parallel, || self.take(part, bases, parallel), || self.take(rest, more, parallel));
            }
        }
    }
}

/// Decay rate of the running means of `G G^T` and `G^T G` (beta of Shampoo in Vyas et al. 2024).
const COVARIANCE_DECAY: f64 = 0.95;
/// Number of rows in a block when only the lower triangle of a product is computed.
const ROWS_AT_ONCE: usize = 32;

/// Running mean of `G G^T` or `G^T G` and its eigenvectors as rows, `(size, size)`; empty if this side is not rotated.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
pub(super) struct Side<S> {
    pub size: usize,
    /// Lower triangle of the running mean; the upper triangle is only valid while the eigenvectors are updated.
    #[serde(with = "numbers")]
    pub covariance: Vec<S>,
    #[serde(with = "numbers")]
    pub vectors: Vec<S>,
    /// Buffer for the next eigenvectors, then for their rotation relative to the last ones; empty after deserialization until the next
    /// update.
    #[serde(skip)]
    next: Vec<S>,
    #[serde(skip)]
    pub turn: Vec<S>,
}

/// Ignores the buffers, which carry nothing from step to step.
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

    /// `true` if the side has length `size` and is complete.
    pub fn is_of(&self, size: usize) -> bool {
        self.size == size && [&self.covariance, &self.vectors].iter().all(|numbers| numbers.len() == size * size)
    }

    pub fn matrix<'a>(&self, data: &'a [S]) -> MatRef<'a, S> {
        MatRef::new(data, self.size, self.size)
    }

    /// Adds `g g^T` to the running mean; the first call also computes the first eigenvectors.
    pub fn observe(&mut self, g: MatRef<'_, S>, first: bool) {
        if self.size == 0 {
            return;
        }
        let (keep, take) = if first { (0.0, 1.0) } else { (COVARIANCE_DECAY, 1.0 - COVARIANCE_DECAY) };
        let keep = S::of_f64(keep);
        self.covariance.iter_mut().for_each(|c| *c *= keep);
        let size = self.size;
        for start in (0..size).step_by(ROWS_AT_ONCE) {
            let end = (start + ROWS_AT_ONCE).min(size);
            let rows = MatMut::with_stride(&mut self.covariance[start * size..], end - start, end, size);
            gemm(rows, true, S::of_f64(take), g.row_range(start, end), g.row_range(0, end).t());
        }
        if first {
            self.begin();
        }
    }

    /// Copies the lower triangle of the running mean to the upper one.
    fn complete(&mut self) {
        let size = self.size;
        for i in 0..size {
            for j in 0..i {
                self.covariance[j * size + i] = self.covariance[i * size + j];
            }
        }
    }

    /// Computes the eigenvectors of the first running mean, sorted by descending eigenvalue.
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

    /// Performs one step of subspace iteration; `turn` becomes the product of the new vectors and the transposed old ones. Does nothing if
    /// the mean is not finite.
    pub fn update_basis(&mut self) {
        let size = self.size;
        if size == 0 {
            return;
        }
        self.next.resize(size * size, <S as Real>::zero());
        self.turn.resize(size * size, <S as Real>::zero());
        self.complete();
        let trace = self.covariance.iter().step_by(size + 1).fold(<S as Real>::zero(), |sum, &c| sum + c);
        // The shift keeps eigenvectors fixed whose eigenvalues are lost in rounding.
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

/// Computes `out = a b` for square matrices.
fn product<S: Scalar>(size: usize, out: &mut [S], a: &[S], b: MatRef<'_, S>) {
    gemm(MatMut::new(out, size, size), false, <S as Real>::one(), MatRef::new(a, size, size), b);
}

/// Number of rows in a block of the orthonormalization.
const ORTHONORMAL_ROWS: usize = 16;

/// Orthonormalizes the rows by blocks: each block is orthogonalized against all rows before it by matrix products, then within itself, and
/// all of this is done twice (Giraud, Langou, Rozložník 2005: twice is enough; for blocks Barlow, Smoktunowicz 2013); `false` if a row
/// vanishes or is not finite.
///
/// The buffer `scratch` is as long as `rows`.
fn orthonormalize<S: Scalar>(size: usize, rows: &mut [S], scratch: &mut [S]) -> bool {
    let one = <S as Real>::one();
    for start in (0..size).step_by(ORTHONORMAL_ROWS) {
        let (before, rest) = rows.split_at_mut(start * size);
        let count = ORTHONORMAL_ROWS.min(size - start);
        let block = &mut rest[..count * size];
        if !normalize(size, block) {
            return false;
        }
        for _ in 0..2 {
            if start > 0 {
                let (before, along) = (MatRef::new(before, start, size), &mut scratch[..count * start]);
                let now = MatRef::new(block, count, size);
                gemm(MatMut::new(along, count, start), false, one, now, before.t());
                let along = MatRef::new(along, count, start);
                gemm(MatMut::new(block, count, size), true, -one, along, before);
            }
            if !orthonormalize_within(size, block) {
                return false;
            }
        }
    }
    true
}

/// Normalizes every row to length 1; `false` if a row vanishes or is not finite.
fn normalize<S: Scalar>(size: usize, rows: &mut [S]) -> bool {
    rows.chunks_exact_mut(size).all(|row| {
        let scale = norm(row).recip();
        row.iter_mut().for_each(|x| *x *= scale);
        scale.is_finite()
    })
}

/// Orthonormalizes a few rows, one after the other.
fn orthonormalize_within<S: Scalar>(size: usize, rows: &mut [S]) -> bool {
    vectorized(
        #[inline(always)]
        || {
            for i in 0..rows.len() / size {
                let (before, rest) = rows.split_at_mut(i * size);
                let row = &mut rest[..size];
                for other in before.chunks_exact(size) {
                    let along = dot(row, other);
                    row.iter_mut().zip(other).for_each(|(x, &y)| *x -= along * y);
                }
                let scale = norm(row).recip();
                if !scale.is_finite() {
                    return false;
                }
                row.iter_mut().for_each(|x| *x *= scale);
            }
            true
        },
    )
}

#[inline(always)]
fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    const LANES: usize = 16;
    let mut sums = [<S as Real>::zero(); LANES];
    let (mut left, mut right) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    while let (Some(a), Some(b)) = (left.next(), right.next()) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    let rest = left.remainder().iter().zip(right.remainder());
    let rest = rest.fold(<S as Real>::zero(), |sum, (&a, &b)| sum + a * b);
    sums.iter().fold(rest, |sum, &x| sum + x)
}

#[inline(always)]
fn norm<S: Scalar>(a: &[S]) -> S {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::state::{from_bytes, to_bytes};
    use crate::optimizers::{Method, Moments};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const PLAIN: Update =
        Update { method: Method::Soap, rate: 0.1, weight_decay: 0.0, decaying: usize::MAX, clip: f64::INFINITY };

    /// Rotates `x` by the basis `choice` of the first matrix.
    fn rotated(moments: &Moments<f64>, choice: Choice, x: &[f64]) -> Vec<f64> {
        let basis = &moments.bases[0];
        let (mut x, mut half) = (x.to_vec(), vec![0.0; x.len()]);
        rotate(basis.block, &basis.sides, choice, &mut x, &mut half);
        x
    }

    fn near(a: &[f64], b: &[f64], error: f64) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < error)
    }

    #[test]
    fn a_matrix_that_is_turned_comes_back_and_eigenvectors_stay_orthonormal() {
        let mut moments = Moments::for_method(Method::Soap, 30, [(3, 6, 4)]);
        let mut weights = random(30, 99);
        for step in 0..60 {
            moments.update(&mut weights, &mut random(30, step), &PLAIN);
            let original = random(24, 100 + step);
            let there = rotated(&moments, Choice::Vectors, &original);
            assert!(!near(&there, &original, 0.1));
            assert!(near(&rotated(&moments, Choice::Inverse, &there), &original, 1e-14), "step {step}");
            let [left, right] = &moments.bases[0].sides;
            assert!(defect(6, &left.vectors) < 1e-14 && defect(4, &right.vectors) < 1e-14);
        }
    }

    /// The first moment, rotated back, equals the running mean of the gradients.
    #[test]
    fn moments_follow_their_eigenbasis() {
        let mut moments = Moments::for_method(Method::Soap, 30, [(3, 6, 4)]);
        let (mut weights, mut mean) = (random(30, 99), vec![0.0; 30]);
        for step in 1..=41 {
            let gradient = random(30, step);
            mean.iter_mut().zip(&gradient).for_each(|(m, g)| *m = 0.95 * *m + 0.05 * g);
            moments.update(&mut weights, &mut gradient.clone(), &PLAIN);
            let first = rotated(&moments, Choice::Inverse, &moments.first[3..27]);
            assert!(near(&first, &mean[3..27], 1e-13), "step {step}");
            assert!(near(&moments.first[..3], &mean[..3], 1e-14) && near(&moments.first[27..], &mean[27..], 1e-14));
        }
    }

    #[test]
    fn any_number_of_threads_takes_the_same_steps() {
        let matrices = [(5, 40, 3), (130, 40, 40), (1735, 33, 40), (3060, 1, 33)];
        let run = |pool: Threads<'_>| {
            let mut moments = Moments::for_method(Method::Soap, 3100, matrices);
            let mut weights: Vec<f32> = random(3100, 99).into_iter().map(|x| x as f32).collect();
            for step in 0..25 {
                let mut gradient: Vec<f32> = random(3100, step).into_iter().map(|x| x as f32).collect();
                moments.update_on(pool, &mut weights, &mut gradient, &PLAIN);
            }
            (weights, moments)
        };
        let alone = run(None);
        for threads in 1..=3 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(run(Some(&pool)) == alone, "{threads} threads");
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
        let mut other: Moments<f64> = from_bytes(&to_bytes(&moments).unwrap()).unwrap();
        assert!(other == moments && other.fit(12) && !other.fit(13));
        let mut same = weights.clone();
        moments.update(&mut weights, &mut random(12, 99), &update);
        other.update(&mut same, &mut random(12, 99), &update);
        assert!(weights == same && moments == other);
        moments.bases[0].block.start = 10;
        assert!(!moments.fit(12));
        moments.bases[0] = Eigenbasis::new(Block { start: 1, rows: 3, cols: 2 });
        moments.bases[0].sides[0].vectors.pop();
        assert!(!moments.fit(12));
    }

    /// Least squares `|A W B - C|^2 / 2` with singular values from 1 to 1e-3 on both sides, in directions that are not the axes: slow for
    /// Adam, which only scales along the axes.
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

    #[test]
    fn a_running_mean_of_squares_is_made_by_half() {
        let (size, other) = (70, 5);
        let mut side = Side::new(size);
        let mut mean = vec![0.0; size * size];
        for step in 0..3 {
            let numbers = random(size * other, step);
            let g = MatRef::new(&numbers, size, other);
            side.observe(g, step == 0);
            let keep = if step == 0 { 0.0 } else { COVARIANCE_DECAY };
            mean.iter_mut().for_each(|c| *c *= keep);
            gemm(MatMut::new(&mut mean, size, size), true, 1.0 - keep, g, g.t());
        }
        // The triangle above the diagonal is not updated at every step.
        assert_ne!(side.covariance[size - 1], side.covariance[(size - 1) * size]);
        side.complete();
        assert!(side.covariance.iter().zip(&mean).all(|(a, b)| (a - b).abs() < 1e-14));
    }

    fn random(count: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    /// Largest element of `A A^T - 1`, which measures how far the rows are from orthonormal.
    fn defect(size: usize, rows: &[f64]) -> f64 {
        let pairs = (0..size).flat_map(|i| (0..size).map(move |j| (i, j)));
        let of = |(i, j): (usize, usize)| {
            let product = dot(&rows[i * size..][..size], &rows[j * size..][..size]);
            (product - f64::from(u8::from(i == j))).abs()
        };
        pairs.map(of).fold(0.0, f64::max)
    }

    #[test]
    fn rows_become_orthonormal_however_nearly_dependent_they_are() {
        // Sizes below one block of rows and above several.
        for size in [7, 20, 50] {
            let mut rows = random(size * size, 1);
            for k in 1..size {
                for i in 0..size {
                    rows[k * size + i] = rows[i] + 1e-9 * rows[k * size + i];
                }
            }
            let first = rows[..size].to_vec();
            assert!(orthonormalize(size, &mut rows, &mut vec![0.0; size * size]));
            assert!(defect(size, &rows) < 20.0 * f64::EPSILON);
            let length = norm(&first);
            assert!(first.iter().zip(&rows).all(|(x, y)| (x / length - y).abs() < 1e-14));
        }
        assert!(!orthonormalize(2, &mut [1.0, 0.0, f64::NAN, 1.0], &mut [0.0; 4]));
        assert!(!orthonormalize(2, &mut [0.0; 4], &mut [0.0; 4]));
    }
}
