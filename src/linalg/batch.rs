//! Lanes: blocks of matrices side by side, and the workspace that holds them.

use super::error::{Failure, LinalgError};
use crate::scalar::{Real, Scalar};

/// Matrices per block.
pub const LANES: usize = 8;

/// One element of `W` matrices.
pub(super) type Lane<S, const W: usize> = [S; W];

/// Buffers of the batched operations, grown on first use, and the rows that failed in the last one.
#[derive(Clone, Debug, Default)]
pub struct Workspace<S> {
    /// Blocks of [`LANES`] matrices.
    pub(super) wide: Buffers<S, LANES>,
    /// Single matrices.
    pub(super) single: Buffers<S, 1>,
    /// Dense scratch of one matrix.
    pub(super) dense: Dense<S>,
    /// Right-hand sides and solutions of an inverse.
    pub(super) columns: Vec<S>,
    /// Scratch of determinants.
    pub(super) minors: Minors<S>,
    /// Lent to callers.
    vector: Vec<S>,
    failures: Vec<(usize, Failure)>,
}

/// Lane buffers: two matrices and four vectors.
#[derive(Clone, Debug)]
pub(super) struct Buffers<S, const W: usize> {
    pub matrix: Vec<Lane<S, W>>,
    pub factor: Vec<Lane<S, W>>,
    pub rhs: Vec<Lane<S, W>>,
    pub solution: Vec<Lane<S, W>>,
    pub residual: Vec<Lane<S, W>>,
    pub order: Vec<Lane<S, W>>,
}

impl<S, const W: usize> Default for Buffers<S, W> {
    fn default() -> Self {
        Self {
            matrix: Vec::new(),
            factor: Vec::new(),
            rhs: Vec::new(),
            solution: Vec::new(),
            residual: Vec::new(),
            order: Vec::new(),
        }
    }
}

impl<S: Scalar, const W: usize> Buffers<S, W> {
    /// Room for matrices of size `n`.
    pub fn reserve(&mut self, n: usize) {
        let zero = [<S as Real>::zero(); W];
        for matrix in [&mut self.matrix, &mut self.factor] {
            matrix.resize(n * n, zero);
        }
        for vector in [&mut self.rhs, &mut self.solution, &mut self.residual, &mut self.order] {
            vector.resize(n, zero);
        }
    }
}

/// Scratch of determinants and their gradients.
#[derive(Clone, Debug, Default)]
pub(super) struct Minors<S> {
    pub block: Vec<S>,
    pub values: Vec<S>,
    pub vectors: Vec<S>,
}

/// Scratch of the paths that treat one matrix at a time.
#[derive(Clone, Debug, Default)]
pub(super) struct Dense<S> {
    pub matrix: Vec<Lane<S, 1>>,
    pub scale: Vec<S>,
}

impl<S: Scalar> Workspace<S> {
    /// An empty workspace.
    pub fn new() -> Self {
        Self::default()
    }
    /// Rows that failed in the last operation and how, in ascending order.
    pub fn failures(&self) -> &[(usize, Failure)] {
        &self.failures
    }
    /// Lends a vector, to be given back after use.
    pub(crate) fn take_vector(&mut self) -> Vec<S> {
        std::mem::take(&mut self.vector)
    }
    /// Takes the vector back.
    pub(crate) fn give_vector(&mut self, vector: Vec<S>) {
        self.vector = vector;
    }
    pub(super) fn clear_failures(&mut self) {
        self.failures.clear();
    }
    pub(super) fn failures_mut(&mut self) -> &mut Vec<(usize, Failure)> {
        &mut self.failures
    }
    /// The error of the first failed row, if any.
    pub(super) fn outcome(&self) -> Result<(), LinalgError> {
        self.failures.first().map_or(Ok(()), |&(row, failure)| Err(LinalgError::of_row(row, failure)))
    }
}

/// Copies rows `start..` of a `(batch, width)` slice into lanes; lanes past the end repeat the last row.
#[inline(always)]
pub(super) fn gather<S: Scalar, const W: usize>(rows: &[S], width: usize, start: usize, lanes: &mut [Lane<S, W>]) {
    let batch = rows.len() / width;
    for l in 0..W {
        let row = (start + l).min(batch - 1);
        for (lane, &x) in lanes.iter_mut().zip(&rows[row * width..(row + 1) * width]) {
            lane[l] = x;
        }
    }
}

/// Copies lanes back into rows `start..` of a `(batch, width)` slice.
#[inline(always)]
pub(super) fn scatter<S: Scalar, const W: usize>(lanes: &[Lane<S, W>], rows: &mut [S], width: usize, start: usize) {
    for (l, row) in rows[start * width..].chunks_exact_mut(width).take(W).enumerate() {
        for (x, lane) in row.iter_mut().zip(lanes) {
            *x = lane[l];
        }
    }
}

/// Runs a kernel with sizes 2 and 3 as constants, so that their loops unroll.
macro_rules! with_size {
    ($n:expr, |$size:ident| $body:expr) => {
        match $n {
            2 => {
                let $size = 2_usize;
                $body
            }
            3 => {
                let $size = 3_usize;
                $body
            }
            $size => $body,
        }
    };
}
pub(super) use with_size;
