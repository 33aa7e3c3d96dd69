//! Multiple shooting: gradients by the state and through the integrator, and what comes of them.

use crate::common::accuracy::{cast, largest};
use crate::common::nested::reference;
use crate::common::{of_scalar, properties};
use lnn::configuration::Penalty;
use lnn::data::{Dataset, Datasets};
use lnn::data::{Noise, StateEstimate};
use lnn::lagrangian::{FormulaConstraints, SystemInstance};
use lnn::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer, Layout, LinearMap};
use lnn::presets::Preset;
use lnn::recording::RecordedTrajectory;
use lnn::rollout::Between;
use lnn::scalar::{Dd, Real, Scalar};
use lnn::shooting::{self, Curvature, Fitted, Segments, Shooting, ShootingError, ShootingObjective, Task, fit};
use lnn::storage::Disk;
use lnn::tape::{Depth, Evaluation, MixedDirections, ScalarFunction, gradient};
use lnn::training::{
    CheckpointInterval, CheckpointManager, Fingerprint, Hooks, Objective, Progress, ResumeOptions, StopReason,
    TrainingError, resume,
};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

fn small(n: usize, activation: ActivationChoice, input_layer: InputLayer, embed_periodic: bool) -> Architecture {
    Architecture {
        coordinates: n,
        hidden: vec![6, 4],
        activation,
        alpha: 0.75,
        time_like: None,
        scale: (0..n).map(|i| 1.5 + i as f64 / 2.0).collect(),
        periodic: (0..n).map(|i| i % 2 == 0).collect(),
        embed_periodic,
        input_layer,
        dissipation: None,
        form: Form::default(),
    }
}

/// Random weights; the parameters of an input layer leave their initial values too, and friction is not small.
fn draw_weights<S: Scalar>(architecture: &Architecture, rng: &mut ChaCha8Rng) -> Vec<S> {
    let mut weights: Vec<S> = architecture.initial_weights(Initialization::Default, rng);
    if let Some(dissipation) = Layout::new(architecture).dissipation {
        dissipation.gamma_range().for_each(|k| weights[k] += S::of_f64(rng.random_range(4.0..5.0)));
    }
    for layer in Layout::new(architecture).branches.iter().flat_map(|branch| &branch.layers) {
        if layer.map != LinearMap::Dense {
            for k in layer.weight_range().chain(layer.bias_range()) {
                weights[k] += S::of_f64(rng.random_range(-0.3..0.3));
            }
        }
    }
    weights
}

/// `L_st` of a moving or still jet as a function of the physical state.
struct Coefficient<'a> {
    architecture: &'a Architecture,
    /// Weights, `s`, `t`.
    given: &'a [Vec<Dd>; 3],
    moving: bool,
}

impl ScalarFunction for Coefficient<'_> {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let n = self.architecture.coordinates;
        let [weights, s, t] = self.given.each_ref().map(|x| x.iter().map(|&x| of_scalar(x)).collect::<Vec<R>>());
        let r = reference(self.architecture, &weights, &x[..n], &x[n..]);
        let mut total = R::zero();
        for i in 0..n {
            for k in 0..n {
                total += s[i] * r.m[i * n + k] * t[k];
            }
            if self.moving {
                total += s[i] * (r.c[i] - r.g[i]);
            }
        }
        total
    }
}

/// Derivatives by scaled `q` and `v`, `(2, n)`.
fn expected_inputs(architecture: &Architecture, moving: bool, [weights, q, v, s, t]: &[Vec<Dd>; 5]) -> Vec<Dd> {
    let given = [weights.clone(), s.clone(), t.clone()];
    let coefficient = Coefficient { architecture, given: &given, moving };
    let (_, physical) = gradient(&coefficient, &[&q[..], v].concat()).unwrap();
    let n = architecture.coordinates;
    physical.iter().enumerate().map(|(k, &d)| d * Dd::of_f64(architecture.scale[k % n])).collect()
}

fn apart(a: &[Dd], b: &[Dd]) -> f64 {
    let difference: Vec<Dd> = a.iter().zip(b).map(|(&a, &b)| a - b).collect();
    largest(&difference)
}

/// Largest error over `eps` times what relative perturbations of all numbers by one unit do.
fn input_gradients<S: Scalar>(architecture: &Architecture, seed: u64, moving: bool) -> f64 {
    let n = architecture.coordinates;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let weights: Vec<S> = draw_weights(architecture, &mut rng);
    let mut vector =
        |count: usize, size: f64| -> Vec<S> { (0..count).map(|_| S::of_f64(rng.random_range(-size..size))).collect() };
    let (q, v) = (vector(2 * n, 4.0), vector(2 * n, 3.0));
    let jets = MixedDirections { s: vector(2 * n, 1.0), t: vector(2 * n, 1.0), moving };
    let mut evaluation = Evaluation::new(architecture.model().lagrangian().clone());
    evaluation.evaluate(&weights, &q, &v, Depth::Training);
    let zeros = |count: usize| vec![<S as Real>::zero(); count];
    let (mut plain, mut found) = (zeros(weights.len()), zeros(weights.len()));
    let (mut dq, mut dv) = (zeros(2 * n), zeros(2 * n));
    evaluation.add_gradient(&weights, &jets, &mut found, Some((&mut dq, &mut dv)));
    evaluation.add_gradient(&weights, &jets, &mut plain, None);
    assert_eq!(plain, found, "who asks for more gets the same gradient by the weights");
    let mut worst = 0.0_f64;
    for state in 0..2 {
        let row = |x: &[S], k: usize| cast::<S, Dd>(&x[k * n..(k + 1) * n]);
        let given = [cast(&weights), row(&q, state), row(&v, state), row(&jets.s, state), row(&jets.t, state)];
        let expected = expected_inputs(architecture, moving, &given);
        let step = 2f64.powi(-40);
        let mut condition = largest(&expected);
        for _ in 0..4 {
            let moved = given.each_ref().map(|x| {
                let by = |x: &Dd, up: bool| *x + *x * Dd::of_f64(if up { step } else { -step });
                x.iter().map(|x| by(x, rng.random())).collect()
            });
            condition = condition.max(apart(&expected_inputs(architecture, moving, &moved), &expected) / step);
        }
        let found = [row(&dq, state), row(&dv, state)].concat();
        let error = apart(&found, &expected);
        worst = worst.max(if error == 0.0 { 0.0 } else { error / (S::epsilon().to_f64() * condition) });
    }
    worst
}

#[test]
fn input_gradients_agree_with_nested_forward_numbers() {
    let mut worst = [0.0_f64; 3];
    for (k, activation) in ActivationChoice::ALL.into_iter().enumerate() {
        for n in 1..=4 {
            for (input_layer, embed, moving) in [
                (InputLayer::None, true, true),
                (InputLayer::Dyt, k % 2 == 0, true),
                (InputLayer::None, false, n % 2 == 0),
            ] {
                let architecture = small(n, activation, input_layer, embed);
                let seed = (10 * k + n) as u64;
                let found = [
                    input_gradients::<f32>(&architecture, seed, moving),
                    input_gradients::<f64>(&architecture, seed, moving),
                    input_gradients::<Dd>(&architecture, seed, moving),
                ];
                assert!(found.iter().all(|&r| r <= 30.0), "{architecture:?}: R = {found:?}");
                worst = std::array::from_fn(|i| worst[i].max(found[i]));
            }
        }
    }
    println!("largest R of f32, f64, double-double: {worst:.3?}");
}

proptest! {
    #![proptest_config(properties(12))]

    #[test]
    fn input_gradients_of_random_networks(
        n in 1_usize..=4,
        hidden in prop::collection::vec(1_usize..6, 1..4),
        activation in prop::sample::select(&ActivationChoice::ALL[..]),
        dyt in any::<bool>(),
        embed in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let input_layer = if dyt { InputLayer::Dyt } else { InputLayer::None };
        let hidden = hidden.into_iter().map(|w| w * activation.branches().len()).collect();
        let architecture = Architecture { hidden, ..small(n, activation, input_layer, embed) };
        prop_assert!(input_gradients::<f64>(&architecture, seed, true) <= 30.0);
        prop_assert!(input_gradients::<f32>(&architecture, seed, true) <= 30.0);
    }
}

/// A made-up recording: smooth, irregular in time, of nothing in particular.
fn track(n: usize, samples: usize, seed: u64, measures: bool) -> RecordedTrajectory {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut time = 0.0;
    let times: Vec<f64> = (0..samples)
        .map(|_| {
            time += rng.random_range(0.03..0.06);
            time
        })
        .collect();
    let phase: Vec<f64> = (0..n).map(|_| rng.random_range(0.0..TAU)).collect();
    let all = |f: &dyn Fn(f64, usize) -> f64| -> Vec<f64> {
        times.iter().flat_map(|&t| (0..n).map(move |i| (t, i))).map(|(t, i)| f(t, i)).collect()
    };
    let q = all(&|t, i| (2.0 * t + phase[i]).sin() + 6.5 * i as f64);
    let v = all(&|t, i| 2.0 * (2.0 * t + phase[i]).cos());
    let force = if measures { all(&|t, i| 0.3 * (t + i as f64).sin()) } else { Vec::new() };
    let v = if measures { v } else { Vec::new() };
    RecordedTrajectory { name: format!("track {seed}"), times, q, v, a: Vec::new(), force }
}

/// Estimates that are a little off.
fn estimates(track: &RecordedTrajectory, n: usize, error: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut off = |x: f64| x + error * rng.random_range(-1.0..1.0);
    let q: Vec<f64> = track.q.iter().map(|&q| off(q)).collect();
    let samples = track.len();
    let v = (0..samples * n)
        .map(|k| {
            let (sample, i) = (k / n, k % n);
            let (a, b) = (sample.saturating_sub(1), (sample + 1).min(samples - 1));
            off((track.q[b * n + i] - track.q[a * n + i]) / (track.times[b] - track.times[a]))
        })
        .collect();
    (q, v)
}

/// Tracks with estimated states.
struct Motion {
    tracks: Vec<RecordedTrajectory>,
    states: Vec<(Vec<f64>, Vec<f64>)>,
}

impl Motion {
    fn made_up(n: usize, samples: usize) -> Self {
        let tracks = vec![track(n, samples, 1, true), track(n, samples + 3, 2, false)];
        let states = tracks.iter().zip(7..).map(|(track, seed)| estimates(track, n, 0.02, seed)).collect();
        Self { tracks, states }
    }

    fn estimated(&self) -> Vec<StateEstimate<'_>> {
        let pairs = self.tracks.iter().zip(&self.states);
        pairs.map(|(track, (q, v))| StateEstimate { track, q, v, between: Between::Linear }).collect()
    }
}

fn noise(n: usize) -> Noise {
    Noise { q: vec![0.02; n], v: vec![0.05; n] }
}

fn segments<S: Scalar>(architecture: &Architecture, motion: &Motion, per_segment: usize, steps: usize) -> Segments<S> {
    Segments::new(architecture, &motion.estimated(), &noise(architecture.coordinates), per_segment, steps)
}

fn shots<S: Scalar>(architecture: &Architecture, penalty: Penalty, threads: usize) -> ShootingObjective<S> {
    ShootingObjective::new(architecture, penalty, (0.5, 2.0), threads).unwrap()
}

/// Formulas over `q0`, `q1`, .. and their velocities.
fn formulas(n: usize, formulas: &[&str]) -> Option<FormulaConstraints> {
    let names: Vec<String> = (0..n).map(|i| format!("q{i}")).collect();
    let named = formulas.iter().enumerate().map(|(k, formula)| (k.to_string(), formula.to_string())).collect();
    (!formulas.is_empty()).then(|| FormulaConstraints::new(&names, named).unwrap())
}

/// Shots under constraints.
fn held<S: Scalar>(shots: ShootingObjective<S>, n: usize, constraints: &[&str]) -> ShootingObjective<S> {
    match formulas(n, constraints) {
        Some(constraints) => shots.under(Arc::new(constraints.manifold().unwrap())),
        None => shots,
    }
}

/// What [`ShootingObjective::step`] differentiates, for `joints` gaps of the `rows`.
fn objective<S: Scalar>(
    shots: &mut ShootingObjective<S>,
    segments: &Segments<S>,
    (weights, starts): (&[S], &[S]),
    (rows, joints): (&[u32], usize),
    width: usize,
) -> S {
    let report = shots.loss(weights, segments, starts, rows);
    assert_eq!(report.left_out, 0);
    report.loss + report.gap * S::of_f64(0.5 * (joints * width) as f64) / S::of_f64(report.residuals as f64)
}

/// Gradient by weights and starts against central differences in double-double.
#[test]
fn the_gradient_through_the_integrator_is_that_of_the_discrete_map() {
    let kinds: [(_, _, _, _, _, &[&str]); 5] = [
        (1, ActivationChoice::Gelu, InputLayer::None, true, None, &[]),
        (2, ActivationChoice::Softplus, InputLayer::None, true, Some(3), &[]),
        (2, ActivationChoice::QuadraticSoftplus, InputLayer::Dyt, false, None, &[]),
        (2, ActivationChoice::Gelu, InputLayer::None, true, Some(3), &["q1^2*cos(q0) + 3*q1 + sin(q0)"]),
        (
            3,
            ActivationChoice::Gelu,
            InputLayer::None,
            false,
            None,
            &["q0_dot*cos(q2) + q1*q1_dot + q2_dot - sin(q0)", "q0*q1 + q2^2/4"],
        ),
    ];
    for (n, activation, input_layer, embed, dissipation, constraints) in kinds {
        let architecture = Architecture { dissipation, ..small(n, activation, input_layer, embed) };
        let motion = Motion::made_up(n, 8);
        let width = 2 * n;
        let exact = segments::<Dd>(&architecture, &motion, 4, 2);
        let double = segments::<f64>(&architecture, &motion, 4, 2);
        // Two pieces of the first track, three of the second; the last of each has no joint.
        assert_eq!((exact.len(), exact.samples()), (5, 19));
        let rows = [3, 0, 2];
        // All three are followed by another.
        let joints = 3;
        let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(3));
        let starts = double.starts().to_vec();
        let (mut by_weights, mut by_starts) = (vec![0.0; weights.len()], vec![f64::NAN; starts.len()]);
        let mut shots_double = held(shots::<f64>(&architecture, Penalty::None, 1), n, constraints);
        let report = shots_double.step(&weights, &double, &starts, &rows, (&mut by_weights, &mut by_starts));
        let found = [by_weights, by_starts].concat();

        let step = Dd::of_f64(2f64.powi(-34));
        let x: Vec<Dd> = [cast::<f64, Dd>(&weights), cast(&starts)].concat();
        let mut shots_exact = held(shots::<Dd>(&architecture, Penalty::None, 2), n, constraints);
        let mut at = |x: &[Dd]| {
            let (weights, starts) = x.split_at(weights.len());
            objective(&mut shots_exact, &exact, (weights, starts), (&rows, joints), width)
        };
        let value = at(&x).to_f64();
        let own = report.loss + report.gap * 0.5 * (joints * width) as f64 / report.residuals as f64;
        assert!((value - own).abs() <= 1e-13 * value, "{value} {own}");
        let expected: Vec<f64> = (0..x.len())
            .map(|k| {
                let mut moved = x.clone();
                moved[k] += step;
                let up = at(&moved);
                moved[k] -= step + step;
                ((up - at(&moved)) / (step + step)).to_f64()
            })
            .collect();
        let size = expected.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let error = found.iter().zip(&expected).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / size;
        println!("n = {n}, {activation}: relative error {error:.1e}");
        assert!(error <= 1e-12, "n = {n}, {activation}: {error:.2e}");
    }
}

/// With a start that lies where the network's mass matrix has the wrong signature, gradient of the penalty as in training on
/// accelerations.
#[test]
fn the_penalty_is_that_of_supervised_training() {
    let architecture = Architecture { alpha: -0.4, ..small(2, ActivationChoice::Gelu, InputLayer::None, true) };
    let motion = Motion::made_up(2, 8);
    let segments = segments::<f64>(&architecture, &motion, 4, 1);
    let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(4));
    let rows: Vec<u32> = (0..segments.len() as u32).collect();
    let gradient = |penalty| {
        let (mut gradient, mut by_starts) = (vec![0.0; weights.len()], vec![0.0; segments.starts().len()]);
        let mut shots = shots::<f64>(&architecture, penalty, 1);
        let report = shots.step(&weights, &segments, segments.starts(), &rows, (&mut gradient, &mut by_starts));
        assert_eq!(report.left_out, 0);
        (report, gradient, by_starts)
    };
    let penalty = Penalty::Eigenvalue { lambda: 3.0 };
    let ((plain, base, base_starts), (report, with, starts)) = (gradient(Penalty::None), gradient(penalty));
    assert_eq!((plain.loss, plain.penalty, plain.penalised), (report.loss, 0.0, 0));
    assert_eq!((report.penalised, base_starts), (rows.len(), starts), "all violate; the data place the starts");

    // The same states in a dataset, one per segment.
    let physical = |part: usize| -> Vec<f64> {
        let parts = segments.starts().chunks(2).enumerate().filter(|(k, _)| k % 2 == part);
        parts.flat_map(|(_, x)| [x[0] * architecture.scale[0], x[1] * architecture.scale[1]]).collect()
    };
    let (q, v) = (physical(0), physical(1));
    let data = Dataset::new(2, q, v, vec![0.0; 2 * rows.len()]).unwrap();
    let supervised = |penalty| {
        let mut gradient = vec![0.0; weights.len()];
        let report = Objective::new(&architecture, penalty, 1).unwrap().step(&weights, &data, &rows, &mut gradient);
        (report.penalty, gradient)
    };
    let ((_, a), (value, b)) = (supervised(Penalty::None), supervised(penalty));
    let expected: Vec<f64> = b.iter().zip(&a).map(|(b, a)| b - a).collect();
    let size = expected.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    assert!((report.penalty - value).abs() <= 1e-14 * value);
    for ((with, base), expected) in with.iter().zip(&base).zip(&expected) {
        // The motion near a singular mass matrix is violent: differences round with its own gradient.
        assert!((with - base - expected).abs() <= 1e-13 * size.max(base.abs()));
    }
}

/// Predictions, at the steps' ends and between them, err by the fourth power of the step.
#[test]
fn the_method_has_order_four() {
    let architecture = small(2, ActivationChoice::Softplus, InputLayer::None, true);
    let mut motion = Motion::made_up(2, 24);
    // A force given by samples has kinks.
    motion.tracks.iter_mut().for_each(|track| track.force.clear());
    let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(5));
    let mut shots = shots::<f64>(&architecture, Penalty::None, 1);
    let mut at = |steps: usize| {
        let segments = segments::<f64>(&architecture, &motion, 12, steps);
        let rows: Vec<u32> = (0..segments.len() as u32).collect();
        shots.residuals(&weights, &segments, segments.starts(), &rows)
    };
    let exact = at(512);
    let errors: Vec<f64> = [8, 16, 32, 64]
        .map(|steps| at(steps).iter().zip(&exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())))
        .to_vec();
    for pair in errors.windows(2) {
        let slope = (pair[0] / pair[1]).log2();
        // Velocities between steps are derivatives of a cubic: one order less.
        assert!((2.7..4.5).contains(&slope), "{errors:?}");
    }
    // Positions alone; where samples lie between steps varies with the steps, the trend is the order.
    let positions = |steps: usize| -> Vec<f64> {
        let bare = Noise { v: Vec::new(), ..noise(2) };
        let segments = Segments::<f64>::new(&architecture, &motion.estimated(), &bare, 12, steps);
        let rows: Vec<u32> = (0..segments.len() as u32).collect();
        let mut shots = self::shots::<f64>(&architecture, Penalty::None, 1);
        shots.residuals(&weights, &segments, segments.starts(), &rows)
    };
    let exact = positions(1024);
    let errors =
        [16, 128].map(|steps| positions(steps).iter().zip(&exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())));
    let slope = (errors[0] / errors[1]).log2() / 3.0;
    assert!((3.6..4.4).contains(&slope), "{errors:?}: order {slope}");
}

/// Whole turns, and which ones a recording counts, change nothing but rounding.
#[test]
fn turns_do_not_matter() {
    let architecture = small(2, ActivationChoice::Gelu, InputLayer::None, false);
    let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(6));
    let at = |turns: f64| {
        let mut motion = Motion::made_up(2, 12);
        let shift = |x: &mut Vec<f64>| x.iter_mut().step_by(2).for_each(|q| *q += turns * TAU);
        motion.tracks.iter_mut().for_each(|track| shift(&mut track.q));
        motion.states.iter_mut().for_each(|(q, _)| shift(q));
        let segments = segments::<f64>(&architecture, &motion, 4, 3);
        let rows: Vec<u32> = (0..segments.len() as u32).collect();
        let report = shots::<f64>(&architecture, Penalty::None, 1).loss(&weights, &segments, segments.starts(), &rows);
        [report.loss, report.gap]
    };
    let (here, there) = (at(0.0), at(-1e6));
    for (a, b) in here.iter().zip(there) {
        // Positions near 6e6 are given to 1e-9; residuals are in units of 0.02.
        assert!((a / b - 1.0).abs() < 1e-6, "{here:?} {there:?}");
    }
}

/// Gauss-Newton steps lead to starts where the exact gradient vanishes.
#[test]
fn refinement_ends_where_the_gradient_by_the_starts_vanishes() {
    let architecture = small(1, ActivationChoice::Gelu, InputLayer::None, true);
    let motion = Motion::made_up(1, 24);
    let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(8));
    let segments = segments::<f64>(&architecture, &motion, 8, 4);
    let rows: Vec<u32> = (0..segments.len() as u32).collect();
    let mut shots = ShootingObjective::<f64>::new(&architecture, Penalty::None, (0.5, f64::INFINITY), 2).unwrap();
    let (mut starts, mut curvature) = (segments.starts().to_vec(), Curvature::default());
    let (mut by_weights, mut by_starts) = (vec![0.0; weights.len()], starts.clone());
    let mut slope = |shots: &mut ShootingObjective<f64>, starts: &[f64]| {
        let report = shots.step(&weights, &segments, starts, &rows, (&mut by_weights, &mut by_starts));
        (report.loss, by_starts.iter().fold(0.0_f64, |m, g| m.max(g.abs())))
    };
    let before = slope(&mut shots, &starts);
    for _ in 0..60 {
        shots.refine(&weights, &segments, &mut starts, &mut curvature, 1.0);
    }
    let after = slope(&mut shots, &starts);
    assert!(after.0 < before.0 && after.1 < 1e-6 * before.1, "{before:?} {after:?}");

    // With the derivatives of that linearisation the way back from somewhere near is as good as a step of refinement.
    let best = starts.clone();
    starts.iter_mut().step_by(2).for_each(|q| *q += 0.01);
    let away = |starts: &[f64]| starts.iter().zip(&best).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    let mut buffer = starts.clone();
    for _ in 0..20 {
        shots.move_starts(&weights, &segments, (&mut starts, &rows), (&mut curvature, &mut buffer), 1.0);
    }
    assert!(away(&starts) < 1e-6, "{}", away(&starts));
}

/// A bob on a circle of radius 1, its angle `sin(2 t)`, seen with errors.
fn bob(samples: usize, error: f64) -> Motion {
    let (mut tracks, mut states) = (Vec::new(), Vec::new());
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    for k in 0..4 {
        let times: Vec<f64> = (0..samples).map(|k| 0.04 * k as f64).collect();
        let mut off = |x: f64| x + error * rng.random_range(-1.0..1.0);
        let (mut q, mut v) = (Vec::new(), Vec::new());
        for t in &times {
            let (angle, rate) = ((2.0 * t + f64::from(k)).sin(), 2.0 * (2.0 * t + f64::from(k)).cos());
            q.extend([off(angle.sin()), off(-angle.cos())]);
            v.extend([off(rate * angle.cos()), off(rate * angle.sin())]);
        }
        states.push((q.clone(), v));
        tracks.push(RecordedTrajectory { name: format!("{k}"), times, q, v: vec![], a: vec![], force: vec![] });
    }
    Motion { tracks, states }
}

/// Starts under constraints are the best of those that obey them.
#[test]
fn starts_under_constraints_stay_on_them_and_are_the_best_there() {
    let architecture =
        Architecture { periodic: vec![false; 2], ..small(2, ActivationChoice::Gelu, InputLayer::None, false) };
    let circle = formulas(2, &["q0^2 + q1^2 - 1"]).unwrap();
    let motion = bob(24, 0.02);
    let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(8));
    let cut = |motion: &Motion| {
        let bare = Noise { q: vec![0.02; 2], v: Vec::new() };
        let segments = Segments::<f64>::new(&architecture, &motion.estimated(), &bare, 8, 4);
        segments.under(&architecture, Arc::new(circle.manifold().unwrap()))
    };
    let segments = cut(&motion);
    let rows: Vec<u32> = (0..segments.len() as u32).collect();
    let shots = ShootingObjective::<f64>::new(&architecture, Penalty::None, (0.5, f64::INFINITY), 2).unwrap();
    let mut shots = shots.under(Arc::new(circle.manifold().unwrap()));
    let (mut starts, mut curvature) = (segments.starts().to_vec(), Curvature::default());
    let (before, joints) = (segments.starts().to_vec(), segments.len() - 4);
    for _ in 0..60 {
        shots.refine(&weights, &segments, &mut starts, &mut curvature, 1.0);
    }
    let mut value = |starts: &[f64]| objective(&mut shots, &segments, (&weights, starts), (&rows, joints), 4);
    let best = value(&starts);
    assert!(best < 0.9 * value(&before), "{best} {}", value(&before));
    let scale = &architecture.scale;
    let physical = |start: &[f64]| [start[0] * scale[0], start[1] * scale[1], start[2] * scale[0], start[3] * scale[1]];
    for k in 0..segments.len() {
        let [x, y, u, w] = physical(&starts[4 * k..4 * k + 4]);
        assert!((x.hypot(y) - 1.0).abs() < 1e-12 && (x * u + y * w).abs() < 1e-12);
        // Along the circle, and faster or slower.
        for (turn, faster) in [(1e-4, 0.0), (-1e-4, 0.0), (0.0, 1e-4), (0.0, -1e-4)] {
            let (sin, cos) = f64::sin_cos(turn);
            let rotated = [cos * x - sin * y, sin * x + cos * y, cos * u - sin * w, sin * u + cos * w];
            let moved = [rotated[0], rotated[1], rotated[2] - faster * rotated[1], rotated[3] + faster * rotated[0]];
            let mut other = starts.clone();
            (0..4).for_each(|i| other[4 * k + i] = moved[i] / scale[i % 2]);
            assert!(value(&other) > best - 1e-12, "start {k}: {} below {best}", value(&other));
        }
    }
}

/// A fit through the motion under constraints predicts, from positions alone, what it did not see.
#[test]
fn a_network_is_fitted_through_its_motion_under_constraints() {
    let architecture = Architecture {
        periodic: vec![false; 2],
        hidden: vec![16, 16],
        ..small(2, ActivationChoice::Gelu, InputLayer::None, false)
    };
    let circle = formulas(2, &["q0^2 + q1^2 - 1"]).unwrap();
    let motion = bob(48, 1e-3);
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(5));
    let (tracks, noise) = (motion.estimated(), Noise { q: vec![1e-3; 2], v: vec![] });
    let settings = Shooting { samples_per_segment: 12, epochs: 100, batch: 4, rate: 2e-2, ..Shooting::default() };
    let run = |threads: usize| {
        let task = Task {
            architecture: &architecture,
            penalty: Penalty::Eigenvalue { lambda: 1.0 },
            weights: weights.clone(),
            training: &tracks[..3],
            validation: &tracks[3..],
            noise: &noise,
            constraints: Some(&circle),
            seed: 3,
        };
        fit(&settings, task, threads, &Hooks::default()).unwrap()
    };
    let fitted = run(1);
    println!("loss {} -> {}", fitted.start_loss, fitted.validation_loss);
    assert!(fitted.validation_loss < 0.01 * fitted.start_loss, "{} -> {}", fitted.start_loss, fitted.validation_loss);
    assert_eq!(run(2).weights, fitted.weights);
}

/// Segments without motion are left out and counted, and give no gradient.
#[test]
fn singular_mass_matrices_are_left_out() {
    let architecture = Architecture { alpha: 0.0, ..small(2, ActivationChoice::Gelu, InputLayer::None, true) };
    let motion = Motion::made_up(2, 8);
    let segments = segments::<f32>(&architecture, &motion, 4, 2);
    let weights = vec![0.0_f32; Layout::new(&architecture).parameters];
    let (mut gradient, mut by_starts) = (vec![1.0; weights.len()], vec![1.0; segments.starts().len()]);
    let rows = [0, 1, 4];
    let report = shots::<f32>(&architecture, Penalty::None, 1).step(
        &weights,
        &segments,
        segments.starts(),
        &rows,
        (&mut gradient, &mut by_starts),
    );
    assert_eq!(report.left_out, 3);
    assert!(report.loss.is_nan() && gradient.iter().chain(&by_starts).all(|g| *g == 0.0));
    let outcome = fit_motion(&Shooting { epochs: 1, ..quick() }, &architecture, weights, &motion, 1, &Hooks::default());
    assert!(matches!(outcome, Err(ShootingError::Training(TrainingError::NothingLearned(None)))));
}

fn quick() -> Shooting {
    Shooting { samples_per_segment: 8, epochs: 3, batch: 2, ..Shooting::default() }
}

fn fit_motion<S: Scalar>(
    settings: &Shooting,
    architecture: &Architecture,
    weights: Vec<S>,
    motion: &Motion,
    threads: usize,
    hooks: &Hooks,
) -> Result<Fitted<S>, ShootingError> {
    let (tracks, noise) = (motion.estimated(), noise(architecture.coordinates));
    let (training, validation) = (&tracks[..], &tracks[1..]);
    let task = Task {
        architecture,
        penalty: Penalty::None,
        weights,
        training,
        validation,
        noise: &noise,
        constraints: None,
        seed: 1,
    };
    fit(settings, task, threads, hooks)
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let architecture = small(2, ActivationChoice::Gelu, InputLayer::None, true);
    let motion = Motion::made_up(2, 300);
    let weights: Vec<f32> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(9));
    // Some epoch must be better than the start, or nothing would be compared.
    let settings = Shooting { batch: 40, rate: 1e-3, continuity: 1.0, epochs: 4, ..quick() };
    let run = |threads| {
        let hooks = Hooks::default();
        let fitted = fit_motion(&settings, &architecture, weights.clone(), &motion, threads, &hooks).unwrap();
        (fitted.weights, fitted.validation_loss, fitted.steps)
    };
    let one = run(1);
    assert_eq!(run(2), one);
    assert_eq!(run(3), one);
    assert_ne!(one.0, weights);
}

/// An oscillator, `q = A cos(w t + phase)`, `w = 2`.
fn oscillator(samples: usize, error: f64) -> Motion {
    let (mut tracks, mut states) = (Vec::new(), Vec::new());
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for k in 0..6 {
        let (size, phase) = (0.4 + 0.2 * f64::from(k), f64::from(k));
        let times: Vec<f64> = (0..samples).map(|k| 0.05 * k as f64).collect();
        let exact: Vec<f64> = times.iter().map(|t| size * (2.0 * t + phase).cos()).collect();
        let v: Vec<f64> =
            times.iter().map(|t| -2.0 * size * (2.0 * t + phase).sin() + rng.random_range(-0.1..0.1)).collect();
        let q: Vec<f64> = exact.iter().map(|q| q + error * rng.random_range(-1.0..1.0)).collect();
        states.push((q.clone(), v));
        tracks.push(RecordedTrajectory { name: format!("{k}"), times, q, v: vec![], a: vec![], force: vec![] });
    }
    Motion { tracks, states }
}

/// Without noise a network that holds the answer finds `a = -4 q`, from estimated velocities that are wrong by 5 %.
#[test]
fn exact_positions_teach_exact_accelerations() {
    let architecture = Architecture {
        coordinates: 1,
        hidden: vec![8],
        activation: ActivationChoice::Quadratic,
        alpha: 1.0,
        time_like: None,
        scale: vec![2.0],
        periodic: vec![false],
        embed_periodic: false,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    };
    let motion = oscillator(64, 0.0);
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(12));
    let tracks = motion.estimated();
    let noise = Noise { q: vec![1e-3], v: vec![] };
    let task = Task {
        architecture: &architecture,
        penalty: Penalty::Eigenvalue { lambda: 1.0 },
        weights,
        training: &tracks[..5],
        validation: &tracks[5..],
        noise: &noise,
        constraints: None,
        seed: 2,
    };
    let settings = Shooting {
        samples_per_segment: 16,
        steps: Some(8),
        epochs: 200,
        batch: 2,
        rate: 1e-2,
        continuity: 1.0,
        ..Shooting::default()
    };
    let fitted = fit(&settings, task, 1, &Hooks::default()).unwrap();
    assert_eq!((fitted.segments, fitted.stop.clone(), fitted.history.len()), ((20, 320), StopReason::Finished, 200));
    let (q, v): (Vec<f64>, Vec<f64>) =
        (0..50).map(|k| 0.9 * f64::from(k)).map(|s| (0.9 * s.cos(), 1.8 * s.sin())).unzip();
    let mut chunk = Evaluation::new(architecture.model().lagrangian().clone());
    chunk.evaluate(&fitted.weights, &q, &v, Depth::Motion);
    let error = (0..q.len())
        .map(|k| (2.0 * (chunk.dl_dq[k] - chunk.coriolis[k]) / chunk.mass_matrix[k] + 4.0 * q[k]).abs())
        .sum::<f64>()
        / q.iter().map(|q| 4.0 * q.abs()).sum::<f64>();
    println!("loss {} -> {}, acceleration error {error:.4}", fitted.start_loss, fitted.validation_loss);
    assert!(fitted.validation_loss < 1e-3 * fitted.start_loss && error < 0.02, "{error}");
    assert!(fitted.integration_error < 0.05, "{}", fitted.integration_error);
}

#[test]
fn an_interrupt_keeps_the_best_so_far() {
    let architecture = small(2, ActivationChoice::Gelu, InputLayer::None, true);
    let motion = Motion::made_up(2, 24);
    let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(9));
    let hooks = Hooks::default();
    hooks.interrupt.store(true, Ordering::Relaxed);
    let fitted = fit_motion(&quick(), &architecture, weights.clone(), &motion, 1, &hooks).unwrap();
    assert_eq!((fitted.stop, fitted.weights), (StopReason::Interrupted, weights));
}

/// The training that gave the weights is but an epoch of nothing; what is held is multiple shooting behind it.
#[test]
fn stopping_after_any_step_changes_nothing() {
    let architecture = small(2, ActivationChoice::Gelu, InputLayer::None, true);
    let motion = Motion::made_up(2, 24);
    let tracks = motion.estimated();
    let noise = noise(2);
    let states = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || (0..16).map(|_| rng.random_range(-1.0..1.0)).collect();
        Dataset::<f64>::new(2, draw(), draw(), draw()).unwrap()
    };
    let data = Datasets { training: vec![states(1)], validation: states(2), test: states(3) };
    let mut config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
    config.phases[0].epochs = 1;
    let settings = Shooting { epochs: 4, curvature_every: 3, batch: 2, ..quick() };
    // As a program does it: the training from the checkpoint or the beginning, then multiple shooting.
    let sit = |directory: &Path, every: CheckpointInterval, threads: usize, hooks: &Hooks| {
        let identity = Fingerprint { config: "fit".to_string(), data: data.checksums() };
        let keeper = Arc::new(CheckpointManager::new(Arc::new(Disk), directory, every, identity));
        let start = keeper.restore::<f64>(Layout::new(&architecture).parameters, 8).ok().map(|found| found.content);
        let shots = start.clone().filter(|snapshot| snapshot.is_shooting());
        let resumed = ResumeOptions { checkpoints: Some(Arc::clone(&keeper)), start };
        let trained =
            resume(&config, &architecture, Penalty::None, data.clone(), threads, &Hooks::default(), resumed).unwrap();
        let (training, validation) = (&tracks[..], &tracks[..]);
        let weights = trained.weights.clone();
        let penalty = Penalty::None;
        let task = Task {
            architecture: &architecture,
            penalty,
            weights,
            training,
            validation,
            noise: &noise,
            constraints: None,
            seed: 1,
        };
        let start = Some(shots.unwrap_or_else(|| trained.snapshot(&config)));
        shooting::resume(&settings, task, threads, hooks, ResumeOptions { checkpoints: Some(keeper), start }).unwrap()
    };
    let stop_after = |steps: usize| {
        let interrupt = Arc::new(AtomicBool::new(false));
        let (raised, taken) = (Arc::clone(&interrupt), AtomicUsize::new(0));
        let watcher = move |progress: Progress<'_>| {
            if matches!(progress, Progress::Step { .. }) && taken.fetch_add(1, Ordering::SeqCst) + 1 == steps {
                raised.store(true, Ordering::SeqCst);
            }
        };
        Hooks { watcher: Some(Arc::new(watcher)), interrupt }
    };
    let numbers = |fitted: &Fitted<f64>| {
        let rows =
            fitted.history.iter().map(|e| [e.training_loss, e.penalty, e.validation_loss, e.gradient_norm, e.rate]);
        let rows: Vec<_> = rows.map(|row| row.map(f64::to_bits)).collect();
        (rows, fitted.weights.clone(), [fitted.start_loss, fitted.validation_loss, fitted.integration_error])
    };
    let directory = || tempfile::tempdir().unwrap();
    let whole = sit(directory().path(), CheckpointInterval::Seconds(1e9), 1, &Hooks::default());
    let per_epoch = whole.segments.0.div_ceil(2);
    assert_eq!((whole.history.len(), whole.stop.clone()), (4, StopReason::Finished));
    assert!(per_epoch >= 3, "{per_epoch}");
    for steps in 1..=4 * per_epoch {
        let place = directory();
        let stopped = sit(place.path(), CheckpointInterval::Seconds(1e9), 1, &stop_after(steps));
        assert_eq!(stopped.stop, StopReason::Interrupted);
        let found = sit(place.path(), CheckpointInterval::Epochs(1), 2, &Hooks::default());
        assert!(numbers(&found) == numbers(&whole) && found.stop == StopReason::Finished, "stopped after step {steps}");
    }
    // Stopped after every step.
    let place = directory();
    for _ in 0..4 * per_epoch {
        sit(place.path(), CheckpointInterval::Epochs(1), 1, &stop_after(1));
    }
    assert!(numbers(&sit(place.path(), CheckpointInterval::Epochs(1), 1, &Hooks::default())) == numbers(&whole));
    let saved = lnn::training::saved(&Disk, place.path()).unwrap().content;
    assert!(saved.epochs > 1, "{saved:?}");
}

#[test]
fn bad_numbers_are_named() {
    let architecture = small(2, ActivationChoice::Gelu, InputLayer::None, true);
    let motion = Motion::made_up(2, 8);
    let tracks = motion.estimated();
    let weights: Vec<f64> = draw_weights(&architecture, &mut ChaCha8Rng::seed_from_u64(9));
    let good = noise(2);
    let message = |noise: &Noise, weights: &[f64], training: &[StateEstimate<'_>]| {
        let (architecture, weights, validation) = (&architecture, weights.to_vec(), training);
        let task = Task {
            architecture,
            penalty: Penalty::None,
            weights,
            training,
            validation,
            noise,
            constraints: None,
            seed: 1,
        };
        fit(&quick(), task, 1, &Hooks::default()).unwrap_err().to_string()
    };
    let short = Noise { q: vec![0.1], v: vec![] };
    let zero = Noise { q: vec![0.1, 0.0], v: vec![] };
    let off = [StateEstimate { q: &tracks[0].q[1..], ..tracks[0] }];
    let sigma = "standard deviations of positions";
    assert_eq!(message(&short, &weights, &tracks), format!("{sigma}: expected 2 numbers, found 1"));
    assert_eq!(message(&zero, &weights, &tracks), format!("{sigma}: expected positive numbers, found 0"));
    let parameters = weights.len();
    assert_eq!(message(&good, &weights[..5], &tracks), format!("weights: expected {parameters} numbers, found 5"));
    assert_eq!(message(&good, &weights, &off), "track 1: estimated positions: expected 16 numbers, found 15");
    let none = "training trajectories: no trajectory has two samples that follow each other";
    assert_eq!(message(&good, &weights, &[]), none);
    let settings = Shooting { rate: -1.0, ..quick() };
    let error = fit_motion(&settings, &architecture, weights.clone(), &motion, 1, &Hooks::default()).unwrap_err();
    let error = error.to_string();
    assert!(error.starts_with("shooting.rate: ") && error.ends_with("found -1"), "{error}");
}
