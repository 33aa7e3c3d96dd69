//! Calls of block operations while a program is recorded.

use super::BlockOp;
use super::activation::{Jet, JetFunction, JetKind};
use super::affine::Affine;
use super::eigen::Eigen;
use super::solve::Solve;
use crate::scalar::{Real, Scalar};
use crate::tape::error::TapeError;
use crate::tape::program::{Node, Recorder, Tracer};
use std::ops::Range;
use std::sync::Arc;

/// A block of a program while it is recorded: `rows x channels` numbers.
#[derive(Clone, Copy, Debug)]
pub struct Block<'t, S> {
    recorder: &'t Recorder<S>,
    first: u32,
    rows: usize,
    channels: usize,
}

impl<'t, S: Scalar> Block<'t, S> {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }
    /// One number of the block; a `NaN` constant past its end. Costs nothing.
    pub fn get(&self, row: usize, channel: usize) -> Tracer<'t, S> {
        if row >= self.rows || channel >= self.channels {
            let expected = self.rows * self.channels;
            self.recorder.latch(TapeError::Block { what: "extract", expected, found: row * self.channels + channel });
            return Tracer::constant(S::NAN);
        }
        self.recorder.tracer(self.first + (row * self.channels + channel) as u32)
    }
}

impl<S: Scalar> Recorder<S> {
    fn block(&self, op: BlockOp<S>, rows: usize, channels: usize) -> Block<'_, S> {
        if rows * channels == 0 {
            self.latch(TapeError::Block { what: "block", expected: 1, found: 0 });
        }
        Block { recorder: self, first: self.row(Node::Block(op)), rows, channels }
    }
    /// Notes a shape error and answers with a block of `NaN`.
    fn unfit(&self, what: &'static str, expected: usize, found: usize, rows: usize, channels: usize) -> Block<'_, S> {
        self.latch(TapeError::Block { what, expected, found });
        self.pack(&vec![Tracer::constant(S::NAN); rows * channels], channels)
    }
    fn owns(&self, block: &Block<'_, S>) {
        if !std::ptr::eq(self, block.recorder) {
            self.latch(TapeError::MixedTapes);
            block.recorder.latch(TapeError::MixedTapes);
        }
    }

    /// Puts numbers into a block, `(rows, channels)` row-major.
    pub fn pack(&self, numbers: &[Tracer<'_, S>], channels: usize) -> Block<'_, S> {
        let rows = numbers.iter().map(|&number| self.row_of(number)).collect();
        if channels == 0 || !numbers.len().is_multiple_of(channels) {
            self.latch(TapeError::Block { what: "pack", expected: channels, found: numbers.len() });
        }
        self.block(BlockOp::Pack(rows), numbers.len() / channels.max(1), channels)
    }

    /// `W X + b`: `W` `(outputs, X.rows)` row-major from parameter `weights` on, `b` (channel 0 only) from parameter
    /// `bias` on, if any.
    pub fn affine(&self, x: Block<'_, S>, outputs: usize, weights: usize, bias: Option<usize>) -> Block<'_, S> {
        self.owns(&x);
        let (rows, channels) = (x.rows, x.channels);
        let end = (weights + outputs * rows).max(bias.map_or(0, |bias| bias + outputs));
        if end > self.parameters() {
            return self.unfit("parameters of an affine map", end, self.parameters(), outputs, channels);
        }
        let op = Affine { input: x.first, inputs: rows, outputs, channels, weights, bias };
        self.block(BlockOp::Affine(op), outputs, channels)
    }

    /// `f` on every row of a jet.
    pub fn jet(&self, x: Block<'_, S>, kind: JetKind, function: Arc<dyn JetFunction<S>>) -> Block<'_, S> {
        self.owns(&x);
        if kind.channels() != x.channels {
            return self.unfit("channels of a jet", kind.channels(), x.channels, x.rows, x.channels);
        }
        let op = Jet { function, kind, rows: x.rows, input: x.first };
        self.block(BlockOp::Jet(op), x.rows, x.channels)
    }

    /// `a = M^-1 r`, `M` `(n, n)` row-major, by LU with partial pivoting and one refinement
    /// ([`linalg::solve`](crate::linalg::solve)).
    ///
    /// A lane whose matrix is singular to working precision, or not finite, is `NaN`. The verdict on a matrix with a
    /// tiny pivot takes it for symmetric (a mass matrix); other matrices are solved as well.
    pub fn solve<'t>(&'t self, matrix: &[Tracer<'_, S>], right: &[Tracer<'_, S>]) -> Vec<Tracer<'t, S>> {
        let n = right.len();
        let solution = if matrix.len() == n * n {
            let (matrix, right) = (self.pack(matrix, 1).first, self.pack(right, 1).first);
            self.block(BlockOp::Solve(Solve { n, matrix, right }), n, 1)
        } else {
            self.unfit("matrix of a solve", n * n, matrix.len(), n, 1)
        };
        numbers(&solution, 0..n)
    }

    /// Eigenvalues (ascending, `n`) and eigenvectors (`(n, n)` row-major, vector `k` in column `k`, its component of
    /// largest size positive) of the symmetric part of `M` `(n, n)`.
    ///
    /// Gradients of functions of the eigenvalues that are symmetric in repeated ones are right there too. Adjoints of
    /// the vectors leave out pairs whose gap is below `sqrt(eps)` times the largest eigenvalue.
    pub fn symmetric_eigen<'t>(
        &'t self,
        n: usize,
        matrix: &[Tracer<'_, S>],
    ) -> (Vec<Tracer<'t, S>>, Vec<Tracer<'t, S>>) {
        let rows = n * (n + 1);
        let block = if matrix.len() == n * n {
            let matrix = self.pack(matrix, 1).first;
            self.block(BlockOp::Eigen(Eigen { n, matrix }), rows, 1)
        } else {
            self.unfit("matrix of an eigendecomposition", n * n, matrix.len(), rows, 1)
        };
        (numbers(&block, 0..n), numbers(&block, n..rows))
    }
}

/// Rows of a block with one channel, as numbers.
fn numbers<'t, S: Scalar>(block: &Block<'t, S>, rows: Range<usize>) -> Vec<Tracer<'t, S>> {
    rows.map(|row| block.get(row, 0)).collect()
}
