//! Batches of small symmetric matrices, and the errors of what was made of them, judged in double-double.

use super::super::common::matrices::{matrices, with_spectrum};
use lnn::linalg::{self, Workspace};
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Matrices of one size with what is known of them.
pub struct Batch {
    pub n: usize,
    pub set: &'static str,
    pub kinds: Vec<String>,
    pub matrices: Vec<f64>,
    pub rhs: Vec<f64>,
    /// Positive and negative eigenvalues.
    pub signs: Vec<(usize, usize)>,
}

impl Batch {
    /// LAPACK's types, each `rounds` times.
    pub fn hard(n: usize, rounds: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
        Self::new(n, "hard", (0..rounds).flat_map(|_| matrices::<f64>(n, &mut rng)).collect(), &mut rng)
    }

    /// Well-conditioned definite ones.
    pub fn regular(n: usize, count: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
        let spectrum: Vec<f64> = (1..=n).map(|k| k as f64).collect();
        let list = (0..count).map(|_| ("regular".into(), with_spectrum(&spectrum, &mut rng))).collect();
        Self::new(n, "regular", list, &mut rng)
    }

    fn new(n: usize, set: &'static str, list: Vec<(String, Vec<f64>)>, rng: &mut ChaCha8Rng) -> Self {
        let (kinds, list): (Vec<String>, Vec<Vec<f64>>) = list.into_iter().unzip();
        let signs = kinds.iter().zip(&list).map(|(kind, m)| exact_signs(n, kind, m)).collect();
        let rhs = (0..kinds.len() * n).map(|_| rng.random_range(-1.0..1.0)).collect();
        Self { n, set, kinds, matrices: list.concat(), rhs, signs }
    }

    pub fn len(&self) -> usize {
        self.kinds.len()
    }

    fn matrix(&self, row: usize) -> &[f64] {
        &self.matrices[row * self.n * self.n..][..self.n * self.n]
    }
}

/// Signs by eigenvalues in double-double; a definite matrix stays definite when rows and columns are scaled alike.
fn exact_signs(n: usize, kind: &str, matrix: &[f64]) -> (usize, usize) {
    if kind.starts_with("scaled") {
        return (n, 0);
    }
    let wide: Vec<Dd> = matrix.iter().map(|&m| Dd::of_f64(m)).collect();
    let mut values = vec![Dd::of_f64(0.0); n];
    if linalg::eigenvalues(n, &wide, &mut values, &mut Workspace::new()).is_err() {
        return (0, 0);
    }
    let negative = values.iter().filter(|w| w.to_f64() < 0.0).count();
    (n - negative, negative)
}

/// The largest error of the rows that did not fail, and the kind of matrix; infinite for one that is not finite.
pub fn worst(batch: &Batch, failed: &[(usize, String)], error: impl Fn(usize) -> f64) -> (f64, String) {
    let mut worst = (0.0, String::new());
    for row in (0..batch.len()).filter(|row| failed.iter().all(|(failed, _)| failed != row)) {
        let error = error(row);
        let error = if error.is_nan() { f64::INFINITY } else { error };
        if error > worst.0 {
            worst = (error, batch.kinds[row].clone());
        }
    }
    worst
}

fn wide(x: f64) -> Dd {
    Dd::of_f64(x)
}

fn norm(x: impl Iterator<Item = Dd>) -> f64 {
    x.fold(0.0, |sum, x| sum + x.to_f64() * x.to_f64()).sqrt()
}

fn product(n: usize, m: &[f64], x: &[f64]) -> Vec<Dd> {
    let dot = |row: &[f64]| row.iter().zip(x).fold(<Dd as Real>::zero(), |s, (&m, &x)| s + wide(m) * wide(x));
    m.chunks_exact(n).map(dot).collect()
}

pub fn solve_error(batch: &Batch, row: usize, x: &[f64]) -> f64 {
    let n = batch.n;
    let (m, r, x) = (batch.matrix(row), &batch.rhs[row * n..][..n], &x[row * n..][..n]);
    let residual = norm(product(n, m, x).into_iter().zip(r).map(|(p, &r)| p - wide(r)));
    let size = |x: &[f64]| norm(x.iter().map(|&x| wide(x)));
    residual / ((size(m) * size(x) + size(r)) * n as f64 * f64::EPSILON)
}

pub fn eigen_error(batch: &Batch, row: usize, w: &[f64], u: &[f64]) -> f64 {
    let n = batch.n;
    let (m, w, u) = (batch.matrix(row), &w[row * n..][..n], &u[row * n * n..][..n * n]);
    let size = norm(m.iter().map(|&m| wide(m)));
    let mut worst = 0f64;
    for (k, vector) in u.chunks_exact(n).enumerate() {
        let residual = norm(product(n, m, vector).into_iter().zip(vector).map(|(p, &x)| p - wide(w[k]) * wide(x)));
        let others = product(n, u, vector).into_iter().enumerate();
        let skew = norm(others.map(|(j, p)| p - wide(f64::from(u8::from(j == k)))));
        for error in [residual / size, skew] {
            worst = if error.is_nan() { f64::NAN } else { worst.max(error) };
        }
    }
    worst / (n as f64 * f64::EPSILON)
}
