//! Singular systems: the solution of least norm, and singular values of tall matrices.

use super::batch::Workspace;
#[cfg(any(test, not(feature = "faer")))]
use super::dot;
use super::eigen::eigh;
use super::{LinalgError, expect_length};
#[cfg(any(test, not(feature = "faer")))]
use crate::platform::float;
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

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

/// The smallest `x` among those that bring `M x` closest to `b`, for symmetric `M` of any rank and signature.
///
/// `x = sum of u_k (u_k . b) / w_k` over the eigenvalues with `|w_k| > n eps max |w|`; the others count as zero. Their directions are
/// undetermined, such as gauge directions or redundant coordinates; `x` has no component along them, and the component of `b` is returned
/// as [`MinimumNorm::outside`]. For a regular matrix the result is that of [`solve`](fn@super::solve), at a higher cost.
///
/// `matrix` is `(n, n)`, `rhs` is `(n)`. Which eigenvalues vanish depends on the units of the coordinates: give them similar sizes. A
/// common factor of all elements, as long as they are normal numbers, changes nothing but exponents.
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
    // Scaled near 1, so that neither products nor quotients leave the range on the way.
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
pub struct Singular {
    /// Singular values, ascending, one for every column of the matrix.
    pub values: Vec<f64>,
    /// Right singular vectors as rows, `(columns, columns)`.
    pub vectors: Vec<Vec<f64>>,
}

/// Decomposes a matrix given by its columns, with at least as many rows as columns; `None` if it is not finite or no decomposition is
/// found. Small singular values are exact to roundings of the largest.
pub fn singular(columns: &[Vec<f64>]) -> Option<Singular> {
    let (n, m) = (columns.len(), columns.first().map_or(0, Vec::len));
    if n == 0 {
        return Some(Singular { values: Vec::new(), vectors: Vec::new() });
    }
    let all: Vec<f64> = columns.concat();
    if m < n || all.iter().any(|x| !x.is_finite()) {
        return None;
    }
    #[cfg(feature = "faer")]
    return super::by_faer::singular(n, m, &all);
    #[cfg(not(feature = "faer"))]
    by_rotations(n, m, &all)
}

/// [`singular`] without faer, of `all`, the columns of `n` of `m` numbers one after the other, finite, `m >= n`.
///
/// Pairs of columns are rotated by the smaller angle until all are orthogonal (Hestenes 1958): their lengths are the singular values, and the
/// rotations together the vectors. Columns count as orthogonal up to the rounding of their inner product, or of that of the longest.
#[cfg(any(test, not(feature = "faer")))]
fn by_rotations(n: usize, m: usize, all: &[f64]) -> Option<Singular> {
    let (all, exponent) = near_one(all);
    let mut columns: Vec<Vec<f64>> = all.chunks_exact(m).map(<[f64]>::to_vec).collect();
    let mut vectors = vec![vec![0.0; n]; n];
    (0..n).for_each(|k| vectors[k][k] = 1.0);
    let rounding = f64::EPSILON * (m as f64).sqrt();
    let longest = columns.iter().fold(0.0, |longest: f64, x| longest.max(dot(x, x)));
    for _ in 0..super::thresholds::MOST_SINGULAR_SWEEPS {
        let mut orthogonal = true;
        for j in 1..n {
            for i in 0..j {
                let (x, y) = (&columns[i], &columns[j]);
                let (xx, yy, xy) = (dot(x, x), dot(y, y), dot(x, y));
                if xy.abs() > rounding * (xx * yy).sqrt() && xy.abs() > rounding * rounding * longest {
                    orthogonal = false;
                    let ratio = (yy - xx) / (2.0 * xy);
                    let tangent = ratio.signum() / (ratio.abs() + float!(f64, hypot(ratio, 1.0)));
                    turn(&mut columns, (i, j), tangent);
                    turn(&mut vectors, (i, j), tangent);
                }
            }
        }
        if orthogonal {
            let mut found: Vec<_> = columns.iter().map(|x| dot(x, x).sqrt().ldexp(exponent)).zip(vectors).collect();
            found.sort_by(|(x, _), (y, _)| x.total_cmp(y));
            let (values, vectors) = found.into_iter().unzip();
            return Some(Singular { values, vectors });
        }
    }
    None
}

/// `(c x - s y, s x + c y)` for two of the vectors, by the tangent of the angle.
#[cfg(any(test, not(feature = "faer")))]
fn turn(vectors: &mut [Vec<f64>], (i, j): (usize, usize), tangent: f64) {
    let cosine = float!(f64, hypot(tangent, 1.0)).recip();
    let (head, tail) = vectors.split_at_mut(j);
    for (x, y) in head[i].iter_mut().zip(&mut tail[0]) {
        (*x, *y) = (cosine * (*x - tangent * *y), cosine * (*y + tangent * *x));
    }
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

    #[test]
    fn rotations_find_what_faer_finds() {
        for n in [3, 40, 70] {
            let m = 2 * n + 1;
            // Columns of lengths from 1 down to 1e-8; the last is the sum of the first two, and in the middle one is nothing.
            let mut columns: Vec<Vec<f64>> = (0..n)
                .map(|k| {
                    let size = 10_f64.powf(-8.0 * k as f64 / n as f64);
                    (0..m).map(|i| size * ((i * i * 7 + k * 13 + i * k * 5) % 101) as f64 / 101.0).collect()
                })
                .collect();
            columns[n - 1] = columns[0].iter().zip(&columns[1]).map(|(x, y)| x + y).collect();
            if n > 3 {
                columns[n / 2].fill(0.0);
            }
            let (found, faer) = (by_rotations(n, m, &columns.concat()).unwrap(), singular(&columns).unwrap());
            let rounding = 4.0 * n as f64 * f64::EPSILON;
            let largest = faer.values[n - 1];
            for (k, (value, vector)) in found.values.iter().zip(&found.vectors).enumerate() {
                assert!((value - faer.values[k]).abs() < rounding * largest, "{n}, {k}: {value} {}", faer.values[k]);
                let image: Vec<f64> = (0..m).map(|i| (0..n).map(|k| columns[k][i] * vector[k]).sum()).collect();
                assert!((dot(&image, &image).sqrt() - value).abs() < rounding * largest, "{n}, {k}");
                for (l, other) in found.vectors.iter().enumerate() {
                    assert!((dot(vector, other) - f64::from(u8::from(k == l))).abs() < rounding, "{n}, {k} and {l}");
                }
            }
            assert!(found.values[0] < rounding * largest && found.values[n - 1] > 1.0);
            // Vectors of distinct singular values agree up to the sign.
            assert!(dot(&found.vectors[n - 1], &faer.vectors[n - 1]).abs() > 1.0 - rounding);
        }
        assert_eq!(by_rotations(2, 2, &[0.0; 4]).unwrap().values, [0.0; 2]);
        assert_eq!(by_rotations(2, 2, &[0.0, 3e300, 4e200, 0.0]).unwrap().values, [4e200, 3e300]);
    }
}
