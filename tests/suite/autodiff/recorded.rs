//! Recorded Lagrangians, random expressions with dense layers inside, against nested forward numbers: every term, and gradients of
//! mixed coefficients by parameters and state.

use crate::common::accuracy::cast;
use crate::common::nested::{Reference, reference_of};
use crate::common::properties;
use lnn::lagrangian::Lagrangian;
use lnn::network::{
    Activation, ActivationChoice, Architecture, Factor, Form, Initialization, InputLayer, Layout, Structure,
};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Depth, Evaluation, MixedDirections, Recorded, ScalarFunction, gradient};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// A node of an expression: what it does to two of the nodes before it.
#[derive(Clone, Copy, Debug)]
struct Node {
    kind: u8,
    a: usize,
    b: usize,
}

/// A random function of coordinates, velocities and parameters; every kind of operation the tape has may be in it.
#[derive(Clone, Debug)]
struct Expression {
    n: usize,
    nodes: Vec<Node>,
}

/// Numbers that are used by themselves, before the weights of layers of 3 inputs and 4 units with biases.
const LOOSE: usize = 3;
const LAYER: usize = 4 * 3 + 4;
const PARAMETERS: usize = LOOSE + 2 * LAYER;
const KINDS: u8 = 20;

impl Lagrangian for Expression {
    fn coordinates(&self) -> usize {
        self.n
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let mut all: Vec<R> = q.iter().chain(v).copied().chain(p[..LOOSE].iter().copied()).collect();
        for (number, node) in self.nodes.iter().enumerate() {
            let (a, b) = (all[node.a % all.len()], all[node.b % all.len()]);
            let above = |x: R| x.sqr() + R::one();
            // Away from 1, where the logarithm would tell the rounding of the sum.
            let around = |x: R| x.tanh() + R::of(2.5);
            let next = match node.kind % KINDS {
                0 => a + b,
                1 => a - b * R::of(0.7),
                2 | 3 => a * b,
                4 => a / above(b),
                5 => a.sin() + b.cos(),
                6 => a.tanh(),
                7 => (a.tanh() * b.tanh()).exp(),
                8 => above(a).sqrt(),
                9 => around(b).ln() + b.sqr().ln_1p(),
                10 => a.atan2(above(b)),
                11 => around(a).powf(b.tanh()),
                12 => a.max(b),
                13 => (a - b).select(a.sqr(), b * a),
                14 => Activation::Gelu.apply(a) - Activation::Silu.apply(b) - b.softplus(),
                15 => Activation::XTanh.apply(a) + b.ln_cosh(),
                16 => a.tanh().powi(3),
                17 => -a.min(R::of(0.4)),
                _ => {
                    let from = LOOSE + number % 2 * LAYER;
                    let x = [a.sin(), b, all[(node.a + 1) % all.len()]];
                    let layer = R::affine(&p[from..from + 12], &p[from + 12..from + LAYER], &x);
                    let hidden: Vec<R> = layer.into_iter().map(R::tanh).collect();
                    hidden[0] + hidden[3] * R::affine(&p[from..from + 4], &[], &hidden)[0]
                }
            };
            // Large numbers would make every comparison one of the largest.
            all.push(next.tanh() + next * R::of(0.01));
        }
        let kinetic = v.iter().fold(R::zero(), |sum, &v| sum + v * v);
        all[all.len() - self.nodes.len().min(3)..].iter().fold(kinetic, |sum, &x| sum + x)
    }
}

fn expressions() -> impl Strategy<Value = (Expression, u64)> {
    let node = (0..KINDS, any::<usize>(), any::<usize>()).prop_map(|(kind, a, b)| Node { kind, a: a >> 1, b });
    (1_usize..=5, prop::collection::vec(node, 1..24), any::<u64>())
        .prop_map(|(n, nodes, seed)| (Expression { n, nodes }, seed))
}

/// The sum over states of `s.M t`, and `s.(c - g)` of moving directions, by parameters and scaled states.
struct Coefficients<'a, L> {
    system: &'a L,
    scale: &'a [f64],
    parameters: usize,
    directions: &'a MixedDirections<Dd>,
}

impl<L: Lagrangian> ScalarFunction for Coefficients<'_, L> {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let n = self.scale.len();
        let (parameters, states) = x.split_at(self.parameters);
        let (q, v) = states.split_at(states.len() / 2);
        let constant = |x: &Dd| R::constant(x.cast());
        let mut sum = R::zero();
        for state in 0..q.len() / n {
            let physical = |x: &[R]| -> Vec<R> {
                x[state * n..][..n].iter().zip(self.scale).map(|(&x, &s)| x * R::of(s)).collect()
            };
            let r = reference_of(self.system, self.scale, parameters, &physical(q), &physical(v));
            for i in 0..n {
                let s = constant(&self.directions.s[state * n + i]);
                if self.directions.moving {
                    sum += s * (r.c[i] - r.g[i]);
                }
                for j in 0..n {
                    sum += s * r.m[i * n + j] * constant(&self.directions.t[state * n + j]);
                }
            }
        }
        sum
    }
}

const STEP: f64 = 1.0 / (1_u64 << 40) as f64;

fn largest(x: &[Dd]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.to_f64().abs()))
}

fn apart(a: &[Dd], b: &[Dd]) -> f64 {
    assert_eq!(a.len(), b.len());
    largest(&a.iter().zip(b).map(|(&a, &b)| a - b).collect::<Vec<_>>())
}

fn moved(x: &[Dd], rng: &mut impl Rng) -> Vec<Dd> {
    x.iter().map(|&x| x + x * Dd::of_f64(if rng.random() { STEP } else { -STEP })).collect()
}

/// Largest error over `eps` times what relative perturbations of everything that goes in do: `R` of the LAPACK tests, at most 30.
fn check<L: Lagrangian, S: Scalar>(system: &L, scale: &[f64], parameters: &[f64], seed: u64) {
    const STATES: usize = 3;
    let n = scale.len();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |count: usize| -> Vec<f64> { (0..count).map(|_| rng.random_range(-1.5..1.5)).collect() };
    let [q, v, s, t] = [(); 4].map(|()| draw(STATES * n));
    // Numbers of this precision, then exactly the same ones in double-double.
    let rounded = |x: &[f64]| -> Vec<S> { x.iter().map(|&x| S::of_f64(x)).collect() };
    let [parameters, q, v, s, t] = [parameters, &q, &v, &s, &t].map(rounded);
    let recorded = Recorded::new(rounded(scale), parameters.len(), |p, q, v| system.lagrangian(p, q, v)).unwrap();
    let mut evaluation = Evaluation::new(Arc::new(recorded));
    evaluation.evaluate(&parameters, &q, &v, Depth::Training);
    let given = [&parameters, &q, &v].map(|x| cast::<S, Dd>(x));
    let terms = |[p, q, v]: &[Vec<Dd>; 3]| -> [Vec<Dd>; 5] {
        let mut all: [Vec<Dd>; 5] = Default::default();
        for state in 0..STATES {
            let Reference { lagrangian, p, g, m, c } =
                reference_of(system, scale, p, &q[state * n..][..n], &v[state * n..][..n]);
            all.iter_mut().zip([vec![lagrangian], p, g, m, c]).for_each(|(all, own)| all.extend(own));
        }
        all
    };
    let found = [
        &evaluation.lagrangian,
        &evaluation.momentum,
        &evaluation.dl_dq,
        &evaluation.mass_matrix,
        &evaluation.coriolis,
    ]
    .map(|x| cast::<S, Dd>(x));
    let perturbed: Vec<_> = (0..4).map(|_| given.each_ref().map(|x| moved(x, &mut rng))).collect();
    let judge = |what: &str, found: &[Dd], expected: &[Dd], others: &[Vec<Dd>]| {
        let condition = others.iter().fold(largest(expected), |most, other| most.max(apart(other, expected) / STEP));
        let error = apart(found, expected);
        let r = if error == 0.0 { 0.0 } else { error / (S::epsilon().to_f64() * condition) };
        assert!(r <= 30.0, "{what} in {}: R = {r:.3}", S::NAME);
    };
    let (expected, others) = (terms(&given), perturbed.iter().map(terms).collect::<Vec<_>>());
    for (k, what) in ["L", "p", "g", "M", "c"].into_iter().enumerate() {
        judge(what, &found[k], &expected[k], &others.iter().map(|other| other[k].clone()).collect::<Vec<_>>());
    }
    for moving in [true, false] {
        let directions = MixedDirections { s: s.clone(), t: t.clone(), moving };
        let zeros = |count: usize| vec![<S as Real>::zero(); count];
        let (mut by_parameter, mut dq, mut dv) = (zeros(parameters.len()), zeros(STATES * n), zeros(STATES * n));
        evaluation.add_gradient(&parameters, &directions, &mut by_parameter, Some((&mut dq, &mut dv)));
        let mut alone = zeros(parameters.len());
        evaluation.add_gradient(&parameters, &directions, &mut alone, None);
        assert!(alone.iter().zip(&by_parameter).all(|(a, b)| a == b), "who asks for less gets the same");
        let wide = MixedDirections { s: cast(&s), t: cast(&t), moving };
        let all = |[p, q, v]: &[Vec<Dd>; 3]| -> Vec<Dd> {
            let scaled =
                |x: &[Dd]| -> Vec<Dd> { x.iter().enumerate().map(|(k, &x)| x / Dd::of_f64(scale[k % n])).collect() };
            let point = [p.clone(), scaled(q), scaled(v)].concat();
            let sum = Coefficients { system, scale, parameters: p.len(), directions: &wide };
            gradient(&sum, &point).unwrap().1
        };
        let (expected, others) = (all(&given), perturbed.iter().map(all).collect::<Vec<_>>());
        let mut from = 0;
        for (what, found) in [("gradient by parameters", by_parameter), ("by q", dq), ("by v", dv)] {
            let part = from..from + found.len();
            from = part.end;
            let others: Vec<Vec<Dd>> = others.iter().map(|other| other[part.clone()].to_vec()).collect();
            judge(what, &cast(&found), &expected[part], &others);
        }
    }
}

proptest! {
    #![proptest_config(properties(40))]

    #[test]
    fn random_expressions_agree_with_nested_forward_numbers((expression, seed) in expressions()) {
        let scale: Vec<f64> = (0..expression.n).map(|i| 1.0 + 0.5 * i as f64).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 3);
        let parameters: Vec<f64> = (0..PARAMETERS).map(|_| rng.random_range(-1.0..1.0)).collect();
        check::<_, f64>(&expression, &scale, &parameters, seed);
        check::<_, Dd>(&expression, &scale, &parameters, seed);
        check::<_, f32>(&expression, &scale, &parameters, seed);
    }
}

#[test]
fn every_structure_agrees_with_nested_forward_numbers() {
    let structures = [
        (Structure::BlackBox, Some(0), vec![], true, true),
        (Structure::BlackBox, None, vec![1], false, true),
        (Structure::Mechanical, None, vec![], false, false),
        (Structure::Mechanical, None, vec![0], true, false),
        (Structure::ConstantMass, None, vec![], false, false),
        (Structure::ConstantMass, None, vec![1], true, false),
        (Structure::Metric, Some(0), vec![0], false, false),
        (Structure::Metric, Some(2), vec![], false, false),
        (Structure::Metric, None, vec![], false, false),
    ];
    let factored = structures
        .into_iter()
        .enumerate()
        .flat_map(|structure| [(structure.clone(), Factor::Triangle), (structure, Factor::Rectangle)]);
    for ((k, (structure, time_like, cyclic, even_in_v, learn_alpha)), factor) in factored {
        let architecture = Architecture {
            coordinates: 3,
            hidden: vec![5, 4],
            activation: [ActivationChoice::Gelu, ActivationChoice::QuadraticSoftplus][k % 2],
            alpha: 0.8,
            time_like,
            scale: vec![1.5, 2.0, 0.5],
            periodic: vec![false, true, false],
            embed_periodic: true,
            input_layer: if k == 3 { InputLayer::Dyt } else { InputLayer::None },
            dissipation: None,
            form: Form { structure, factor, cyclic: cyclic.clone(), even_in_v, learn_alpha, ..Form::default() },
        };
        let architecture = Architecture { hidden: vec![6, 4], ..architecture };
        assert_eq!(architecture.validate(), Ok(()));
        let mut rng = ChaCha8Rng::seed_from_u64(k as u64);
        let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
        let layout = Layout::new(&architecture);
        assert_eq!(weights.len(), layout.parameters);
        assert_eq!(architecture.model::<f64>().matrices(), layout.matrices().collect::<Vec<_>>());
        let scale = architecture.scale.clone();
        check::<_, f64>(&architecture, &scale, &weights, k as u64);
        check::<_, Dd>(&architecture, &scale, &weights, k as u64);
        // What the structure promises: signature, cyclic coordinates, parity.
        let mut evaluation = Evaluation::new(architecture.model::<f64>().lagrangian().clone());
        let states: Vec<f64> = (0..3 * 40).map(|_| rng.random_range(-3.0..3.0)).collect();
        let v: Vec<f64> = (0..3 * 40).map(|_| rng.random_range(-3.0..3.0)).collect();
        evaluation.evaluate(&weights, &states, &v, Depth::Motion);
        if structure != Structure::BlackBox {
            for matrix in evaluation.mass_matrix.chunks_exact(9) {
                let values = nalgebra::DMatrix::from_row_slice(3, 3, matrix).symmetric_eigenvalues();
                let negative = values.iter().filter(|x| **x < 0.0).count();
                assert_eq!(negative, usize::from(time_like.is_some() && structure == Structure::Metric));
            }
        }
        if structure == Structure::ConstantMass {
            let first = &evaluation.mass_matrix[..9];
            let same = |m: &[f64]| m.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-13);
            assert!(evaluation.mass_matrix.chunks_exact(9).all(same));
        }
        for &i in &cyclic {
            assert!(evaluation.dl_dq.chunks_exact(3).all(|g| g[i] == 0.0));
        }
        if even_in_v || structure == Structure::Metric {
            let forward = evaluation.lagrangian.clone();
            evaluation.evaluate(&weights, &states, &v.iter().map(|v| -v).collect::<Vec<_>>(), Depth::Value);
            let same = forward.iter().zip(&evaluation.lagrangian).all(|(a, b)| (a - b).abs() < 1e-13 * (1.0 + a.abs()));
            assert!(same, "{structure:?} is even in v");
        }
    }
}
