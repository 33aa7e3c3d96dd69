//! The training objective against reverse mode through the whole loss; the trainer's promises.

use crate::common::{of_scalar, properties, solve};
use lnn::configuration::{
    Config, Data, Lbfgs, Network, OnFailure, Optimizer, Penalty, Phase, Precision, Regularizer, Scaling,
};
use lnn::data::{Dataset, Datasets};
use lnn::forward::HyperDual;
use lnn::lagrangian::{Lagrangian, MechanicsError};
use lnn::network::{
    ActivationChoice, Architecture, Factor, Form, Initialization, InputLayer, JointFriction, Layout, Structure,
};
use lnn::optimizers::{Method, Schedule};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{ScalarFunction, gradient};
use lnn::training::{Hooks, Objective, StopReason, Trained, TrainingError, train};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn architecture(n: usize, hidden: &[usize]) -> Architecture {
    Architecture {
        coordinates: n,
        hidden: hidden.to_vec(),
        activation: ActivationChoice::Gelu,
        alpha: 0.3,
        time_like: None,
        scale: (0..n).map(|i| 2.0 + i as f64).collect(),
        periodic: vec![true; n],
        embed_periodic: true,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    }
}

fn random_data<S: Scalar>(n: usize, states: usize, seed: u64) -> Dataset<S> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |size: f64| (0..states * n).map(|_| S::of_f64(rng.random_range(-size..size))).collect();
    Dataset::new(n, draw(3.0), draw(4.0), draw(5.0)).unwrap()
}

/// Penalties written down a second time, with what is constant for the gradient.
enum Judge<S> {
    /// Eigenvectors of the wrong eigenvalues of every state's scaled mass matrix, with the sign by which these are penalised.
    Eigenvectors(Vec<Vec<(f64, Vec<f64>)>>),
    /// Characteristic scales and the time-like coordinate.
    Sylvester(Vec<S>, Option<usize>),
}

/// Determinant by expansion along the first row.
fn determinant<T: Real>(n: usize, m: &[T]) -> T {
    if n == 0 {
        return T::one();
    }
    (0..n).fold(T::zero(), |sum, j| {
        let minor: Vec<T> = (n..n * n).filter(|k| k % n != j).map(|k| m[k]).collect();
        let term = m[j] * determinant(n - 1, &minor);
        if j % 2 == 0 { sum + term } else { sum - term }
    })
}

impl<S: Scalar> Judge<S> {
    /// The penalty of state `row` with the scaled mass matrix `m`, without its weight.
    fn penalty<T: Real>(&self, row: usize, n: usize, m: &[T]) -> T {
        let mut sum = T::zero();
        match self {
            Self::Eigenvectors(active) => {
                for (sign, u) in &active[row] {
                    for k in 0..n * n {
                        // First-order change of an eigenvalue: u^T dM u.
                        sum += T::of(sign * u[k / n] * u[k % n]) * m[k];
                    }
                }
            }
            Self::Sylvester(scales, time) => {
                let scale = |i: usize| of_scalar::<T>(scales[i]);
                let eps = T::of(1e-8);
                if let Some(t) = *time {
                    sum += m[t * n + t].relu() / (scale(t) + eps);
                }
                let axes: Vec<usize> = (0..n).filter(|&i| Some(i) != *time).collect();
                let mut product = T::one();
                for (k, &axis) in axes.iter().enumerate() {
                    product *= scale(axis);
                    let block: Vec<T> =
                        axes[..=k].iter().flat_map(|i| axes[..=k].iter().map(move |j| m[i * n + j])).collect();
                    sum += (-determinant(k + 1, &block)).relu() / (product + eps);
                }
            }
        }
        sum
    }
}

/// Loss of one state in the paper's convention plus the penalty, over any number type.
fn whole_loss<T: Real>(
    architecture: &Architecture,
    weights: &[T],
    [q, v, a, external]: [&[T]; 4],
    (judge, row, lambda): (&Judge<impl Scalar>, usize, f64),
) -> T {
    let n = architecture.coordinates;
    let lifted: Vec<HyperDual<T>> = weights.iter().map(|&w| HyperDual::lift(w)).collect();
    let jet = |s: &[T], t: &[T]| {
        let x: Vec<HyperDual<T>> =
            (0..2 * n).map(|k| HyperDual::new(if k < n { q[k] } else { v[k - n] }, s[k], t[k], T::zero())).collect();
        architecture.lagrangian(&lifted, &x[..n], &x[n..])
    };
    let unit = |k: usize| -> Vec<T> { (0..2 * n).map(|i| if i == k { T::one() } else { T::zero() }).collect() };
    let moving: Vec<T> = v.iter().copied().chain((0..n).map(|_| T::zero())).collect();
    let mass: Vec<T> = (0..n * n).map(|k| jet(&unit(n + k / n), &unit(n + k % n)).st).collect();
    let friction = |i: usize| {
        let at = |k: usize| {
            if k == i { HyperDual::new(v[k], T::one(), T::zero(), T::zero()) } else { HyperDual::lift(v[k]) }
        };
        let q: Vec<HyperDual<T>> = q.iter().map(|&q| HyperDual::lift(q)).collect();
        architecture.rayleigh_dissipation(&lifted, &q, &(0..n).map(at).collect::<Vec<_>>()).s
    };
    let own = |i: usize| jet(&unit(i), &unit(i)).s - jet(&unit(n + i), &moving).st;
    let force: Vec<T> = (0..n).map(|i| own(i) - friction(i) + external[i]).collect();
    let scale = |i: usize| T::of(architecture.scale[i]);
    let predicted = solve(n, &mass, &force);
    let mut loss = T::zero();
    for i in 0..n {
        loss += ((predicted[i] - a[i]) / scale(i)).abs();
    }
    loss /= T::of(2.0 * n as f64);
    let scaled: Vec<T> = (0..n * n).map(|k| mass[k] * scale(k / n) * scale(k % n)).collect();
    loss += T::of(lambda) * judge.penalty(row, n, &scaled);
    loss
}

/// Mean of [`whole_loss`] over a dataset as a function of the weights.
struct MeanLoss<'a, S> {
    architecture: &'a Architecture,
    data: &'a Dataset<S>,
    judge: &'a Judge<S>,
    lambda: f64,
}

impl<S: Scalar> ScalarFunction for MeanLoss<'_, S> {
    fn eval<R: Real>(&self, weights: &[R]) -> R {
        let n = self.architecture.coordinates;
        let mut total = R::zero();
        for row in 0..self.data.len() {
            let part = |x: &[S]| -> Vec<R> { x[row * n..(row + 1) * n].iter().map(|&x| of_scalar(x)).collect() };
            let [q, v, a] = [self.data.q(), self.data.v(), self.data.a()].map(part);
            let force = if self.data.force().is_empty() { vec![R::zero(); n] } else { part(self.data.force()) };
            total += whole_loss(self.architecture, weights, [&q, &v, &a, &force], (self.judge, row, self.lambda));
        }
        total / R::of(self.data.len() as f64)
    }
}

/// Activation, input layer, units of the dissipation.
type Model = (ActivationChoice, InputLayer, Option<usize>);

/// One or two branches, with and without an input layer, with and without friction.
const MODELS: [Model; 6] = [
    (ActivationChoice::Gelu, InputLayer::None, None),
    (ActivationChoice::Gelu, InputLayer::Dyt, None),
    (ActivationChoice::QuadraticSoftplus, InputLayer::None, None),
    (ActivationChoice::QuadraticSoftplus, InputLayer::Dyt, None),
    (ActivationChoice::Gelu, InputLayer::None, Some(5)),
    (ActivationChoice::QuadraticSoftplus, InputLayer::Dyt, Some(3)),
];

fn gradient_agrees<S: Scalar>(
    (activation, input_layer, dissipation): Model,
    n: usize,
    alpha: f64,
    penalty: Penalty,
    tolerance: f64,
) {
    let architecture = Architecture { alpha, activation, input_layer, dissipation, ..architecture(n, &[6, 4]) };
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut weights: Vec<S> = architecture.initial_weights(Initialization::Default, &mut rng);
    let mut data = random_data::<S>(n, 7, 12);
    if let Some(layout) = Layout::new(&architecture).dissipation {
        // Strong friction that depends on the place, and known forces.
        weights[layout.gamma_range().start..].iter_mut().for_each(|w| *w += S::of_f64(rng.random_range(0.0..2.0)));
        let force = (0..7 * n).map(|_| S::of_f64(rng.random_range(-2.0..2.0))).collect();
        data = data.with_forces(force).unwrap();
    }
    let mut objective = Objective::new(&architecture, penalty, 2).unwrap();
    let mut found = vec![S::nan(); weights.len()];
    let report = objective.step(&weights, &data, &[0, 1, 2, 3, 4, 5, 6], &mut found);
    assert_eq!(report.failure, None);

    // Mass matrices from a separate evaluation.
    let mut chunk = lnn::tape::Evaluation::new(architecture.model().lagrangian().clone());
    chunk.evaluate(&weights, data.q(), data.v(), lnn::tape::Depth::MassMatrix);
    let matrices = || chunk.mass_matrix.chunks_exact(n * n);
    let scale = |i: usize| {
        let mut column: Vec<S> = matrices().map(|m| Real::abs(m[i * n + i])).collect();
        column.sort_by(|a, b| a.partial_cmp(b).unwrap());
        column[(column.len() - 1) / 2]
    };
    let (judge, active) = match penalty {
        Penalty::Sylvester { time, .. } => {
            let judge = Judge::Sylvester((0..n).map(scale).collect(), time);
            let active = (0..data.len()).filter(|&k| judge.penalty(k, n, matrices().nth(k).unwrap()).to_f64() > 0.0);
            let active = active.count();
            (judge, active)
        }
        _ => {
            let one_negative = matches!(penalty, Penalty::Signature { .. });
            let factor = |i: usize| if one_negative { (scale(i).to_f64() + 1e-8).sqrt().recip() } else { 1.0 };
            let factor: Vec<f64> = (0..n).map(factor).collect();
            let active: Vec<Vec<(f64, Vec<f64>)>> = matrices()
                .map(|m| {
                    let element = |i: usize, j: usize| m[i * n + j].to_f64() * factor[i] * factor[j];
                    let eigen = nalgebra::DMatrix::from_fn(n, n, element).symmetric_eigen();
                    let lowest = eigen.eigenvalues.imin();
                    let sign = |k: usize| match eigen.eigenvalues[k] {
                        _ if penalty == Penalty::None => 0.0,
                        w if one_negative && k == lowest => f64::from(u8::from(w > 0.0)),
                        w => -f64::from(u8::from(w < 0.0)),
                    };
                    let along =
                        |k: usize| eigen.eigenvectors.column(k).iter().zip(&factor).map(|(u, d)| u * d).collect();
                    (0..n).filter(|&k| sign(k) != 0.0).map(|k| (sign(k), along(k))).collect()
                })
                .collect();
            let count = active.iter().filter(|u| !u.is_empty()).count();
            (Judge::Eigenvectors(active), count)
        }
    };
    assert_eq!(report.penalised, active);
    assert!(active > 0 || penalty == Penalty::None, "the penalty was not active");
    let loss = MeanLoss { architecture: &architecture, data: &data, judge: &judge, lambda: penalty.lambda() };
    let (value, expected) = gradient(&loss, &weights).unwrap();
    let size = expected.iter().fold(0.0, |m: f64, x| m.max(x.to_f64().abs()));
    for (&found, &expected) in found.iter().zip(&expected) {
        let error = (found - expected).to_f64().abs() / size;
        assert!(error <= tolerance, "gradient {found} for {expected}: {error:.2e}");
    }
    let error = (report.loss + report.penalty - value).to_f64().abs() / value.to_f64().abs();
    assert!(error <= tolerance, "loss {} + {} for {value}", report.loss, report.penalty);
}

#[test]
fn the_gradient_is_that_of_the_whole_loss() {
    for model in MODELS {
        for n in 1..=4 {
            gradient_agrees::<f64>(model, n, 0.6, Penalty::None, 1e-12);
            gradient_agrees::<Dd>(model, n, 0.6, Penalty::None, 1e-26);
        }
    }
}

#[test]
fn the_gradient_of_an_active_penalty_is_right() {
    for model in MODELS {
        for n in 1..=4 {
            // A negative quadratic term makes every mass matrix negative; eigenvectors of the reference are f64.
            gradient_agrees::<f64>(model, n, -0.4, Penalty::Eigenvalue { lambda: 3.0 }, 1e-11);
        }
    }
}

#[test]
fn the_gradient_of_the_penalty_on_the_signature_is_right() {
    for model in MODELS {
        for n in 1..=4 {
            // All eigenvalues positive, then all negative: the first one is wrong, then all others are.
            for alpha in [0.6, -0.4].into_iter().filter(|alpha| n > 1 || *alpha > 0.0) {
                gradient_agrees::<f64>(model, n, alpha, Penalty::Signature { lambda: 3.0 }, 1e-10);
            }
        }
    }
}

#[test]
fn the_gradient_of_sylvesters_penalty_is_right() {
    for n in 1..=3 {
        for time in std::iter::once(None).chain((0..n).map(Some)) {
            let penalty = Penalty::Sylvester { lambda: 3.0, time };
            // Near -alpha of half the scale some signs are right and some are wrong.
            for alpha in [-0.4, 0.02, 0.4] {
                if alpha < 0.0 && time.is_some() && n == 1 || alpha > 0.0 && time.is_none() {
                    continue;
                }
                gradient_agrees::<f64>(MODELS[0], n, alpha, penalty, 1e-11);
                gradient_agrees::<Dd>(MODELS[0], n, alpha, penalty, 1e-26);
            }
        }
    }
}

/// More states than are evaluated together, so that those in doubt are evaluated again.
#[test]
fn sylvesters_penalty_takes_its_scales_from_the_whole_batch() {
    let architecture = Architecture { alpha: -0.1, ..architecture(2, &[6, 5]) };
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(4));
    let data = random_data(2, 700, 5);
    let penalty = Penalty::Sylvester { lambda: 2.0, time: None };
    let rows: Vec<u32> = (0..700).collect();
    let step = |penalty, rows: &[u32], threads| {
        let mut gradient = vec![0.0; weights.len()];
        let report =
            Objective::new(&architecture, penalty, threads).unwrap().step(&weights, &data, rows, &mut gradient);
        (report, gradient)
    };
    let (whole, gradient) = step(penalty, &rows, 1);
    assert_eq!((whole, gradient.clone()), step(penalty, &rows, 3));
    // The same states thrice: the same median, the same mean.
    let thrice: Vec<u32> = (0..2100).map(|k| k % 700).collect();
    let (repeated, again) = step(penalty, &thrice, 2);
    assert!(whole.penalised > 0 && repeated.penalised == 3 * whole.penalised);
    let size = gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    // A sum of 2,100 states against one of 700.
    assert!((repeated.penalty - whole.penalty).abs() <= 1e-14 * whole.penalty);
    assert!(gradient.iter().zip(&again).all(|(a, b)| (a - b).abs() <= 1e-12 * size));
    // Not the mean of the halves' penalties: each half has scales of its own.
    let (first, second) = (step(penalty, &rows[..350], 1).0, step(penalty, &rows[350..], 1).0);
    assert!((0.5 * (first.penalty + second.penalty) - whole.penalty).abs() > 1e-6 * whole.penalty);
}

#[test]
fn an_inactive_penalty_is_exactly_zero() {
    let architecture = Architecture { alpha: 5.0, ..architecture(2, &[6, 6]) };
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(1));
    let data = random_data(2, 40, 2);
    let rows: Vec<u32> = (0..40).collect();
    let run = |penalty| {
        let mut gradient = vec![0.0; weights.len()];
        let report = Objective::new(&architecture, penalty, 1).unwrap().step(&weights, &data, &rows, &mut gradient);
        (report, gradient)
    };
    let (with, gradient) = run(Penalty::Eigenvalue { lambda: 1000.0 });
    assert_eq!((with.penalty, with.penalised), (0.0, 0));
    assert_eq!((with, gradient.clone()), run(Penalty::None));
    assert_eq!((with, gradient), run(Penalty::Sylvester { lambda: 1000.0, time: None }));
}

#[test]
fn a_state_of_weight_three_counts_three_times() {
    let architecture = architecture(2, &[6, 5]);
    let weights = architecture.initial_weights::<f64>(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(11));
    let times = |k: usize| k % 4;
    let data = random_data::<f64>(2, 40, 12);
    let heavy = data.clone().with_weights((0..40).map(|k| times(k) as f64).collect()).unwrap();
    let repeated: Vec<u32> = (0..40).flat_map(|k| vec![k as u32; times(k)]).collect();
    let all: Vec<u32> = (0..40).collect();
    let mut objective = Objective::new(&architecture, Penalty::None, 1).unwrap();
    let (mut one, mut other) = (vec![0.0; weights.len()], vec![0.0; weights.len()]);
    let weighted = objective.step(&weights, &heavy, &all, &mut one).loss;
    let plain = objective.step(&weights, &data, &repeated, &mut other).loss;
    let factor = repeated.len() as f64 / 40.0;
    assert!((weighted - factor * plain).abs() < 1e-12 * weighted && weighted > 0.0);
    let size = one.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    assert!(one.iter().zip(&other).all(|(a, b)| (a - factor * b).abs() < 1e-12 * size));
    assert!((objective.loss(&weights, &heavy).loss - weighted).abs() < 1e-12 * weighted);

    assert!(data.clone().with_weights(vec![1.0; 39]).unwrap_err().to_string().contains("expected 40 numbers"));
    let text = data.clone().with_weights(vec![f64::NAN; 40]).unwrap_err().to_string();
    assert_eq!(text, "weight 0 of state 0 is not finite");
    assert_ne!(heavy.checksum(), data.checksum());
    assert_eq!(heavy.cast::<f32>().weight(3), 3.0);
}

#[test]
fn polishing_lowers_the_loss_and_keeps_the_best() {
    let mut config = config(3);
    config.optimizer.averaging = 0.0;
    let before = run(&config, datasets(), 1, &Hooks::default()).unwrap();
    config.lbfgs = Some(Lbfgs { iterations: 30, memory: 8 });
    let after = run(&config, datasets(), 2, &Hooks::default()).unwrap();
    let rows = before.history.len();
    // The phases are what they were; polishing has rows of its own, without a learning rate.
    for (a, b) in before.history.iter().zip(&after.history) {
        assert_eq!((a.validation_loss, a.training_loss), (b.validation_loss, b.training_loss));
    }
    assert!(after.history.len() > rows);
    assert!(after.history[rows..].iter().all(|e| e.phase == 3 && e.rate == 0.0));
    let lowest = after.history.iter().map(|e| e.validation_loss).fold(f64::INFINITY, f64::min);
    assert_eq!(after.validation_loss, lowest);
    assert!(
        after.validation_loss < 0.8 * before.validation_loss,
        "{} {}",
        after.validation_loss,
        before.validation_loss
    );
    // Any number of threads, the same bytes.
    assert_eq!(after.weights, run(&config, datasets(), 1, &Hooks::default()).unwrap().weights);
    // Interrupted before it began: the phases' model stands.
    let hooks = Hooks { watcher: None, interrupt: Arc::new(AtomicBool::new(true)) };
    assert!(run(&config, datasets(), 1, &hooks).is_err());
}

proptest! {
    #![proptest_config(properties(64))]

    /// `lambda` times the mean of `sum relu(-eigenvalue)`: never negative, zero exactly where no eigenvalue is negative.
    #[test]
    fn the_penalty_counts_negative_eigenvalues_and_nothing_else(
        n in 1_usize..=6,
        alpha in -1.0_f64..1.0,
        seed in any::<u64>(),
    ) {
        let architecture = Architecture { alpha, ..architecture(n, &[7, 6]) };
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let weights: Vec<f64> = architecture.initial_weights(Initialization::VariancePreserving, &mut rng);
        let data = random_data(n, 9, seed ^ 1);
        let penalty = Penalty::Eigenvalue { lambda: 2.5 };
        let mut gradient = vec![0.0; weights.len()];
        let rows: Vec<u32> = (0..9).collect();
        let report = Objective::new(&architecture, penalty, 1).unwrap().step(&weights, &data, &rows, &mut gradient);
        let mut chunk = lnn::tape::Evaluation::new(architecture.model().lagrangian().clone());
        chunk.evaluate(&weights, data.q(), data.v(), lnn::tape::Depth::MassMatrix);
        let sums: Vec<f64> = chunk
            .mass_matrix
            .chunks_exact(n * n)
            .map(|m| nalgebra::DMatrix::from_row_slice(n, n, m).symmetric_eigenvalues())
            .map(|w| w.iter().map(|w| (-w).max(0.0)).sum())
            .collect();
        let expected = 2.5 * sums.iter().sum::<f64>() / 9.0;
        prop_assert!(report.penalty >= 0.0);
        prop_assert!((report.penalty - expected).abs() <= 1e-12 * (1.0 + expected), "{} {expected}", report.penalty);
        prop_assert_eq!(report.penalised == 0, report.penalty == 0.0);
    }
}

fn config(epochs: usize) -> Config {
    Config {
        from: None,
        description: None,
        system: "none".to_string(),
        seed: 3,
        precision: Precision::F32,
        parameters: Default::default(),
        data: Data {
            training: 700,
            validation: 100,
            rescaled_fraction: 0.0,
            trajectory_fraction: 0.0,
            acceleration_weighting: 0.0,
            shell: Vec::new(),
            shell_radius: None,
            rapidity: None,
            test: 100,
            validation_position: vec![[-1.0, 1.0]; 2],
            validation_velocity: vec![[-1.0, 1.0]; 2],
        },
        network: Network {
            hidden: vec![16, 16],
            activation: ActivationChoice::Gelu,
            alpha: 1.0,
            time_like: None,
            scaling: Scaling::Physical,
            embed_periodic: true,
            input_layer: InputLayer::None,
            dissipation: None,
            joint_friction: JointFriction::None,
            structure: Structure::BlackBox,
            factor: Factor::Triangle,
            cyclic: Vec::new(),
            radial: Vec::new(),
            radial_unit: None,
            even_in_v: false,
            learn_alpha: false,
            known: None,
            initialization: Initialization::Default,
        },
        penalty: Regularizer::Eigenvalue { lambda: 10.0 },
        optimizer: Optimizer {
            method: Method::Radam,
            batch: 150,
            weight_decay: 1e-6,
            clip: 1.0,
            averaging: 0.9,
            on_failure: OnFailure::Skip,
        },
        phases: vec![
            Phase {
                epochs,
                rate: 3e-3,
                eta_min: 0.0,
                schedule: Schedule::Cosine,
                t_max: 1.0,
                position: vec![[-1.0, 1.0]; 2],
                velocity: vec![[-1.0, 1.0]; 2],
                log_uniform: vec![],
            };
            2
        ],
        lbfgs: None,
    }
}

/// Two uncoupled oscillators.
fn oscillators(states: usize, seed: u64) -> Dataset<f32> {
    let data = random_data::<f32>(2, states, seed);
    let a = data.q().iter().enumerate().map(|(k, &q)| if k % 2 == 0 { -q } else { -2.0 * q }).collect();
    Dataset::new(2, data.q().to_vec(), data.v().to_vec(), a).unwrap()
}

fn datasets() -> Datasets<f32> {
    Datasets {
        training: vec![oscillators(700, 1), oscillators(700, 2)],
        validation: oscillators(100, 3),
        test: oscillators(100, 4),
    }
}

fn run(config: &Config, data: Datasets<f32>, threads: usize, hooks: &Hooks) -> Result<Trained<f32>, TrainingError> {
    let Network { activation, input_layer, dissipation, ref hidden, .. } = config.network;
    let architecture =
        Architecture { embed_periodic: false, activation, input_layer, dissipation, ..architecture(2, hidden) };
    let penalty = config.penalty().unwrap();
    train(config, &architecture, penalty, data, threads, hooks)
}

#[test]
fn training_learns_and_keeps_the_best_epoch() {
    let mut config = config(12);
    config.optimizer.batch = 20;
    let trained = run(&config, datasets(), 2, &Hooks::default()).unwrap();
    assert_eq!((trained.stop, trained.history.len()), (StopReason::Finished, 24));
    let losses: Vec<f64> = trained.history.iter().map(|e| e.validation_loss).collect();
    let best = losses.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(trained.validation_loss, best);
    assert!(best < 0.25 * losses[0], "{losses:?}");
    assert!(f64::from(trained.test.loss) < 2.0 * best);
    assert_eq!(trained.states, 24 * 700);
}

#[test]
fn every_kind_of_model_learns() {
    for (activation, input_layer, dissipation) in MODELS {
        let mut config = config(12);
        config.network.dissipation = dissipation;
        config.optimizer.batch = 20;
        config.network.activation = activation;
        config.network.input_layer = input_layer;
        let trained = run(&config, datasets(), 2, &Hooks::default()).unwrap();
        let first = trained.history[0].validation_loss;
        let best = trained.validation_loss;
        assert!(best < 0.25 * first, "{activation} {input_layer:?}: {best} after {first}");
    }
}

#[test]
fn a_configuration_needs_no_input_layer_and_even_widths_for_a_hybrid() {
    let mut config = config(1);
    let text = serde_json::to_string(&config).unwrap();
    let field = ",\"input_layer\":\"none\"";
    assert!(text.contains(field));
    assert_eq!(serde_json::from_str::<Config>(&text.replace(field, "")).unwrap(), config);
    config.network.input_layer = InputLayer::Dyt;
    config.network.activation = ActivationChoice::QuadraticSoftplus;
    config.network.initialization = Initialization::NearZero;
    let text = serde_json::to_string(&config).unwrap();
    for name in ["\"dyt\"", "\"quadratic-softplus\"", "\"near-zero\""] {
        assert!(text.contains(name), "{text}");
    }
    assert_eq!(serde_json::from_str::<Config>(&text).unwrap(), config);
    assert_eq!(config.validate(2), Ok(()));
    for width in [1, 17] {
        config.network.hidden = vec![16, width];
        let error = config.validate(2).unwrap_err();
        assert_eq!((error.field.as_str(), error.found), ("network.hidden[1]", width.to_string()));
        assert!(error.expected.contains("even") && error.expected.contains("quadratic-softplus"));
    }
    config.network.activation = ActivationChoice::Softplus;
    assert_eq!(config.validate(2), Ok(()));
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let bits = |threads| {
        let trained = run(&config(3), datasets(), threads, &Hooks::default()).unwrap();
        trained.weights.iter().map(|w| w.to_bits()).collect::<Vec<_>>()
    };
    let one = bits(1);
    assert_eq!(one, bits(2));
    assert_eq!(one, bits(3));
    let mut other = config(3);
    other.seed = 4;
    let trained = run(&other, datasets(), 1, &Hooks::default()).unwrap();
    assert_ne!(one, trained.weights.iter().map(|w| w.to_bits()).collect::<Vec<_>>());
}

#[test]
fn an_interrupt_ends_training_with_the_best_so_far() {
    let interrupt = Arc::new(AtomicBool::new(false));
    let raise = interrupt.clone();
    let watcher: lnn::training::Watcher = Arc::new(move |progress| {
        if let lnn::training::Progress::Epoch(epoch) = progress {
            raise.store(epoch.epoch == 4, Ordering::Relaxed);
        }
    });
    let trained = run(&config(12), datasets(), 2, &Hooks { watcher: Some(watcher), interrupt }).unwrap();
    assert_eq!((trained.stop, trained.history.len()), (StopReason::Interrupted, 4));
    assert!(trained.validation_loss.is_finite());
}

/// What would divide by zero, or leave out phases without a word.
#[test]
fn a_batch_of_nothing_and_missing_training_states_are_named() {
    let refused = |config: &Config, data| run(config, data, 1, &Hooks::default()).unwrap_err().to_string();
    let mut empty = config(2);
    empty.optimizer.batch = 0;
    let expected = "optimizer.batch: expected 1 to 2^30 states, found 0";
    assert_eq!(refused(&empty, datasets()), expected);
    let mut data = datasets();
    data.training.truncate(1);
    let expected = "expected a set of training states for each of 2 phases, found 1";
    assert_eq!(refused(&config(2), data), expected);
}

/// A network whose mass matrix vanishes: no hidden curvature in the velocities, no quadratic term.
#[test]
fn a_singular_mass_matrix_stops_or_is_left_out_by_choice() {
    let architecture = Architecture { alpha: 0.0, ..architecture(2, &[4]) };
    let weights = vec![0.0_f64; lnn::network::Layout::new(&architecture).parameters];
    let data = random_data(2, 5, 1);
    let mut objective = Objective::new(&architecture, Penalty::None, 1).unwrap();
    let mut gradient = vec![f64::NAN; weights.len()];
    let report = objective.step(&weights, &data, &[3, 4], &mut gradient);
    assert_eq!(report.left_out, 2);
    assert!(matches!(report.failure, Some(MechanicsError::Singular { row: 3, .. })), "{:?}", report.failure);
    assert!(gradient.iter().all(|&g| g == 0.0));
    // The mean over no state is no loss, least of all 0.
    assert!(report.loss.is_nan() && objective.loss(&weights, &data).loss.is_nan());
}

/// A model that has no acceleration on the validation states is not a good one.
#[test]
fn validation_states_that_are_left_out_never_make_the_best_epoch() {
    let config = config(2);
    // Far from 0 a softplus is linear to the last bit: M vanishes on states moved there, and on them alone.
    let activation = ActivationChoice::Softplus;
    let shape = architecture(2, &config.network.hidden);
    let architecture = Architecture { activation, alpha: 0.0, embed_periodic: false, ..shape };
    let near = datasets();
    let learn = |data| train(&config, &architecture, config.penalty().unwrap(), data, 1, &Hooks::default());
    assert!(learn(near.clone()).is_ok());
    let q = vec![-1e9; near.validation.q().len()];
    let validation = Dataset::new(2, q, near.validation.v().to_vec(), near.validation.a().to_vec()).unwrap();
    let outcome = learn(Datasets { validation, ..near });
    assert!(matches!(outcome, Err(TrainingError::NothingLearned(_))), "{:?}", outcome.map(|t| t.validation_loss));
}

#[test]
fn one_number_that_is_not_finite_is_named_and_never_reaches_the_weights() {
    let bad = oscillators(700, 1);
    let mut q = bad.q().to_vec();
    q[2 * 50] = 1e30;
    let bad = Dataset::new(2, q, bad.v().to_vec(), bad.a().to_vec()).unwrap();
    let mut data = datasets();
    data.training[0] = bad;
    let mut skipping = config(2);
    skipping.network.activation = ActivationChoice::Quadratic;
    let mut stopping = skipping.clone();
    stopping.optimizer.on_failure = OnFailure::Stop;
    let error = run(&stopping, data.clone(), 2, &Hooks::default()).unwrap_err().to_string();
    assert!(error.contains("step ") && error.contains("state 50"), "{error}");
    let trained = run(&skipping, data, 2, &Hooks::default()).unwrap();
    assert!(trained.weights.iter().all(|w| w.is_finite()));
    assert!(trained.history[0].skipped > 0);
    assert!(trained.validation_loss.is_finite());
}
