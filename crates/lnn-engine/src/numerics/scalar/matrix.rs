//! Views of matrices, and operations on them by a routine of each scalar.

use super::float::{AnyFloat, Foreign};
use super::{Dd, Real, Scalar, update};
use alloc::vec::Vec;

/// A matrix view over row-major storage, possibly transposed.
#[derive(Clone, Copy, Debug)]
pub struct MatRef<'a, S> {
    pub(crate) data: &'a [S],
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    pub(crate) stride: usize,
    pub(crate) transposed: bool,
}

/// A mutable matrix view over row-major storage.
#[derive(Debug)]
pub struct MatMut<'a, S> {
    pub(crate) data: &'a mut [S],
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    pub(crate) stride: usize,
}

/// Numbers a `rows x cols` row-major matrix with `stride` between its rows occupies.
fn extent(rows: usize, cols: usize, stride: usize) -> usize {
    if rows == 0 || cols == 0 { 0 } else { (rows - 1) * stride + cols }
}

impl<'a, S> MatRef<'a, S> {
    /// `rows x cols` matrix stored row after row without gaps.
    ///
    /// # Panics
    /// If `data` is shorter than `rows * cols`.
    pub fn new(data: &'a [S], rows: usize, cols: usize) -> Self {
        Self::with_stride(data, rows, cols, cols)
    }
    /// `rows x cols` matrix whose rows start `stride >= cols` apart.
    ///
    /// # Panics
    /// If `data` is too short or `stride < cols`.
    pub fn with_stride(data: &'a [S], rows: usize, cols: usize, stride: usize) -> Self {
        assert!(stride >= cols && data.len() >= extent(rows, cols, stride), "matrix view past the end of its storage");
        Self { data, rows, cols, stride, transposed: false }
    }
    /// The transpose; nothing is moved.
    #[must_use]
    pub fn t(self) -> Self {
        Self { transposed: !self.transposed, ..self }
    }
    /// The rows `from..to` of this view.
    ///
    /// # Panics
    /// Panics if the range exceeds the rows of the matrix.
    #[must_use]
    pub fn row_range(self, from: usize, to: usize) -> Self {
        assert!(from <= to && to <= self.rows(), "rows past the end of a matrix view");
        let Self { data, stride, .. } = self;
        if self.transposed {
            Self { data: &data[from.min(data.len())..], cols: to - from, ..self }
        } else {
            Self { data: &data[(from * stride).min(data.len())..], rows: to - from, ..self }
        }
    }
    /// Number of rows as seen.
    pub fn rows(&self) -> usize {
        if self.transposed { self.cols } else { self.rows }
    }
    /// Number of columns as seen.
    pub fn cols(&self) -> usize {
        if self.transposed { self.rows } else { self.cols }
    }
}

impl<'a, S> MatMut<'a, S> {
    /// `rows x cols` matrix stored row after row without gaps.
    ///
    /// # Panics
    /// If `data` is shorter than `rows * cols`.
    pub fn new(data: &'a mut [S], rows: usize, cols: usize) -> Self {
        Self::with_stride(data, rows, cols, cols)
    }
    /// `rows x cols` matrix whose rows start `stride >= cols` apart.
    ///
    /// # Panics
    /// If `data` is too short or `stride < cols`.
    pub fn with_stride(data: &'a mut [S], rows: usize, cols: usize, stride: usize) -> Self {
        assert!(stride >= cols && data.len() >= extent(rows, cols, stride), "matrix view past the end of its storage");
        Self { data, rows, cols, stride }
    }
}

/// Products and solutions of large systems, for one scalar.
///
/// With the feature `faer`, those of `f32` and `f64` are faer's, in functions that this crate compiles. Generic code calls them, so that a
/// crate with a Lagrangian of its own does not compile faer again.
pub trait Matrices: Sized {
    /// `C = alpha A B`, or `C += alpha A B` if `accumulate`; the shapes fit.
    fn product(c: MatMut<'_, Self>, accumulate: bool, alpha: Self, a: MatRef<'_, Self>, b: MatRef<'_, Self>)
    where
        Self: Scalar,
    {
        product_by_loops(c, accumulate, alpha, a, b);
    }

    /// Solves symmetric systems `A X = B` into `solutions`, `(batch, n, m)`, with the identity for `B` if there is no right-hand side;
    /// returns the rows whose matrices must be examined. `None` if this scalar has no routine.
    fn eliminate(
        _n: usize,
        _m: usize,
        _matrices: &[Self],
        _right: Option<&[Self]>,
        _solutions: &mut [Self],
    ) -> Option<Vec<usize>> {
        None
    }

    /// Eigenvalues, ascending, and eigenvectors as rows (if requested) of one symmetric matrix, `NaN` if they are not found; `false` if this
    /// scalar has no routine.
    fn eigh(_n: usize, _matrix: &[Self], _values: &mut [Self], _vectors: &mut [Self]) -> bool {
        false
    }
}

/// `C = alpha A B`, or `C += alpha A B` if `accumulate`; the shapes fit. Row `i` of `C` gathers rows of `B`.
#[inline(always)]
pub(crate) fn product_by_loops<S: Scalar>(
    c: MatMut<'_, S>,
    accumulate: bool,
    alpha: S,
    a: MatRef<'_, S>,
    b: MatRef<'_, S>,
) {
    let at = |m: &MatRef<'_, S>, i: usize, j: usize| {
        if m.transposed { m.data[j * m.stride + i] } else { m.data[i * m.stride + j] }
    };
    for i in 0..c.rows {
        let row = &mut c.data[i * c.stride..i * c.stride + c.cols];
        if !accumulate {
            row.fill(<S as Real>::zero());
        }
        for k in 0..a.cols() {
            let factor = alpha * at(&a, i, k);
            if b.transposed {
                for (j, target) in row.iter_mut().enumerate() {
                    *target += factor * b.data[j * b.stride + k];
                }
            } else {
                let source = &b.data[k * b.stride..k * b.stride + b.cols];
                update(row, source, |target, value| *target += factor * value);
            }
        }
    }
}

impl Matrices for Dd {}
impl<F: Foreign> Matrices for AnyFloat<F> {}
