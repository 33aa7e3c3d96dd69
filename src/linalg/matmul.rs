//! Matrix products on row-major slices: the only place that names the product of a library.

use crate::scalar::{Real, Scalar, View, ViewMut};
use faer::linalg::matmul::matmul;
use faer::traits::ComplexField;
use faer::{Accum, MatMut, MatRef, Par};

/// A matrix in a slice: element `(i, j)` at `i * row_stride + j * column_stride`.
#[derive(Clone, Copy, Debug)]
pub struct Matrix<'a, S> {
    data: &'a [S],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a, S> Matrix<'a, S> {
    /// A row-major `(rows, columns)` matrix. Panics if the slice is shorter.
    pub fn new(data: &'a [S], rows: usize, columns: usize) -> Self {
        assert!(data.len() >= rows * columns, "matrix of {rows} x {columns} in a slice of {}", data.len());
        Self { data, rows, columns, row_stride: columns, column_stride: 1 }
    }
    /// The transpose, without moving a number.
    pub fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

/// What happens to the numbers that stand in the destination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// They are replaced.
    Replace,
    /// The product is added to them.
    Add,
}

/// `destination (+)= left right`, destination row-major `(left rows, right columns)`; on the calling thread.
///
/// Hardware floats go through faer (run-time dispatch to AVX-512, AVX2, NEON), software numbers through a plain loop.
/// Panics if the inner dimensions or the destination's length disagree.
pub fn multiply<S: Scalar>(left: Matrix<'_, S>, right: Matrix<'_, S>, destination: &mut [S], update: Update) {
    assert_eq!(left.columns, right.rows, "inner dimensions of a matrix product");
    assert_eq!(destination.len(), left.rows * right.columns, "destination of a matrix product");
    if destination.is_empty() {
        return;
    }
    match (S::view(left.data), S::view(right.data), S::view_mut(destination)) {
        (View::F32(l), View::F32(r), ViewMut::F32(d)) => through_faer((l, left), (r, right), d, update),
        (View::F64(l), View::F64(r), ViewMut::F64(d)) => through_faer((l, left), (r, right), d, update),
        _ => plain(left, right, destination, update),
    }
}

fn through_faer<S, F: ComplexField + Copy>(
    (left, l): (&[F], Matrix<'_, S>),
    (right, r): (&[F], Matrix<'_, S>),
    destination: &mut [F],
    update: Update,
) {
    // Strides of a transpose are swapped back: faer sees the stored orientation.
    let view = |data, m: &Matrix<'_, S>| -> MatRef<'_, F> {
        if m.column_stride == 1 {
            MatRef::from_row_major_slice(data, m.rows, m.columns)
        } else {
            MatRef::from_column_major_slice(data, m.rows, m.columns)
        }
    };
    let left = view(&left[..l.rows * l.columns], &l);
    let right = view(&right[..r.rows * r.columns], &r);
    let accumulate = if update == Update::Add { Accum::Add } else { Accum::Replace };
    let destination: MatMut<'_, F> = MatMut::from_row_major_slice_mut(destination, l.rows, r.columns);
    matmul(destination, accumulate, left, right, F::one_impl(), Par::Seq);
}

fn plain<S: Scalar>(left: Matrix<'_, S>, right: Matrix<'_, S>, destination: &mut [S], update: Update) {
    for (i, row) in destination.chunks_exact_mut(right.columns).enumerate() {
        if update == Update::Replace {
            row.fill(<S as Real>::zero());
        }
        for k in 0..left.columns {
            let factor = left.data[i * left.row_stride + k * left.column_stride];
            for (j, element) in row.iter_mut().enumerate() {
                *element += factor * right.data[k * right.row_stride + j * right.column_stride];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

    fn check<S: Scalar>() {
        let at = |k: usize| S::of_f64(((k * 7919) % 31) as f64 - 15.0);
        let (m, k, n) = (5, 7, 3);
        let left: Vec<S> = (0..m * k).map(at).collect();
        let right: Vec<S> = (0..k * n).map(|i| at(i + 3)).collect();
        let expected: Vec<S> = (0..m * n)
            .map(|e| {
                (0..k).fold(<S as Real>::zero(), |sum, p| sum + left[e / n * k + p] * right[p * n + e % n])
            })
            .collect();
        let mut out = vec![S::NAN; m * n];
        multiply(Matrix::new(&left, m, k), Matrix::new(&right, k, n), &mut out, Update::Replace);
        assert_eq!(out, expected, "integers multiply exactly");
        multiply(Matrix::new(&left, m, k), Matrix::new(&right, k, n), &mut out, Update::Add);
        let twice: Vec<S> = expected.iter().map(|&e| e + e).collect();
        assert_eq!(out, twice);
        // (A B)^T = B^T A^T
        let mut flipped = vec![S::NAN; m * n];
        let (l, r) = (Matrix::new(&right, k, n).transposed(), Matrix::new(&left, m, k).transposed());
        multiply(l, r, &mut flipped, Update::Replace);
        for i in 0..m {
            for j in 0..n {
                assert_eq!(flipped[j * m + i], expected[i * n + j]);
            }
        }
    }

    #[test]
    fn products_of_integers_are_exact_in_every_precision() {
        check::<f32>();
        check::<f64>();
        check::<Dd>();
    }
}
