use super::{Chain, Passes};
use crate::lagrangian::{
    Accelerations, Description, EulerLagrange, InverseDynamics, Linearization, Linearizer, Request, SystemInstance,
    Terms, Torques, inertia_symbols, loss_symbols,
};
use crate::random::RngStream;
use crate::scalar::Scalar;
use rand::Rng;
use std::borrow::Cow;

/// Largest number of links.
const MOST: usize = 8;

/// A system file with links, and values of its constants.
struct Arm {
    text: String,
    coordinates: usize,
    constants: Vec<(String, String)>,
}

/// Generates links that could be built, with joints of both kinds, quarter turns and other twists: a chain, or a tree in which some joints
/// follow others.
fn arm(links: usize, rng: &mut impl Rng, (friction, armature, tree): (bool, bool, bool)) -> Arm {
    let (mut rows, mut constants, mut coordinates) = (Vec::new(), Vec::new(), 0);
    for k in 1..=links {
        let carried = rng.random_range(0..k);
        let mut draw = |size: f64| rng.random_range(-size..size);
        let (a, d, theta) = (draw(0.5), draw(0.5), draw(3.0));
        let alpha = if draw(1.0) > 0.0 { "\"pi/2\"".to_string() } else { draw(3.0).to_string() };
        let mut keys = match tree && draw(1.0) > 0.0 {
            true => {
                format!(r#""xyz": [{a}, {d}, 0.1], "rpy": [{theta}, {alpha}, {}], "axis": [{a}, 0, {d}]"#, draw(3.0))
            }
            false => format!(r#""a": {a}, "alpha": {alpha}, "d": {d}, "theta": {theta}"#),
        };
        keys += &format!(r#", "prismatic": {}"#, draw(1.0) > 0.3);
        if tree {
            keys += &format!(r#", "parent": {carried}"#);
        }
        match tree && k > 2 && draw(1.0) > 0.5 {
            true => keys += &format!(r#", "mimic": "1", "ratio": {}, "offset": {}"#, draw(2.0), draw(1.0)),
            false => coordinates += 1,
        }
        rows.push(format!("{{{keys}}}"));
        let (m, c, own) =
            (1.0 + draw(0.5), [draw(0.3), draw(0.3), draw(0.3)], [0.2 + draw(0.1), 0.2, 0.25 + draw(0.1)]);
        let square: f64 = c.iter().map(|c| c * c).sum();
        let inertia = |i: usize, j: usize| if i == j { own[i] + m * (square - c[i] * c[i]) } else { -m * c[i] * c[j] };
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        let values = [m].into_iter().chain(c.map(|c| m * c)).chain(pairs.map(|(i, j)| inertia(i, j)));
        constants.extend(inertia_symbols(k).into_iter().zip(values));
        let losses = [(armature, 0.1), (friction, 0.4), (friction, 0.3)];
        let given = loss_symbols(k).into_iter().zip(losses);
        constants.extend(given.filter(|(_, (has, _))| *has).map(|(name, (_, value))| (name, value)));
    }
    let convention = if rng.random_range(0..2) == 0 && !tree { "standard" } else { "modified" };
    let chain = format!(
        r#"{{"convention": "{convention}", "gravity": [1.5, -2, -9], "friction": {friction}, "armature": {armature}, "coulomb_speed": 0.5}}"#
    );
    Arm {
        text: format!(r#"{{"name": "arm", "chain": {chain}, "links": [{}]}}"#, rows.join(", ")),
        coordinates,
        constants: constants.into_iter().map(|(name, value)| (name, value.to_string())).collect(),
    }
}

impl Arm {
    fn configured<S: Scalar>(&self) -> SystemInstance<S> {
        let description: Description = serde_json::from_str(&self.text).unwrap();
        SystemInstance::new(Cow::Owned(description.system().unwrap()), &self.constants).unwrap()
    }
}

fn chain(arm: &SystemInstance<f64>) -> Chain<f64> {
    Chain::new(arm.system.described.as_ref().unwrap().chain.as_ref().unwrap(), &arm.parameters)
}

fn torques(chain: &Chain<f64>, state: [&[f64]; 3]) -> Vec<f64> {
    let mut torques = vec![0.0; state[0].len()];
    chain.inverse_dynamics(state, &mut Passes::default(), &mut torques);
    torques
}

/// Largest difference, relative to the largest number.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = |x: &mut dyn Iterator<Item = f64>| x.fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
    largest(&mut a.iter().zip(b).map(|(a, b)| a - b)) / largest(&mut b.iter().copied())
}

/// Calls `show` with arms of one to eight links, a state and accelerations.
fn with_arms(mut show: impl FnMut(&Arm, [&[f64]; 3], &str)) {
    let mut rng = RngStream::Region.generator(17);
    for links in 1..=MOST {
        for case in 0..9 {
            let arm = arm(links, &mut rng, (case % 2 == 0, case % 3 == 0, case > 5));
            let mut draw =
                |size: f64| -> Vec<f64> { (0..arm.coordinates).map(|_| rng.random_range(-size..size)).collect() };
            let (q, v, a) = (draw(3.0), draw(2.0), draw(5.0));
            show(&arm, [&q, &v, &a], &format!("{links} links, case {case}: {}", arm.text));
        }
    }
}

#[test]
fn recursions_are_the_terms_of_the_lagrangian() {
    with_arms(|arm, [q, v, a], what| {
        let configured = arm.configured::<f64>();
        let (chain, model, n) = (chain(&configured), configured.build().unwrap(), q.len());
        let mut terms = Terms::default();
        model.terms(q, v, Request::ACCELERATION, &mut terms).unwrap();
        let rows = chain.mass_matrix(q);
        let mass: Vec<f64> = (0..n * n).map(|at| rows[(at / n).max(at % n)][(at / n).min(at % n)]).collect();
        assert!(distance(&mass, &terms.mass_matrix) < 1e-11, "M: {what}");
        let forces = |a: &[f64]| -> Vec<f64> {
            let row = |i: usize| (0..n).map(|j| terms.mass_matrix[i * n + j] * a[j]).sum::<f64>();
            (0..n).map(|i| row(i) + terms.coriolis[i] - terms.dl_dq[i]).collect()
        };
        let torques = torques(&chain, [q, v, a]);
        assert!(distance(&torques, &forces(a)) < 1e-11, "torques: {what}");
        if !terms.force.is_empty() {
            assert!(
                distance(&(0..n).map(|k| chain.friction(k, v[k])).collect::<Vec<_>>(), &terms.force) < 1e-11,
                "friction: {what}"
            );
        }
    });
}

#[test]
fn torques_are_the_power_that_changes_the_energy() {
    with_arms(|arm, [q, v, a], what| {
        let configured = arm.configured::<f64>();
        let (chain, model) = (chain(&configured), configured.build().unwrap());
        let mut terms = Terms::default();
        let mut energy = |time: f64| {
            let at = |k: usize| q[k] + v[k] * time + a[k] * time * time / 2.0;
            let q: Vec<f64> = (0..q.len()).map(at).collect();
            let v: Vec<f64> = v.iter().zip(a).map(|(v, a)| v + a * time).collect();
            model.terms(&q, &v, Request::ACCELERATION | Request::LAGRANGIAN, &mut terms).unwrap();
            let n = q.len();
            // Twice the kinetic energy minus L.
            (0..n * n).map(|at| v[at / n] * terms.mass_matrix[at] * v[at % n]).sum::<f64>() - terms.lagrangian[0]
        };
        let step = 1e-4;
        let change = (8.0 * (energy(step) - energy(-step)) - energy(2.0 * step) + energy(-2.0 * step)) / (12.0 * step);
        let power: Vec<f64> = torques(&chain, [q, v, a]).iter().zip(v).map(|(torque, v)| torque * v).collect();
        let size = power.iter().fold(1.0f64, |most, x| most.max(x.abs()));
        assert!((power.iter().sum::<f64>() - change).abs() < 1e-7 * size, "{power:?} {change}: {what}");
    });
}

#[test]
fn single_states_are_those_of_the_terms_with_friction() {
    with_arms(|arm, [q, v, a], what| {
        let model = arm.configured::<f64>().build().unwrap();
        let (mut found, mut torques) = (vec![0.0; q.len()], vec![0.0; q.len()]);
        Accelerations::new(model.as_ref()).at(q, v, &mut found).unwrap();
        assert!(distance(&found, &model.acceleration(q, v).unwrap()) < 1e-10, "{what}");
        Torques::new(model.as_ref()).at(q, v, &found, &mut torques).unwrap();
        let forces = InverseDynamics::of(model.as_ref(), q, v, a).unwrap();
        let size = forces.generalized.iter().fold(0f64, |most, x| most.max(x.abs()));
        assert!(torques.iter().all(|torque| torque.abs() < 1e-10 * size), "{what}: {torques:?}");
        Torques::new(model.as_ref()).at(q, v, a, &mut torques).unwrap();
        assert_eq!(torques, forces.external);
        assert_eq!(forces.friction.is_empty(), model.conserves_energy());
        let several = |x: &[f64]| [x, x, x].concat();
        let (q, v, a) = (several(q), several(v), several(a));
        let mut all = several(&torques);
        Torques::new(model.as_ref()).at(&q, &v, &a, &mut all).unwrap();
        assert!(distance(&all, &several(&torques)) < 1e-14, "{what}");
    });
}

#[test]
fn linearizations_by_recursion_are_those_of_the_lagrangian() {
    with_arms(|arm, [q, v, _], what| {
        let model = arm.configured::<f64>().build().unwrap();
        assert!(model.solved().unwrap().linearized().is_some());
        let lagrangian = model.inner().unwrap();
        let (mut ours, mut theirs) = (Linearizer::new(&*model), Linearizer::new(lagrangian));
        let (found, expected) = (ours.at(q, v).unwrap(), theirs.at(q, v).unwrap());
        let all = |of: &Linearization<f64>| [&of.acceleration[..], &of.by_q, &of.by_v, &of.by_force].concat();
        assert!(distance(&all(found), &all(expected)) < 1e-10, "{what}: {found:?} {expected:?}");
    });
}

#[test]
fn single_precision_and_wide_numbers_have_their_own_digits() {
    let arm = arm(5, &mut RngStream::Region.generator(3), (true, false, false));
    let (q, v) = ([0.3, -1.0, 0.7, 2.0, -0.4], [1.0, 0.5, -0.8, 0.2, 1.4]);
    let exact = arm.configured::<f64>().build().unwrap().acceleration(&q, &v).unwrap();
    let (model, mut a) = (arm.configured::<f32>().build().unwrap(), [0f32; 5]);
    Accelerations::new(model.as_ref()).at(&q.map(|x| x as f32), &v.map(|x| x as f32), &mut a).unwrap();
    assert!(distance(&a.map(f64::from), &exact) < 1e-4);
    // The geometry of the links is stored in double precision.
    let wide = arm.configured::<crate::scalar::Dd>().build().unwrap();
    assert!(wide.links().is_none());
}

#[test]
fn what_stands_beside_the_links_and_singular_masses_are_left_to_the_lagrangian() {
    let arm = arm(3, &mut RngStream::Region.generator(5), (false, false, false));
    let with = |more: &str| {
        let text = arm.text.replacen('{', &format!("{{{more}, "), 1);
        let description: Description = serde_json::from_str(&text).unwrap();
        SystemInstance::<f64>::new(Cow::Owned(description.system().unwrap()), &arm.constants).unwrap()
    };
    let described = |arm: &SystemInstance<f64>| arm.system.described.as_ref().unwrap().chain.is_some();
    assert!(described(&arm.configured()) && described(&with(r#""title": "An arm""#)));
    assert!(!described(&with(r#""lagrangian": "-q1^2/2""#)) && !described(&with(r#""dissipation": "q1_dot^2""#)));
    let massless: Vec<(String, String)> =
        arm.constants.iter().map(|(name, _)| (name.clone(), "0".to_string())).collect();
    let model =
        Arm { text: arm.text.clone(), constants: massless, coordinates: 3 }.configured::<f64>().build().unwrap();
    let mut a = [0.0; 3];
    assert!(Accelerations::new(model.as_ref()).at(&[0.1; 3], &[0.2; 3], &mut a).is_err());
    let model = arm.configured::<f64>().build().unwrap();
    assert!(Torques::new(model.as_ref()).at(&[0.1; 3], &[0.2; 3], &[f64::NAN; 3], &mut a).is_err());
    assert!(Torques::new(model.as_ref()).at(&[0.1; 3], &[0.2; 3], &[0.0; 2], &mut a).is_err());
    assert!(Torques::new(model.as_ref()).at(&[0.1; 3], &[0.2; 3], &[0.0; 3], &mut a[1..]).is_err());
}
