//! Euler-Lagrange terms of hand-written systems: states per second, against num-dual's Hessian of the same Lagrangian.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lnn::lagrangian::{self, Request, Terms};
use nalgebra_of_num_dual::SVector;
use num_dual::{Dual2SVec64, DualNum, hessian};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::time::Duration;

/// The double pendulum's Lagrangian over num-dual's numbers, unit masses and lengths.
fn double_pendulum(x: &SVector<Dual2SVec64<4>, 4>) -> Dual2SVec64<4> {
    let (u, w) = (x[2], x[3]);
    let kinetic = u * u + w * w * 0.5 + u * w * (x[0] - x[1]).cos();
    kinetic + (x[0].cos() * 2.0 + x[1].cos()) * 9.8
}

fn benches(c: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for system in lagrangian::systems() {
        let n = system.size.default();
        let configured = lagrangian::configure::<f64>(system.name, &[]).expect("the defaults are valid");
        let built = configured.build().expect("the system is of the catalogue");
        let bounds = (system.validation)(n);
        let mut group = c.benchmark_group(system.name);
        group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_millis(1500));
        for batch in [1, 16, 128, 1024] {
            let mut draw = |b: &[(f64, f64)]| -> Vec<f64> {
                (0..batch * n).map(|k| rng.random_range(b[k % n].0..=b[k % n].1)).collect()
            };
            let (q, mut v) = (draw(&bounds.positions), draw(&bounds.velocities));
            for (q, v) in q.chunks_exact(n).zip(v.chunks_exact_mut(n)) {
                configured.impose_constraint(q, v).expect("the state has n coordinates");
            }
            let mut terms = Terms::default();
            group.throughput(Throughput::Elements(batch as u64));
            for (name, request) in
                [("energy", Request::ENERGY), ("acceleration", Request::ACCELERATION), ("all", Request::ALL)]
            {
                group.bench_function(BenchmarkId::new(name, batch), |b| {
                    b.iter(|| built.terms(black_box(&q), &v, request, &mut terms));
                });
            }
            if system.name == "double-pendulum" {
                group.bench_function(BenchmarkId::new("num-dual hessian", batch), |b| {
                    b.iter(|| {
                        for (q, v) in q.chunks_exact(2).zip(v.chunks_exact(2)) {
                            let x = SVector::from([q[0], q[1], v[0], v[1]]);
                            black_box(hessian(|x| double_pendulum(&x), &black_box(x)));
                        }
                    });
                });
            }
        }
        group.finish();
    }
}

criterion_group!(systems_benches, benches);
criterion_main!(systems_benches);
