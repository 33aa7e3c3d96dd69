//! Throughput of network Lagrangians: mass matrices and motion per state, and the whole training step.
//!
//! `cargo bench --bench network`; the suffix of a name is `n`, hidden width, batch, precision. Elements are states.

#[path = "shared/networks.rs"]
mod networks;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::network::{Architecture, Initialization};
use lnn::optimizers::{Method, Moments, Update};
use lnn::scalar::Scalar;
use lnn::tape::{Depth, Evaluation, STATES};
use lnn::training::Objective;
use networks::architecture;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::time::Duration;

struct Setup<S> {
    architecture: Architecture,
    weights: Vec<S>,
    data: Dataset<S>,
}

fn setup<S: Scalar>(n: usize, width: usize, batch: usize) -> Setup<S> {
    let architecture = architecture(n, width, 1.0);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let weights = architecture.initial_weights(Initialization::Default, &mut rng);
    let mut draw = || (0..batch * n).map(|_| S::of_f64(rng.random_range(-10.0..10.0))).collect();
    let data = Dataset::new(n, draw(), draw(), draw()).expect("finite numbers");
    Setup { architecture, weights, data }
}

fn evaluation<S: Scalar>(c: &mut Criterion, n: usize, width: usize, batch: usize) {
    let Setup { architecture, weights, data } = setup::<S>(n, width, batch);
    let mut chunk = Evaluation::new(architecture.model().lagrangian().clone());
    let mut group = c.benchmark_group("one thread");
    group.throughput(Throughput::Elements(batch as u64));
    for (name, depth) in [
        ("value", Depth::Value),
        ("gradient", Depth::Gradient),
        ("mass matrix", Depth::MassMatrix),
        ("motion", Depth::Motion),
    ] {
        let id = BenchmarkId::new(name, format!("n{n} w{width} b{batch} {}", S::NAME));
        group.bench_function(id, |b| {
            b.iter(|| {
                let states = data.q().chunks(STATES * n).zip(data.v().chunks(STATES * n));
                states.for_each(|(q, v)| chunk.evaluate(&weights, black_box(q), black_box(v), depth));
            });
        });
    }
    group.finish();
}

fn step<S: Scalar>(c: &mut Criterion, n: usize, width: usize, batch: usize) {
    let Setup { architecture, mut weights, data } = setup::<S>(n, width, batch);
    let rows: Vec<u32> = (0..batch as u32).collect();
    let mut gradient = weights.clone();
    let mut group = c.benchmark_group("training step");
    group.throughput(Throughput::Elements(batch as u64));
    for threads in [1, 2] {
        let penalty = Penalty::Eigenvalue { lambda: 5.0 };
        let mut objective = Objective::new(&architecture, penalty, threads).expect("threads");
        let mut moments = Moments::new(weights.len());
        let update = Update { method: Method::Radam, rate: 1e-5, weight_decay: 1e-6, decaying: usize::MAX, clip: 1.0 };
        let id = BenchmarkId::new(format!("{threads} threads"), format!("n{n} w{width} b{batch} {}", S::NAME));
        group.bench_function(id, |b| {
            b.iter(|| {
                objective.step(&weights, &data, &rows, &mut gradient);
                moments.update(&mut weights, &mut gradient, &update)
            });
        });
    }
    group.finish();
}

fn all(c: &mut Criterion) {
    step::<f32>(c, 2, 500, 128);
    step::<f32>(c, 4, 500, 128);
    step::<f64>(c, 2, 500, 128);
    step::<f32>(c, 2, 128, 128);
    for n in [1, 2, 4, 8, 20] {
        evaluation::<f32>(c, n, 128, 128);
    }
    for width in [64, 256, 500, 1000] {
        evaluation::<f32>(c, 2, width, 128);
        evaluation::<f64>(c, 2, width, 128);
    }
    for batch in [1, 16, 1024, 4096] {
        evaluation::<f32>(c, 2, 128, batch);
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1500));
    targets = all
}
criterion_main!(benches);
