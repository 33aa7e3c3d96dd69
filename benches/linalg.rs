//! Batched small symmetric matrices: lanes against faer and nalgebra, one matrix at a time.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use faer::linalg::solvers::Solve;
use lnn::linalg::{self, Workspace};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::time::Duration;

const BATCH: usize = 1024;

/// Random symmetric matrices, diagonally heavy, and right-hand sides.
fn data(n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
    let mut matrices = vec![0.0; BATCH * n * n];
    for m in matrices.chunks_exact_mut(n * n) {
        for i in 0..n {
            for j in 0..=i {
                let x = rng.random_range(-1.0..1.0) + if i == j { 2.0 } else { 0.0 };
                m[i * n + j] = x;
                m[j * n + i] = x;
            }
        }
    }
    (matrices, (0..BATCH * n).map(|_| rng.random_range(-1.0..1.0)).collect())
}

/// nalgebra with its size known to the compiler.
macro_rules! nalgebra_static {
    ($n:literal, $matrices:ident, $rhs:ident, $x:ident) => {
        for ((m, r), x) in $matrices.chunks_exact($n * $n).zip($rhs.chunks_exact($n)).zip($x.chunks_exact_mut($n)) {
            let found = SMatrix::<f64, $n, $n>::from_column_slice(m).lu().solve(&SVector::from_column_slice(r));
            if let Some(found) = found {
                x.copy_from_slice(found.as_slice());
            }
        }
    };
}

fn nalgebra_solve(n: usize, matrices: &[f64], rhs: &[f64], x: &mut [f64]) {
    match n {
        2 => nalgebra_static!(2, matrices, rhs, x),
        3 => nalgebra_static!(3, matrices, rhs, x),
        4 => nalgebra_static!(4, matrices, rhs, x),
        6 => nalgebra_static!(6, matrices, rhs, x),
        8 => nalgebra_static!(8, matrices, rhs, x),
        _ => {
            for ((m, r), x) in matrices.chunks_exact(n * n).zip(rhs.chunks_exact(n)).zip(x.chunks_exact_mut(n)) {
                let m = DMatrix::from_column_slice(n, n, m);
                if let Some(found) = m.lu().solve(&DVector::from_column_slice(r)) {
                    x.copy_from_slice(found.as_slice());
                }
            }
        }
    }
}

fn benches(c: &mut Criterion) {
    for n in [2, 3, 4, 6, 8, 12, 20] {
        let (m, r) = data(n);
        let (mut x, mut u, mut w) = (r.clone(), m.clone(), r.clone());
        let mut workspace = Workspace::new();
        let mut group = c.benchmark_group(format!("n{n}/batch{BATCH}"));
        group.throughput(Throughput::Elements(BATCH as u64));
        group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_millis(1500));
        group.bench_function(BenchmarkId::new("solve", "lanes"), |b| {
            b.iter(|| linalg::solve(n, black_box(&m), &r, &mut x, &mut workspace));
        });
        group.bench_function(BenchmarkId::new("solve", "nalgebra"), |b| {
            b.iter(|| nalgebra_solve(n, black_box(&m), &r, &mut x));
        });
        group.bench_function(BenchmarkId::new("solve", "faer"), |b| {
            b.iter(|| {
                for ((m, r), x) in m.chunks_exact(n * n).zip(r.chunks_exact(n)).zip(x.chunks_exact_mut(n)) {
                    let m = faer::MatRef::from_column_major_slice(m, n, n);
                    let found = m.partial_piv_lu().solve(faer::MatRef::from_column_major_slice(r, n, 1));
                    x.iter_mut().enumerate().for_each(|(i, x)| *x = found[(i, 0)]);
                }
            });
        });
        group.bench_function(BenchmarkId::new("eigh", "lanes"), |b| {
            b.iter(|| linalg::eigh(n, black_box(&m), &mut w, &mut u, &mut workspace));
        });
        group.bench_function(BenchmarkId::new("eigenvalues", "lanes"), |b| {
            b.iter(|| linalg::eigenvalues(n, black_box(&m), &mut w, &mut workspace));
        });
        group.bench_function(BenchmarkId::new("eigh", "nalgebra"), |b| {
            b.iter(|| {
                for (m, w) in m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)) {
                    let found = DMatrix::from_column_slice(n, n, black_box(m)).symmetric_eigen();
                    w.copy_from_slice(found.eigenvalues.as_slice());
                }
            });
        });
        group.bench_function(BenchmarkId::new("eigh", "faer"), |b| {
            b.iter(|| {
                for (m, w) in m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)) {
                    let m = faer::MatRef::from_column_major_slice(black_box(m), n, n);
                    if let Ok(found) = m.self_adjoint_eigen(faer::Side::Lower) {
                        w.iter_mut().enumerate().for_each(|(i, w)| *w = found.S()[i]);
                    }
                }
            });
        });
        group.bench_function(BenchmarkId::new("inverse", "lanes"), |b| {
            b.iter(|| linalg::inverse(n, black_box(&m), &mut u, &mut workspace));
        });
        group.bench_function(BenchmarkId::new("inverse", "nalgebra"), |b| {
            b.iter(|| {
                for (m, u) in m.chunks_exact(n * n).zip(u.chunks_exact_mut(n * n)) {
                    if let Some(found) = DMatrix::from_column_slice(n, n, black_box(m)).try_inverse() {
                        u.copy_from_slice(found.as_slice());
                    }
                }
            });
        });
        let mut scratch = vec![0.0; n * n];
        group.bench_function(BenchmarkId::new("is_positive_definite", "pivots"), |b| {
            b.iter(|| m.chunks_exact(n * n).filter(|m| linalg::is_positive_definite(n, m, &mut scratch)).count());
        });
        group.finish();
    }
}

criterion_group!(linalg_benches, benches);
criterion_main!(linalg_benches);
