//! Matrix products `C = alpha A B` or `C += alpha A B`: faer's kernels for `f32` and `f64`, dot products for a few rows. Other numbers have the loop
//! of [`Matrices`](crate::scalar::Matrices); without faer `f32` and `f64` have dot products and that loop.
//!
//! Products of a few rows with a transposed matrix, `C = alpha A B^T`, by dot products: the rows of both are contiguous, so that
//! nothing is packed. A blocked product packs `B^T` whatever the number of rows, which takes longer than to multiply few.

use crate::scalar::{MatMut, MatRef, Scalar, Simd, WithSimd, in_vectors, product_by_loops, vectorized};

/// `C = alpha A B`, or `C += alpha A B` if `accumulate`; one thread.
///
/// The result does not depend on the thread count of the caller: nothing here is parallel.
///
/// # Panics
/// If the shapes do not fit.
pub fn gemm<S: Scalar>(c: MatMut<'_, S>, accumulate: bool, alpha: S, a: MatRef<'_, S>, b: MatRef<'_, S>) {
    assert!(c.rows == a.rows() && c.cols == b.cols() && a.cols() == b.rows(), "matrix product of unfit shapes");
    if c.rows == 0 || c.cols == 0 {
        return;
    }
    S::product(c, accumulate, alpha, a, b);
}

/// Whether dot products are faster than a blocked product.
#[cfg(feature = "faer")]
pub(super) fn is_small<S>(c: &MatMut<'_, S>, a: &MatRef<'_, S>, b: &MatRef<'_, S>) -> bool {
    (c.rows <= super::thresholds::DOT_PRODUCT_ROWS || c.cols == 1) && b.transposed && !a.transposed
}

/// The product without faer: by dot products where the rows of both are contiguous, by loops otherwise.
pub(super) fn plain<S: Scalar>(c: MatMut<'_, S>, accumulate: bool, alpha: S, a: MatRef<'_, S>, b: MatRef<'_, S>) {
    if b.transposed && !a.transposed {
        let shape = (c.rows, c.cols, a.cols());
        let [a, b] = [a, b].map(|m| Rows { numbers: m.data, stride: m.stride });
        return SmallBatch { a, b, c: c.data, stride: c.stride, shape, alpha, accumulate }.run();
    }
    vectorized(
        #[inline(always)]
        || product_by_loops(c, accumulate, alpha, a, b),
    );
}

/// Sum of products.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Rows of a matrix, `stride` numbers apart.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a, S> {
    pub numbers: &'a [S],
    pub stride: usize,
}

impl<'a, S> Rows<'a, S> {
    /// `R` rows of `length` numbers, from `first` on.
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
struct SmallBatch<'a, S> {
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

    // Chooses the number of columns so that about eight sums stay in registers.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

    /// Small integers: every product and sum is exact in every precision.
    fn numbers<S: Scalar>(count: usize, seed: i32) -> Vec<S> {
        (0..count as i32).map(|i| S::of_f64(f64::from((i * 7 + seed * 5) % 11 - 5))).collect()
    }

    fn check<S: Scalar>() {
        for (m, k, n) in [
            (1, 1, 1),
            (3, 4, 5),
            (17, 9, 33),
            (2, 0, 3),
            (0, 3, 2),
            (1, 33, 17),
            (2, 16, 9),
            (4, 40, 7),
            (5, 8, 3),
            (7, 19, 4),
            (8, 5, 10),
        ] {
            for (ta, tb) in [(false, false), (true, false), (false, true), (true, true)] {
                let (a, b) = (numbers::<S>(m * k, 1), numbers::<S>(k * n, 2));
                let (stride, mut c) = (n + 3, numbers::<S>(m * (n + 3), 3));
                let before = c.clone();
                let va = if ta { MatRef::new(&a, k, m).t() } else { MatRef::new(&a, m, k) };
                let vb = if tb { MatRef::new(&b, n, k).t() } else { MatRef::new(&b, k, n) };
                let element = |i: usize, j: usize| {
                    (0..k).fold(S::of_f64(0.0), |sum, l| {
                        let x = if ta { a[l * m + i] } else { a[i * k + l] };
                        let y = if tb { b[j * k + l] } else { b[l * n + j] };
                        sum + x * y
                    })
                };
                for accumulate in [false, true] {
                    c.copy_from_slice(&before);
                    gemm(MatMut::with_stride(&mut c, m, n, stride), accumulate, S::of_f64(2.0), va, vb);
                    for i in 0..m {
                        for j in 0..stride {
                            let old = before[i * stride + j];
                            let sum = if j < n { element(i, j) * S::of_f64(2.0) } else { old };
                            let want = if j < n && accumulate { old + sum } else { sum };
                            assert!(c[i * stride + j] == want, "{} {m}x{k}x{n} at {i},{j}", S::NAME);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn rows_of_a_view_are_those_that_are_seen() {
        let a = numbers::<f64>(5 * 7, 1);
        let one = numbers::<f64>(7, 2);
        for (view, rows) in [(MatRef::new(&a, 5, 7), 5), (MatRef::new(&a, 7, 5).t(), 5)] {
            let product = |view: MatRef<'_, f64>| {
                let mut out = vec![0.0; view.rows()];
                gemm(MatMut::new(&mut out, view.rows(), 1), false, 1.0, view, MatRef::new(&one, 7, 1));
                out
            };
            for (from, to) in [(0, rows), (1, 4), (4, rows), (2, 2), (rows, rows)] {
                assert_eq!(product(view.row_range(from, to)), product(view)[from..to]);
            }
        }
    }

    /// Sizes beyond those for which dot products are used with faer.
    fn check_plain<S: Scalar>() {
        for n in [3, 40, 70] {
            let (m, k) = (n + 1, n + 2);
            let (a, b) = (numbers::<S>(m * k, 1), numbers::<S>(k * n, 2));
            for (ta, tb) in [(false, false), (true, false), (false, true), (true, true)] {
                let va = if ta { MatRef::new(&a, k, m).t() } else { MatRef::new(&a, m, k) };
                let vb = if tb { MatRef::new(&b, n, k).t() } else { MatRef::new(&b, k, n) };
                for accumulate in [false, true] {
                    let (mut c, mut faer) = (numbers::<S>(m * n, 3), numbers::<S>(m * n, 3));
                    plain(MatMut::new(&mut c, m, n), accumulate, S::of_f64(2.0), va, vb);
                    gemm(MatMut::new(&mut faer, m, n), accumulate, S::of_f64(2.0), va, vb);
                    assert!(c == faer, "{} {n} {ta} {tb} {accumulate}", S::NAME);
                }
            }
        }
    }

    #[test]
    fn products_without_faer_are_those_with_it() {
        check_plain::<f32>();
        check_plain::<f64>();
    }

    #[test]
    fn products_of_integers_are_exact_in_every_precision() {
        check::<f32>();
        check::<f64>();
        check::<Dd>();
    }
}
