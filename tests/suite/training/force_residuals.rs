//! Losses of residuals of force: against the terms of the model, their gradient against differences, and what they need not.

use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::lagrangian::InverseDynamics;
use lnn::network::{
    ActivationChoice, Architecture, Factor, Form, Initialization, InputLayer, JointFriction, Layout, NetworkLagrangian,
    Sizes, Structure,
};
use lnn::training::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const N: usize = 3;
const STATES: usize = 9;
const SCALE: [f64; N] = [0.5, 30.0, 4.0];

fn architecture(structure: Structure, joint_friction: JointFriction, dissipation: Option<usize>) -> Architecture {
    let sizes = Sizes { velocity: vec![3.0, 0.5, 1.0], potential: 20.0, friction: vec![2.0, 0.3, 1.0] };
    let form = Form { structure, factor: Factor::Triangle, joint_friction, sizes: Some(sizes), ..Form::default() };
    Architecture {
        coordinates: N,
        hidden: vec![6, 5],
        activation: ActivationChoice::Gelu,
        alpha: 0.4,
        time_like: None,
        scale: vec![2.0, 1.0, 3.0],
        periodic: vec![false, true, false],
        embed_periodic: true,
        input_layer: InputLayer::None,
        dissipation,
        form,
    }
}

fn data(seed: u64) -> Dataset<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |size: f64| (0..STATES * N).map(|_| rng.random_range(-size..size)).collect::<Vec<f64>>();
    let data = Dataset::new(N, draw(2.0), draw(3.0), draw(5.0)).unwrap().with_forces(draw(9.0)).unwrap();
    let weights = (0..STATES).map(|k| 1.0 + 0.1 * k as f64).collect();
    data.with_weights(weights).unwrap().with_force_residuals(SCALE.to_vec()).unwrap()
}

/// The same states, each with a constraint of its own.
fn held(seed: u64) -> Dataset<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 100);
    let mut draw = |count: usize| (0..count).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f64>>();
    data(seed).with_constraints(draw(STATES * N), draw(STATES)).unwrap()
}

/// Half the mean of the weighted residuals over their scales, without what a force along the constraint of the state makes of them.
fn expected(architecture: &Architecture, weights: &[f64], data: &Dataset<f64>) -> f64 {
    let network = NetworkLagrangian::new(architecture.clone(), weights.to_vec()).unwrap();
    let found = InverseDynamics::of(&network, data.q(), data.v(), data.a()).unwrap().external;
    let pairs = found.iter().zip(data.force()).enumerate();
    let mut residuals: Vec<f64> = pairs.map(|(k, (f, q))| (f - q) / SCALE[k % N]).collect();
    for (state, r) in residuals.chunks_exact_mut(N).enumerate() {
        let (row, _) = data.constraint(state);
        let row: Vec<f64> = row.iter().zip(SCALE).map(|(a, size)| a / size).collect();
        let square: f64 = row.iter().map(|a| a * a).sum();
        let along = row.iter().zip(&*r).map(|(a, r)| a * r).sum::<f64>() / square;
        r.iter_mut().zip(&row).for_each(|(r, a)| *r -= along * a);
    }
    let sum: f64 = residuals.iter().enumerate().map(|(k, r)| data.weight(k / N) * r.abs()).sum();
    sum / (2 * N * STATES) as f64
}

#[test]
fn the_loss_is_that_of_the_forces_and_has_its_gradient() {
    for (structure, joints, dissipation, data) in [
        (Structure::BlackBox, JointFriction::None, None, data(4)),
        (Structure::BlackBox, JointFriction::Stribeck, Some(3), data(4)),
        (Structure::Mechanical, JointFriction::Dry, None, held(4)),
        (Structure::Mechanical, JointFriction::Stribeck, Some(2), data(4)),
    ] {
        let architecture = architecture(structure, joints, dissipation);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
        // Friction that is felt.
        let layout = Layout::new(&architecture);
        weights[layout.joint_friction].iter_mut().for_each(|w| *w += rng.random_range(1.0..2.0));
        let rows: Vec<u32> = (0..STATES as u32).collect();
        let mut objective = Objective::new(&architecture, Penalty::None, 2).unwrap();
        let mut gradient = vec![f64::NAN; weights.len()];
        let report = objective.step(&weights, &data, &rows, &mut gradient);
        let loss = expected(&architecture, &weights, &data);
        assert!((report.loss / loss - 1.0).abs() < 1e-12 && report.left_out == 0, "{structure:?} {joints:?}");
        assert!((objective.loss(&weights, &data).loss / loss - 1.0).abs() < 1e-12);
        let size = gradient.iter().map(|g| g.abs()).fold(0.0, f64::max);
        for k in 0..weights.len() {
            let at = |h: f64| {
                let mut moved = weights.clone();
                moved[k] += h;
                expected(&architecture, &moved, &data)
            };
            let h = 1e-6;
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!(
                (gradient[k] - difference).abs() < 1e-7 * size,
                "{structure:?} {joints:?} {k}: {} {difference}",
                gradient[k]
            );
        }
    }
}

#[test]
fn a_singular_mass_matrix_leaves_no_state_out() {
    let architecture = Architecture { alpha: 0.0, ..architecture(Structure::BlackBox, JointFriction::None, None) };
    let weights = vec![0.0; Layout::new(&architecture).parameters];
    let (by_forces, mut gradient) = (data(5), vec![f64::NAN; weights.len()]);
    let rows: Vec<u32> = (0..STATES as u32).collect();
    let mut objective = Objective::new(&architecture, Penalty::None, 1).unwrap();
    let report = objective.step(&weights, &by_forces, &rows, &mut gradient);
    assert_eq!((report.left_out, report.failure), (0, None));
    assert!(report.loss.is_finite() && gradient.iter().all(|g| g.is_finite()));
    let force = by_forces.force().to_vec();
    let [q, v, a] = [by_forces.q(), by_forces.v(), by_forces.a()].map(<[f64]>::to_vec);
    let by_accelerations = Dataset::new(N, q, v, a).unwrap().with_forces(force).unwrap();
    assert_eq!(objective.step(&weights, &by_accelerations, &rows, &mut gradient).left_out, STATES);
}

#[test]
fn a_state_whose_force_is_not_finite_is_left_out() {
    let architecture = architecture(Structure::Mechanical, JointFriction::Dry, None);
    let mut weights: Vec<f32> =
        architecture.initial_weights(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(6));
    let whole = data(7);
    let mut a = whole.a().to_vec();
    a[3 * N] = 1e38;
    let data = Dataset::new(N, whole.q().to_vec(), whole.v().to_vec(), a).unwrap();
    let data = data.with_forces(whole.force().to_vec()).unwrap().with_force_residuals(SCALE.to_vec()).unwrap();
    // The diagonal of the factor: a mass that makes the force of the third state overflow.
    let bias = Layout::new(&architecture).branches[0].layers.last().unwrap().bias_range();
    weights[bias.start] = 30.0;
    let (rows, mut gradient): (Vec<u32>, _) = ((0..STATES as u32).collect(), vec![f32::NAN; weights.len()]);
    let mut objective = Objective::new(&architecture, Penalty::None, 1).unwrap();
    let report = objective.step(&weights, &data.cast(), &rows, &mut gradient);
    assert_eq!((report.left_out, report.failure.and_then(|failure| failure.row())), (1, Some(3)));
    assert!(report.loss.is_finite() && gradient.iter().all(|g| g.is_finite()));
}

#[test]
fn joint_friction_is_the_stated_force_and_takes_energy() {
    for joints in [JointFriction::Dry, JointFriction::Stribeck] {
        let architecture = architecture(Structure::Mechanical, joints, None);
        let mut weights: Vec<f64> =
            architecture.initial_weights(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(8));
        let layout = Layout::new(&architecture);
        let parameters: Vec<f64> = (0..layout.joint_friction.len()).map(|k| (1.7 * k as f64).sin()).collect();
        weights[layout.joint_friction].copy_from_slice(&parameters);
        let network = NetworkLagrangian::new(architecture.clone(), weights).unwrap();
        let (q, v) = ([0.3, -0.2, 1.0], [0.7, -1.5, 0.05]);
        let found = InverseDynamics::of(&network, &q, &v, &[0.0; N]).unwrap().friction;
        let softplus = |x: f64| x.exp().ln_1p();
        for i in 0..N {
            let row = |row: usize| parameters[row * N + i];
            let w = v[i] / architecture.scale[i];
            let mut force = softplus(row(0)) * w + softplus(row(1)) * (w / row(2).exp()).tanh();
            if joints == JointFriction::Stribeck {
                let x = w / row(4).exp();
                force += softplus(row(3)) * 2.0 * x * (-x * x).exp();
            }
            let size = architecture.form.sizes.as_ref().unwrap().friction[i];
            let expected = -size * force / architecture.scale[i];
            assert!(
                (found[i] - expected).abs() < 1e-12 && found[i] * v[i] < 0.0,
                "{joints:?} {i}: {} {expected}",
                found[i]
            );
        }
    }
}
