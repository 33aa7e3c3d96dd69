//! Loss and parameter gradient of a batch, and the losses of a whole dataset.
//!
//! Loss of the paper: the mean of `|prediction - target|` over the `2n` components `(v, a)` of the scaled state
//! derivative, the first `n` equal by construction: half the mean absolute error of the scaled accelerations.
//!
//! A batch is cut into stripes and chunks whose sizes do not depend on the number of threads, and every sum is taken in
//! their order: the same numbers on any number of threads.

use crate::network::{Adjoint, Architecture, Chunk, Depth, Jets};
use crate::scalar::{Real, Scalar, Sum};
use crate::training::dataset::Dataset;
use crate::training::penalty::Penalty;
use rayon::prelude::*;

/// States evaluated together.
const CHUNK: usize = 64;
/// Stripes a batch is cut into at most; each has its own gradient.
const STRIPES: usize = 8;

/// What a batch came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchReport<S> {
    /// Loss in the paper's convention, without penalty, over the states that count.
    pub loss: S,
    /// Penalty with its weight.
    pub penalty: S,
    /// States whose penalty is active.
    pub penalised: usize,
    /// States left out because their mass matrix is singular.
    pub singular: usize,
    /// First state, by its row in the dataset, that failed, and why.
    pub failure: Option<Failure>,
}

/// A state that gives no acceleration.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// Its mass matrix is singular.
    #[error("mass matrix of row {row} is singular (condition number {condition:.3e})")]
    Singular {
        /// Row of the dataset.
        row: usize,
        /// Condition number, infinite if exactly singular.
        condition: f64,
    },
    /// The network gives no finite numbers there.
    #[error("network is not finite on row {row}")]
    NotFinite {
        /// Row of the dataset.
        row: usize,
    },
}

/// Evaluates batches; owns the threads and every buffer, so that a step allocates nothing after the first.
pub struct Objective<S> {
    architecture: Architecture,
    penalty: Penalty,
    pool: rayon::ThreadPool,
    stripes: Vec<Stripe<S>>,
}

/// A contiguous part of a batch with its own buffers.
struct Stripe<S> {
    chunk: Chunk<S>,
    adjoint: Adjoint<S>,
    jets: Jets<S>,
    penalty_jets: Jets<S>,
    gradient: Vec<S>,
    q: Vec<S>,
    v: Vec<S>,
    acceleration: Vec<S>,
    solved: Vec<bool>,
    inverse_scale: Vec<S>,
    residual: Sum<S>,
    penalty: Sum<S>,
    penalised: usize,
    singular: usize,
    failure: Option<Failure>,
}

impl<S: Scalar> Stripe<S> {
    fn new(architecture: &Architecture) -> Self {
        let chunk = Chunk::new(architecture);
        Self {
            adjoint: Adjoint::new(&chunk),
            chunk,
            jets: Jets::default(),
            penalty_jets: Jets::default(),
            gradient: Vec::new(),
            q: Vec::new(),
            v: Vec::new(),
            acceleration: Vec::new(),
            solved: Vec::new(),
            inverse_scale: architecture.scale.iter().map(|&s| S::of_f64(s).recip()).collect(),
            residual: Sum::default(),
            penalty: Sum::default(),
            penalised: 0,
            singular: 0,
            failure: None,
        }
    }

    fn reset(&mut self, parameters: usize) {
        self.gradient.clear();
        self.gradient.resize(parameters, <S as Real>::zero());
        (self.residual, self.penalty) = (Sum::default(), Sum::default());
        (self.penalised, self.singular, self.failure) = (0, 0, None);
    }

    /// Copies the states of these rows side by side.
    fn gather(&mut self, data: &Dataset<S>, rows: &[u32]) {
        let n = data.coordinates();
        self.q.clear();
        self.v.clear();
        for &row in rows {
            let range = row as usize * n..(row as usize + 1) * n;
            self.q.extend_from_slice(&data.q()[range.clone()]);
            self.v.extend_from_slice(&data.v()[range]);
        }
    }

    /// Loss, penalty and their gradients of one chunk; `weight` is `1/(2 n batch)`, `lambda` the penalty's over the batch.
    fn add_chunk(&mut self, weights: &[S], data: &Dataset<S>, rows: &[u32], weight: S, lambda: Option<S>) {
        self.gather(data, rows);
        self.chunk.evaluate(weights, &self.q, &self.v, Depth::Training);
        self.jets.clear(true);
        self.penalty_jets.clear(false);
        self.solve(rows);
        for (state, &row) in rows.iter().enumerate() {
            self.add_residual(data, state, row as usize, Some(weight));
        }
        if let Some(lambda) = lambda {
            self.add_penalties(lambda);
        }
        self.adjoint.add_gradient(&self.chunk, weights, &self.jets, &mut self.gradient);
        self.adjoint.add_gradient(&self.chunk, weights, &self.penalty_jets, &mut self.gradient);
    }

    /// Losses of one chunk, no gradient.
    fn add_losses(&mut self, weights: &[S], data: &Dataset<S>, rows: &[u32]) {
        self.gather(data, rows);
        self.chunk.evaluate(weights, &self.q, &self.v, Depth::Motion);
        self.solve(rows);
        for (state, &row) in rows.iter().enumerate() {
            self.add_residual(data, state, row as usize, None);
        }
    }

    /// Accelerations of the chunk, scaled; failures are noted with their rows.
    fn solve(&mut self, rows: &[u32]) {
        let n = self.chunk.coordinates();
        let count = rows.len();
        self.acceleration.resize(count * n, <S as Real>::zero());
        self.solved.clear();
        for state in 0..count {
            let range = state * n..(state + 1) * n;
            for i in range.clone() {
                self.acceleration[i] = self.chunk.dl_dq[i] - self.chunk.coriolis[i];
            }
            let matrix = &self.chunk.mass_matrix[state * n * n..(state + 1) * n * n];
            let solved = temporary::solve(n, matrix, &mut self.acceleration[range]);
            self.solved.push(solved.is_ok());
            if let Err(condition) = solved {
                let row = rows[state] as usize;
                self.singular += 1;
                self.failure.get_or_insert(match condition {
                    Some(condition) => Failure::Singular { row, condition },
                    None => Failure::NotFinite { row },
                });
            }
        }
    }

    /// Absolute residual of a state, and with `weight` its jet: `s = -lam = -M^-1 dl/da`, `t = a`.
    fn add_residual(&mut self, data: &Dataset<S>, state: usize, row: usize, weight: Option<S>) {
        if !self.solved[state] {
            return;
        }
        let n = data.coordinates();
        let a = &self.acceleration[state * n..(state + 1) * n];
        let target = &data.a()[row * n..(row + 1) * n];
        let zero = <S as Real>::zero();
        let start = self.jets.s.len();
        for i in 0..n {
            let residual = a[i] - target[i] * self.inverse_scale[i];
            self.residual.add(residual.abs());
            if let Some(weight) = weight {
                // The sign of zero is zero.
                let sign = if residual > zero {
                    weight
                } else if residual < zero {
                    -weight
                } else {
                    zero
                };
                self.jets.s.push(-sign);
            }
        }
        if weight.is_some() {
            let matrix = &self.chunk.mass_matrix[state * n * n..(state + 1) * n * n];
            let _ = temporary::solve(n, matrix, &mut self.jets.s[start..]);
            self.jets.t.extend_from_slice(a);
            self.jets.state.push(state);
        }
    }

    /// `lambda sum relu(-eigenvalue)`: one jet per negative eigenvalue.
    fn add_penalties(&mut self, lambda: S) {
        let n = self.chunk.coordinates();
        for state in 0..self.chunk.mass_matrix.len() / (n * n) {
            let matrix = &self.chunk.mass_matrix[state * n * n..(state + 1) * n * n];
            let before = self.penalty_jets.state.len();
            temporary::negative(n, matrix, |value, vector: &[S]| {
                self.penalty.add(-lambda * value);
                self.penalty_jets.state.push(state);
                self.penalty_jets.s.extend(vector.iter().map(|&u| -lambda * u));
                self.penalty_jets.t.extend_from_slice(vector);
            });
            self.penalised += usize::from(self.penalty_jets.state.len() > before);
        }
    }
}

impl<S: Scalar> Objective<S> {
    /// An objective for networks of this shape on `threads` threads.
    ///
    /// # Errors
    /// When the threads cannot be started.
    pub fn new(
        architecture: &Architecture,
        penalty: Penalty,
        threads: usize,
    ) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build()?;
        Ok(Self { architecture: architecture.clone(), penalty, pool, stripes: Vec::new() })
    }

    /// Runs `work` on every stripe of `rows`, at most [`STRIPES`] of whole chunks each.
    fn run(&mut self, rows: &[u32], work: impl Fn(&mut Stripe<S>, &[u32]) + Sync) -> usize {
        let chunks = rows.len().div_ceil(CHUNK);
        let size = chunks.div_ceil(STRIPES) * CHUNK;
        let count = rows.len().div_ceil(size);
        while self.stripes.len() < count {
            self.stripes.push(Stripe::new(&self.architecture));
        }
        let stripes = &mut self.stripes[..count];
        self.pool.install(|| {
            stripes.par_iter_mut().zip(rows.par_chunks(size)).for_each(|(stripe, rows)| work(stripe, rows));
        });
        count
    }

    /// Loss, penalty and gradient of the states `rows` of `data`; `gradient` is overwritten.
    pub fn step(&mut self, weights: &[S], data: &Dataset<S>, rows: &[u32], gradient: &mut [S]) -> BatchReport<S> {
        let count = S::of_f64(rows.len() as f64);
        let weight = (S::of_f64(2.0 * data.coordinates() as f64) * count).recip();
        let lambda = match self.penalty {
            Penalty::None => None,
            Penalty::Eigenvalue { lambda } => Some(S::of_f64(lambda) / count),
        };
        let stripes = self.run(rows, |stripe, rows| {
            stripe.reset(weights.len());
            for rows in rows.chunks(CHUNK) {
                stripe.add_chunk(weights, data, rows, weight, lambda);
            }
        });
        let stripes = &self.stripes[..stripes];
        self.pool.install(|| {
            gradient.par_chunks_mut(SUM_BLOCK).enumerate().for_each(|(k, block)| sum_gradients(stripes, k, block));
        });
        self.report(stripes.len(), rows.len(), data.coordinates())
    }

    /// Loss of a whole dataset, no gradient.
    pub fn loss(&mut self, weights: &[S], data: &Dataset<S>) -> BatchReport<S> {
        let rows: Vec<u32> = (0..data.len() as u32).collect();
        let stripes = self.run(&rows, |stripe, rows| {
            stripe.reset(0);
            for rows in rows.chunks(CHUNK) {
                stripe.add_losses(weights, data, rows);
            }
        });
        self.report(stripes, rows.len(), data.coordinates())
    }

    fn report(&self, stripes: usize, states: usize, n: usize) -> BatchReport<S> {
        let (mut residual, mut penalty) = (Sum::default(), Sum::default());
        let (mut penalised, mut singular, mut failure) = (0, 0, None);
        for stripe in &self.stripes[..stripes] {
            residual.add(stripe.residual.value());
            penalty.add(stripe.penalty.value());
            penalised += stripe.penalised;
            singular += stripe.singular;
            failure = failure.or(stripe.failure);
        }
        let loss = residual.value() / S::of_f64((2 * n * (states - singular).max(1)) as f64);
        BatchReport { loss, penalty: penalty.value(), penalised, singular, failure }
    }
}

/// Parameters summed over the stripes at a time.
const SUM_BLOCK: usize = 1 << 14;

fn sum_gradients<S: Scalar>(stripes: &[Stripe<S>], block: usize, out: &mut [S]) {
    let range = block * SUM_BLOCK..block * SUM_BLOCK + out.len();
    out.copy_from_slice(&stripes[0].gradient[range.clone()]);
    for stripe in &stripes[1..] {
        for (sum, &g) in out.iter_mut().zip(&stripe.gradient[range.clone()]) {
            *sum += g;
        }
    }
}

mod temporary {
    use crate::scalar::{Real, Scalar};
    pub fn solve<S: Scalar>(n: usize, m: &[S], x: &mut [S]) -> Result<(), Option<f64>> {
        let mut a = m.to_vec();
        for k in 0..n {
            let mut p = k;
            for i in k + 1..n {
                if a[i * n + k].abs() > a[p * n + k].abs() {
                    p = i;
                }
            }
            if !a[p * n + k].is_finite() {
                return Err(None);
            }
            if a[p * n + k].abs() <= S::EPSILON * m[0].abs() {
                return Err(Some(f64::INFINITY));
            }
            for j in 0..n {
                a.swap(k * n + j, p * n + j);
            }
            x.swap(k, p);
            for i in k + 1..n {
                let f = a[i * n + k] / a[k * n + k];
                for j in k..n {
                    let t = a[k * n + j];
                    a[i * n + j] -= f * t;
                }
                let t = x[k];
                x[i] -= f * t;
            }
        }
        for k in (0..n).rev() {
            for j in k + 1..n {
                let t = a[k * n + j] * x[j];
                x[k] -= t;
            }
            x[k] /= a[k * n + k];
        }
        if x.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(None) }
    }
    pub fn negative<S: Scalar>(n: usize, m: &[S], mut f: impl FnMut(S, &[S])) {
        if !m.iter().all(|x| x.is_finite()) {
            return;
        }
        let e = nalgebra::DMatrix::from_fn(n, n, |i, j| m[i * n + j].to_f64()).symmetric_eigen();
        for k in 0..n {
            if e.eigenvalues[k] < 0.0 {
                let u: Vec<S> = e.eigenvectors.column(k).iter().map(|&x| S::of_f64(x)).collect();
                f(S::of_f64(e.eigenvalues[k]), &u);
            }
        }
        let _ = <S as Real>::zero();
    }
}
