//! Products of few rows with a transposed matrix, `C = alpha A B^T`, by dot products: the rows of both are contiguous, so that
//! nothing is packed. A blocked product packs `B^T` whatever the number of rows, which takes longer than to multiply few.

use crate::scalar::{Scalar, Simd, WithSimd, in_vectors};

/// Rows up to which dot products are faster than a blocked product.
pub(super) const FEW_ROWS: usize = 8;

/// Rows of a matrix, `stride` numbers apart.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a, S> {
    pub numbers: &'a [S],
    pub stride: usize,
}

impl<'a, S> Rows<'a, S> {
    /// `R` rows of so many numbers, from `first` on.
    #[inline(always)]
    fn rows<const R: usize>(&self, first: usize, length: usize) -> [&'a [S]; R] {
        let mut rows: [&[S]; R] = [&[]; R];
        for r in 0..R {
            rows[r] = &self.numbers[(first + r) * self.stride..][..length];
        }
        rows
    }
}

/// `C = alpha A B^T`, or `C += alpha A B^T`, with `A` `(rows, inner)`, `B` `(columns, inner)` and `C` `(rows, columns)`.
pub(super) struct SmallBatch<'a, S> {
    pub a: Rows<'a, S>,
    pub b: Rows<'a, S>,
    pub c: &'a mut [S],
    /// Numbers between two rows of `C`.
    pub stride: usize,
    /// Rows, columns, inner.
    pub shape: (usize, usize, usize),
    pub alpha: S,
    pub accumulate: bool,
}

impl<S: Scalar> SmallBatch<'_, S> {
    /// Computes the product.
    pub(super) fn run(self) {
        in_vectors(self);
    }

    /// All columns of `R` rows from `row` on, `O` at a time; the number of rows.
    #[inline(always)]
    fn rows<V: Simd, const R: usize, const O: usize>(&mut self, simd: V, row: usize) -> usize {
        let whole = self.shape.1 / O * O;
        let mut column = 0;
        while column < whole {
            self.block::<V, R, O>(simd, row, column);
            column += O;
        }
        while column < self.shape.1 {
            self.block::<V, R, 1>(simd, row, column);
            column += 1;
        }
        R
    }

    /// A block of `R` rows and `O` columns of `C`.
    #[inline(always)]
    fn block<V: Simd, const R: usize, const O: usize>(&mut self, simd: V, row: usize, column: usize) {
        let inner = self.shape.2;
        let sums = S::dots::<V, R, O>(simd, self.a.rows(row, inner), self.b.rows(column, inner));
        for o in 0..O {
            for r in 0..R {
                let to = &mut self.c[(row + r) * self.stride + column + o];
                let value = self.alpha * sums[o][r];
                *to = if self.accumulate { *to + value } else { value };
            }
        }
    }
}

impl<S: Scalar> WithSimd for SmallBatch<'_, S> {
    type Output = ();

    // As many columns at once as keep some eight sums in registers.
    #[inline(always)]
    fn with_simd<V: Simd>(mut self, simd: V) {
        let rows = self.shape.0;
        let mut row = 0;
        while row < rows {
            row += match (rows - row, self.shape.1) {
                (8.., 1) => self.rows::<V, 8, 1>(simd, row),
                (1, _) => self.rows::<V, 1, 8>(simd, row),
                (2, _) => self.rows::<V, 2, 4>(simd, row),
                (3 | 6, _) => self.rows::<V, 3, 3>(simd, row),
                (5, _) => self.rows::<V, 5, 2>(simd, row),
                _ => self.rows::<V, 4, 2>(simd, row),
            };
        }
    }
}
