//! Batched network derivatives against nested forward numbers of the same network written over `Real`.

mod common;

use common::of_scalar;
use lnn::forward::HyperDual;
use lnn::lagrangian::Lagrangian;
use lnn::network::{Activation, Adjoint, Architecture, Chunk, Depth, Initialization, Jets, Layout, initial_weights};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{ScalarFunction, gradient};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// `L`, `p`, `g`, `M`, `c` by nested forward numbers, in scaled coordinates.
struct Reference<T> {
    lagrangian: T,
    p: Vec<T>,
    g: Vec<T>,
    m: Vec<T>,
    c: Vec<T>,
}

fn reference<T: Real>(architecture: &Architecture, weights: &[T], q: &[T], v: &[T]) -> Reference<T> {
    let n = architecture.coordinates;
    let weights: Vec<HyperDual<T>> = weights.iter().map(|&w| HyperDual::lift(w)).collect();
    let scale = |i: usize| T::from_f64(architecture.scale[i]);
    // Second derivative along two scaled directions, each a list of (index in (q, v), component).
    let jet = |s: &[(usize, T)], t: &[(usize, T)]| -> HyperDual<T> {
        let part = |direction: &[(usize, T)], k: usize| {
            direction.iter().filter(|d| d.0 == k).fold(T::zero(), |sum, d| sum + d.1) * scale(k % n)
        };
        let x: Vec<HyperDual<T>> = (0..2 * n)
            .map(|k| HyperDual::new(if k < n { q[k] } else { v[k - n] }, part(s, k), part(t, k), T::zero()))
            .collect();
        architecture.lagrangian(&weights, &x[..n], &x[n..])
    };
    let along: Vec<(usize, T)> = (0..n).map(|i| (i, v[i] / scale(i))).collect();
    let one = T::one();
    let mut out = Reference { lagrangian: T::zero(), p: vec![], g: vec![], m: vec![], c: vec![] };
    for i in 0..n {
        let moving = jet(&[(n + i, one)], &along);
        out.lagrangian = moving.value;
        out.p.push(moving.s);
        out.c.push(moving.st);
        out.g.push(jet(&[(i, one)], &[]).s);
        for j in 0..n {
            out.m.push(jet(&[(n + i, one)], &[(n + j, one)]).st);
        }
    }
    out
}

struct Case {
    architecture: Architecture,
    seed: u64,
}

fn cases() -> impl Strategy<Value = Case> {
    let activations =
        [Activation::Gelu, Activation::Softplus, Activation::XTanh, Activation::Tanh, Activation::Quadratic];
    let shape = (1_usize..=6, prop::collection::vec(1_usize..24, 1..4), 0..activations.len());
    (shape, prop::collection::vec(any::<bool>(), 6), any::<bool>(), any::<u64>()).prop_map(
        move |((n, hidden, activation), periodic, embed_periodic, seed)| Case {
            architecture: Architecture {
                coordinates: n,
                hidden,
                activation: activations[activation],
                alpha: 0.75,
                scale: (0..n).map(|i| 1.5 + i as f64 / 2.0).collect(),
                periodic: periodic[..n].to_vec(),
                embed_periodic,
            },
            seed,
        },
    )
}

impl std::fmt::Debug for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}, seed {}", self.architecture, self.seed)
    }
}

/// Random weights and states of a case.
fn draw<S: Scalar>(case: &Case, batch: usize) -> (Vec<S>, Vec<S>, Vec<S>) {
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed);
    let weights = initial_weights(&case.architecture, Initialization::Default, &mut rng);
    let mut states = |size: f64| -> Vec<S> {
        (0..batch * case.architecture.coordinates).map(|_| S::of_f64(rng.random_range(-size..size))).collect()
    };
    (weights, states(4.0), states(3.0))
}

/// Largest difference over the largest magnitude.
fn difference<S: Scalar>(found: &[S], expected: &[S]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let size = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs().to_f64()));
    let error = found.iter().zip(expected).fold(0.0, |m: f64, (&x, &y)| {
        assert!(x.is_finite() && y.is_finite());
        m.max((x - y).abs().to_f64())
    });
    if size == 0.0 { error } else { error / size }
}

fn forward_identity<S: Scalar>(case: &Case, tolerance: f64) {
    let n = case.architecture.coordinates;
    let (weights, q, v) = draw::<S>(case, 3);
    let mut chunk = Chunk::new(&case.architecture);
    chunk.evaluate(&weights, &q, &v, Depth::Motion);
    for state in 0..3 {
        let row = state * n..(state + 1) * n;
        let expected = reference(&case.architecture, &weights, &q[row.clone()], &v[row.clone()]);
        let check = |what: &str, found: &[S], expected: &[S], size: f64| {
            let error = difference(found, expected) * if size > 0.0 { size } else { 1.0 };
            assert!(error <= tolerance, "{what} of state {state}: {error:.2e} > {tolerance:.2e}");
        };
        check("L", &chunk.lagrangian[state..=state], &[expected.lagrangian], 1.0);
        check("p", &chunk.momentum[row.clone()], &expected.p, 1.0);
        check("g", &chunk.dl_dq[row.clone()], &expected.g, 1.0);
        check("M", &chunk.mass_matrix[state * n * n..(state + 1) * n * n], &expected.m, 1.0);
        check("c", &chunk.coriolis[row], &expected.c, 1.0);
    }
}

/// A sum of mixed Taylor coefficients as a function of the weights.
struct SumOfCoefficients<'a, S> {
    architecture: &'a Architecture,
    q: &'a [S],
    v: &'a [S],
    jets: [&'a Jets<S>; 2],
}

impl<S: Scalar> ScalarFunction for SumOfCoefficients<'_, S> {
    fn eval<R: Real>(&self, weights: &[R]) -> R {
        let n = self.architecture.coordinates;
        let constant = |x: &[S]| -> Vec<R> { x.iter().map(|&x| of_scalar(x)).collect() };
        let mut total = R::zero();
        for jets in self.jets {
            for (j, &state) in jets.state.iter().enumerate() {
                let row = state * n..(state + 1) * n;
                let r = reference(self.architecture, weights, &constant(&self.q[row.clone()]), &constant(&self.v[row]));
                let (s, t) = (constant(&jets.s[j * n..][..n]), constant(&jets.t[j * n..][..n]));
                for i in 0..n {
                    for k in 0..n {
                        total += s[i] * r.m[i * n + k] * t[k];
                    }
                    if jets.moving {
                        total += s[i] * (r.c[i] - r.g[i]);
                    }
                }
            }
        }
        total
    }
}

/// Gradient of a sum of mixed Taylor coefficients by every weight, against nested forward numbers on the scalar tape.
fn adjoint_identity<S: Scalar>(case: &Case, tolerance: f64) {
    let architecture = &case.architecture;
    let n = architecture.coordinates;
    let (weights, q, v) = draw::<S>(case, 2);
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 1);
    let mut vector = |count: usize| -> Vec<S> { (0..count).map(|_| S::of_f64(rng.random_range(-1.0..1.0))).collect() };
    let moving = Jets { state: vec![0, 1], s: vector(2 * n), t: vector(2 * n), moving: true };
    let still = Jets { state: vec![1, 0, 1], s: vector(3 * n), t: vector(3 * n), moving: false };
    let mut chunk = Chunk::new(architecture);
    chunk.evaluate(&weights, &q, &v, Depth::Training);
    let mut adjoint = Adjoint::new(&chunk);
    let mut found = vec![<S as Real>::zero(); weights.len()];
    adjoint.add_gradient(&chunk, &weights, &moving, &mut found);
    adjoint.add_gradient(&chunk, &weights, &still, &mut found);

    let sum = SumOfCoefficients { architecture, q: &q, v: &v, jets: [&moving, &still] };
    let (_, expected) = gradient(&sum, &weights).unwrap();
    let error = difference(&found, &expected);
    assert!(error <= tolerance, "gradient: {error:.2e} > {tolerance:.2e}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn the_forward_identity_agrees_with_nested_forward_numbers(case in cases()) {
        forward_identity::<f64>(&case, 1e-12);
        forward_identity::<Dd>(&case, 1e-26);
    }

    #[test]
    fn single_precision_keeps_single_precision(case in cases()) {
        forward_identity::<f32>(&case, 2e-4);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn the_adjoint_identity_agrees_with_nested_forward_numbers_on_the_tape(case in cases()) {
        let mut case = case;
        case.architecture.hidden.iter_mut().for_each(|w| *w = 1 + *w % 7);
        adjoint_identity::<f64>(&case, 1e-12);
        adjoint_identity::<Dd>(&case, 1e-26);
    }
}

#[test]
fn shallower_evaluations_give_the_same_numbers() {
    let case = Case {
        architecture: Architecture {
            coordinates: 3,
            hidden: vec![17, 9],
            activation: Activation::Softplus,
            alpha: 1.0,
            scale: vec![2.0; 3],
            periodic: vec![true, false, true],
            embed_periodic: true,
        },
        seed: 5,
    };
    let (weights, q, v) = draw::<f64>(&case, 4);
    let run = |depth| {
        let mut chunk = Chunk::new(&case.architecture);
        chunk.evaluate(&weights, &q, &v, depth);
        chunk
    };
    let whole = run(Depth::Training);
    let same = |a: &[f64], b: &[f64]| assert!(difference(a, b) < 1e-14);
    same(&run(Depth::Value).lagrangian, &whole.lagrangian);
    let gradient = run(Depth::Gradient);
    same(&gradient.momentum, &whole.momentum);
    same(&gradient.dl_dq, &whole.dl_dq);
    same(&run(Depth::MassMatrix).mass_matrix, &whole.mass_matrix);
    assert!(run(Depth::MassMatrix).coriolis.is_empty());
    assert_eq!(run(Depth::Motion).coriolis, whole.coriolis);
    assert_eq!(Layout::new(&case.architecture).parameters, weights.len());
}
