//! Rows made orthonormal.

use crate::linalg::{MatMut, MatRef, gemm};
use crate::scalar::{Real, Scalar, vectorized};

/// Rows that are made orthonormal at once.
const ROWS: usize = 16;

/// Makes the rows orthonormal, one after the other: a block of rows against those before it by matrix products, then within
/// itself, all of it twice (Giraud, Langou, Rozložník 2005: twice is enough; for blocks Barlow, Smoktunowicz 2013); `false` if
/// a row vanishes or is not finite.
///
/// `scratch` has room for as many numbers as `rows`.
pub(super) fn orthonormalize<S: Scalar>(size: usize, rows: &mut [S], scratch: &mut [S]) -> bool {
    let one = <S as Real>::one();
    for start in (0..size).step_by(ROWS) {
        let (before, rest) = rows.split_at_mut(start * size);
        let count = ROWS.min(size - start);
        let block = &mut rest[..count * size];
        if !normalize(size, block) {
            return false;
        }
        for _ in 0..2 {
            if start > 0 {
                let (before, along) = (MatRef::new(before, start, size), &mut scratch[..count * start]);
                let now = MatRef::new(block, count, size);
                gemm(MatMut::new(along, count, start), false, one, now, before.t());
                let along = MatRef::new(along, count, start);
                gemm(MatMut::new(block, count, size), true, -one, along, before);
            }
            if !orthonormalize_within(size, block) {
                return false;
            }
        }
    }
    true
}

/// Gives every row the length 1; `false` if one vanishes or is not finite.
fn normalize<S: Scalar>(size: usize, rows: &mut [S]) -> bool {
    rows.chunks_exact_mut(size).all(|row| {
        let scale = norm(row).recip();
        row.iter_mut().for_each(|x| *x *= scale);
        scale.is_finite()
    })
}

/// Makes a few rows orthonormal, one after the other.
fn orthonormalize_within<S: Scalar>(size: usize, rows: &mut [S]) -> bool {
    vectorized(
        #[inline(always)]
        || {
            for i in 0..rows.len() / size {
                let (before, rest) = rows.split_at_mut(i * size);
                let row = &mut rest[..size];
                for other in before.chunks_exact(size) {
                    let along = dot(row, other);
                    row.iter_mut().zip(other).for_each(|(x, &y)| *x -= along * y);
                }
                let scale = norm(row).recip();
                if !scale.is_finite() {
                    return false;
                }
                row.iter_mut().for_each(|x| *x *= scale);
            }
            true
        },
    )
}

#[inline(always)]
fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    const LANES: usize = 16;
    let mut sums = [<S as Real>::zero(); LANES];
    let (mut left, mut right) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    while let (Some(a), Some(b)) = (left.next(), right.next()) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    let rest = left.remainder().iter().zip(right.remainder());
    let rest = rest.fold(<S as Real>::zero(), |sum, (&a, &b)| sum + a * b);
    sums.iter().fold(rest, |sum, &x| sum + x)
}

#[inline(always)]
fn norm<S: Scalar>(a: &[S]) -> S {
    dot(a, a).sqrt()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    pub fn random(count: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    /// Largest element of `A A^T - 1`.
    pub fn defect(size: usize, rows: &[f64]) -> f64 {
        let pairs = (0..size).flat_map(|i| (0..size).map(move |j| (i, j)));
        let of = |(i, j): (usize, usize)| {
            let product = dot(&rows[i * size..][..size], &rows[j * size..][..size]);
            (product - f64::from(u8::from(i == j))).abs()
        };
        pairs.map(of).fold(0.0, f64::max)
    }

    #[test]
    fn rows_become_orthonormal_however_nearly_dependent_they_are() {
        // Less than a block of rows, and several.
        for size in [7, 20, 50] {
            let mut rows = random(size * size, 1);
            for k in 1..size {
                for i in 0..size {
                    rows[k * size + i] = rows[i] + 1e-9 * rows[k * size + i];
                }
            }
            let first = rows[..size].to_vec();
            assert!(orthonormalize(size, &mut rows, &mut vec![0.0; size * size]));
            assert!(defect(size, &rows) < 20.0 * f64::EPSILON);
            let length = norm(&first);
            assert!(first.iter().zip(&rows).all(|(x, y)| (x / length - y).abs() < 1e-14));
        }
        assert!(!orthonormalize(2, &mut [1.0, 0.0, f64::NAN, 1.0], &mut [0.0; 4]));
        assert!(!orthonormalize(2, &mut [0.0; 4], &mut [0.0; 4]));
    }
}
