//! Learned friction: closed forms against nested forward numbers, passivity, motion that loses energy, what training tells
//! apart.

use crate::common::accuracy::{cast, largest};
use crate::common::damped;
use crate::common::{of_scalar, properties};
use lnn::configuration::{Config, Data, Network, OnFailure, Optimizer, Phase, Precision, Regularizer, Scaling};
use lnn::data::{Dataset, Datasets};
use lnn::forward::HyperDual;
use lnn::lagrangian::{Description, EulerLagrange, Request, Terms};
use lnn::linalg::Workspace;
use lnn::network::{
    ActivationChoice, Architecture, Factor, Form, Initialization, InputLayer, JointFriction, Layout, NetworkLagrangian,
    Structure,
};
use lnn::optimizers::{Method, Schedule};
use lnn::rollout::{Integrator, RolloutError, RolloutOptions, rollout, rollout_fixed, rollout_together};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Depth, Evaluation, MixedDirections, ScalarFunction, gradient};
use lnn::training::{Hooks, train};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

#[derive(Clone, Debug)]
struct Case {
    architecture: Architecture,
    seed: u64,
}

fn architecture(n: usize, units: usize) -> Architecture {
    Architecture {
        coordinates: n,
        hidden: vec![6, 4],
        activation: ActivationChoice::Gelu,
        alpha: 1.0,
        time_like: None,
        scale: (0..n).map(|i| 1.5 + i as f64 / 2.0).collect(),
        periodic: (0..n).map(|i| i % 2 == 0).collect(),
        embed_periodic: true,
        input_layer: InputLayer::None,
        dissipation: Some(units),
        form: Form::default(),
    }
}

#[test]
fn the_friction_of_a_known_part_acts_and_its_constants_are_learned() {
    let text = r#"{"name": "axle", "lagrangian": "a_dot^2", "dissipation": "c*a_dot^2/2", "parameters": {"c": {"default": 0.3, "learn": true}},
        "coordinates": [{"name": "a", "periodic": true, "velocity_bounds": [-1, 1]}]}"#;
    let description: Description = serde_json::from_str(text).unwrap();
    let form = Form { known: Some(Box::new(description)), ..Form::default() };
    let architecture = Architecture { dissipation: None, alpha: 0.0, form, ..architecture(1, 1) };
    let mut weights = vec![0.0; Layout::new(&architecture).parameters];
    let mut force = |learned: f64| {
        *weights.last_mut().unwrap() = learned;
        let network = NetworkLagrangian::new(architecture.clone(), weights.clone()).unwrap();
        assert!(!network.conserves_energy());
        let mut terms = Terms::default();
        network.terms(&[0.4], &[1.5], Request::FORCE, &mut terms).unwrap();
        terms.force[0]
    };
    let found = [force(0.0), force(0.1)];
    assert!((found[0] + 0.45).abs() < 1e-12 && (found[1] + 0.6).abs() < 1e-12, "{found:?}");
}

fn cases() -> impl Strategy<Value = Case> {
    let kind = (prop::sample::select(&ActivationChoice::ALL[..]), any::<bool>(), any::<bool>());
    (1_usize..=4, 1_usize..40, kind, any::<u64>()).prop_map(|(n, units, (activation, embed_periodic, dyt), seed)| {
        let input_layer = if dyt { InputLayer::Dyt } else { InputLayer::None };
        Case { architecture: Architecture { activation, embed_periodic, input_layer, ..architecture(n, units) }, seed }
    })
}

impl Case {
    /// Weights with friction of any strength, directions of length `10^-2` to `10^driest`: from viscous to dry; and `batch`
    /// states, angles in `[0, 2 pi)`.
    fn draw<S: Scalar>(&self, batch: usize, driest: f64) -> (Vec<S>, Vec<S>, Vec<S>) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut weights: Vec<S> = self.architecture.initial_weights(Initialization::Default, &mut rng);
        let layout = Layout::new(&self.architecture).dissipation.unwrap();
        let length = 10f64.powf(rng.random_range(-2.0..driest));
        for k in layout.gamma_range().chain(layout.weight_range()) {
            weights[k] = S::of_f64(rng.random_range(-4.0..2.0));
        }
        weights[layout.direction_range()].iter_mut().for_each(|b| *b *= S::of_f64(length));
        let n = self.architecture.coordinates;
        let mut states = |low: f64, high: f64| (0..batch * n).map(|_| S::of_f64(rng.random_range(low..high))).collect();
        (weights, states(0.0, 6.0), states(-3.0, 3.0))
    }
}

/// `dD/dv` and `v.dD/dv` of one state in physical units, by nested forward numbers.
fn friction<T: Real>(architecture: &Architecture, weights: &[T], q: &[T], v: &[T]) -> [Vec<T>; 2] {
    let lift = |x: &[T]| -> Vec<HyperDual<T>> { x.iter().map(|&x| HyperDual::lift(x)).collect() };
    let (weights, q) = (lift(weights), lift(q));
    let along = |direction: &dyn Fn(usize) -> T| {
        let v: Vec<_> = (0..v.len()).map(|k| HyperDual::new(v[k], direction(k), T::zero(), T::zero())).collect();
        architecture.rayleigh_dissipation(&weights, &q, &v).s
    };
    let gradient = (0..v.len()).map(|i| along(&|k| if k == i { T::one() } else { T::zero() })).collect();
    [gradient, vec![along(&|k| v[k])]]
}

/// Relative perturbation of everything that goes in.
const STEP: f64 = 1.0 / (1_u64 << 40) as f64;

/// Every number moved by the step up or down.
fn perturb(x: &[Dd], rng: &mut impl Rng) -> Vec<Dd> {
    x.iter().map(|&x| x + x * Dd::of_f64(if rng.random() { STEP } else { -STEP })).collect()
}

/// Largest error over `eps` times what the perturbations do; 30 is the limit of the LAPACK tests.
fn roundings<'a, S: Scalar>(found: &[Dd], expected: &[Dd], perturbed: impl Iterator<Item = &'a [Dd]>) -> f64 {
    let apart = |a: &[Dd]| largest(&a.iter().zip(expected).map(|(&a, &b)| a - b).collect::<Vec<_>>());
    let condition = perturbed.fold(largest(expected), |most, p| most.max(apart(p) / STEP));
    if condition == 0.0 { apart(found) } else { apart(found) / (S::epsilon().to_f64() * condition) }
}

/// Force and power of three states against nested forward numbers.
fn forces_are_accurate<S: Scalar>(case: &Case) {
    let n = case.architecture.coordinates;
    let (weights, q, v) = case.draw::<S>(3, 2.0);
    let network = NetworkLagrangian::new(case.architecture.clone(), weights.clone()).unwrap();
    let mut terms = Terms::default();
    network.terms(&q, &v, Request::FORCE, &mut terms).unwrap();
    assert!(terms.acceleration.is_empty() && terms.force.len() == 3 * n && terms.dissipation.len() == 3);
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 2);
    for state in 0..3 {
        let row = state * n..(state + 1) * n;
        let inputs: [Vec<Dd>; 3] = [cast(&weights), cast(&q[row.clone()]), cast(&v[row.clone()])];
        let evaluate = |[w, q, v]: &[Vec<Dd>; 3]| friction(&case.architecture, w, q, v);
        let expected = evaluate(&inputs);
        let perturbed: Vec<_> = (0..6).map(|_| evaluate(&inputs.each_ref().map(|x| perturb(x, &mut rng)))).collect();
        let force: Vec<Dd> = cast(&terms.force[row]);
        let found = [force.iter().map(|&f| -f).collect(), cast(&terms.dissipation[state..=state])];
        for (k, found) in found.iter().enumerate() {
            let r = roundings::<S>(found, &expected[k], perturbed.iter().map(|p| p[k].as_slice()));
            assert!(r <= 30.0, "{} of state {state}: R = {r:.3}", ["dD/dv", "power"][k]);
        }
    }
}

/// `sum_j u_j.dD/d(v/s)` as a function of the weights and of the scaled states it belongs to.
struct Along<'a, S> {
    architecture: &'a Architecture,
    weights: usize,
    u: &'a [S],
}

impl<S: Scalar> ScalarFunction for Along<'_, S> {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let n = self.architecture.coordinates;
        let scale = |k: usize| R::of(self.architecture.scale[k % n]);
        let (weights, states) = x.split_at(self.weights);
        let (q, v) = states.split_at(self.u.len());
        let weights: Vec<HyperDual<R>> = weights.iter().map(|&w| HyperDual::lift(w)).collect();
        (0..self.u.len() / n).fold(R::zero(), |sum, j| {
            let q: Vec<_> = (j * n..(j + 1) * n).map(|k| HyperDual::lift(q[k] * scale(k))).collect();
            let moving =
                |k: usize| HyperDual::new(v[k] * scale(k), of_scalar::<R>(self.u[k]) * scale(k), R::zero(), R::zero());
            let v: Vec<_> = (j * n..(j + 1) * n).map(moving).collect();
            sum + self.architecture.rayleigh_dissipation(&weights, &q, &v).s
        })
    }
}

/// Gradients by parameters, coordinates and velocities against reverse mode over nested forward numbers in double-double:
/// largest error over `eps` times what relative perturbations of all numbers that go in do.
fn gradients_are_accurate<S: Scalar>(case: &Case) {
    let architecture = &case.architecture;
    let n = architecture.coordinates;
    // Where tanh saturates its slope cancels in the nested numbers.
    let (weights, q, v) = case.draw::<S>(3, 0.5);
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 1);
    let states = [2, 0, 2];
    let u: Vec<S> = (0..3 * n).map(|_| S::of_f64(rng.random_range(-1.0..1.0))).collect();
    let rows = |x: &[S]| -> Vec<S> { states.iter().flat_map(|&k| x[k * n..(k + 1) * n].to_vec()).collect() };
    let mut dissipation = Evaluation::new(architecture.model().dissipation().unwrap().clone());
    dissipation.evaluate(&weights, &rows(&q), &rows(&v), Depth::Training);
    let zeros = |length: usize| vec![<S as Real>::zero(); length];
    let (mut found, mut dq, mut dv) = (zeros(weights.len()), zeros(3 * n), zeros(3 * n));
    let directions = MixedDirections { s: u.clone(), t: u.clone(), moving: true };
    dissipation.add_momentum_gradient(&weights, &directions, &mut found, Some((&mut dq, &mut dv)));

    let scaled = |x: &[S]| -> Vec<Dd> {
        let rows = states.iter().flat_map(|&state| x[state * n..(state + 1) * n].iter().enumerate());
        rows.map(|(i, &x)| x.cast::<Dd>() / Dd::of_f64(architecture.scale[i])).collect()
    };
    let (count, wide) = (weights.len(), cast::<S, Dd>(&u));
    let point = [cast(&weights), scaled(&q), scaled(&v)].concat();
    let by_part = |point: &[Dd]| -> [Vec<Dd>; 3] {
        let (_, all) = gradient(&Along { architecture, weights: count, u: &wide }, point).unwrap();
        [all[..count].to_vec(), all[count..count + 3 * n].to_vec(), all[count + 3 * n..].to_vec()]
    };
    let expected = by_part(&point);
    let perturbed: Vec<_> = (0..6).map(|_| by_part(&perturb(&point, &mut rng))).collect();
    for (k, found) in [found, dq, dv].iter().enumerate() {
        let r = roundings::<S>(&cast(found), &expected[k], perturbed.iter().map(|p| p[k].as_slice()));
        assert!(r <= 30.0, "by {}: R = {r:.3}", ["weights", "q", "v"][k]);
    }
}

proptest! {
    #![proptest_config(properties(48))]

    #[test]
    fn forces_agree_with_nested_forward_numbers(case in cases()) {
        forces_are_accurate::<f32>(&case);
        forces_are_accurate::<f64>(&case);
        forces_are_accurate::<Dd>(&case);
    }

    /// `v.dD/dv >= 0` to the last bit, whatever the parameters, and nothing at rest.
    #[test]
    fn friction_only_takes_energy_away(case in cases(), size in -6_i32..6) {
        let (weights, q, v) = case.draw::<f32>(16, 2.0);
        let factor = 10f32.powi(size);
        let v: Vec<f32> = v.iter().map(|v| v * factor).collect();
        let network = NetworkLagrangian::new(case.architecture.clone(), weights).unwrap();
        prop_assert!(!network.conserves_energy());
        let mut terms = Terms::default();
        network.terms(&q, &v, Request::FORCE, &mut terms).unwrap();
        prop_assert!(terms.dissipation.iter().all(|&power| power >= 0.0), "{:?}", terms.dissipation);
        network.terms(&q, &vec![0.0; v.len()], Request::FORCE, &mut terms).unwrap();
        prop_assert!(terms.dissipation.iter().chain(&terms.force).all(|&x| x == 0.0));
    }
}

proptest! {
    #![proptest_config(properties(24))]

    #[test]
    fn gradients_agree_with_reverse_mode(case in cases()) {
        let mut case = case;
        case.architecture.dissipation = case.architecture.dissipation.map(|units| 1 + units % 8);
        gradients_are_accurate::<f32>(&case);
        gradients_are_accurate::<f64>(&case);
    }
}

/// The mass matrix and the forces of `L` are those of the same network without friction; the acceleration has it.
#[test]
fn friction_adds_to_the_forces_of_the_same_lagrangian() {
    for n in 1..=4 {
        let case = Case { architecture: architecture(n, 5), seed: n as u64 };
        let (weights, q, v) = case.draw::<f64>(70, 2.0);
        let plain = Architecture { dissipation: None, ..case.architecture.clone() };
        let own = weights[..Layout::new(&plain).parameters].to_vec();
        let (mut with, mut without) = (Terms::default(), Terms::default());
        let plain = NetworkLagrangian::new(plain, own).unwrap();
        plain.terms(&q, &v, Request::ALL, &mut without).unwrap();
        NetworkLagrangian::new(case.architecture, weights).unwrap().terms(&q, &v, Request::ALL, &mut with).unwrap();
        assert!(plain.conserves_energy() && without.force.is_empty() && without.dissipation.is_empty());
        let same = |t: &Terms<f64>| {
            [&t.lagrangian, &t.momentum, &t.dl_dq, &t.coriolis, &t.mass_matrix, &t.energy].map(Vec::clone)
        };
        assert_eq!(same(&with), same(&without));
        for state in 0..70 {
            let mass = &with.mass_matrix[state * n * n..][..n * n];
            for i in 0..n {
                let k = state * n + i;
                let terms = (0..n).map(|j| mass[i * n + j] * with.acceleration[state * n + j]);
                let right = with.dl_dq[k] - with.coriolis[k] + with.force[k];
                let size: f64 = terms.clone().map(f64::abs).sum::<f64>() + right.abs();
                // Residual of a backward stable solve.
                assert!((terms.sum::<f64>() - right).abs() <= 64.0 * f64::EPSILON * size);
            }
        }
    }
}

#[test]
fn the_energy_of_a_motion_goes_where_friction_takes_it() {
    let model = damped::chain(2);
    let (q, v) = ([2.0, 2.5], [0.5, -1.0]);
    let at = |dt: f64| {
        let options = RolloutOptions::new(3.0, dt).tolerances(1e-12, 1e-12).method(Integrator::Dop853);
        let rolled = rollout(&model, &q, &v, &options);
        assert_eq!(rolled.stop, None);
        rolled.trajectory.energy_balance(&model).unwrap()
    };
    let [coarse, fine] = [0.01, 0.0025].map(at);
    assert!(fine.change < -1.0 && fine.dissipated > 1.0, "{fine:?}");
    // 1e-12 per component and step over some hundred steps, velocities of some rad/s against momenta of some N m s.
    assert!(fine.defect().abs() < 1e-8 * fine.size, "{fine:?}");
    assert!(coarse.defect().abs() < 1e-4 * coarse.size, "{coarse:?}");
    // Backwards the motion takes its energy back.
    let rolled = rollout(&model, &q, &v, &RolloutOptions::new(-0.3, 0.0025).tolerances(1e-12, 1e-12));
    let back = rolled.complete().unwrap().energy_balance(&model).unwrap();
    assert!(back.change > 0.1 && back.dissipated < -0.1 && back.defect().abs() < 1e-8 * back.size, "{back:?}");
}

/// Orders 2, 4 and 6 on a motion with friction, the same motion for all.
#[test]
fn gauss_methods_integrate_friction_and_the_variational_one_refuses() {
    let model = damped::chain(2);
    let (q, v) = ([2.0, 2.5], [0.5, -1.0]);
    let reference = RolloutOptions::reference(0.5, 0.5).tolerances(1e-13, 1e-13);
    let exact = rollout(&model, &q, &v, &reference).complete().unwrap();
    let error = |method, step: f64| {
        let rolled = rollout_fixed(&model, &q, &v, &RolloutOptions::new(0.5, 0.5).method(method).step(step));
        let motion = rolled.complete().unwrap();
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        apart(&motion.q, &exact.q).max(apart(&motion.v, &exact.v))
    };
    for (method, order) in [(Integrator::Midpoint, 2.0), (Integrator::Gauss4, 4.0), (Integrator::Gauss6, 6.0)] {
        let (coarse, fine) = (error(method, 0.02), error(method, 0.01));
        let slope = (coarse / fine).log2();
        assert!((slope - order).abs() < 0.7, "{method:?}: {coarse:.1e}, {fine:.1e}, order {slope:.2}");
    }
    let options = RolloutOptions::new(1.0, 0.1).method(Integrator::Variational);
    let starts = vec![(q.to_vec(), v.to_vec()); 2];
    let refused = rollout_together(&model, &starts, &options, 1).into_iter().chain([rollout(&model, &q, &v, &options)]);
    for rolled in refused {
        assert!(rolled.trajectory.is_empty());
        let Some(RolloutError::Invalid { what, problem }) = rolled.stop else { panic!("{:?}", rolled.stop) };
        assert!(what == "method" && problem.contains("friction") && problem.contains("dop853"), "{problem}");
    }
}

fn sample(model: &dyn EulerLagrange<f64>, states: usize, seed: u64, forced: bool) -> Dataset<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n = model.coordinates();
    let mut draw = |low: f64, high: f64| -> Vec<f64> { (0..states * n).map(|_| rng.random_range(low..high)).collect() };
    let (q, v) = (draw(0.0, TAU), draw(-4.0, 4.0));
    let mut terms = Terms::default();
    model.terms(&q, &v, Request::ACCELERATION, &mut terms).unwrap();
    if !forced {
        return Dataset::new(n, q, v, terms.acceleration).unwrap();
    }
    // Known torques that push the same states.
    let force = draw(-10.0, 10.0);
    for (total, push) in terms.force.iter_mut().zip(&force) {
        *total += push;
    }
    terms.complete(n, &v, Request::ACCELERATION, &mut Workspace::new()).unwrap();
    Dataset::new(n, q, v, terms.acceleration).unwrap().with_forces(force).unwrap()
}

fn config(units: Option<usize>, epochs: usize) -> Config {
    // States are given, not sampled.
    let bounds = || vec![[-1.0, 1.0]; 2];
    Config {
        from: None,
        description: None,
        system: "recorded".to_string(),
        seed: 1,
        precision: Precision::F32,
        parameters: Default::default(),
        data: Data {
            training: 1,
            validation: 1,
            rescaled_fraction: 0.0,
            trajectory_fraction: 0.0,
            acceleration_weighting: 0.0,
            shell: Vec::new(),
            shell_radius: None,
            rapidity: None,
            test: 1,
            validation_position: bounds(),
            validation_velocity: bounds(),
        },
        network: Network {
            hidden: vec![48; 2],
            activation: ActivationChoice::Gelu,
            alpha: 1.0,
            time_like: None,
            scaling: Scaling::Physical,
            embed_periodic: true,
            input_layer: InputLayer::None,
            dissipation: units,
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
        penalty: Regularizer::Sylvester { lambda: 100.0 },
        optimizer: Optimizer {
            method: Method::Radam,
            batch: 64,
            weight_decay: 1e-6,
            clip: 1.0,
            averaging: 0.99,
            on_failure: OnFailure::Skip,
        },
        phases: vec![Phase {
            epochs,
            rate: 5e-3,
            eta_min: 0.0,
            schedule: Schedule::Cosine,
            t_max: epochs as f64,
            position: bounds(),
            velocity: bounds(),
            log_uniform: vec![],
        }],
        lbfgs: None,
    }
}

/// What was learned of a system, on states that were not learned from.
#[derive(Debug)]
struct Judged {
    /// Mean `|a - exact| / |exact|`, sums over states and coordinates.
    acceleration: f64,
    /// Factor of the learned `M` to the exact one, and what remains of `M` beside it, relative.
    factor: f64,
    mass: f64,
    /// Dissipated power over the factor against the exact one, mean of `|error|` over mean.
    power: f64,
    /// Mean learned power over the factor, relative to the exact mean.
    mean_power: f64,
}

fn relative(found: &[f64], exact: &[f64]) -> f64 {
    let sum = |x: &mut dyn Iterator<Item = f64>| x.map(f64::abs).sum::<f64>();
    sum(&mut found.iter().zip(exact).map(|(a, b)| a - b)) / sum(&mut exact.iter().copied())
}

fn learn(model: &dyn EulerLagrange<f64>, units: Option<usize>, epochs: usize, forced: bool) -> Judged {
    let (training, validation) = (sample(model, 6000, 1, forced), sample(model, 1000, 2, forced));
    let config = config(units, epochs);
    let n = model.coordinates();
    let architecture = Architecture {
        hidden: config.network.hidden.clone(),
        scale: training.physical_scale(),
        periodic: vec![true; n],
        dissipation: units,
        form: Form::default(),
        ..architecture(n, 1)
    };
    let data =
        Datasets { training: vec![training.cast::<f32>()], validation: validation.cast(), test: validation.cast() };
    let penalty = config.penalty().unwrap();
    let trained = train(&config, &architecture, penalty, data, 1, &Hooks::default()).unwrap();
    let network = NetworkLagrangian::new(architecture, trained.weights).unwrap().cast::<f64>();

    let fresh = sample(model, 2000, 3, false);
    let (mut exact, mut found) = (Terms::default(), Terms::default());
    let request = Request::ACCELERATION;
    model.terms(fresh.q(), fresh.v(), request, &mut exact).unwrap();
    network.terms(fresh.q(), fresh.v(), request, &mut found).unwrap();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let factor = dot(&found.mass_matrix, &exact.mass_matrix) / dot(&exact.mass_matrix, &exact.mass_matrix);
    let in_joule = |x: &[f64]| -> Vec<f64> { x.iter().map(|x| x / factor).collect() };
    let power = in_joule(&found.dissipation);
    Judged {
        acceleration: relative(&found.acceleration, &exact.acceleration),
        factor,
        mass: relative(&in_joule(&found.mass_matrix), &exact.mass_matrix),
        power: if power.is_empty() { 1.0 } else { relative(&power, &exact.dissipation) },
        mean_power: power.iter().sum::<f64>() / exact.dissipation.iter().sum::<f64>(),
    }
}

/// Two coordinates tell friction from the forces of a Lagrangian: `D` explains what `L` alone cannot, and what it takes
/// is what the joints take, in units of the factor by which `M` was found. Known torques leave no factor.
#[test]
fn friction_is_learned_beside_the_lagrangian() {
    let model = damped::chain(2);
    let (without, with) = (learn(&model, None, 60, false), learn(&model, Some(16), 60, false));
    // Measured: 0.159 without, 0.037 with.
    assert!(without.acceleration > 0.1, "{without:?}");
    assert!(with.acceleration < 0.06 && with.acceleration < 0.4 * without.acceleration, "{with:?}");
    // Measured: 4 % of M and 10 % of the power of single states, 0.2 % of the mean power.
    assert!(with.mass < 0.08 && with.power < 0.2 && (with.mean_power - 1.0).abs() < 0.05, "{with:?}");
    assert!(with.factor > 0.0 && with.factor < 0.5, "{with:?}");
    // Measured: 0.90.
    let forced = learn(&model, Some(16), 60, true);
    assert!((forced.factor - 1.0).abs() < 0.2 && forced.mass < 0.15, "{forced:?}");
}
