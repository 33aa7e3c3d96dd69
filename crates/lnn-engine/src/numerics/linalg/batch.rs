//! Lanes: blocks of matrices side by side, and the workspace that holds them.

use super::{Failure, LinalgError};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Matrices per block.
pub const LANES: usize = 8;

/// One element of `W` matrices.
pub(super) type Lane<S, const W: usize> = [S; W];

/// Buffers of the batched operations, grown on first use, and the rows that failed in the last one.
#[derive(Clone, Debug, Default)]
pub struct Workspace<S> {
    /// A block of matrices too large for the stack.
    pub(super) block: Buffer<S>,
    /// Scratch memory for the second pass over a block.
    pub(super) second: Retry<S>,
    /// Scratch of determinants.
    pub(super) minors: Minors<S>,
    /// Scratch memory for callers.
    vector: Vec<S>,
    failures: Vec<(usize, Failure)>,
}

/// Numbers on the boundary of a cache line, as the widest vector instructions prefer.
#[derive(Clone, Debug, Default)]
pub(crate) struct Buffer<S> {
    numbers: Vec<S>,
}

/// Bytes of a cache line.
const LINE: usize = 64;

impl<S: Scalar> Buffer<S> {
    /// The first `count` lanes, with the numbers of their last use.
    pub fn lanes<const W: usize>(&mut self, count: usize) -> &mut [Lane<S, W>] {
        let spare = LINE / size_of::<S>();
        if self.numbers.len() < count * W + spare {
            self.numbers.resize(count * W + spare, <S as Real>::zero());
        }
        let start = self.numbers.as_ptr().align_offset(LINE).min(spare);
        self.numbers[start..start + count * W].as_chunks_mut().0
    }
}

/// Scratch of rows that need more than one elimination.
#[derive(Clone, Debug, Default)]
pub(super) struct Retry<S> {
    /// A block of matrices.
    pub block: Buffer<S>,
    /// Solutions of the systems.
    pub solution: Buffer<S>,
    /// One matrix.
    pub dense: Dense<S>,
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
    /// The matrix.
    pub matrix: Vec<S>,
    /// Powers of two that scale its rows.
    pub scale: Vec<S>,
    /// Lanes made of it.
    pub lanes: Buffer<S>,
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
        core::mem::take(&mut self.vector)
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
    /// The three parts that a solver uses at the same time.
    pub(super) fn parts(&mut self) -> (&mut Buffer<S>, &mut Retry<S>, &mut Vec<(usize, Failure)>) {
        (&mut self.block, &mut self.second, &mut self.failures)
    }
    /// The error of the first failed row, if any.
    pub(super) fn outcome(&self) -> Result<(), LinalgError> {
        self.failures.first().map_or(Ok(()), |&(row, failure)| Err(LinalgError::of_row(row, failure)))
    }
}

/// The rows `start..start + W` of a batch; lanes past its end repeat the last row.
#[inline(always)]
pub(super) fn rows<S, const W: usize>(batch: &[S], width: usize, start: usize) -> [&[S]; W] {
    let last = batch.len() / width - 1;
    let mut rows = [&batch[..width]; W];
    for l in 0..W {
        let row = (start + l).min(last);
        rows[l] = &batch[row * width..][..width];
    }
    rows
}

/// Element `e` of every row.
#[inline(always)]
pub(super) fn across<S: Copy, const W: usize>(rows: &[&[S]; W], e: usize) -> Lane<S, W> {
    let mut lane = [rows[0][e]; W];
    for l in 1..W {
        lane[l] = rows[l][e];
    }
    lane
}

/// A choice that never compiles to a branch: branching lanes do not become vector instructions.
#[inline(always)]
pub(super) fn select<S>(condition: bool, chosen: S, otherwise: S) -> S {
    core::hint::select_unpredictable(condition, chosen, otherwise)
}

/// Lanes on the boundary of a cache line.
#[repr(align(64))]
pub(super) struct Aligned<T>(pub T);

/// `true` if loops of known length pay: for wider numbers the arithmetic dominates.
pub(crate) const fn constant_sizes<S>() -> bool {
    size_of::<S>() <= size_of::<f64>()
}

/// Calls `$body` with `$lanes` lanes of storage, small sizes as constants with the storage on the stack.
///
/// `$n` is the size inside of `$count` and `$body`.
macro_rules! with_size {
    (($scalar:ty, $width:ident) $size:expr, $buffer:expr, |$n:ident| $count:expr, |$lanes:ident| $body:expr) => {{
        macro_rules! constant {
            ($literal:literal) => {{
                #[allow(non_upper_case_globals)]
                const $n: usize = $literal;
                let mut storage = Aligned([[<$scalar as Real>::zero(); $width]; $count]);
                let $lanes = &mut storage.0[..];
                $body
            }};
        }
        match $size {
            2 if const { super::batch::constant_sizes::<$scalar>() } => constant!(2),
            3 if const { super::batch::constant_sizes::<$scalar>() } => constant!(3),
            4 if const { super::batch::constant_sizes::<$scalar>() } => constant!(4),
            $n => {
                let $lanes = $buffer.lanes::<$width>($count);
                $body
            }
        }
    }};
}
pub(super) use with_size;
