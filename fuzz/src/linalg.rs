//! Batches of small symmetric matrices, solved and decomposed in `f64` and judged in double-double.
//!
//! Tame matrices have elements within `2^+-20` of each other and a common power of two of any size: errors are a few
//! roundings of the norm. Wild ones have any bits: nothing may panic, and a row is either finite or reported.

use super::accuracy::{cast, finite};
use super::bytes::Bytes;
use lnn::linalg::{Failure, Workspace, condition_number, eigenvalues, eigh, inertia, is_positive_definite, solve};
use lnn::scalar::{Dd, Real, Scalar};

/// Most roundings, times the size of the matrix, that an error may have (LAPACK's limit for its tests).
const R: f64 = 30.0;

struct Batch {
    n: usize,
    rows: usize,
    tame: bool,
    matrices: Vec<f64>,
    right: Vec<f64>,
}

impl Batch {
    fn of(bytes: &mut Bytes<'_>) -> Self {
        let n = 1 + bytes.below(8);
        let rows = 1 + bytes.below(11);
        let tame = bytes.below(4) > 0;
        let (mut matrices, mut right) = (Vec::new(), Vec::new());
        for _ in 0..rows {
            // Powers of two: the same matrix in other units.
            let scale = if tame { f64::from(bytes.byte() as i8) * 3.0 } else { 0.0 };
            let mut number = || {
                if !tame {
                    return bytes.any();
                }
                let mantissa = f64::from(bytes.byte() as i8);
                let exponent = f64::from(bytes.byte() as i8 % 21);
                mantissa * (exponent + scale).exp2()
            };
            let mut m = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..=i {
                    m[i * n + j] = number();
                    m[j * n + i] = m[i * n + j];
                }
            }
            matrices.extend(m);
            right.extend((0..n).map(|_| number()));
        }
        Self { n, rows, tame, matrices, right }
    }
    fn matrix(&self, row: usize) -> &[f64] {
        &self.matrices[row * self.n * self.n..][..self.n * self.n]
    }
    fn right(&self, row: usize) -> &[f64] {
        &self.right[row * self.n..][..self.n]
    }
}

/// The matrix with elements below 1 and the power of two taken out, in double-double.
fn reduced(m: &[f64]) -> (Vec<Dd>, i32) {
    let largest = m.iter().fold(0.0f64, |most, m| most.max(m.abs()));
    let exponent = if largest > 0.0 { largest.ilogb() + 1 } else { 0 };
    (m.iter().map(|&m| Dd::of_f64(m).ldexp(-exponent)).collect(), exponent)
}

fn norm(x: &[Dd]) -> f64 {
    x.iter().map(|x| x.to_f64() * x.to_f64()).sum::<f64>().sqrt()
}

/// `M x`.
fn times(n: usize, m: &[Dd], x: &[Dd]) -> Vec<Dd> {
    (0..n).map(|i| (0..n).fold(<Dd as Real>::zero(), |sum, j| sum + m[i * n + j] * x[j])).collect()
}

/// Solves and decomposes the batch.
pub fn run(bytes: &[u8]) {
    let batch = Batch::of(&mut Bytes(bytes));
    let mut workspace = Workspace::new();
    solutions(&batch, &mut workspace);
    decompositions(&batch, &mut workspace);
    for row in 0..batch.rows {
        signs(&batch, row);
    }
}

fn solutions(batch: &Batch, workspace: &mut Workspace<f64>) {
    let n = batch.n;
    let mut x = vec![0.0; batch.right.len()];
    let outcome = solve(n, &batch.matrices, &batch.right, &mut x, workspace);
    let failures = workspace.failures().to_vec();
    assert_eq!(outcome.is_ok(), failures.is_empty());
    for row in 0..batch.rows {
        let (m, r, x) = (batch.matrix(row), batch.right(row), &x[row * n..][..n]);
        let mut alone = vec![0.0; n];
        let outcome = solve(n, m, r, &mut alone, workspace);
        assert_eq!(bits(&alone), bits(x), "a matrix gives the same bits anywhere in a batch: {m:?} {r:?}");
        let failure = failures.iter().find(|f| f.0 == row).map(|f| f.1);
        assert_eq!(outcome.is_err(), failure.is_some());
        if let Some(failure) = failure {
            assert!(x.iter().all(|x| x.is_nan()));
            if let Failure::Singular { .. } = failure
                && batch.tame
            {
                let condition = condition_number(n, &reduced(m).0, &mut Workspace::new()).expect("finite");
                assert!(condition > 1e-2 / f64::EPSILON, "{m:?} is called singular at {condition:e}");
            }
            continue;
        }
        assert!(finite(x) && finite(m) && finite(r), "{m:?} {r:?} {x:?}");
        if batch.tame {
            let ((m, a), (r, b)) = (reduced(m), reduced(r));
            let x: Vec<Dd> = x.iter().map(|&x| Dd::of_f64(x).ldexp(a - b)).collect();
            let product = times(n, &m, &x);
            let residual: Vec<Dd> = product.iter().zip(&r).map(|(&p, &r)| p - r).collect();
            let scale = norm(&m) * norm(&x) + norm(&r);
            let error = norm(&residual) / (scale * n as f64 * f64::EPSILON);
            assert!(scale == 0.0 || error < R, "backward error {error} of {m:?} {r:?} {x:?}");
        }
    }
}

fn decompositions(batch: &Batch, workspace: &mut Workspace<f64>) {
    let n = batch.n;
    let (mut values, mut vectors) = (vec![0.0; batch.right.len()], batch.matrices.clone());
    let outcome = eigh(n, &batch.matrices, &mut values, &mut vectors, workspace);
    assert_eq!(outcome.is_ok(), workspace.failures().is_empty());
    let failures = workspace.failures().to_vec();
    for row in 0..batch.rows {
        let m = batch.matrix(row);
        let (w, u) = (&values[row * n..][..n], &vectors[row * n * n..][..n * n]);
        if failures.iter().any(|f| f.0 == row) {
            assert!(w.iter().chain(u).all(|x| x.is_nan()));
            continue;
        }
        assert!(finite(m) && finite(w) && finite(u) && w.is_sorted(), "{m:?}: {w:?} {u:?}");
        if batch.tame {
            let (m, exponent) = reduced(m);
            let u: Vec<Dd> = cast(u);
            let w: Vec<Dd> = w.iter().map(|&w| Dd::of_f64(w).ldexp(-exponent)).collect();
            let mut exact = w.clone();
            eigenvalues(n, &m, &mut exact, &mut Workspace::new()).expect("finite");
            let size = norm(&m);
            let mut error = 0f64;
            for k in 0..n {
                let row = &u[k * n..][..n];
                let image = times(n, &m, row);
                let residual: Vec<Dd> = image.iter().zip(row).map(|(&y, &u)| y - w[k] * u).collect();
                error = error.max(norm(&residual)).max((w[k] - exact[k]).to_f64().abs());
                for j in 0..=k {
                    let dot = (0..n).fold(<Dd as Real>::zero(), |sum, i| sum + row[i] * u[j * n + i]).to_f64();
                    error = error.max(size * (dot - f64::from(u8::from(j == k))).abs());
                }
            }
            let error = error / (n as f64 * f64::EPSILON);
            assert!(error <= R * size, "error {error} of {m:?}: {w:?} {u:?}");
        }
    }
}

/// Inertia and definiteness, where no eigenvalue is within rounding of zero.
fn signs(batch: &Batch, row: usize) {
    let (n, m) = (batch.n, batch.matrix(row));
    let mut scratch = vec![0.0; n * n];
    let definite = is_positive_definite(n, m, &mut scratch);
    let Ok(found) = inertia(n, m, &mut scratch) else { return assert!(!finite(m)) };
    assert_eq!(found.positive + found.zero + found.negative, n);
    if !batch.tame {
        return;
    }
    let (m, _) = reduced(m);
    let mut w = vec![<Dd as Real>::zero(); n];
    eigenvalues(n, &m, &mut w, &mut Workspace::new()).expect("finite");
    let rounding = R * n as f64 * f64::EPSILON * norm(&m);
    if w.iter().all(|w| w.to_f64().abs() > rounding) {
        let positive = w.iter().filter(|w| w.to_f64() > 0.0).count();
        assert_eq!((found.positive, found.zero), (positive, 0), "{m:?} has eigenvalues {w:?}");
        assert_eq!(definite, positive == n, "{m:?} has eigenvalues {w:?}");
    }
}

fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }).collect()
}
