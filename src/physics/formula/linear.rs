//! Small dense linear algebra of normal equations: symmetric matrices `(n, n)`, row-major.

/// Part of the diagonal that is added to it: directions that the data say nothing of get the smallest solution.
const RIDGE: f64 = 1e-11;

/// Inverse of a symmetric matrix that is positive semi-definite, by Cholesky's factors of the matrix scaled to unit diagonal.
pub(super) fn inverse(n: usize, matrix: &[f64]) -> Option<Vec<f64>> {
    inverse_with(n, matrix, RIDGE)
}

/// [`inverse`] with so much added to the diagonal, relative to it.
pub(super) fn inverse_with(n: usize, matrix: &[f64], ridge: f64) -> Option<Vec<f64>> {
    let scale: Vec<f64> = (0..n).map(|i| matrix[i * n + i].max(0.0).sqrt()).collect();
    let scale: Vec<f64> = scale.into_iter().map(|s| if s > 0.0 { 1.0 / s } else { 1.0 }).collect();
    // Lower factor, then its inverse in place.
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let mut sum = matrix[i * n + j] * scale[i] * scale[j] + if i == j { ridge } else { 0.0 };
            for k in 0..j {
                sum -= l[i * n + k] * l[j * n + k];
            }
            if i == j {
                if sum.is_nan() {
                    return None;
                }
                l[i * n + i] = sum.max(ridge * 0.1).sqrt();
            } else {
                l[i * n + j] = sum / l[j * n + j];
            }
        }
    }
    let mut inverse = vec![0.0; n * n];
    for j in 0..n {
        for i in j..n {
            let mut sum = if i == j { 1.0 } else { 0.0 };
            for k in j..i {
                sum -= l[i * n + k] * inverse[k * n + j];
            }
            inverse[i * n + j] = sum / l[i * n + i];
        }
    }
    let mut product = vec![0.0; n * n];
    for k in 0..n {
        for i in 0..=k {
            let factor = inverse[k * n + i];
            for j in 0..=i {
                product[i * n + j] += factor * inverse[k * n + j];
            }
        }
    }
    for i in 0..n {
        for j in 0..=i {
            let value = product[i * n + j] * scale[i] * scale[j];
            (product[i * n + j], product[j * n + i]) = (value, value);
        }
    }
    product.iter().all(|x| x.is_finite()).then_some(product)
}

/// `A x`.
pub(super) fn times(n: usize, matrix: &[f64], x: &[f64]) -> Vec<f64> {
    (0..n).map(|i| dot(&matrix[i * n..(i + 1) * n], x)).collect()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Rows and columns of some indices.
pub(super) fn part(n: usize, matrix: &[f64], indices: &[usize]) -> Vec<f64> {
    indices.iter().flat_map(|&i| indices.iter().map(move |&j| matrix[i * n + j])).collect()
}

/// Solves `A X = B` of a small square matrix in place by elimination with pivots, `B` of `m` columns; `false` if `A` is singular to
/// rounding.
pub(super) fn eliminate(n: usize, matrix: &mut [f64], m: usize, right: &mut [f64]) -> bool {
    let largest = matrix.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    for k in 0..n {
        let mut pivot = k;
        for i in k + 1..n {
            if matrix[i * n + k].abs() > matrix[pivot * n + k].abs() {
                pivot = i;
            }
        }
        let size = matrix[pivot * n + k].abs();
        if size.is_nan() || size <= 1e-13 * largest {
            return false;
        }
        if pivot != k {
            (0..n).for_each(|j| matrix.swap(k * n + j, pivot * n + j));
            (0..m).for_each(|j| right.swap(k * m + j, pivot * m + j));
        }
        for i in k + 1..n {
            let factor = matrix[i * n + k] / matrix[k * n + k];
            if factor != 0.0 {
                for j in k + 1..n {
                    matrix[i * n + j] -= factor * matrix[k * n + j];
                }
                for j in 0..m {
                    right[i * m + j] -= factor * right[k * m + j];
                }
            }
        }
    }
    for k in (0..n).rev() {
        let reciprocal = 1.0 / matrix[k * n + k];
        for j in 0..m {
            let mut sum = right[k * m + j];
            for i in k + 1..n {
                sum -= matrix[k * n + i] * right[i * m + j];
            }
            right[k * m + j] = sum * reciprocal;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_solves() {
        let matrix = [4.0, 1.0, 0.0, 1.0, 3.0, -2.0, 0.0, -2.0, 6.0];
        let inverse = inverse(3, &matrix).unwrap();
        let x = times(3, &inverse, &[1.0, 2.0, 3.0]);
        let again = times(3, &matrix, &x);
        assert!(again.iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-10), "{again:?}");
        let (mut a, mut b) = (matrix.to_vec(), vec![1.0, 2.0, 3.0]);
        assert!(eliminate(3, &mut a, 1, &mut b));
        assert!(b.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-10), "{b:?} {x:?}");
    }

    #[test]
    fn a_direction_without_data_is_left_alone() {
        let inverse = inverse(2, &[1.0, 1.0, 1.0, 1.0]).unwrap();
        let x = times(2, &inverse, &[2.0, 2.0]);
        assert!((x[0] + x[1] - 2.0).abs() < 1e-3, "{x:?}");
        assert!(!eliminate(2, &mut [1.0, 1.0, 1.0, 1.0], 1, &mut [1.0, 1.0]));
    }
}
