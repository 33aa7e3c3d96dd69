//! Batched small symmetric matrices: lanes against faer and nalgebra, one matrix at a time.
//!
//! Random matrices with a heavy diagonal; the rows named `lorentzian` have one negative eigenvalue and a time-like
//! diagonal element that vanishes. faer once as its solver objects and once with buffers kept (`faer kept`).
//! Sizes 32 to 64 show from where faer's own decompositions are chosen: there `lanes` is faer too, with our judgement of
//! singular matrices.

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::linalg::solvers::Solve;
use faer::{MatMut, MatRef, Par, Side, Spec};
use lnn::linalg::{self, Workspace};
use lnn::scalar::Scalar;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::time::Duration;

const BATCH: usize = 1024;

/// Numbers that all three know.
trait Number: Scalar + faer::traits::RealField + nalgebra::RealField {}
impl Number for f32 {}
impl Number for f64 {}

/// Random symmetric matrices and right-hand sides.
fn data<S: Number>(n: usize, lorentzian: bool) -> (Vec<S>, Vec<S>) {
    let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
    let mut matrices = vec![S::of_f64(0.0); BATCH * n * n];
    for m in matrices.chunks_exact_mut(n * n) {
        for i in 0..n {
            for j in 0..=i {
                let x = rng.random_range(-1.0..1.0) + if i == j { 2.0 } else { 0.0 };
                m[i * n + j] = S::of_f64(if lorentzian && i == 0 { 0.0 } else { x });
                m[j * n + i] = m[i * n + j];
            }
        }
    }
    (matrices, (0..BATCH * n).map(|_| S::of_f64(rng.random_range(-1.0..1.0))).collect())
}

/// nalgebra with its size known to the compiler.
macro_rules! nalgebra_static {
    ($n:literal, $matrices:ident, $rhs:ident, $x:ident) => {
        for ((m, r), x) in $matrices.chunks_exact($n * $n).zip($rhs.chunks_exact($n)).zip($x.chunks_exact_mut($n)) {
            let found = SMatrix::<S, $n, $n>::from_column_slice(m).lu().solve(&SVector::from_column_slice(r));
            if let Some(found) = found {
                x.copy_from_slice(found.as_slice());
            }
        }
    };
}

fn nalgebra_solve<S: Number>(n: usize, matrices: &[S], rhs: &[S], x: &mut [S]) {
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

/// faer's LU with everything allocated before.
fn faer_solve<S: Number>(n: usize, matrices: &[S], rhs: &[S], x: &mut [S], factors: &mut [S], memory: &mut MemBuffer) {
    let (mut order, mut inverse) = ([0_usize; 64], [0_usize; 64]);
    x.copy_from_slice(rhs);
    for (m, x) in matrices.chunks_exact(n * n).zip(x.chunks_exact_mut(n)) {
        factors.copy_from_slice(m);
        let mut lu = MatMut::from_column_major_slice_mut(factors, n, n);
        let stack = MemStack::new(memory);
        let (order, inverse) = (&mut order[..n], &mut inverse[..n]);
        let (_, order) = factor::lu_in_place(lu.as_mut(), order, inverse, Par::Seq, stack, Spec::default());
        let x = MatMut::from_column_major_slice_mut(x, n, 1);
        solve::solve_in_place(lu.as_ref(), lu.as_ref(), order, x, Par::Seq, stack);
    }
}

/// faer's eigendecomposition with everything allocated before.
fn faer_eigh<S: Number>(n: usize, matrices: &[S], values: &mut [S], vectors: &mut [S], memory: &mut MemBuffer) {
    let each = matrices.chunks_exact(n * n).zip(values.chunks_exact_mut(n)).zip(vectors.chunks_exact_mut(n * n));
    for ((m, w), u) in each {
        let found = self_adjoint_evd(
            MatRef::from_column_major_slice(m, n, n),
            DiagMut::from_slice_mut(w),
            Some(MatMut::from_column_major_slice_mut(u, n, n)),
            Par::Seq,
            MemStack::new(memory),
            Spec::default(),
        );
        assert!(found.is_ok());
    }
}

/// What faer needs at size `n`.
fn memory<S: Number>(n: usize) -> MemBuffer {
    MemBuffer::new(StackReq::any_of(&[
        factor::lu_in_place_scratch::<usize, S>(n, n, Par::Seq, Spec::default()),
        solve::solve_in_place_scratch::<usize, S>(n, 1, Par::Seq),
        self_adjoint_evd_scratch::<S>(n, ComputeEigenvectors::Yes, Par::Seq, Spec::default()),
    ]))
}

fn lanes<S: Number>(group: &mut BenchmarkGroup<'_, WallTime>, name: &str, n: usize, m: &[S], r: &[S]) {
    let (mut x, mut u, mut w) = (r.to_vec(), m.to_vec(), r.to_vec());
    let mut workspace = Workspace::new();
    group.bench_function(BenchmarkId::new("solve", name), |b| {
        b.iter(|| linalg::solve(n, black_box(m), r, &mut x, &mut workspace));
    });
    group.bench_function(BenchmarkId::new("eigh", name), |b| {
        b.iter(|| linalg::eigh(n, black_box(m), &mut w, &mut u, &mut workspace));
    });
    group.bench_function(BenchmarkId::new("eigenvalues", name), |b| {
        b.iter(|| linalg::eigenvalues(n, black_box(m), &mut w, &mut workspace));
    });
    group.bench_function(BenchmarkId::new("inverse", name), |b| {
        b.iter(|| linalg::inverse(n, black_box(m), &mut u, &mut workspace));
    });
}

fn faer<S: Number>(group: &mut BenchmarkGroup<'_, WallTime>, n: usize, m: &[S], r: &[S]) {
    let (mut x, mut u, mut w, mut factors) = (r.to_vec(), m.to_vec(), r.to_vec(), m[..n * n].to_vec());
    let mut memory = memory::<S>(n);
    group.bench_function(BenchmarkId::new("solve", "faer"), |b| {
        b.iter(|| {
            for ((m, r), x) in m.chunks_exact(n * n).zip(r.chunks_exact(n)).zip(x.chunks_exact_mut(n)) {
                let m = MatRef::from_column_major_slice(black_box(m), n, n);
                let found = m.partial_piv_lu().solve(MatRef::from_column_major_slice(r, n, 1));
                x.iter_mut().enumerate().for_each(|(i, x)| *x = found[(i, 0)]);
            }
        });
    });
    group.bench_function(BenchmarkId::new("solve", "faer kept"), |b| {
        b.iter(|| faer_solve(n, black_box(m), r, &mut x, &mut factors, &mut memory));
    });
    group.bench_function(BenchmarkId::new("eigh", "faer"), |b| {
        b.iter(|| {
            for (m, w) in m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)) {
                let m = MatRef::from_column_major_slice(black_box(m), n, n);
                if let Ok(found) = m.self_adjoint_eigen(Side::Lower) {
                    w.iter_mut().enumerate().for_each(|(i, w)| *w = found.S()[i]);
                }
            }
        });
    });
    group.bench_function(BenchmarkId::new("eigh", "faer kept"), |b| {
        b.iter(|| faer_eigh(n, black_box(m), &mut w, &mut u, &mut memory));
    });
}

fn nalgebra<S: Number>(group: &mut BenchmarkGroup<'_, WallTime>, n: usize, m: &[S], r: &[S]) {
    let (mut x, mut u, mut w) = (r.to_vec(), m.to_vec(), r.to_vec());
    group.bench_function(BenchmarkId::new("solve", "nalgebra"), |b| {
        b.iter(|| nalgebra_solve(n, black_box(m), r, &mut x));
    });
    group.bench_function(BenchmarkId::new("eigh", "nalgebra"), |b| {
        b.iter(|| {
            for (m, w) in m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)) {
                let found = DMatrix::from_column_slice(n, n, black_box(m)).symmetric_eigen();
                w.copy_from_slice(found.eigenvalues.as_slice());
            }
        });
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
}

fn sizes<S: Number>(c: &mut Criterion) {
    for n in [2, 3, 4, 6, 8, 12, 20, 32, 40, 48, 64] {
        let (m, r) = data::<S>(n, false);
        let mut group = c.benchmark_group(format!("{}/n{n}", <S as Scalar>::NAME));
        group.throughput(Throughput::Elements(BATCH as u64));
        group.sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(500));
        lanes(&mut group, "lanes", n, &m, &r);
        faer(&mut group, n, &m, &r);
        nalgebra(&mut group, n, &m, &r);
        let mut scratch = vec![S::of_f64(0.0); n * n];
        group.bench_function(BenchmarkId::new("is_positive_definite", "pivots"), |b| {
            b.iter(|| m.chunks_exact(n * n).filter(|m| linalg::is_positive_definite(n, m, &mut scratch)).count());
        });
        let (m, r) = data::<S>(n, true);
        lanes(&mut group, "lorentzian", n, &m, &r);
        group.finish();
    }
}

fn benches(c: &mut Criterion) {
    sizes::<f64>(c);
    sizes::<f32>(c);
}

criterion_group!(linalg_benches, benches);
criterion_main!(linalg_benches);
