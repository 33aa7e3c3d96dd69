//! What several test programs share.

use lnn::scalar::Real;

/// Gaussian elimination without exchanges over any number type, for small well-conditioned systems.
pub fn solve<T: Real>(n: usize, matrix: &[T], right: &[T]) -> Vec<T> {
    let (mut m, mut x) = (matrix.to_vec(), right.to_vec());
    for k in 0..n {
        for i in k + 1..n {
            let factor = m[i * n + k] / m[k * n + k];
            for j in k..n {
                let element = m[k * n + j];
                m[i * n + j] -= factor * element;
            }
            let element = x[k];
            x[i] -= factor * element;
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n {
            let known = m[k * n + j] * x[j];
            x[k] -= known;
        }
        x[k] = x[k] / m[k * n + k];
    }
    x
}
