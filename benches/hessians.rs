//! Second derivatives: the latency of one point and the throughput of a batch, of functions and of Lagrangians.
//!
//! Every function is recorded once; its values, gradients and Hessians are compared with those of the eager tape before any of them is
//! timed. `cargo bench --bench hessians`; `-- --count NAME N` evaluates one point of a row N times, for a tool that counts instructions
//! (`valgrind --tool=callgrind`): two counts give that of a point. `benches/peers/hessians.sh` times CasADi's interpreter on the same
//! functions.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group};
use lnn::lagrangian::{Accelerations, EulerLagrange, Lagrangian, Linearizer, Mechanics, Request, Terms};
use lnn::rollout::{RolloutOptions, rollout};
use lnn::scalar::{Real, vectorized};
use lnn::tape::{Function, ScalarFunction, hessian};
use std::hint::black_box;
use std::time::Instant;

/// Points of a batch.
const BATCH: usize = 1024;

struct Rosenbrock;

impl ScalarFunction for Rosenbrock {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        x.windows(2).fold(R::zero(), |f, x| f + (R::one() - x[0]).sqr() + R::of(100.0) * (x[1] - x[0].sqr()).sqr())
    }
}

/// Ackley's function, whose Hessian is full.
struct Ackley;

impl ScalarFunction for Ackley {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let mean = |sum: R| sum * R::of(1.0 / x.len() as f64);
        let squares = mean(x.iter().fold(R::zero(), |sum, x| sum + x.sqr()));
        let waves = mean(x.iter().fold(R::zero(), |sum, &x| sum + (x * R::of(std::f64::consts::TAU)).cos()));
        R::of(20.0 + std::f64::consts::E) - R::of(20.0) * (-R::of(0.2) * squares.sqrt()).exp() - waves.exp()
    }
}

/// A chain of pendula in absolute angles by running sums, unit masses and lengths.
struct Chain(usize);

impl Lagrangian for Chain {
    fn coordinates(&self) -> usize {
        self.0
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let (mut x, mut y, mut height, mut l) = (R::zero(), R::zero(), R::zero(), R::zero());
        for (&q, &v) in q.iter().zip(v) {
            let (sin, cos) = q.sin_cos();
            (x, y, height) = (x + v * cos, y + v * sin, height + cos);
            l += (x.sqr() + y.sqr()) * R::half() + height * R::of(9.8);
        }
        l
    }
}

/// Unit masses in a line, springs to the neighbours with a quartic term, fixed ends.
struct Lattice(usize);

impl Lagrangian for Lattice {
    fn coordinates(&self) -> usize {
        self.0
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let spring = |d: R| d.sqr() * R::half() + d.sqr().sqr() * R::of(0.0625);
        let kinetic = v.iter().fold(R::zero(), |l, v| l + v.sqr() * R::half());
        let inner = q.windows(2).fold(kinetic, |l, q| l - spring(q[1] - q[0]));
        inner - spring(q[0]) - spring(q[q.len() - 1])
    }
}

fn numbers(count: usize) -> Vec<f64> {
    (0..count).map(|k| (0.37 * k as f64 + 0.1).sin() + 0.5).collect()
}

/// A recorded function after a comparison with the eager tape.
fn checked(f: &impl ScalarFunction, n: usize) -> Function<f64> {
    let mut function = Function::record(n, |x| f.eval(x)).expect("no branches");
    let x = numbers(n);
    let (mut value, mut gradient, mut matrix) = ([0.0], vec![0.0; n], vec![0.0; n * n]);
    function.hessians(&x, &mut value, &mut gradient, &mut matrix).expect("a program of the second derivatives");
    let (exact, first, second) = hessian(f, &x).expect("no branches");
    let largest = second.iter().fold(1.0_f64, |size, h| size.max(h.abs()));
    for (ours, exact) in value.iter().chain(&gradient).chain(&matrix).zip([exact].iter().chain(&first).chain(&second)) {
        assert!((ours - exact).abs() < 1e-13 * largest.max(exact.abs()), "{ours} {exact}");
    }
    function
}

fn functions(c: &mut Criterion) {
    let mut group = c.benchmark_group("Hessian of one point");
    let mut row = |name: &str, f: &dyn Fn(usize) -> Function<f64>, sizes: &[usize]| {
        for &n in sizes {
            let (mut function, x) = (f(n), numbers(n));
            let (mut value, mut gradient) = ([0.0], vec![0.0; n]);
            let entries = function.pattern().expect("a program").len();
            let mut sparse = vec![0.0; entries];
            group.throughput(Throughput::Elements(entries as u64));
            group.bench_function(BenchmarkId::new(format!("{name}, pattern"), n), |b| {
                b.iter(|| function.sparse_hessians(black_box(&x), &mut value, &mut gradient, &mut sparse));
            });
            let mut dense = vec![0.0; n * n];
            group.bench_function(BenchmarkId::new(format!("{name}, dense"), n), |b| {
                b.iter(|| function.hessians(black_box(&x), &mut value, &mut gradient, &mut dense));
            });
        }
    };
    row("Rosenbrock", &|n| checked(&Rosenbrock, n), &[2, 8, 32, 128, 1024]);
    row("Ackley", &|n| checked(&Ackley, n), &[8, 128]);
    group.finish();
    let mut group = c.benchmark_group(format!("Hessians of {BATCH} points"));
    group.throughput(Throughput::Elements(BATCH as u64));
    for n in [2, 8, 32] {
        let (mut function, x) = (checked(&Rosenbrock, n), numbers(n * BATCH));
        let (mut value, mut gradient) = (vec![0.0; BATCH], vec![0.0; n * BATCH]);
        let mut dense = vec![0.0; n * n * BATCH];
        group.bench_function(BenchmarkId::new("Rosenbrock, dense", n), |b| {
            b.iter(|| function.hessians(black_box(&x), &mut value, &mut gradient, &mut dense));
        });
    }
    group.finish();
}

fn lagrangians(c: &mut Criterion) {
    let terms_of = |model: &dyn EulerLagrange<f64>, x: &[f64], request, terms: &mut Terms<f64>| {
        let (q, v) = x.split_at(x.len() / 2);
        model.terms(black_box(q), v, request, terms).expect("regular mass matrices");
    };
    let matrices = Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ;
    let mut group = c.benchmark_group("Lagrangian");
    let mut row = |name: &str, make: &dyn Fn(usize) -> Box<dyn EulerLagrange<f64>>, sizes: &[usize]| {
        for &n in sizes {
            let (model, mut terms) = (make(n), Terms::default());
            let start = Instant::now();
            terms_of(model.as_ref(), &numbers(2 * n), matrices, &mut terms);
            println!("{name} {n}: first call in {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
            for (what, batch, request) in [
                ("M, c, g, one state", 1, matrices),
                ("M, c, g, 128 states", 128, matrices),
                ("acceleration, one state", 1, Request::ACCELERATION),
                ("acceleration, 16 states", 16, Request::ACCELERATION),
                ("acceleration, 128 states", 128, Request::ACCELERATION),
            ] {
                // A batch of large systems says what one state says; a full matrix of a thousand rows is for the handle to leave out.
                if n * batch > 8192 || n > 256 {
                    continue;
                }
                let x = numbers(2 * n * batch);
                group.throughput(Throughput::Elements(batch as u64));
                group.bench_function(BenchmarkId::new(format!("{name}, {what}"), n), |b| {
                    b.iter(|| terms_of(model.as_ref(), &x, request, &mut terms));
                });
            }
            let (x, mut handle, mut a) = (numbers(2 * n), Accelerations::new(model.as_ref()), vec![0.0; n]);
            group.bench_function(BenchmarkId::new(format!("{name}, acceleration, one state, by the handle"), n), |b| {
                b.iter(|| handle.at(black_box(&x[..n]), &x[n..], &mut a).expect("regular mass matrices"));
            });
            // Of more coordinates the derivatives are the solution of dense systems.
            if n > 32 {
                continue;
            }
            let (mut linearizer, w) = (Linearizer::new(model.as_ref()), vec![1.0; n]);
            group.bench_function(BenchmarkId::new(format!("{name}, linearization, one state"), n), |b| {
                b.iter(|| linearizer.at(black_box(&x[..n]), &x[n..]).map(|found| found.by_q[0]));
            });
            group.bench_function(BenchmarkId::new(format!("{name}, gradient of an acceleration, one state"), n), |b| {
                b.iter(|| linearizer.gradient(black_box(&x[..n]), &x[n..], &w).map(|found| found.by_q[0]));
            });
        }
    };
    row("chain", &|n| Box::new(Mechanics::new(Chain(n), [])), &[2, 4, 8, 16, 32, 64, 128, 256]);
    row("lattice", &|n| Box::new(Mechanics::new(Lattice(n), [])), &[2, 8, 64, 256, 1000]);
    group.finish();
}

/// Products of rows of 64 numbers without an interpreter: what a program could reach at most, with rows in the first and in the second cache.
fn roof(c: &mut Criterion) {
    const LANES: usize = 64;
    let mut group = c.benchmark_group("Products of rows");
    for count in [48, 400] {
        let rows: Vec<[f64; LANES]> = (0..count).map(|k| [1.0 + 1e-9 * k as f64; LANES]).collect();
        let mut products = rows.clone();
        // Operands in no order, as those of a program.
        let places: Vec<[usize; 2]> = (0..count).map(|k| [(7 * k + 5) % count, (11 * k + 3) % count]).collect();
        group.throughput(Throughput::Elements((count * LANES) as u64));
        group.bench_function(BenchmarkId::new("rows", count), |b| {
            b.iter(|| {
                vectorized(
                    #[inline(always)]
                    || {
                        for k in 0..count {
                            let [a, b] = places[k].map(|place| &rows[place]);
                            let product = &mut products[k];
                            for l in 0..LANES {
                                product[l] = a[l] * b[l];
                            }
                        }
                    },
                );
            });
        });
        assert!(products.iter().flatten().all(|x| (1.0..1.001).contains(x)));
    }
    group.finish();
}

/// Points on rods in Cartesian coordinates, a tenth of a radian from the vertical to either side in turn, at rest.
fn hanging(rods: usize) -> Vec<f64> {
    let mut at = [0.0, 0.0];
    let next = |k: usize| {
        let (sin, cos) = (0.1 * (-1.0_f64).powi(k as i32)).sin_cos();
        at = [at[0] + sin, at[1] - cos];
        at
    };
    (0..rods).flat_map(next).collect()
}

/// The chain of so many rods of the catalogue.
fn rods(n: usize) -> Box<dyn EulerLagrange<f64>> {
    lnn::lagrangian::SystemInstance::<f64>::named(&format!("cartesian-chain-{n}"), &[])
        .expect("of the catalogue")
        .build()
        .expect("of the catalogue")
}

/// The end of a short motion of a model under constraints.
fn moved(model: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> f64 {
    let found = rollout(model, black_box(q), v, &RolloutOptions::new(0.02, 0.02));
    found.complete().expect("independent rods").q[q.len()]
}

fn constrained(c: &mut Criterion) {
    let mut group = c.benchmark_group("Cartesian chain");
    group.sample_size(10);
    for n in [20, 100, 500] {
        let (model, q, v) = (rods(n), hanging(n), vec![0.0; 2 * n]);
        let start = Instant::now();
        let (mut handle, mut a) = (Accelerations::new(model.as_ref()), vec![0.0; 2 * n]);
        handle.at(&q, &v, &mut a).expect("independent rods");
        println!("Cartesian chain {n}: first call in {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
        group.bench_function(BenchmarkId::new("acceleration, one state, by the handle", n), |b| {
            b.iter(|| handle.at(black_box(&q), &v, &mut a).expect("independent rods"));
        });
        group.bench_function(BenchmarkId::new("motion of 0.02 s", n), |b| b.iter(|| moved(model.as_ref(), &q, &v)));
    }
    group.finish();
}

/// One point of a row, `times` times.
fn count(name: &str, n: usize, times: usize) {
    let x = numbers(2 * n);
    let (q, v) = x.split_at(n);
    let recorded = || Function::<f64>::record(n, |x| Rosenbrock.eval(x)).expect("no branches");
    let chain = Mechanics::<_, f64>::new(Chain(n), []);
    let mut terms = Terms::default();
    let repeat = |f: &mut dyn FnMut()| (0..times).for_each(|_| f());
    let regular = "regular mass matrices";
    match name {
        "chain" => repeat(&mut || chain.terms(black_box(q), v, Request::ACCELERATION, &mut terms).expect(regular)),
        "lattice" => {
            let lattice = Mechanics::<_, f64>::new(Lattice(n), []);
            repeat(&mut || lattice.terms(black_box(q), v, Request::ACCELERATION, &mut terms).expect(regular));
        }
        "handle" => {
            let (mut handle, mut a) = (Accelerations::new(&chain), vec![0.0; n]);
            repeat(&mut || handle.at(black_box(q), v, &mut a).expect(regular));
        }
        "rods" => {
            let (model, q, v) = (rods(n), hanging(n), vec![0.0; 2 * n]);
            let (mut handle, mut a) = (Accelerations::new(model.as_ref()), vec![0.0; 2 * n]);
            repeat(&mut || handle.at(black_box(&q), &v, &mut a).expect("independent rods"));
        }
        "motion" => {
            let (model, q, v) = (rods(n), hanging(n), vec![0.0; 2 * n]);
            repeat(&mut || {
                black_box(moved(model.as_ref(), &q, &v));
            });
        }
        "linearization" => {
            let mut linearizer = Linearizer::new(&chain);
            repeat(&mut || {
                black_box(linearizer.at(black_box(q), v).expect(regular));
            });
        }
        "gradient" => {
            let mut linearizer = Linearizer::new(&chain);
            repeat(&mut || {
                black_box(linearizer.gradient(black_box(q), v, q).expect(regular));
            });
        }
        "batch" => {
            let arm = lnn::lagrangian::SystemInstance::<f64>::named("double-pendulum", &[])
                .expect("of the catalogue")
                .build()
                .expect("of the catalogue");
            let request = Request::MASS_MATRIX | Request::CORIOLIS;
            repeat(&mut || arm.terms(black_box(q), v, request, &mut terms).expect(regular));
        }
        "pattern" => {
            let mut function = recorded();
            let mut entries = vec![0.0; function.pattern().expect("a program").len()];
            let (mut value, mut gradient) = ([0.0], vec![0.0; n]);
            repeat(&mut || {
                function.sparse_hessians(black_box(q), &mut value, &mut gradient, &mut entries).expect("a program");
            });
        }
        _ => {
            let mut function = recorded();
            let (mut value, mut gradient, mut dense) = ([0.0], vec![0.0; n], vec![0.0; n * n]);
            repeat(&mut || function.hessians(black_box(q), &mut value, &mut gradient, &mut dense).expect("a program"));
        }
    }
}

criterion_group!(hessian_benches, functions, lagrangians, constrained, roof);

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|argument| argument == "--count") {
        let number = |k: usize| arguments.get(at + k).and_then(|text| text.parse().ok());
        match (arguments.get(at + 1), number(2), number(3)) {
            (Some(name), Some(n), Some(times)) => return count(name, n, times),
            _ => {
                return eprintln!(
                    "--count chain|lattice|handle|rods|motion|linearization|gradient|batch|pattern|rosenbrock NUMBERS TIMES"
                );
            }
        }
    }
    hessian_benches();
    Criterion::default().configure_from_args().final_summary();
}
