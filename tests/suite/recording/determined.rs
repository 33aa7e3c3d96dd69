//! What is said to be determined: it does not depend on the start, and it is true. Inertias of links are those of bodies.

use crate::common::forms::{KINDS, Trial, stated, values};
use lnn::identification::{Identified, IdentifyOptions, identify};
use lnn::lagrangian::{Description, EulerLagrange, InverseDynamics, SystemInstance};
use lnn::linalg::is_positive_definite;
use lnn::random::RngStream;
use lnn::recording::{RecordedTrajectory, Recording};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::borrow::Cow;

/// Standard errors within which a stated value lies: of some fifty normal numbers all, but for one in a thousand runs.
const WITHIN: f64 = 4.0;

#[test]
fn what_is_stated_is_true_and_is_the_same_from_every_start() {
    // Constants and combinations that are stated of each kind.
    let expected = [1, 2, 2, 1, 2, 3, 3, 2, 2, 2];
    for kind in 0..KINDS {
        let trial = Trial::new(kind, 3, 5.0).unwrap();
        let found = [0, 1].map(|start| trial.identified(start).unwrap());
        for (own, elsewhere) in [(&found[0], &found[1]), (&found[1], &found[0])] {
            let all = stated(own);
            assert_eq!(all.len(), expected[kind], "kind {kind}: {:?} {:?}", own.constants, own.undetermined);
            for value in all {
                let off = (value.value - value.by(&trial.truth)).abs();
                let moved = (value.value - value.by(&values(elsewhere))).abs();
                assert!(off <= WITHIN * value.error, "kind {kind}: {} {} {}", value.name, value.value, value.error);
                assert!(moved <= value.error, "kind {kind}: {} {} {moved}", value.name, value.value);
            }
        }
        let all_advice =
            |found: &Identified| found.undetermined.iter().map(|open| open.advice.clone()).collect::<Vec<_>>();
        assert_eq!(all_advice(&found[0]), all_advice(&found[1]), "kind {kind}");
    }
}

const ARM: &str = r#"{"name": "arm", "chain": {"convention": "standard", "friction": true},
    "links": [{"d": 0.2, "alpha": "pi/2"}, {"a": -0.6}, {"a": -0.5}]}"#;
const TRUTH: [(&str, f64); 18] = [
    ("m1", 3.0),
    ("Izz1", 0.06),
    ("m2", 2.5),
    ("mx2", 0.7),
    ("Ixx2", 0.02),
    ("Iyy2", 0.3),
    ("Izz2", 0.31),
    ("m3", 1.5),
    ("mx3", 0.35),
    ("Ixx3", 0.01),
    ("Iyy3", 0.12),
    ("Izz3", 0.12),
    ("Fv1", 0.4),
    ("Fv2", 0.3),
    ("Fv3", 0.2),
    ("Fc1", 0.3),
    ("Fc2", 0.2),
    ("Fc3", 0.1),
];

fn arm(given: &[(String, String)]) -> SystemInstance<f64> {
    let description: Description = serde_json::from_str(ARM).unwrap();
    SystemInstance::new(Cow::Owned(description.system().unwrap()), given).unwrap()
}

fn true_arm() -> SystemInstance<f64> {
    arm(&TRUTH.map(|(name, x)| (name.to_string(), x.to_string())))
}

/// A log of the arm whose joints swing by some sizes.
fn log(sizes: [f64; 3]) -> Recording {
    let model = true_arm().build().unwrap();
    let mut rng = RngStream::Trajectories.generator(5);
    let mut draw = move |size: f64| {
        let draw: f64 = StandardNormal.sample(&mut rng);
        size * draw
    };
    let times: Vec<f64> = (0..500).map(|k| 0.02 * f64::from(k)).collect();
    let (mut q, mut force) = (Vec::new(), Vec::new());
    for t in &times {
        let swing = |i: usize| {
            let (slow, fast) = (1.3 + 0.4 * i as f64, 3.1 - 0.5 * i as f64);
            let size = sizes[i];
            [
                size * ((slow * t).sin() + 0.4 * (fast * t).cos()),
                size * (slow * (slow * t).cos() - 0.4 * fast * (fast * t).sin()),
                -size * (slow * slow * (slow * t).sin() + 0.4 * fast * fast * (fast * t).cos()),
            ]
        };
        let state = [0, 1, 2].map(swing);
        let [own_q, v, a] = [0, 1, 2].map(|order| state.map(|joint| joint[order]));
        let torque = InverseDynamics::of(&model, &own_q, &v, &a).unwrap().external;
        q.extend(own_q.iter().zip(sizes).map(|(q, size)| q + draw(if size > 0.0 { 1e-4 } else { 0.0 })));
        force.extend(torque.iter().map(|torque| torque + draw(0.05)));
    }
    let track = RecordedTrajectory { name: "run".into(), times, q, v: vec![], a: vec![], force };
    let coordinates = ["q1", "q2", "q3"].map(String::from).to_vec();
    Recording { coordinates, periodic: vec![true; 3], tracks: vec![track] }
}

/// The mass matrix at random poses.
fn is_positive_everywhere(found: &Identified) -> bool {
    let given: Vec<(String, String)> =
        found.constants.iter().map(|constant| (constant.symbol.clone(), constant.value.to_string())).collect();
    let model = arm(&given).build().unwrap();
    let mut rng = RngStream::Trajectories.generator(6);
    (0..1000).all(|_| {
        let q: Vec<f64> = (0..3).map(|_| rng.random_range(-3.2..3.2)).collect();
        is_positive_definite(3, &model.mass_matrix(&q, &[0.0; 3]).unwrap(), &mut [0.0; 9])
    })
}

#[test]
fn inertias_of_an_arm_are_those_of_bodies_and_a_joint_that_stands_still_is_named() {
    let truth = true_arm();
    for sizes in [[0.8, 0.7, 0.9], [0.8, 0.0, 0.9]] {
        let found = identify(&arm(&[]), &log(sizes), &IdentifyOptions::default()).unwrap();
        let bodies = found.bodies.as_ref().unwrap();
        assert!(bodies.exist && is_positive_everywhere(&found), "{bodies:?} {:?}", found.constants);
        let still = found.undetermined.iter().any(|open| open.advice.contains("q2, which stands still"));
        assert_eq!(still, sizes[1] == 0.0, "{:?}", found.undetermined);
        // Friction is no part of what the equations hold together.
        let held = found.undetermined.iter().filter(|open| open.text.contains("equations"));
        assert!(held.flat_map(|open| &open.constants).all(|name| !name.starts_with('F')), "{:?}", found.undetermined);
        let exact = truth.system.parameters.iter().zip(&truth.parameters);
        let exact = exact.map(|(known, x)| (known.symbol.to_string(), *x)).collect();
        for known in stated(&found) {
            assert!(
                (known.value - known.by(&exact)).abs() < 6.0 * known.error,
                "{sizes:?} {} {}",
                known.name,
                known.value
            );
        }
        let friction = found.constants.iter().find(|constant| constant.symbol == "Fv3").unwrap();
        assert!((friction.value - 0.2).abs() < 5.0 * friction.standard_error.unwrap(), "{friction:?}");
    }
}
