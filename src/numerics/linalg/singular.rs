//! Singular values and right singular vectors of tall matrices, by faer.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{Mat, MatRef, Par, Spec};

/// Singular values `s_k` and right singular vectors `u_k` of a matrix `A`: `|A u_k| = s_k`, the `u_k` orthonormal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Singular {
    /// Singular values, ascending, one for every column of the matrix.
    pub values: Vec<f64>,
    /// Right singular vectors as rows, `(columns, columns)`.
    pub vectors: Vec<Vec<f64>>,
}

/// Decomposes a matrix that is given by its columns, at least as many rows as columns; `None` if it is not finite or faer gives
/// up. Small singular values are exact to roundings of the largest.
pub(crate) fn singular(columns: &[Vec<f64>]) -> Option<Singular> {
    let (n, m) = (columns.len(), columns.first().map_or(0, Vec::len));
    if n == 0 {
        return Some(Singular { values: Vec::new(), vectors: Vec::new() });
    }
    let all: Vec<f64> = columns.concat();
    if m < n || all.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let matrix = MatRef::from_column_major_slice(&all, m, n);
    let (mut values, mut right) = (Diag::<f64>::zeros(n), Mat::<f64>::zeros(n, n));
    let scratch = svd_scratch::<f64>(m, n, ComputeSvdVectors::No, ComputeSvdVectors::Full, Par::Seq, Spec::default());
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    svd(matrix, values.as_mut(), None, Some(right.as_mut()), Par::Seq, stack, Spec::default()).ok()?;
    let order = (0..n).rev();
    Some(Singular {
        values: order.clone().map(|k| values[k]).collect(),
        vectors: order.map(|k| (0..n).map(|i| right[(i, k)]).collect()).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_belong_to_their_values() {
        // Columns (3, 0, 0, 4), (0, 1, 0, 0) and their sum: rank 2.
        let columns = vec![vec![3.0, 0.0, 0.0, 4.0], vec![0.0, 1.0, 0.0, 0.0], vec![3.0, 1.0, 0.0, 4.0]];
        let found = singular(&columns).unwrap();
        assert!(found.values[0] < 1e-15 && found.values[1] > 0.1);
        for (value, vector) in found.values.iter().zip(&found.vectors) {
            let image: Vec<f64> = (0..4).map(|i| (0..3).map(|k| columns[k][i] * vector[k]).sum()).collect();
            let length = image.iter().map(|x: &f64| x * x).sum::<f64>().sqrt();
            assert!((length - value).abs() < 1e-14, "{length} {value}");
        }
        let null = &found.vectors[0];
        assert!((null[0] - null[1]).abs() < 1e-14 && (null[0] + null[2]).abs() < 1e-14, "{null:?}");
        assert!(singular(&[vec![1.0], vec![2.0]]).is_none() && singular(&[vec![f64::NAN]]).is_none());
        assert_eq!(singular(&[]).unwrap().values.len(), 0);
    }
}
