//! Symmetric matrices with prescribed spectra, LAPACK's test types among them, and products in double-double.

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

/// Matrix types by their spectra and structure; signs alternate in the indefinite ones.
pub fn matrices<S: Scalar>(n: usize, rng: &mut ChaCha8Rng) -> Vec<(String, Vec<S>)> {
    let eps = S::epsilon().to_f64();
    let mut list = Vec::new();
    for indefinite in [false, true] {
        let sign = |k: usize| if indefinite && k % 2 == 1 { -1.0 } else { 1.0 };
        for condition in [2.0, 1e3, 0.1 / eps.sqrt(), 0.01 / eps] {
            let graded = |k: usize| condition.powf(-(k as f64) / (n.max(2) - 1) as f64) * sign(k);
            let ramp = |k: usize| (1.0 - (k as f64 / (n.max(2) - 1) as f64) * (1.0 - 1.0 / condition)) * sign(k);
            let one_small = |k: usize| if k + 1 == n { 1.0 / condition } else { sign(k) };
            let one_large = |k: usize| if k == 0 { 1.0 } else { sign(k) / condition };
            let shapes: [(&str, &dyn Fn(usize) -> f64); 4] =
                [("graded", &graded), ("ramp", &ramp), ("one small", &one_small), ("one large", &one_large)];
            for (name, shape) in shapes {
                let w: Vec<f64> = (0..n).map(shape).collect();
                list.push((format!("{name} {condition:.0e} {indefinite}"), with_spectrum(&w, rng)));
            }
        }
    }
    let random: Vec<f64> = (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
    list.push(("random".into(), with_spectrum(&random, rng)));
    // Zero diagonal, tiny diagonal: no pivot without an exchange.
    for diagonal in [0.0, 2f64.powi(-60)] {
        let mut m: Vec<S> = vec![S::of_f64(diagonal); n * n];
        for i in 0..n {
            for j in 0..i {
                m[i * n + j] = S::of_f64(rng.random_range(0.5..1.5));
                m[j * n + i] = m[i * n + j];
            }
        }
        if n > 1 {
            list.push((format!("diagonal {diagonal:e}"), m));
        }
    }
    // Units of very different size: D A D.
    let base: Vec<S> = with_spectrum(&(0..n).map(|k| 1.0 + k as f64).collect::<Vec<_>>(), rng);
    for step in if n > 20 { [-1, 1] } else { [-3, 3] } {
        let m = (0..n * n).map(|k| base[k].ldexp(step * (k / n + k % n) as i32)).collect();
        list.push((format!("scaled {step}"), m));
    }
    list
}
