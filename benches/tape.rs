//! Speed of the tapes: nanoseconds per node, gradients of the double pendulum's acceleration error.

#[path = "shared/ratio.rs"]
mod ratio;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lnn::forward::Jet2;
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Adjoints, Program, Replay, Tape, Tracer, Var};
use std::hint::black_box;
use std::sync::Arc;

/// Squared difference between the double pendulum's accelerations and `target`; parameters `m1, m2, l1, l2, g`, state
/// `theta1, theta2, omega1, omega2`.
fn error<R: Real>(p: &[R], x: &[R], target: &[R]) -> R {
    let [m1, m2, l1, l2, g] = [p[0], p[1], p[2], p[3], p[4]];
    let (sin, cos) = (x[0] - x[1]).sin_cos();
    let a1 = (l2 / l1) * (m2 / (m1 + m2)) * cos;
    let a2 = (l1 / l2) * cos;
    let f1 = -(l2 / l1) * (m2 / (m1 + m2)) * x[3].sqr() * sin - (g / l1) * x[0].sin();
    let f2 = (l1 / l2) * x[2].sqr() * sin - (g / l2) * x[1].sin();
    let det = R::one() - a1 * a2;
    let (u, v) = ((f1 - a1 * f2) / det, (f2 - a2 * f1) / det);
    (u - target[0]).sqr() + (v - target[1]).sqr()
}

fn states<S: Scalar>(count: usize) -> Vec<S> {
    (0..6 * count).map(|i| S::of_f64((i as f64 * 0.7391).sin() * 2.0)).collect()
}

const PARAMETERS: [f64; 5] = [1.0, 0.8, 1.1, 0.9, 9.81];

fn nodes(c: &mut Criterion) {
    let mut group = c.benchmark_group("eager tape, record and sweep");
    let count = 10_000;
    group.throughput(Throughput::Elements(count));
    let (mut tape, mut adjoints) = (Tape::<f64>::new(), Adjoints::new());
    group.bench_function("products and sums, per node", |b| {
        b.iter(|| {
            tape.reset();
            let x = tape.variable(black_box(1.0001));
            let mut y = x;
            for _ in 0..count / 2 {
                y *= x;
                y += x;
            }
            tape.reverse(y, &mut adjoints).unwrap();
            adjoints.of(x)
        });
    });
    group.bench_function("eight independent chains, per node", |b| {
        b.iter(|| {
            tape.reset();
            let x: [Var<'_, f64>; 8] = std::array::from_fn(|k| tape.variable(black_box(1.0 + k as f64 * 1e-4)));
            let mut y = x;
            for _ in 0..count / 16 {
                for k in 0..8 {
                    y[k] *= x[7 - k];
                    y[k] += x[k];
                }
            }
            let sum = y.into_iter().fold(Var::zero(), |sum, y| sum + y);
            tape.reverse(sum, &mut adjoints).unwrap();
            adjoints.of(x[0])
        });
    });
    group.finish();
}

/// Sum of the errors of all states as numbers on a tape.
fn recorded<'t, S: Scalar>(p: &[Var<'t, S>], data: &[S]) -> Var<'t, S> {
    let mut sum = Var::zero();
    for row in data.chunks(6) {
        let lift = |i: usize| Var::lift(row[i]);
        sum += error(p, &[lift(0), lift(1), lift(2), lift(3)], &[lift(4), lift(5)]);
    }
    sum
}

/// The same in floats.
fn plain<S: Scalar>(p: &[S], data: &[S]) -> S {
    data.chunks(6).fold(S::of_f64(0.0), |sum, row| sum + error(p, &row[..4], &row[4..]))
}

/// Gradients and values against each other in the same run.
fn ratios<S: Scalar>(_: &mut Criterion) {
    let parameters = PARAMETERS.map(S::of_f64);
    let (mut tape, mut adjoints) = (Tape::<S>::new(), Adjoints::new());
    for count in [100, 1024] {
        let data = states::<S>(count);
        let name = |what: &str| format!("double pendulum error, {}, {count} states, {what}", S::NAME);
        let mut eager = || {
            tape.reset();
            let p = black_box(parameters).map(|p| tape.variable(p));
            tape.reverse(recorded(&p, &data), &mut adjoints).unwrap();
            black_box(p.map(|p| adjoints.of(p)));
        };
        let value = || {
            black_box(plain(black_box(&parameters), &data));
        };
        ratio::compare(&name("floats, eager gradient"), count, "at most 5", value, &mut eager);
        let program = Program::<S>::record(6, 5, |x, p| vec![error(p, &x[..4], &x[4..])]).unwrap();
        let mut replay = Replay::new(Arc::new(program));
        let mut y = vec![S::of_f64(0.0); count];
        let lanes = || {
            replay.evaluate(count, &[&data], black_box(&parameters), &mut [&mut y]).unwrap();
            black_box(&y);
        };
        ratio::compare(&name("value by lanes, floats"), count, "at least 1.7", lanes, value);
        tape.reset();
        let p = parameters.map(|p| tape.variable(p));
        black_box(recorded(&p, &data).value());
        println!("{}: {}", name("nodes"), tape.statistics().nodes);
    }
}

fn pendulum<S: Scalar>(c: &mut Criterion) {
    let mut group = c.benchmark_group(format!("double pendulum acceleration error, {}", S::NAME));
    let parameters = PARAMETERS.map(S::of_f64);
    for count in [100, 1024] {
        let data = states::<S>(count);
        group.throughput(Throughput::Elements(count as u64));
        group.bench_function(BenchmarkId::new("value, floats", count), |b| {
            b.iter(|| plain(black_box(&parameters), &data));
        });
        let (mut tape, mut adjoints) = (Tape::<S>::new(), Adjoints::new());
        group.bench_function(BenchmarkId::new("gradient, eager tape", count), |b| {
            b.iter(|| {
                tape.reset();
                let p = black_box(parameters).map(|p| tape.variable(p));
                tape.reverse(recorded(&p, &data), &mut adjoints).unwrap();
                p.map(|p| adjoints.of(p))
            });
        });
        let program = Program::<S>::record(6, 5, |x, p| vec![error(p, &x[..4], &x[4..])]).unwrap();
        let mut replay = Replay::new(Arc::new(program));
        let mut y = vec![S::of_f64(0.0); count];
        group.bench_function(BenchmarkId::new("value, lanes", count), |b| {
            b.iter(|| replay.evaluate(count, &[&data], black_box(&parameters), &mut [&mut y]).unwrap());
        });
    }
    group.finish();
}

/// Lagrangian of the double pendulum with unit masses and lengths.
fn lagrangian<R: Real>(q: [R; 2], v: [R; 2]) -> R {
    let g = R::of(9.81);
    v[0].sqr() + R::half() * v[1].sqr() + v[0] * v[1] * (q[0] - q[1]).cos() + g * (R::two() * q[0].cos() + q[1].cos())
}

fn second_order(c: &mut Criterion) {
    let mut group = c.benchmark_group("double pendulum Lagrangian, second derivatives, one state");
    let x = [0.3f64, -0.7, 1.1, 0.2];
    group.bench_function("all four variables", |b| {
        b.iter(|| {
            let z = |i: usize| Jet2::<f64, 4>::variable(black_box(x[i]), i);
            lagrangian([z(0), z(1)], [z(2), z(3)])
        });
    });
    group.bench_function("velocities only", |b| {
        b.iter(|| {
            let (q, v) = (|i: usize| Jet2::<f64, 2>::lift(black_box(x[i])), |i: usize| Jet2::variable(x[2 + i], i));
            lagrangian([q(0), q(1)], [v(0), v(1)])
        });
    });
    let program = Program::<f64>::record(4, 0, |x, _| {
        let z: [Jet2<Tracer<'_, f64>, 4>; 4] = std::array::from_fn(|i| Jet2::variable(x[i], i));
        let jet = lagrangian([z[0], z[1]], [z[2], z[3]]);
        jet.gradient
            .into_iter()
            .chain((0..10).map(|k| jet.second([0, 1, 1, 2, 2, 2, 3, 3, 3, 3][k], [0, 0, 1, 0, 1, 2, 0, 1, 2, 3][k])))
            .collect()
    })
    .unwrap();
    let mut replay = Replay::new(Arc::new(program));
    let (data, mut out) = (states::<f64>(1024)[..4096].to_vec(), vec![0.0; 14 * 1024]);
    group.bench_function("all four, 1024 states in lanes", |b| {
        b.iter(|| replay.evaluate(1024, &[black_box(&data)], &[], &mut [&mut out]).unwrap());
    });
    group.finish();
}

criterion_group!(
    benches,
    ratios::<f32>,
    ratios::<f64>,
    nodes,
    pendulum::<f32>,
    pendulum::<f64>,
    pendulum::<Dd>,
    second_order
);
criterion_main!(benches);
