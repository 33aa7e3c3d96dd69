//! Working space of block operations, and the way between rows and batches of small matrices.

use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar};
use crate::tape::program::{LANES, Row};

/// Working space shared by the block operations of a program.
#[derive(Clone, Debug)]
pub(in crate::tape) struct Scratch<S> {
    pub(super) numbers: Vec<S>,
    pub(super) workspace: Workspace<S>,
}

impl<S: Scalar> Scratch<S> {
    /// Room for `size` numbers.
    pub(in crate::tape) fn new(size: usize) -> Self {
        Self { numbers: vec![<S as Real>::zero(); size], workspace: Workspace::new() }
    }
}

/// Rows to a batch: `batch` `(LANES, rows)`.
pub(super) fn gather<S: Scalar>(rows: &[Row<S>], batch: &mut [S]) {
    let width = rows.len();
    for (k, row) in rows.iter().enumerate() {
        for (l, &value) in row.iter().enumerate() {
            batch[l * width + k] = value;
        }
    }
}

/// A batch `(LANES, rows)` to rows.
pub(super) fn scatter<S: Scalar>(batch: &[S], rows: &mut [Row<S>]) {
    let width = rows.len();
    for (k, row) in rows.iter_mut().enumerate() {
        for l in 0..LANES {
            row[l] = batch[l * width + k];
        }
    }
}
