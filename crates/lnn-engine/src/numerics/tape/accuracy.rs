//! Errors of recorded functions against nested forward numbers in double-double, which have 32 digits.
//!
//! `R` is an error in units of the rounding unit times the condition: the change of a result by one relative rounding of every operand, or
//! the result itself if that is larger. `cargo test --lib tape::accuracy -- --nocapture` prints the largest `R`.

use super::Function;
use crate::forward::HyperDual;
use crate::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::cell::RefCell;

/// Random points of a function.
const POINTS: usize = 12;
const SEED: u64 = 1;
/// Relative perturbation of operands, far below all numbers and far above the roundings of double-double.
const STEP: f64 = 1.0 / (1u64 << 48) as f64;
/// Patterns of signs of perturbations.
const PATTERNS: u64 = 12;

#[derive(Clone, Copy, Debug)]
enum Case {
    Rosenbrock,
    Ackley,
    Chain,
    BlackHole,
    Powers,
}

impl Case {
    const ALL: [Self; 5] = [Self::Rosenbrock, Self::Ackley, Self::Chain, Self::BlackHole, Self::Powers];

    /// The value; every result passes through `r` on its way.
    fn eval<T: Real>(self, x: &[T], r: impl Fn(T) -> T) -> T {
        let x: Vec<T> = x.iter().map(|&x| r(x)).collect();
        let mean = T::of(1.0 / x.len() as f64);
        match self {
            Self::Rosenbrock => x.windows(2).fold(T::zero(), |f, x| {
                let (near, square) = (r(T::one() - x[0]), r(x[0].sqr()));
                let (near, valley) = (r(near.sqr()), r(r(x[1] - square).sqr()));
                let f = r(f + near);
                r(f + r(valley * T::of(100.0)))
            }),
            Self::Ackley => {
                let (mut squares, mut waves) = (T::zero(), T::zero());
                for &x in &x {
                    squares = r(squares + r(x.sqr()));
                    let angle = r(x * T::of(std::f64::consts::TAU));
                    waves = r(waves + r(angle.cos()));
                }
                let root = r(r(squares * mean).sqrt());
                let hill = r(r(-root * T::of(0.2)).exp());
                let waves = r(r(waves * mean).exp());
                r(r(T::of(22.0) - r(hill * T::of(20.0))) - waves)
            }
            Self::Chain => {
                let (q, v) = x.split_at(x.len() / 2);
                let (mut x, mut y, mut height, mut l) = (T::zero(), T::zero(), T::zero(), T::zero());
                for (&q, &v) in q.iter().zip(v) {
                    let (sin, cos) = q.sin_cos();
                    let (sin, cos) = (r(sin), r(cos));
                    (x, y, height) = (r(x + r(v * cos)), r(y + r(v * sin)), r(height + cos));
                    let square = r(r(x.sqr()) + r(y.sqr()));
                    l = r(l + r(r(square * T::half()) + r(height * T::of(9.8))));
                }
                l
            }
            Self::BlackHole => {
                // Radius, angle, and rates of time, radius, angle and turn; spin 0.9.
                let (spin, radius) = (T::of(0.9), x[0].abs() + T::of(3.0));
                let (radius, sin, cos) = (r(radius), r(x[1].sin()), r(x[1].cos()));
                let square = r(radius.sqr());
                let sigma = r(square + r(r(spin * cos).sqr()));
                let delta = r(r(square - r(radius * T::two())) + r(spin.sqr()));
                let turn = r(r(spin * r(sin.sqr())) * x[5]);
                let first = r(r(delta / sigma) * r(r(x[2] - turn).sqr()));
                let outer = r(r(r(square + r(spin.sqr())) * x[5]) - r(spin * x[2]));
                let second = r(r(r(sin.sqr()) / sigma) * r(outer.sqr()));
                let rest = r(r(r(sigma / delta) * r(x[3].sqr())) + r(sigma * r(x[4].sqr())));
                r(r(r(second - first) + rest) * T::half())
            }
            Self::Powers => {
                let base = r(r(x[0].sqr()) + T::one());
                let power = r(base.powf(x[1]));
                let logarithm = r(r(r(x[2].sqr()) + T::two()).ln());
                let product = r(r(r(x[2] * x[3]).exp()) * logarithm);
                let quotient = r(power / r(r(r(x[4].exp()) + T::one()).powf(x[2])));
                r(r(product + quotient) - r(r(r(x[3] * x[4]).exp()) * r(power.ln())))
            }
        }
    }

    fn variables(self) -> usize {
        if matches!(self, Self::Powers) { 5 } else { 6 }
    }
}

/// Value, gradient, lower triangle of the Hessian, and its product with `u`.
fn nested(case: Case, x: &[Dd], u: &[Dd], pattern: Option<u64>) -> Vec<Dd> {
    let (n, zero) = (x.len(), <Dd as Real>::zero());
    let one = |i: usize, j: usize| if i == j { <Dd as Real>::one() } else { zero };
    let eval = |point: Vec<HyperDual<Dd>>| {
        let random = RefCell::new(ChaCha8Rng::seed_from_u64(pattern.unwrap_or(0)));
        let moved = |y: Dd| y + y * Dd::of_f64(if random.borrow_mut().random::<bool>() { STEP } else { -STEP });
        case.eval(&point, |y| match pattern {
            None => y,
            Some(_) => HyperDual::new(moved(y.value), moved(y.s), moved(y.t), moved(y.st)),
        })
    };
    let (mut first, mut second, mut products) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..n {
        for j in 0..=i {
            second.push(eval((0..n).map(|k| HyperDual::new(x[k], one(i, k), one(j, k), zero)).collect()).st);
        }
        let along = eval((0..n).map(|k| HyperDual::new(x[k], one(i, k), u[k], zero)).collect());
        products.push(along.st);
        if i == 0 {
            first.push(along.value);
        }
        first.push(along.s);
    }
    [first, second, products].concat()
}

#[test]
fn recorded_functions_are_exact_to_a_few_roundings() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    println!("largest R of {POINTS} points: value, gradient, Hessian, product");
    for case in Case::ALL {
        let n = case.variables();
        let mut f = Function::<f64>::record(n, |x| case.eval(x, |y| y)).unwrap();
        let pattern = f.pattern().unwrap().to_vec();
        let mut numbers = || (0..n * POINTS).map(|_| random.random_range(-2.0..2.0)).collect::<Vec<f64>>();
        let (x, u) = (numbers(), numbers());
        let (mut values, mut gradients, mut dense) = (vec![0.0; POINTS], x.clone(), vec![0.0; n * n * POINTS]);
        let (mut entries, mut products) = (vec![0.0; pattern.len() * POINTS], u.clone());
        f.sparse_hessians(&x, &mut values, &mut gradients, &mut entries).unwrap();
        f.hessians(&x, &mut values, &mut gradients, &mut dense).unwrap();
        f.hessian_vectors(&x, &u, &mut products).unwrap();
        let mut worst = [0.0_f64; 4];
        for row in 0..POINTS {
            let matrix = &dense[row * n * n..][..n * n];
            let mut expanded = vec![0.0_f64; n * n];
            for (&(i, j), &entry) in pattern.iter().zip(&entries[row * pattern.len()..]) {
                (expanded[i * n + j], expanded[j * n + i]) = (entry, entry);
            }
            assert!(expanded.iter().zip(matrix).all(|(a, b)| a.to_bits() == b.to_bits()), "{case:?}");
            let at = row * n..(row + 1) * n;
            let wide = |x: &[f64]| x.iter().map(|&x| Dd::of_f64(x)).collect::<Vec<Dd>>();
            let (x, u) = (wide(&x[at.clone()]), wide(&u[at.clone()]));
            let exact = nested(case, &x, &u, None);
            let mut condition: Vec<f64> = exact.iter().map(|y| y.to_f64().abs()).collect();
            for pattern in 0..PATTERNS {
                for ((c, &y), z) in condition.iter_mut().zip(&exact).zip(nested(case, &x, &u, Some(pattern))) {
                    *c = c.max((z - y).to_f64().abs() / STEP);
                }
            }
            let triangle = (0..n).flat_map(|i| matrix[i * n..=i * n + i].iter());
            let found = values[row..=row].iter().chain(&gradients[at.clone()]).chain(triangle).chain(&products[at]);
            let kinds = [1, n, n * (n + 1) / 2, n].into_iter().enumerate().flat_map(|(k, m)| vec![k; m]);
            for (((&y, kind), &exact), &condition) in found.zip(kinds).zip(&exact).zip(&condition) {
                let error = (Dd::of_f64(y) - exact).to_f64().abs();
                let r = if error == 0.0 { 0.0 } else { error / (f64::EPSILON * condition) };
                worst[kind] = worst[kind].max(r);
            }
        }
        println!("{case:?}: {:.2} {:.2} {:.2} {:.2}", worst[0], worst[1], worst[2], worst[3]);
        assert!(worst.iter().all(|r| *r < 3.0), "{case:?}: {worst:?}");
    }
}
