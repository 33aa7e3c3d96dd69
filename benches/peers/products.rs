//! The bare matrix products of a training step: `n + 11` passes through the layers, nothing between them.

use lnn::linalg::gemm;
use lnn::scalar::{MatMut, MatRef};
use lnn::scalar::{Real, Scalar};
use rayon::prelude::*;

/// States a thread treats at a time, as in a training step.
const CHUNK: usize = 64;

/// Operands of the products of a batch, one set per chunk.
pub struct Products<S> {
    n: usize,
    /// `(inputs, outputs)` of every layer but the last, whose output is one number.
    layers: Vec<(usize, usize)>,
    weights: Vec<S>,
    chunks: Vec<Operands<S>>,
    pool: rayon::ThreadPool,
}

struct Operands<S> {
    rows: usize,
    input: Vec<S>,
    output: Vec<S>,
    gradient: Vec<S>,
}

impl<S: Scalar> Products<S> {
    /// For a network of `n` coordinates and these hidden layers on a batch.
    pub fn new(n: usize, hidden: &[usize], batch: usize, threads: usize) -> Self {
        let widths: Vec<usize> = std::iter::once(2 * n).chain(hidden.iter().copied()).collect();
        let layers: Vec<(usize, usize)> = widths.windows(2).map(|w| (w[0], w[1])).collect();
        let widest = widths.iter().copied().max().unwrap_or(0);
        let size = layers.iter().map(|l| l.0 * l.1).max().unwrap_or(0);
        let some = |count: usize| (0..count).map(|k| S::of_f64((k as f64).sin())).collect::<Vec<S>>();
        let chunks = (0..batch.div_ceil(CHUNK)).map(|k| {
            let rows = CHUNK.min(batch - k * CHUNK);
            let planes = (n + 2).max(4) * rows * widest;
            Operands { rows, input: some(planes), output: some(planes), gradient: some(size) }
        });
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        Self { n, layers, weights: some(size), chunks: chunks.collect(), pool }
    }

    /// Takes all products once.
    pub fn take(&mut self) {
        let (n, layers, weights) = (self.n, &self.layers, &self.weights);
        self.pool.install(|| {
            self.chunks.par_iter_mut().for_each(|chunk| {
                for &layer in layers {
                    chunk.forward(layer, n + 2, weights);
                }
                for &layer in layers {
                    chunk.back(layer, 1, weights);
                }
                for &layer in layers {
                    chunk.forward(layer, 1, weights);
                }
                for &layer in layers {
                    chunk.weights(layer, 4);
                    chunk.back(layer, 3, weights);
                }
            });
        });
    }
}

impl<S: Scalar> Operands<S> {
    /// `output = input W^T` of so many channels.
    fn forward(&mut self, (inputs, outputs): (usize, usize), channels: usize, weights: &[S]) {
        let rows = channels * self.rows;
        let matrix = MatRef::new(weights, outputs, inputs);
        let input = MatRef::new(&self.input, rows, inputs);
        gemm(MatMut::new(&mut self.output, rows, outputs), false, <S as Real>::one(), input, matrix.t());
    }

    /// `input = output W`.
    fn back(&mut self, (inputs, outputs): (usize, usize), channels: usize, weights: &[S]) {
        let rows = channels * self.rows;
        let matrix = MatRef::new(weights, outputs, inputs);
        let output = MatRef::new(&self.output, rows, outputs);
        gemm(MatMut::new(&mut self.input, rows, inputs), false, <S as Real>::one(), output, matrix);
    }

    /// `gradient += output^T input`.
    fn weights(&mut self, (inputs, outputs): (usize, usize), channels: usize) {
        let rows = channels * self.rows;
        let output = MatRef::new(&self.output, rows, outputs).t();
        let input = MatRef::new(&self.input, rows, inputs);
        gemm(MatMut::new(&mut self.gradient, outputs, inputs), true, <S as Real>::one(), output, input);
    }
}
