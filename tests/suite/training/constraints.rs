//! Learning under constraints: the gradient through the solve with multipliers, and what is learned by it.

use lnn::configuration::Penalty;
use lnn::data::{Dataset, DatasetError};
use lnn::lagrangian::{EulerLagrange, FormulaConstraints, SystemInstance, project};
use lnn::network::ModelFile;
use lnn::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer, NetworkLagrangian, Structure};
use lnn::presets::{Trainer, TrainerError};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::training::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn architecture(n: usize, alpha: f64) -> Architecture {
    Architecture {
        coordinates: n,
        hidden: vec![6],
        activation: ActivationChoice::Gelu,
        alpha,
        time_like: None,
        scale: (0..n).map(|i| 2.0 + i as f64).collect(),
        periodic: vec![false; n],
        embed_periodic: true,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    }
}

/// Random states under `m` random rows each.
fn random_data<S: Scalar>(n: usize, m: usize, states: usize) -> Dataset<S> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut draw = |count: usize| -> Vec<S> { (0..count).map(|_| S::of_f64(rng.random_range(-3.0..3.0))).collect() };
    let [q, v, a] = [0; 3].map(|_| draw(states * n));
    let (rows, drift) = (draw(states * m * n), draw(states * m));
    Dataset::new(n, q, v, a).unwrap().with_constraints(rows, drift).unwrap()
}

/// In double-double against central differences, which have 20 digits there; with a penalty on mass matrices that are not positive
/// within the constraints.
#[test]
fn the_gradient_goes_through_the_multipliers() {
    for (n, m, alpha, penalty, driven) in [
        (3, 1, 0.4, Penalty::None, false),
        (4, 2, 0.4, Penalty::None, false),
        (3, 1, -0.3, Penalty::Eigenvalue { lambda: 0.7 }, false),
        // With friction and known forces.
        (3, 1, 0.4, Penalty::None, true),
    ] {
        let architecture = Architecture { dissipation: driven.then_some(2), ..architecture(n, alpha) };
        let mut data = random_data::<Dd>(n, m, 7);
        if driven {
            data = data.with_forces((0..7 * n).map(|k| Dd::of((k as f64).sin())).collect()).unwrap();
        }
        let rows: Vec<u32> = (0..7).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let weights: Vec<Dd> = architecture.initial_weights(Initialization::Default, &mut rng);
        let mut objective = Objective::<Dd>::new(&architecture, penalty, 1).unwrap();
        let mut gradient = vec![Dd::of(0.0); weights.len()];
        let report = objective.step(&weights, &data, &rows, &mut gradient);
        assert_eq!((report.left_out, report.penalised > 0), (0, penalty != Penalty::None), "{report:?}");
        let mut value = |weights: &[Dd]| {
            let report = objective.step(weights, &data, &rows, &mut vec![Dd::of(0.0); weights.len()]);
            report.loss + report.penalty
        };
        let h = Dd::of(1e-9);
        let largest = gradient.iter().fold(0.0, |most: f64, x| most.max(x.to_f64().abs()));
        for k in (0..weights.len()).step_by(5) {
            let mut at = |x: Dd| {
                let mut moved = weights.clone();
                moved[k] = x;
                value(&moved)
            };
            let slope = (at(weights[k] + h) - at(weights[k] - h)) / (h + h);
            let off = (slope - gradient[k]).to_f64().abs() / largest;
            assert!(off < 1e-13, "{n} {m} {penalty:?}, weight {k}: {off:e}");
        }
    }
}

/// What is learned from accelerations on the constraints alone moves as the system does, in directions where it was told nothing.
#[test]
fn a_particle_on_a_sphere_is_learned_in_cartesian_coordinates() {
    let sphere = SystemInstance::<f64>::named("particle-on-sphere", &[]).unwrap().build().unwrap();
    let manifold = sphere.manifold().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut q, mut v) = (Vec::new(), Vec::new());
    while q.len() < 3 * 1500 {
        let mut draw = || -> Vec<f64> { (0..3).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let (mut place, mut speed) = (draw(), draw());
        if project(manifold, &mut place, &mut speed).is_ok() {
            q.extend(place);
            v.extend(speed);
        }
    }
    let a = sphere.acceleration(&q, &v).unwrap();
    let free = Dataset::new(3, q.clone(), v.clone(), a).unwrap();
    let data = free.clone().on(manifold).unwrap();
    assert_eq!((data.constraints(), free.constraints()), (1, 0));
    assert!(data.checksum() != free.checksum());
    let learn = |data: &Dataset<f64>| {
        let trainer = Trainer::new(data).structure(Structure::Mechanical).hidden(&[16]).batch(32).epochs(30);
        trainer.train().unwrap()
    };
    let learned = learn(&data);
    assert!(learned.test_loss < 0.2, "{}", learned.test_loss);
    // Without the rows the same budget learns less.
    assert!(learned.test_loss < 0.2 * learn(&free).test_loss);
}

#[test]
fn rows_of_another_shape_are_refused() {
    let data = || Dataset::new(2, vec![0.0; 4], vec![0.0; 4], vec![0.0; 4]).unwrap();
    let refused = data().with_constraints(vec![1.0; 3], vec![0.0; 2]);
    assert_eq!(refused, Err(DatasetError::Shape { what: "constraint row", expected: 4, found: 3 }));
    let refused = data().with_constraints(vec![1.0, 0.0, f64::NAN, 1.0], vec![0.0; 2]);
    assert_eq!(refused, Err(DatasetError::NotFinite { what: "constraint row", row: 1, column: 0 }));
    assert!(data().with_constraints(vec![1.0; 4], vec![0.0; 3]).is_err());
    // A row that vanishes leaves its state out.
    let architecture = architecture(2, 1.0);
    let data = data().with_constraints(vec![0.0, 0.0, 1.0, 2.0], vec![0.0; 2]).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
    let mut gradient = vec![0.0; weights.len()];
    let mut objective = Objective::<f64>::new(&architecture, Penalty::None, 1).unwrap();
    let report = objective.step(&weights, &data, &[0, 1], &mut gradient);
    assert!(report.left_out == 1 && report.loss.is_finite() && gradient.iter().all(|x| x.is_finite()));
    let _ = NetworkLagrangian::new(architecture, weights).unwrap().coordinates();
}

/// States, velocities and accelerations that noise took off their constraints come back to them.
#[test]
fn recorded_states_are_brought_to_their_constraints() {
    let formulas = [("rod".to_string(), "x^2 + y^2 - 1".to_string())].into();
    let rod = FormulaConstraints::new(&["x", "y"], formulas).unwrap();
    let data = Dataset::new(2, vec![1.1, 0.0, 0.0, -0.9], vec![0.1, 2.0, 1.0, 0.0], vec![-3.0, 1.0, 0.0, 0.5]).unwrap();
    let (data, distance) = data.brought_to(&rod.manifold::<f64>().unwrap()).unwrap();
    assert!((distance - 0.1).abs() < 1e-12 && data.constraints() == 1);
    for (k, exact) in [[1.0, 0.0, 0.0, 2.0, -4.0, 1.0], [0.0, -1.0, 1.0, 0.0, 0.0, 1.0]].into_iter().enumerate() {
        let at = 2 * k..2 * k + 2;
        let found = [&data.q()[at.clone()], &data.v()[at.clone()], &data.a()[at]].concat();
        assert!(found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }
    let nowhere = [("rod".to_string(), "x^2 + y^2 + 1".to_string())].into();
    let nowhere = FormulaConstraints::new(&["x", "y"], nowhere).unwrap();
    let refused = data.brought_to(&nowhere.manifold::<f64>().unwrap());
    assert!(matches!(refused, Err(DatasetError::Unreachable { row: 0, constraint }) if constraint == "rod"));
}

#[test]
fn a_trainer_keeps_the_constraints_with_its_model() {
    let chain = SystemInstance::<f64>::named("cartesian-chain-1", &[]).unwrap().build().unwrap();
    let (mut q, mut v) = (Vec::new(), Vec::new());
    for k in 0..200 {
        let (sin, cos) = (0.37 * f64::from(k)).sin_cos();
        let rate = 4.0 * (0.61 * f64::from(k)).sin();
        q.extend([sin, -cos]);
        v.extend([rate * cos, rate * sin]);
    }
    let a = chain.acceleration(&q, &v).unwrap();
    let data = Dataset::new(2, q, v, a).unwrap();
    let trainer =
        || Trainer::new(&data).coordinates(&["x", "y"]).structure(Structure::Mechanical).hidden(&[6]).epochs(2);
    let learned = trainer().constraints(&[("rod", "x^2 + y^2 - 1"), ("same", "2*x^2 + 2*y^2 - 2")]).train().unwrap();
    let motion = learned.motion().unwrap();
    assert_eq!(motion.manifold().unwrap().names(), ["rod"]);
    let a = motion.acceleration(&[0.6, -0.8], &[0.8, 0.6]).unwrap();
    // On a circle of radius 1 at speed 1.
    assert!((0.6 * a[0] - 0.8 * a[1] + 1.0).abs() < 1e-12, "{a:?}");
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.safetensors");
    learned.save(&path).unwrap();
    let header = ModelFile::<f64>::load(&path).unwrap().header;
    assert_eq!(header.constraints["rod"], "x^2 + y^2 - 1");
    assert!(matches!(trainer().constraints(&[("rod", "x^2 + z")]).train(), Err(TrainerError::Constraints(_))));
}
