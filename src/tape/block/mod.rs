//! Block operations: many rows at once, each with its own adjoint rule.
//!
//! A block is a matrix `rows x (channels * lanes)` stored row by row. Channel 0 holds values, the others the tangents
//! of a forward jet ([`JetKind`]); an affine map is one matrix product for all channels and lanes.

mod activation;
mod affine;
mod eigen;
mod record;
mod scratch;
mod solve;

pub use activation::{JetFunction, JetKind};
pub use record::Block;
pub(super) use scratch::Scratch;

use super::program::{PARAMETERS, Row, Sweep};
use crate::scalar::Scalar;
use std::sync::Arc;

/// A block operation on rows; a block is named by its first row.
#[derive(Clone, Debug)]
pub(super) enum BlockOp<S> {
    /// Copies rows side by side.
    Pack(Vec<u32>),
    /// `W X + b`, the bias for channel 0 only.
    Affine(affine::Affine),
    /// A function and its derivatives on every row of a jet.
    Jet(activation::Jet<S>),
    /// `M a = r`.
    Solve(solve::Solve),
    /// Eigenvalues and eigenvectors of a symmetric matrix.
    Eigen(eigen::Eigen),
}

impl<S> BlockOp<S> {
    /// Rows that it fills.
    pub(super) fn rows(&self) -> usize {
        match self {
            Self::Pack(rows) => rows.len(),
            Self::Affine(op) => op.outputs * op.channels,
            Self::Jet(op) => op.rows * op.kind.channels(),
            Self::Solve(op) => op.n,
            Self::Eigen(op) => op.n * (op.n + 1),
        }
    }
    /// Visits the rows that it reads; the first row of a block stands for the block.
    pub(super) fn operands(&self, mut visit: impl FnMut(u32)) {
        match self {
            Self::Pack(rows) => rows.iter().copied().for_each(visit),
            Self::Affine(op) => visit(op.input),
            Self::Jet(op) => visit(op.input),
            Self::Solve(op) => [op.matrix, op.right].into_iter().for_each(visit),
            Self::Eigen(op) => visit(op.matrix),
        }
    }
    /// The same operation on renumbered rows.
    pub(super) fn renumbered(&self, to: impl Fn(u32) -> u32) -> Self {
        match self {
            Self::Pack(rows) => Self::Pack(rows.iter().map(|&row| to(row)).collect()),
            Self::Affine(op) => Self::Affine(affine::Affine { input: to(op.input), ..*op }),
            Self::Jet(op) => Self::Jet(activation::Jet {
                function: Arc::clone(&op.function),
                kind: op.kind,
                rows: op.rows,
                input: to(op.input),
            }),
            Self::Solve(op) => Self::Solve(solve::Solve { matrix: to(op.matrix), right: to(op.right), ..*op }),
            Self::Eigen(op) => Self::Eigen(eigen::Eigen { matrix: to(op.matrix), ..*op }),
        }
    }
    /// Whether it reads parameters itself.
    pub(super) fn has_parameters(&self) -> bool {
        matches!(self, Self::Affine(_))
    }
    /// Numbers of working space.
    pub(super) fn scratch(&self) -> usize {
        match self {
            Self::Solve(op) => op.scratch(),
            Self::Eigen(op) => op.scratch(),
            _ => 0,
        }
    }
}

impl<S: Scalar> BlockOp<S> {
    /// Fills the rows from `out` on.
    #[inline(never)]
    pub(super) fn forward(
        &self,
        uniform: &[Row<S>],
        rows: &mut [Row<S>],
        out: usize,
        parameters: &[S],
        scratch: &mut Scratch<S>,
    ) {
        let base = uniform.len();
        let (before, after) = rows.split_at_mut(out);
        let block = |first: u32, count: usize| {
            let first = first as usize - base;
            &before[first..first + count]
        };
        match self {
            Self::Pack(sources) => {
                for (target, &source) in after.iter_mut().zip(sources) {
                    let source = source as usize;
                    *target = if source < base { uniform[source] } else { before[source - base] };
                }
            }
            Self::Affine(op) => {
                op.forward(block(op.input, op.inputs * op.channels), parameters, &mut after[..self.rows()]);
            }
            Self::Jet(op) => op.forward(block(op.input, self.rows()), &mut after[..self.rows()]),
            Self::Solve(op) => {
                op.forward(block(op.matrix, op.n * op.n), block(op.right, op.n), &mut after[..op.n], scratch);
            }
            Self::Eigen(op) => op.forward(block(op.matrix, op.n * op.n), &mut after[..self.rows()], scratch),
        }
    }

    /// Adds to the adjoints of the rows it read, where they are asked for.
    #[inline(never)]
    pub(super) fn reverse(&self, sweep: &mut Sweep<'_, S>, out: usize) {
        let base = sweep.uniform.len();
        let (before, after) = sweep.adjoints.split_at_mut(out);
        let adjoint = &after[..self.rows()];
        let value = &sweep.rows[out..out + self.rows()];
        let range = |first: u32, count: usize| first as usize - base..first as usize - base + count;
        let wanted = |row: u32| sweep.reach[row as usize] & sweep.wanted != 0;
        match self {
            Self::Pack(sources) => {
                for (weight, &source) in adjoint.iter().zip(sources) {
                    if !wanted(source) {
                        continue;
                    }
                    let source = source as usize;
                    let target = match source {
                        _ if source < base => &mut sweep.uniform_adjoints[source],
                        _ => &mut before[source - base],
                    };
                    for (sum, &weight) in target.iter_mut().zip(weight) {
                        *sum += weight;
                    }
                }
            }
            Self::Affine(op) => {
                let input = range(op.input, op.inputs * op.channels);
                let x = &sweep.rows[input.clone()];
                if wanted(op.input) {
                    op.reverse_input(sweep.parameters, adjoint, &mut before[input]);
                }
                if sweep.wanted & PARAMETERS != 0 {
                    op.reverse_parameters(x, adjoint, sweep.parameter_adjoints);
                }
            }
            Self::Jet(op) => {
                let input = range(op.input, self.rows());
                op.reverse(&sweep.rows[input.clone()], adjoint, &mut before[input]);
            }
            Self::Solve(op) => {
                let (matrix, right) = (range(op.matrix, op.n * op.n), range(op.right, op.n));
                let wanted = [wanted(op.matrix), wanted(op.right)];
                op.reverse(&sweep.rows[matrix.clone()], value, adjoint, before, [matrix, right], wanted, sweep.scratch);
            }
            Self::Eigen(op) => {
                op.reverse(value, adjoint, &mut before[range(op.matrix, op.n * op.n)], sweep.scratch);
            }
        }
    }
}
