//! Hessians of single points by the crate num-dual, for `hessians.sh`, which builds this program in three ways.

use nalgebra::SVector;
use num_dual::{Dual2SVec64, DualNum, hessian};
use std::hint::black_box;
use std::time::Instant;

/// The double pendulum's Lagrangian, unit masses and lengths in absolute angles: the chain of two of `cargo bench --bench hessians`.
fn pendulum(x: &SVector<Dual2SVec64<4>, 4>) -> Dual2SVec64<4> {
    let (mut a, mut b, mut height) = (x[2] * 0.0, x[2] * 0.0, x[0] * 0.0);
    let mut l = x[0] * 0.0;
    for i in 0..2 {
        let (sin, cos) = x[i].sin_cos();
        (a, b, height) = (a + x[2 + i] * cos, b + x[2 + i] * sin, height + cos);
        l += (a * a + b * b) * 0.5 + height * 9.8;
    }
    l
}

/// Rosenbrock's function.
fn rosenbrock<const N: usize>(x: &SVector<Dual2SVec64<N>, N>) -> Dual2SVec64<N> {
    let mut f = x[0] * 0.0;
    for i in 0..N - 1 {
        let (near, valley) = (-x[i] + 1.0, x[i + 1] - x[i] * x[i]);
        f += near * near + valley * valley * 100.0;
    }
    f
}

/// Nanoseconds of a call: the least of many rounds.
fn time(name: &str, mut call: impl FnMut() -> f64) {
    let mut least = f64::INFINITY;
    for _ in 0..200 {
        let start = Instant::now();
        for _ in 0..1000 {
            black_box(call());
        }
        least = least.min(start.elapsed().as_secs_f64() * 1e6);
    }
    println!("  {name}: {least:.0} ns");
}

fn point<const N: usize>() -> SVector<f64, N> {
    SVector::from_fn(|i, _| (0.37 * i as f64 + 0.3).sin())
}

fn main() {
    let x = point::<4>();
    let (_, gradient, matrix) = hessian(|x| pendulum(&x), &x);
    // d2L/dv dv and the force of gravity are known.
    let exact = [2.0, (x[0] - x[1]).cos(), 1.0];
    let found = [matrix[(2, 2)], matrix[(2, 3)], matrix[(3, 3)]];
    assert!(exact.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-14) && gradient[0].is_finite());
    time("double pendulum", || hessian(|x| pendulum(&x), black_box(&x)).2[(3, 3)]);
    let x = point::<8>();
    time("Rosenbrock of 8", || hessian(|x| rosenbrock(&x), black_box(&x)).2[(7, 7)]);
}
