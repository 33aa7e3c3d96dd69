//! Singular systems: the solution of least norm, and singular values of tall matrices.

use super::batch::Workspace;
use super::eigen::eigh;
use super::{LinalgError, expect_length};
use crate::scalar::{Real, Scalar};
use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{Mat, MatRef, Par, Spec};

/// Solution of a symmetric system that may be singular, and the numerical rank used.
#[derive(Clone, Debug, PartialEq)]
pub struct MinimumNorm<S> {
    /// `x`, `(n)`, in units of the right-hand side over those of the matrix.
    pub solution: Vec<S>,
    /// Number of eigenvalues that count as not zero.
    pub rank: usize,
    /// `|b - P b|_2` in the unit of `b`, `P` the projector on the range: zero but for rounding where `M x = b` has a
    /// solution.
    pub outside: S,
}

/// The shortest `x` among those that bring `M x` closest to `b`, `M` symmetric, of any rank and signature.
///
/// `x = sum of u_k (u_k . b) / w_k` over the eigenvalues with `|w_k| > n eps max |w|`; the others count as zero. Their
/// directions are those in which nothing is determined, such as gauge directions or redundant coordinates; `x` has no
/// component along them, and what `b` has is returned as [`MinimumNorm::outside`]. For a regular matrix this is what
/// [`solve`](fn@super::solve) gives, at a higher price.
///
/// `matrix` is `(n, n)`, `rhs` is `(n)`. Which eigenvalues vanish depends on the units of the coordinates: give them
/// alike sizes. A common factor of all elements, as long as they are normal numbers, changes nothing but exponents.
///
/// # Errors
/// [`LinalgError::Shape`]; [`LinalgError::NotFinite`] (row 0) for an infinity or a `NaN` in the arguments or a solution
/// beyond the largest number.
///
/// Source: Moore (1920), Penrose (1955); the threshold is the customary one of numerical rank (Golub and Van Loan, 5.5.8).
pub fn minimum_norm<S: Scalar>(
    n: usize,
    matrix: &[S],
    rhs: &[S],
    workspace: &mut Workspace<S>,
) -> Result<MinimumNorm<S>, LinalgError> {
    expect_length("matrix", n * n, matrix.len())?;
    expect_length("right-hand side", n, rhs.len())?;
    if !matrix.iter().chain(rhs).all(|x| x.is_finite()) {
        return Err(LinalgError::NotFinite { row: 0 });
    }
    let zero = <S as Real>::zero();
    // Near 1: neither products nor quotients leave the range on the way.
    let (matrix, of_matrix) = near_one(matrix);
    let (rhs, of_rhs) = near_one(rhs);
    let (mut values, mut vectors) = (vec![zero; n], vec![zero; n * n]);
    eigh(n, &matrix, &mut values, &mut vectors, workspace)?;
    let largest = values.iter().fold(zero, |m, w| if w.abs() > m { w.abs() } else { m });
    let floor = S::of_f64(n as f64) * S::epsilon() * largest;
    let (mut solution, mut rank, mut outside) = (vec![zero; n], 0, zero);
    for (&w, u) in values.iter().zip(vectors.chunks_exact(n.max(1))) {
        let component = u.iter().zip(&rhs).fold(zero, |sum, (&u, &b)| sum + u * b);
        if w.abs() > floor {
            rank += 1;
            let weight = component / w;
            solution.iter_mut().zip(u).for_each(|(x, &u)| *x += weight * u);
        } else {
            outside += component * component;
        }
    }
    solution.iter_mut().for_each(|x| *x = x.ldexp(of_rhs - of_matrix));
    let outside = outside.sqrt().ldexp(of_rhs);
    if !(outside.is_finite() && solution.iter().all(|x| x.is_finite())) {
        return Err(LinalgError::NotFinite { row: 0 });
    }
    Ok(MinimumNorm { solution, rank, outside })
}

/// Numbers scaled by a power of two to a largest magnitude in `[1, 2)`, and the exponent that scales them back.
fn near_one<S: Scalar>(numbers: &[S]) -> (Vec<S>, i32) {
    let zero = <S as Real>::zero();
    let largest = numbers.iter().fold(zero, |m, x| if x.abs() > m { x.abs() } else { m });
    let exponent = if largest > zero { largest.ilogb() } else { 0 };
    (numbers.iter().map(|x| x.ldexp(-exponent)).collect(), exponent)
}

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
