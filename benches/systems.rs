//! Euler-Lagrange terms of hand-written systems: states per second, against num-dual's Hessian of the same Lagrangian.

#[path = "shared/ratio.rs"]
mod ratio;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lnn::geometry::Geometry;
use lnn::lagrangian::{self, Accelerations, Linearizer, Request, Terms, Torques};
use lnn::pipeline::parse_system;
use lnn::scalar::Scalar;
use nalgebra_of_num_dual::SVector;
use num_dual::{Dual2SVec32, Dual2SVec64, DualNum, hessian};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::borrow::Cow;
use std::hint::black_box;
use std::time::Duration;

/// The double pendulum's Lagrangian over num-dual's numbers, unit masses and lengths, and all its second derivatives.
macro_rules! num_dual_hessian {
    ($name:ident, $float:ty, $number:ty) => {
        fn $name(q: &[$float], v: &[$float]) {
            let lagrangian = |x: &SVector<$number, 4>| {
                let (u, w) = (x[2], x[3]);
                let kinetic = u * u + w * w * 0.5 + u * w * (x[0] - x[1]).cos();
                kinetic + (x[0].cos() * 2.0 + x[1].cos()) * 9.8
            };
            let x = SVector::from([q[0], q[1], v[0], v[1]]);
            black_box(hessian(|x| lagrangian(&x), &black_box(x)));
        }
    };
}
num_dual_hessian!(hessian_f32, f32, Dual2SVec32<4>);
num_dual_hessian!(hessian_f64, f64, Dual2SVec64<4>);

/// The double pendulum's terms against the Hessian of its Lagrangian, one state at a time, in the same run.
fn ratios<S: Scalar>(one: fn(&[S], &[S])) {
    let batch = 1024;
    let built = lagrangian::SystemInstance::<S>::named("double-pendulum", &[])
        .expect("the defaults are valid")
        .build()
        .expect("the defaults are valid");
    let numbers =
        |shift: f64| -> Vec<S> { (0..2 * batch).map(|i| S::of_f64((shift + 0.7391 * i as f64).sin() * 2.0)).collect() };
    let (q, v) = (numbers(0.1), numbers(0.7));
    let mut terms = Terms::default();
    for (name, request) in [
        ("mass matrix and coriolis term", Request::MASS_MATRIX | Request::CORIOLIS),
        ("acceleration", Request::ACCELERATION),
    ] {
        let batched = || built.terms(black_box(&q), &v, request, &mut terms).expect("regular states");
        let each = || q.chunks_exact(2).zip(v.chunks_exact(2)).for_each(|(q, v)| one(q, v));
        let name = format!("double pendulum, {}, {name}, num-dual's Hessian", S::NAME);
        ratio::compare(&name, batch, "at least 3", batched, each);
    }
}

/// The accelerations of a batch by the Lagrangian of a file against those by the same Lagrangian as code, in the same run.
fn described(text: &str, name: &str) {
    let batch = 1024;
    let system = parse_system(text).expect("an example is valid");
    let written = lagrangian::SystemInstance::<f64>::new(Cow::Owned(system), &[]).expect("the defaults are valid");
    let coded = lagrangian::SystemInstance::<f64>::named(name, &[]).expect("the defaults are valid");
    let (n, bounds) = (coded.coordinates, coded.system.validation(coded.coordinates));
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut draw =
        |b: &[(f64, f64)]| -> Vec<f64> { (0..batch * n).map(|k| rng.random_range(b[k % n].0..=b[k % n].1)).collect() };
    let (q, v) = (draw(&bounds.positions), draw(&bounds.velocities));
    let (own, code) = (written.build().expect("it is described"), coded.build().expect("it is of the catalogue"));
    let (mut ours, mut theirs) = (Terms::default(), Terms::default());
    let request = Request::ACCELERATION;
    let file = || own.terms(black_box(&q), &v, request, &mut ours).expect("regular states");
    let code = || code.terms(black_box(&q), &v, request, &mut theirs).expect("regular states");
    ratio::compare(&format!("{name} of a file, acceleration, the same as code"), batch, "at least 0.67", file, code);
}

/// Torques and accelerations of an arm of seven joints with general inertias, one state, by recursion over the links and by the Lagrangian.
fn seven_joints(c: &mut Criterion) {
    let mut group = c.benchmark_group("seven joints, one state");
    for friction in ["false", "true"] {
        let text = include_str!("../examples/systems/seven_joints.toml");
        let text = text.replace("friction = true", &format!("friction = {friction}"));
        let mut configured =
            lagrangian::SystemInstance::<f64>::new(Cow::Owned(parse_system(&text).expect("an example is valid")), &[])
                .expect("the defaults are valid");
        // No constant of an arm is zero.
        configured.parameters.iter_mut().enumerate().for_each(|(k, p)| *p += 0.02 + 0.01 * (k as f64).sin());
        let arm = configured.build().expect("regular constants");
        let [q, v, a] =
            [0.3, 1.1, 2.7].map(|shift| (0..7).map(|i| (shift + 1.3 * f64::from(i)).sin()).collect::<Vec<_>>());
        let (mut torques, mut accelerations) = (Torques::new(&*arm), Accelerations::new(&*arm));
        let (mut out, mut terms, mut linearizer) = (vec![0.0; 7], Terms::default(), Linearizer::new(&*arm));
        // `benches/peers/arm.sh` compares them with another program's.
        torques.at(&q, &v, &a, &mut out).expect("finite");
        println!("torques, friction {friction}: {out:?}");
        accelerations.at(&q, &v, &mut out).expect("regular");
        println!("accelerations, friction {friction}: {out:?}");
        println!("da/dq, friction {friction}: {:?}", linearizer.at(&q, &v).expect("regular").by_q);
        group.bench_function(BenchmarkId::new("inverse dynamics, friction", friction), |b| {
            b.iter(|| torques.at(black_box(&q), &v, &a, &mut out).expect("finite"));
        });
        group.bench_function(BenchmarkId::new("accelerations, friction", friction), |b| {
            b.iter(|| accelerations.at(black_box(&q), &v, &mut out).expect("regular"));
        });
        group.bench_function(BenchmarkId::new("accelerations by the Lagrangian, friction", friction), |b| {
            b.iter(|| arm.terms(black_box(&q), &v, Request::ACCELERATION, &mut terms).expect("regular"));
        });
        group.bench_function(BenchmarkId::new("linearization, friction", friction), |b| {
            b.iter(|| linearizer.at(black_box(&q), &v).expect("regular").by_q[0]);
        });
    }
    group.finish();
}

fn benches(c: &mut Criterion) {
    seven_joints(c);
    described(include_str!("../examples/systems/two_pendula.toml"), "double-pendulum");
    described(include_str!("../examples/systems/black_hole.toml"), "schwarzschild-geodesic");
    ratios::<f32>(hessian_f32);
    ratios::<f64>(hessian_f64);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let longer = ["8", "20"].map(|n| ("n-pendulum", vec![("n".to_string(), n.to_string())]));
    let systems =
        lagrangian::System::unconstrained().iter().map(|system| (system.name.as_ref(), Vec::new())).chain(longer);
    for (name, given) in systems {
        let configured = lagrangian::SystemInstance::<f64>::named(name, &given).expect("the values are valid");
        let (system, n) = (&configured.system, configured.coordinates);
        let built = configured.build().expect("the system is of the catalogue");
        let bounds = system.validation(n);
        let number = given.first().map_or(String::new(), |(_, n)| format!(" of {n}"));
        let mut group = c.benchmark_group(format!("{name}{number}"));
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
            for (what, request) in
                [("energy", Request::ENERGY), ("acceleration", Request::ACCELERATION), ("all", Request::ALL)]
            {
                group.bench_function(BenchmarkId::new(what, batch), |b| {
                    b.iter(|| built.terms(black_box(&q), &v, request, &mut terms));
                });
            }
            if system.time_like.is_some() && batch == 128 {
                let rest = vec![0.0; n];
                group.bench_function(BenchmarkId::new("geometry", batch), |b| {
                    b.iter(|| Geometry::of(&*built, black_box(&q), &rest));
                });
            }
            if name == "double-pendulum" {
                group.bench_function(BenchmarkId::new("num-dual hessian", batch), |b| {
                    b.iter(|| {
                        q.chunks_exact(2).zip(v.chunks_exact(2)).for_each(|(q, v)| hessian_f64(q, v));
                    });
                });
            }
        }
        group.finish();
    }
}

criterion_group!(systems_benches, benches);
criterion_main!(systems_benches);
