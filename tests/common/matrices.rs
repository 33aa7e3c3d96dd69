//! Matrices of given spectrum and products with them, in double-double.

use lnn::scalar::{Dd, Real, Scalar};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Exactly the same number.
pub fn dd<S: Scalar>(x: S) -> Dd {
    x.cast()
}

/// A random orthogonal matrix as a product of reflections, in double-double.
pub fn orthogonal(n: usize, rng: &mut ChaCha8Rng) -> Vec<Dd> {
    let mut q: Vec<Dd> = (0..n * n).map(|k| Dd::of_f64(f64::from(u8::from(k % (n + 1) == 0)))).collect();
    for _ in 0..n {
        let u: Vec<Dd> = (0..n).map(|_| Dd::of_f64(rng.random_range(-1.0..1.0))).collect();
        let square = u.iter().fold(<Dd as Real>::zero(), |s, &x| s + x * x);
        for j in 0..n {
            let dot = (0..n).fold(<Dd as Real>::zero(), |s, i| s + u[i] * q[i * n + j]);
            for i in 0..n {
                q[i * n + j] -= u[i] * dot * Dd::two() / square;
            }
        }
    }
    q
}

/// `Q diag(w) Q^T`, rounded to `S` and symmetric.
pub fn with_spectrum<S: Scalar>(w: &[f64], rng: &mut ChaCha8Rng) -> Vec<S> {
    let n = w.len();
    let q = orthogonal(n, rng);
    let mut m = vec![S::of_f64(0.0); n * n];
    for i in 0..n {
        for j in 0..=i {
            let sum = (0..n).fold(<Dd as Real>::zero(), |s, k| s + q[i * n + k] * q[j * n + k] * Dd::of_f64(w[k]));
            m[i * n + j] = sum.cast();
            m[j * n + i] = m[i * n + j];
        }
    }
    m
}

/// Euclidean norm.
pub fn norm(x: impl Iterator<Item = Dd>) -> f64 {
    x.fold(0.0, |s, x| s + x.to_f64() * x.to_f64()).sqrt()
}

/// `M x`.
pub fn times<S: Scalar>(n: usize, m: &[S], x: &[Dd]) -> Vec<Dd> {
    (0..n).map(|i| (0..n).fold(<Dd as Real>::zero(), |s, j| s + dd(m[i * n + j]) * x[j])).collect()
}
