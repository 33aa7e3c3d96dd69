//! Vectors of Euclidean space and of space-time as arrays.

/// `a.b`.
pub(super) fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(&b).fold(0.0, |sum, (a, b)| sum + a * b)
}

/// `|a|`.
pub(super) fn norm<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}

/// `a + s b`.
pub(super) fn along<const N: usize>(a: [f64; N], s: f64, b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// `s a`.
pub(super) fn times<const N: usize>(s: f64, a: [f64; N]) -> [f64; N] {
    a.map(|a| s * a)
}

/// `g(a, b) = g_ij a^i b^j` of a metric `(4, 4)`.
pub(super) fn product(metric: &[f64], a: [f64; 4], b: [f64; 4]) -> f64 {
    dot(a, lower(metric, b))
}

/// `a_i = g_ij a^j` of a metric `(4, 4)`.
pub(super) fn lower(metric: &[f64], a: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| (0..4).fold(0.0, |sum, j| sum + metric[4 * i + j] * a[j]))
}
