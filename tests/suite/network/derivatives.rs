//! Batched network derivatives against nested forward numbers of the same network written over `Real`.

use crate::common::accuracy::cast;
use crate::common::nested::reference;
use crate::common::{of_scalar, properties};
use lnn::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer, Layout, LinearMap};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Depth, Evaluation, MixedDirections, ScalarFunction, gradient};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

struct Case {
    architecture: Architecture,
    seed: u64,
}

fn cases() -> impl Strategy<Value = Case> {
    let shape =
        (1_usize..=6, prop::collection::vec(1_usize..24, 1..4), prop::sample::select(&ActivationChoice::ALL[..]));
    let input_layer = prop::sample::select(vec![InputLayer::None, InputLayer::Dyt]);
    (shape, input_layer, prop::collection::vec(any::<bool>(), 6), any::<bool>(), any::<u64>()).prop_map(
        |((n, hidden, activation), input_layer, periodic, embed_periodic, seed)| Case {
            architecture: Architecture {
                coordinates: n,
                hidden: hidden.into_iter().map(|w| w * activation.branches().len()).collect(),
                activation,
                alpha: 0.75,
                // One of the coordinates, or none.
                time_like: Some((seed % (n as u64 + 1)) as usize).filter(|&i| i < n),
                scale: (0..n).map(|i| 1.5 + i as f64 / 2.0).collect(),
                periodic: periodic[..n].to_vec(),
                embed_periodic,
                input_layer,
                dissipation: None,
                form: Form::default(),
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

/// Random weights and states of a case; the parameters of an input layer leave their initial values too.
fn draw<S: Scalar>(case: &Case, batch: usize) -> (Vec<S>, Vec<S>, Vec<S>) {
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed);
    let mut weights: Vec<S> = case.architecture.initial_weights(Initialization::Default, &mut rng);
    for layer in Layout::new(&case.architecture).branches.iter().flat_map(|branch| &branch.layers) {
        if layer.map != LinearMap::Dense {
            for k in layer.weight_range().chain(layer.bias_range()) {
                weights[k] += S::of_f64(rng.random_range(-0.3..0.3));
            }
        }
    }
    let mut states = |size: f64| -> Vec<S> {
        (0..batch * case.architecture.coordinates).map(|_| S::of_f64(rng.random_range(-size..size))).collect()
    };
    (weights, states(4.0), states(3.0))
}

/// A network's Lagrangian on a chunk of states.
fn evaluated<S: Scalar>(architecture: &Architecture, weights: &[S], [q, v]: [&[S]; 2], depth: Depth) -> Evaluation<S> {
    let mut evaluation = Evaluation::new(architecture.model().lagrangian().clone());
    evaluation.evaluate(weights, q, v, depth);
    evaluation
}

/// Largest difference over the largest magnitude.
fn difference<S: Scalar>(found: &[S], expected: &[S]) -> f64 {
    let (size, error) = (largest(expected), apart(found, expected));
    if size == 0.0 { error } else { error / size }
}

fn largest<S: Scalar>(x: &[S]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.abs().to_f64()))
}

/// Largest difference of finite numbers.
fn apart<S: Scalar>(found: &[S], expected: &[S]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).fold(0.0, |m, (&x, &y)| {
        assert!(x.is_finite() && y.is_finite());
        m.max((x - y).abs().to_f64())
    })
}

/// Every output of one state by nested forward numbers, in double-double, by name.
fn expected_outputs(architecture: &Architecture, [weights, q, v]: [&[Dd]; 3]) -> [(&'static str, Vec<Dd>); 5] {
    let r = reference(architecture, weights, q, v);
    [("L", vec![r.lagrangian]), ("p", r.p), ("g", r.g), ("M", r.m), ("c", r.c)]
}

/// Largest error over `eps` times what relative perturbations of all weights and inputs by one unit do, and that no
/// more than `30`: outputs that cancel, as a force near its zero may, are as exact as their numbers allow.
fn forward_identity<S: Scalar>(case: &Case) {
    let n = case.architecture.coordinates;
    let (weights, q, v) = draw::<S>(case, 3);
    let chunk = evaluated(&case.architecture, &weights, [&q, &v], Depth::Motion);
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 2);
    let step = 2f64.powi(-40);
    let mut moved = |x: &[Dd]| -> Vec<Dd> {
        x.iter().map(|&x| x + x * Dd::of_f64(if rng.random() { step } else { -step })).collect()
    };
    let eps = S::epsilon().to_f64();
    for state in 0..3 {
        let row = state * n..(state + 1) * n;
        let inputs: [Vec<Dd>; 3] = [cast(&weights), cast(&q[row.clone()]), cast(&v[row.clone()])];
        let expected = expected_outputs(&case.architecture, inputs.each_ref().map(|x| &x[..]));
        let perturbed: Vec<_> = (0..6)
            .map(|_| {
                let inputs = inputs.each_ref().map(|x| moved(x));
                expected_outputs(&case.architecture, inputs.each_ref().map(|x| &x[..]))
            })
            .collect();
        let found = [
            &chunk.lagrangian[state..=state],
            &chunk.momentum[row.clone()],
            &chunk.dl_dq[row.clone()],
            &chunk.mass_matrix[state * n * n..(state + 1) * n * n],
            &chunk.coriolis[row],
        ];
        for (k, found) in found.into_iter().enumerate() {
            let (what, expected) = &expected[k];
            let condition = perturbed.iter().fold(largest(expected), |m, p| m.max(apart(&p[k].1, expected) / step));
            let error = apart(&cast(found), expected);
            let r = if error == 0.0 { 0.0 } else { error / (eps * condition) };
            assert!(r <= 30.0, "{what} of state {state}: R = {r:.3}");
        }
    }
}

/// A sum of mixed Taylor coefficients as a function of the weights.
struct SumOfCoefficients<'a, S> {
    architecture: &'a Architecture,
    q: &'a [S],
    v: &'a [S],
    jets: [&'a (Vec<usize>, MixedDirections<S>); 2],
}

impl<S: Scalar> ScalarFunction for SumOfCoefficients<'_, S> {
    fn eval<R: Real>(&self, weights: &[R]) -> R {
        let n = self.architecture.coordinates;
        let constant = |x: &[S]| -> Vec<R> { x.iter().map(|&x| of_scalar(x)).collect() };
        let mut total = R::zero();
        for (states, jets) in self.jets {
            for (j, &state) in states.iter().enumerate() {
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
    let moving = (vec![0, 1], MixedDirections { s: vector(2 * n), t: vector(2 * n), moving: true });
    let still = (vec![1, 0, 1], MixedDirections { s: vector(3 * n), t: vector(3 * n), moving: false });
    let mut found = vec![<S as Real>::zero(); weights.len()];
    for (states, directions) in [&moving, &still] {
        let of = |x: &[S]| -> Vec<S> { states.iter().flat_map(|&k| x[k * n..(k + 1) * n].to_vec()).collect() };
        let mut evaluation = evaluated(architecture, &weights, [&of(&q), &of(&v)], Depth::Training);
        evaluation.add_gradient(&weights, directions, &mut found, None);
    }

    let sum = SumOfCoefficients { architecture, q: &q, v: &v, jets: [&moving, &still] };
    let (_, expected) = gradient(&sum, &weights).unwrap();
    let error = difference(&found, &expected);
    assert!(error <= tolerance, "gradient: {error:.2e} > {tolerance:.2e}");
}

proptest! {
    #![proptest_config(properties(48))]

    #[test]
    fn the_forward_identity_agrees_with_nested_forward_numbers(case in cases()) {
        forward_identity::<f64>(&case);
        forward_identity::<Dd>(&case);
    }

    #[test]
    fn single_precision_keeps_single_precision(case in cases()) {
        forward_identity::<f32>(&case);
    }
}

proptest! {
    #![proptest_config(properties(12))]

    #[test]
    fn the_adjoint_identity_agrees_with_nested_forward_numbers_on_the_tape(case in cases()) {
        let mut case = case;
        let branches = case.architecture.activation.branches().len();
        case.architecture.hidden.iter_mut().for_each(|w| *w = branches * (1 + *w % 7));
        adjoint_identity::<f64>(&case, 1e-12);
        adjoint_identity::<Dd>(&case, 1e-26);
    }
}

/// Every kind of model at every small number of coordinates: one or two branches, with and without an input layer.
fn models() -> impl Iterator<Item = Case> {
    let kinds = [ActivationChoice::XTanh, ActivationChoice::QuadraticSoftplus]
        .into_iter()
        .flat_map(|activation| [InputLayer::None, InputLayer::Dyt].map(|input_layer| (activation, input_layer)));
    kinds.flat_map(|(activation, input_layer)| {
        (1..=4).map(move |n| Case {
            architecture: Architecture {
                coordinates: n,
                hidden: vec![6, 4],
                activation,
                alpha: 0.75,
                time_like: None,
                scale: (0..n).map(|i| 1.5 + i as f64 / 2.0).collect(),
                periodic: (0..n).map(|i| i % 2 == 0).collect(),
                embed_periodic: true,
                input_layer,
                dissipation: None,
                form: Form::default(),
            },
            seed: n as u64,
        })
    })
}

#[test]
fn both_identities_hold_for_every_kind_of_model() {
    for case in models() {
        forward_identity::<f64>(&case);
        forward_identity::<Dd>(&case);
        adjoint_identity::<f64>(&case, 1e-12);
        adjoint_identity::<Dd>(&case, 1e-26);
    }
}

/// A hybrid is the sum of two networks of half the widths with the same features, `alpha |v/s|^2` counted once.
#[test]
fn a_hybrid_is_the_sum_of_its_branches() {
    for case in models().filter(|case| case.architecture.activation == ActivationChoice::QuadraticSoftplus) {
        let (weights, q, v) = draw::<f64>(&case, 3);
        let evaluate = |architecture: &Architecture, weights: &[f64]| {
            let chunk = evaluated(architecture, weights, [&q, &v], Depth::Motion);
            [&chunk.lagrangian[..], &chunk.momentum, &chunk.dl_dq, &chunk.mass_matrix, &chunk.coriolis].concat()
        };
        let half = |activation, alpha| {
            let hidden = case.architecture.hidden.iter().map(|w| w / 2).collect();
            Architecture { activation, alpha, hidden, ..case.architecture.clone() }
        };
        let (softplus, quadratic) = weights.split_at(weights.len() / 2);
        let one = evaluate(&half(ActivationChoice::Softplus, case.architecture.alpha), softplus);
        let two = evaluate(&half(ActivationChoice::Quadratic, 0.0), quadratic);
        let sum: Vec<f64> = one.iter().zip(&two).map(|(a, b)| a + b).collect();
        assert!(difference(&evaluate(&case.architecture, &weights), &sum) < 1e-14);
    }
}

/// `gamma tanh(a x) + beta` written out: such a network is a plain one on other features.
#[test]
fn dynamic_tanh_stands_before_the_first_dense_layer() {
    let plain = Architecture {
        coordinates: 1,
        hidden: vec![1],
        activation: ActivationChoice::Quadratic,
        alpha: 0.5,
        time_like: None,
        scale: vec![2.0],
        periodic: vec![false],
        embed_periodic: false,
        input_layer: InputLayer::Dyt,
        dissipation: None,
        form: Form::default(),
    };
    let (a, gamma, beta, row, bias, output) = (0.7, [1.5, -0.5], [0.25, 0.1], [0.3, -1.1], 0.6, 2.0);
    let weights = [&[a][..], &gamma, &beta, &row, &[bias, output]].concat();
    let (q, v) = (1.2, -3.0);
    let chunk = evaluated(&plain, &weights, [&[q], &[v]], Depth::Value);
    let feature = |i: usize, x: f64| gamma[i] * (a * x / 2.0).tanh() + beta[i];
    let z = row[0] * feature(0, q) + row[1] * feature(1, v) + bias;
    let expected = output * z * z + 0.5 * (v / 2.0) * (v / 2.0);
    assert!((chunk.lagrangian[0] / expected - 1.0).abs() < 1e-14, "{} for {expected}", chunk.lagrangian[0]);
}

#[test]
fn widths_that_a_hybrid_cannot_halve_are_refused() {
    for case in models() {
        assert_eq!(case.architecture.validate(), Ok(()));
        for width in [1, 5] {
            let odd = Architecture { hidden: vec![4, width], ..case.architecture.clone() };
            let hybrid = odd.activation == ActivationChoice::QuadraticSoftplus;
            match odd.validate() {
                Ok(()) => assert!(!hybrid),
                Err(error) => {
                    let text = error.to_string();
                    assert!(
                        hybrid && text.contains("quadratic-softplus") && text.ends_with(&width.to_string()),
                        "{text}"
                    );
                }
            }
        }
    }
}

#[test]
fn shallower_evaluations_give_the_same_numbers() {
    let case = Case {
        architecture: Architecture {
            coordinates: 3,
            hidden: vec![17, 9],
            activation: ActivationChoice::Softplus,
            alpha: 1.0,
            time_like: None,
            scale: vec![2.0; 3],
            periodic: vec![true, false, true],
            embed_periodic: true,
            input_layer: InputLayer::None,
            dissipation: None,
            form: Form::default(),
        },
        seed: 5,
    };
    let (weights, q, v) = draw::<f64>(&case, 4);
    let run = |depth| evaluated(&case.architecture, &weights, [&q, &v], depth);
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

/// `alpha (-t'^2 + x'^2 + ..)` with a time-like coordinate, all squares added without.
#[test]
fn the_added_term_follows_the_time_like_coordinate() {
    let plain = Architecture {
        coordinates: 3,
        hidden: vec![2],
        activation: ActivationChoice::Gelu,
        alpha: 1.5,
        time_like: None,
        scale: vec![2.0, 4.0, 1.0],
        periodic: vec![false; 3],
        embed_periodic: false,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    };
    // A network that gives 0: what is left is the added term.
    let weights = vec![0.0; Layout::new(&plain).parameters];
    let (q, v) = ([0.3, -0.4, 0.5], [6.0, 8.0, -1.0]);
    for (time_like, signs) in [(None, [1.0; 3]), (Some(0), [-1.0, 1.0, 1.0]), (Some(2), [1.0, 1.0, -1.0])] {
        let architecture = Architecture { time_like, ..plain.clone() };
        let chunk = evaluated(&architecture, &weights, [&q, &v], Depth::Motion);
        // Scaled velocities 3, 2, -1.
        let [a, b, c] = signs;
        assert_eq!(chunk.lagrangian, [1.5 * (9.0 * a + 4.0 * b + c)]);
        assert_eq!(chunk.momentum, [9.0 * a, 6.0 * b, -3.0 * c]);
        assert_eq!(chunk.mass_matrix, [3.0 * a, 0.0, 0.0, 0.0, 3.0 * b, 0.0, 0.0, 0.0, 3.0 * c]);
    }
    let beyond = Architecture { time_like: Some(3), ..plain };
    let error = beyond.validate().unwrap_err().to_string();
    assert_eq!(error, "architecture: expected a time-like coordinate below 3, found 3");
}
