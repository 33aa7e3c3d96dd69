//! faer's decompositions for matrices too large for lanes.

use crate::scalar::{Scalar, Slice, SliceMut};
use faer::traits::RealField;
use faer::{MatRef, Side};

/// Size above which faer's tridiagonal method beats Jacobi on lanes.
const EIGEN: usize = 32;

/// `true` if faer has an eigensolver for this scalar and this size.
pub(super) fn serves<S: Scalar>(n: usize) -> bool {
    n > EIGEN && !matches!(S::slice(&[]), Slice::Other(_))
}

/// Eigenvalues, ascending, and eigenvectors as rows (if asked for) of one symmetric matrix; `NaN` if faer gives up.
pub(super) fn eigh<S: Scalar>(n: usize, matrix: &[S], values: &mut [S], vectors: &mut [S]) {
    match (S::slice(matrix), S::slice_mut(values), S::slice_mut(vectors)) {
        (Slice::F32(m), SliceMut::F32(w), SliceMut::F32(u)) => through_faer(n, m, w, u, f32::NAN),
        (Slice::F64(m), SliceMut::F64(w), SliceMut::F64(u)) => through_faer(n, m, w, u, f64::NAN),
        _ => {}
    }
}

fn through_faer<F: RealField + Copy>(n: usize, matrix: &[F], values: &mut [F], vectors: &mut [F], nan: F) {
    // Row-major and lower triangle: column-major and upper triangle of the same symmetric matrix.
    let matrix = MatRef::from_column_major_slice(matrix, n, n);
    if vectors.is_empty() {
        match matrix.self_adjoint_eigenvalues(Side::Lower) {
            Ok(found) => values.copy_from_slice(&found),
            Err(_) => values.fill(nan),
        }
        return;
    }
    match matrix.self_adjoint_eigen(Side::Lower) {
        Ok(found) => {
            for k in 0..n {
                values[k] = found.S()[k];
                for i in 0..n {
                    vectors[k * n + i] = found.U()[(i, k)];
                }
            }
        }
        Err(_) => values.fill(nan),
    }
}
