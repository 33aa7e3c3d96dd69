//! Contractions of tensors with the metric.

use crate::scalar::{Real, Scalar};

/// `sum_k a_k b_k`.
pub(super) fn dot<S: Scalar>(a: impl IntoIterator<Item = S>, b: impl IntoIterator<Item = S>) -> S {
    a.into_iter().zip(b).fold(<S as Real>::zero(), |sum, (a, b)| sum + a * b)
}

/// `T^a_.. = h^ae T_e..` for the first of several indices, `h` `(n, n)`: raises with the inverse metric, lowers with the metric.
pub(super) fn move_first<S: Scalar>(n: usize, h: &[S], tensor: &[S]) -> Vec<S> {
    let size = tensor.len() / n;
    let mut moved = vec![<S as Real>::zero(); tensor.len()];
    for (out, row) in moved.chunks_exact_mut(size).zip(h.chunks_exact(n)) {
        for (part, &factor) in tensor.chunks_exact(size).zip(row) {
            // Diagonal metrics are common.
            if factor != <S as Real>::zero() {
                out.iter_mut().zip(part).for_each(|(out, &x)| *out += factor * x);
            }
        }
    }
    moved
}

/// [`move_first`] for the second index.
pub(super) fn move_second<S: Scalar>(n: usize, h: &[S], tensor: &[S]) -> Vec<S> {
    tensor.chunks_exact(tensor.len() / n).flat_map(|part| move_first(n, h, part)).collect()
}

/// The same numbers in another precision.
pub(super) fn rounded<S: Scalar, T: Scalar>(tensor: &[S]) -> Vec<T> {
    tensor.iter().map(|x| x.cast()).collect()
}
