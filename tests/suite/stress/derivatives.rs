//! Cases 8, 9 and 11: exact polynomials, adjoint identity, long programs.

use super::record::{Row, exact};
use crate::common::accuracy::cast;
use crate::common::matrices::norm;
use lnn::forward::{Dual, Jet2};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Program, Replay, ScalarFunction, Tracer, VectorFunction, gradient, hessian, hessian_vector, jacobian};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Sum of integers times products of at most three of the variables.
struct Monomials(Vec<(i32, Vec<usize>)>);

impl ScalarFunction for Monomials {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let term = |(c, factors): &(i32, Vec<usize>)| factors.iter().fold(R::ratio(*c, 1), |y, &i| y * x[i]);
        self.0.iter().map(term).fold(R::zero(), |sum, term| sum + term)
    }
}

impl Monomials {
    fn random(rng: &mut ChaCha8Rng) -> Self {
        let mut term = || {
            let degree = rng.random_range(0..=3);
            (rng.random_range(-9..=9), (0..degree).map(|_| rng.random_range(0..3)).collect())
        };
        Self((0..6).map(|_| term()).collect())
    }
    /// Its derivative by one variable, by the product rule.
    fn derivative(&self, by: usize) -> Self {
        let without = |(c, factors): &(i32, Vec<usize>)| {
            let (c, factors) = (*c, factors.clone());
            (0..factors.len())
                .filter(|&k| factors[k] == by)
                .map(|k| {
                    let mut rest = factors.clone();
                    rest.remove(k);
                    (c, rest)
                })
                .collect::<Vec<_>>()
        };
        Self(self.0.iter().flat_map(without).collect())
    }
    fn integer(&self, x: [i32; 3]) -> f64 {
        let term = |(c, factors): &(i32, Vec<usize>)| factors.iter().fold(*c, |y, &i| y * x[i]);
        f64::from(self.0.iter().map(term).sum::<i32>())
    }
}

fn polynomials<S: Scalar>() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut checks = 0;
    for _ in 0..300 {
        let f = Monomials::random(&mut rng);
        let at: [i32; 3] = std::array::from_fn(|_| rng.random_range(-5..=5));
        let x = at.map(|x| S::of_f64(f64::from(x)));
        let (value, first, second) = hessian(&f, &x).unwrap();
        let jet = f.eval(&[0, 1, 2].map(|i| Jet2::<S, 3>::variable(x[i], i)));
        let mut same = |found: S, g: &Monomials| {
            assert_eq!(found.parts(), (g.integer(at), 0.0), "{:?} at {at:?}", f.0);
            checks += 1;
        };
        same(value, &f);
        for i in 0..3 {
            let di = f.derivative(i);
            same(first[i], &di);
            for j in 0..3 {
                let dij = di.derivative(j);
                same(second[3 * i + j], &dij);
                same(jet.second(i, j), &dij);
                for k in 0..3 {
                    let unit = |l: usize, m: usize| S::of_f64(f64::from(u8::from(l == m)));
                    let third = [0, 1, 2].map(|l| {
                        let inner = Dual::new(x[l], unit(l, i));
                        let middle = Dual::new(inner, Dual::lift(unit(l, j)));
                        Dual::new(middle, Dual::lift(Dual::lift(unit(l, k))))
                    });
                    same(f.eval(&third).tangent.tangent.tangent, &dij.derivative(k));
                }
            }
        }
    }
    exact::<S>(8, "polynomials of degree 3, derivatives to order 3", checks);
}

#[test]
fn case_08_polynomials_are_exact() {
    polynomials::<f32>();
    polynomials::<f64>();
    polynomials::<Dd>();
}

/// `W2 tanh(W1 x)`, `n` to 12 to `m` numbers.
struct Layers {
    n: usize,
    m: usize,
    weights: Vec<f64>,
}

const HIDDEN: usize = 12;

impl VectorFunction for Layers {
    fn outputs(&self) -> usize {
        self.m
    }
    fn eval<R: Real>(&self, x: &[R], out: &mut [R]) {
        let (first, second) = self.weights.split_at(HIDDEN * self.n);
        let times = |row: &[f64], x: &[R]| row.iter().zip(x).fold(R::zero(), |s, (&w, &x)| s + R::of(w) * x);
        let hidden: Vec<R> = first.chunks(self.n).map(|row| times(row, x).tanh()).collect();
        out.iter_mut().zip(second.chunks(HIDDEN)).for_each(|(y, row)| *y = times(row, &hidden));
    }
}

/// `w.f(x)`.
struct Weighted<'a, S>(&'a Layers, &'a [S]);

impl<S: Scalar> ScalarFunction for Weighted<'_, S> {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let mut out = vec![R::zero(); self.0.m];
        self.0.eval(x, &mut out);
        out.iter().zip(self.1).fold(R::zero(), |sum, (&y, &w)| sum + R::constant(w.cast()) * y)
    }
}

fn adjoint_identity<S: Scalar>() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let eps = S::epsilon().to_f64();
    let mut adjoint = Row::new::<S>(9, "<J v, w> = <v, J' w>, unit n eps |v| |w| |J|");
    let mut symmetric = Row::new::<S>(9, "H = H', unit eps |H|");
    for n in 1..=20 {
        for m in [1, 3, 10, 25] {
            // Weights that are the same numbers in every precision.
            let weights = (0..HIDDEN * (n + m)).map(|_| f64::from(rng.random_range(-1.0_f32..1.0))).collect();
            let f = Layers { n, m, weights };
            let mut draw =
                |size: usize| -> Vec<S> { (0..size).map(|_| S::of_f64(rng.random_range(-1.0..1.0))).collect() };
            let (x, v, w) = (draw(n), draw(n), draw(m));
            let seeded: Vec<Dual<S>> = x.iter().zip(&v).map(|(&x, &v)| Dual::new(x, v)).collect();
            let mut forward = vec![Dual::lift(S::of_f64(0.0)); m];
            f.eval(&seeded, &mut forward);
            let (_, reverse) = gradient(&Weighted(&f, &w), &x).unwrap();
            let dot = |a: &[S], b: &[S]| {
                cast::<S, Dd>(a).iter().zip(cast::<S, Dd>(b)).fold(<Dd as Real>::zero(), |s, (&a, b)| s + a * b)
            };
            let left = dot(&forward.iter().map(|y| y.tangent).collect::<Vec<_>>(), &w);
            let gap = (left - dot(&v, &reverse)).to_f64().abs();
            let wide: Vec<Dd> = cast(&x);
            let (_, matrix) = jacobian(&f, &wide).unwrap();
            let size = norm(matrix.into_iter()) * dot(&v, &v).to_f64().sqrt() * dot(&w, &w).to_f64().sqrt();
            adjoint.see(gap / (n as f64 * eps * size), || format!("n = {n}, m = {m}"));
            // Every column by a sweep of its own.
            let columns: Vec<Vec<S>> = (0..n)
                .map(|j| {
                    let unit: Vec<S> = (0..n).map(|i| S::of_f64(f64::from(u8::from(i == j)))).collect();
                    hessian_vector(&Weighted(&f, &w), &x, &unit).unwrap().2
                })
                .collect();
            let size = norm(columns.iter().flatten().map(|&h| h.cast()));
            for i in 0..n {
                for j in 0..i {
                    let gap = (columns[i][j] - columns[j][i]).to_f64().abs();
                    symmetric.see(gap / (eps * size), || format!("n = {n}, m = {m}"));
                }
            }
        }
    }
    adjoint.end_below(10.0);
    symmetric.end_below(4.0);
}

#[test]
fn case_09_adjoint_identity_and_symmetry() {
    adjoint_identity::<f32>();
    adjoint_identity::<f64>();
}

/// Recorded programs: a long chain, a wide fan, and the same bits from every replay.
fn long_programs<S: Scalar>() {
    let one = S::of_f64(1.0);
    let length = 100_000;
    let chain = Program::<S>::record(2, 0, |x, _| vec![(0..length).fold(x[0], |y, _| y * x[1])]).unwrap();
    // The two inputs count too.
    assert_eq!(chain.lane_operations(), length + 2);
    let mut y = [S::nan()];
    Replay::new(Arc::new(chain)).evaluate(1, &[&[one, one]], &[], &mut [&mut y]).unwrap();
    assert_eq!(y, [one]);
    let fan = Program::<S>::record(1, 0, |x, _| vec![(0..length).fold(Tracer::zero(), |sum, _| sum + x[0])]).unwrap();
    Replay::new(Arc::new(fan)).evaluate(1, &[&[one]], &[], &mut [&mut y]).unwrap();
    assert_eq!(y, [S::of_f64(length as f64)]);

    let lanes = 65;
    let program = Program::<S>::record(2, 1, |x, p| {
        vec![(0..50).fold(x[0], |y, k| if k % 5 == 0 { (y * p[0]).sin() } else { y * x[1] })]
    });
    let mut replay = Replay::new(Arc::new(program.unwrap()));
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let x: Vec<S> = (0..2 * lanes).map(|_| S::of_f64(rng.random_range(0.5..1.5))).collect();
    let mut first = None;
    for _ in 0..10_000 {
        let mut y = vec![S::nan(); lanes];
        replay.evaluate(lanes, &[&x], &[one], &mut [&mut y]).unwrap();
        assert!(y.iter().all(|x| x.is_finite()));
        assert_eq!(first.get_or_insert_with(|| y.clone()), &y);
    }
    exact::<S>(11, "recorded chain and fan of 1e5, 1e4 replays", 10_000);
}

#[test]
fn case_11_long_programs() {
    long_programs::<f32>();
    long_programs::<f64>();
}
