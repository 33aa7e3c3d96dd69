use super::*;
use crate::lagrangian::description::quantity::Decimal;
use crate::lagrangian::{InverseDynamics, SystemInstance};
use rand::Rng;
use std::borrow::Cow;

fn instance(chain: &str, links: &str, pairs: &[(&str, f64)]) -> SystemInstance<f64> {
    let text = format!(r#"{{"name": "arm", "chain": {chain}, "links": {links}}}"#);
    let description: Description = serde_json::from_str(&text).unwrap();
    let given: Vec<(String, String)> = pairs.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
    SystemInstance::new(Cow::Owned(description.system().unwrap()), &given).unwrap()
}

fn forces(instance: &SystemInstance<f64>, [q, v, a]: [&[f64]; 3]) -> Vec<f64> {
    InverseDynamics::of(&instance.build().unwrap(), q, v, a).unwrap().external
}

fn close(found: &[f64], expected: &[f64]) {
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
    assert_eq!(found.len(), expected.len());
}

/// A double pendulum with horizontal axes: rods of lengths `l` with masses `m` at their ends.
const RODS: [(&str, f64); 8] =
    [("m1", 2.0), ("mx1", 1.4), ("Izz1", 0.98), ("m2", 0.5), ("mx2", 0.2), ("Izz2", 0.08), ("Fv2", 0.3), ("Fc2", 0.1)];
const STATE: [&[f64]; 3] = [&[0.4, -1.1], &[0.8, 1.7], &[-0.6, 2.3]];

/// Torques of these rods by the textbook equations, with angles from the direction of gravity.
fn textbook() -> Vec<f64> {
    let ([q, v, a], g) = (STATE, 9.81);
    let (l, [m1, c1], [m2, c2]) = (0.7, [2.0, 0.7], [0.5, 0.4]);
    let (cosine, sine) = (q[1].cos(), q[1].sin());
    let (far, mixed) = (m2 * c2 * c2, m2 * l * c2);
    let hanging = m2 * g * c2 * (q[0] + q[1]).sin();
    let first = (m1 * c1 * c1 + m2 * l * l + far + 2.0 * mixed * cosine) * a[0] + (far + mixed * cosine) * a[1]
        - mixed * sine * v[1] * (2.0 * v[0] + v[1])
        + (m1 * c1 + m2 * l) * g * q[0].sin()
        + hanging;
    let second = (far + mixed * cosine) * a[0] + far * a[1] + mixed * sine * v[0] * v[0] + hanging;
    vec![first, second + 0.3 * v[1] + 0.1 * (v[1] / 0.01).tanh()]
}

#[test]
fn rods_by_rows_of_either_convention_move_as_the_textbook_says() {
    // Gravity points along x of the base.
    let chain =
        |convention: &str| format!(r#"{{"convention": "{convention}", "gravity": [9.81, 0, 0], "friction": true}}"#);
    let modified = instance(&chain("modified"), r#"[{}, {"a": 0.7}]"#, &RODS);
    close(&forces(&modified, STATE), &textbook());
    let standard = instance(&chain("standard"), r#"[{"a": 0.7}, {"a": 3, "alpha": 1}]"#, &RODS);
    close(&forces(&standard, STATE), &textbook());
}

#[test]
fn a_pole_on_a_cart_moves_as_the_textbook_says() {
    // Gravity points against the x axis of the base and of the cart, which slides along its own z axis. At q2 = 0 the pole points upwards,
    // and it rotates towards z.
    let links = r#"[{"prismatic": true, "d": 0.3, "alpha": "pi/2"}, {"alpha": "pi/2"}]"#;
    let masses = [("m1", 2.0), ("m2", 0.5), ("mx2", 0.2), ("Izz2", 0.08), ("Ia1", 0.25)];
    let cart = instance(r#"{"armature": true, "gravity": [-9.81, 0, 0]}"#, links, &masses);
    let [q, v, a] = STATE;
    let (cosine, sine) = (q[1].cos(), q[1].sin());
    let push = 2.75 * a[0] + 0.2 * (cosine * a[1] - sine * v[1] * v[1]);
    let swing = 0.08 * a[1] + 0.2 * cosine * a[0] - 0.2 * 9.81 * sine;
    close(&forces(&cart, STATE), &[push, swing]);
}

#[test]
fn constants_of_links_have_their_symbols() {
    let arm = instance(r#"{"friction": true, "armature": true}"#, r#"[{}, {"prismatic": true}]"#, &[]);
    let mut own: Vec<String> = arm.system.parameters.iter().map(|known| known.symbol.to_string()).collect();
    let mut symbols: Vec<String> =
        (1..=2).flat_map(|link| [&inertia_symbols(link)[..], &loss_symbols(link)].concat()).collect();
    own.sort();
    symbols.sort();
    assert_eq!(own, symbols);
}

#[test]
fn a_mistake_in_links_names_its_key() {
    let key = |text: &str| {
        let description: Description = serde_json::from_str(text).unwrap();
        description.system().unwrap_err().key
    };
    let of = |more: &str| key(&format!(r#"{{"name": "arm", {more}}}"#));
    assert_eq!(of(r#""chain": {}"#), "chain");
    assert_eq!(of(r#""chain": {"gravity": [0, 1]}, "links": [{}]"#), "chain.gravity");
    assert_eq!(of(r#""chain": {"coulomb_speed": 0}, "links": [{}]"#), "chain.coulomb_speed");
    assert_eq!(of(r#""links": [{}, {"alpha": "1/0"}]"#), "links[1].alpha");
    assert_eq!(of(r#""links": [{}], "metric": {}"#), "metric");
    assert_eq!(of(r#""links": [{}], "definitions": {"link1_s": "1"}"#), "definitions.link1_s");
    assert_eq!(of(r#""links": [{}], "parameters": {"lzz1": 1}"#), "parameters.lzz1");
    assert_eq!(of(r#""links": [{}], "parameters": {"k": 1}, "lagrangian": "-kk*q1^2""#), "parameters.k");
    let coordinates = r#""coordinates": [{"name": "a", "velocity_bounds": [-1, 1], "periodic": true}]"#;
    assert_eq!(of(&format!(r#""links": [{{}}, {{}}], {coordinates}"#)), "coordinates");
    assert_eq!(of(&format!(r#""links": [{}]"#, vec!["{}"; Description::MOST_LINKS + 1].join(","))), "links");
    for (second, at) in [
        (r#""parent": 2"#, ".parent"),
        (r#""parent": "c""#, ".parent"),
        (r#""name": "a""#, ".name"),
        (r#""name": "7""#, ".name"),
        (r#""a": 1, "xyz": [0, 0, 1]"#, ".a"),
        (r#""rpy": [0, 0]"#, ".rpy"),
        (r#""axis": [0, 0, 0]"#, ".axis"),
        (r#""mimic": "0""#, ".mimic"),
        (r#""mimic": 2"#, ".mimic"),
        (r#""mimic": "a", "ratio": 0"#, ".ratio"),
        (r#""offset": 1"#, ".offset"),
    ] {
        assert_eq!(of(&format!(r#""links": [{{"name": "a"}}, {{{second}}}]"#)), format!("links[1]{at}"));
    }
    let standard = r#""chain": {"convention": "standard"}, "links": [{"xyz": [0, 0, 1]}]"#;
    assert_eq!(of(standard), "links[0]");
}

#[test]
fn what_the_file_says_is_added_and_kept() {
    let text = r#"{"name": "arm", "links": [{}], "chain": {"friction": true}, "lagrangian": "-k*q1^2/2", "dissipation": "c*q1_dot^4",
        "parameters": {"k": 3, "c": 0.5, "m1": {"default": 4, "unit": "kg"}}}"#;
    let description: Description = serde_json::from_str(text).unwrap();
    let system = description.system().unwrap();
    let symbols: Vec<&str> = system.parameters.iter().filter(|p| p.learn).map(|p| p.symbol.as_ref()).collect();
    assert!(symbols.contains(&"Izz1") && !symbols.contains(&"m1") && !symbols.contains(&"k"), "{symbols:?}");
    let given = [("Izz1", 0.5), ("Fv1", 0.2)].map(|(name, x)| (name.to_string(), x.to_string()));
    let instance = SystemInstance::<f64>::new(Cow::Owned(system), &given).unwrap();
    close(&forces(&instance, [&[0.2], &[1.5], &[3.0]]), &[1.5 + 0.6 + 0.3 + 2.0 * 1.5_f64.powi(3)]);
    let described = instance.system.described.as_ref().unwrap();
    let again = described.with_defaults(&[("Izz1", 0.25)]);
    assert!(again.definitions.is_empty() && again.links == description.links);
    assert_eq!(again.parameters["Izz1"].default, Decimal("0.25".to_string()));
    assert_eq!(again.system().unwrap().parameters.len(), instance.parameters.len());
}

/// Rotates about an axis of length 1, by Rodrigues' formula.
fn turn(axis: [f64; 3], angle: f64, x: [f64; 3]) -> [f64; 3] {
    let (sine, cosine) = angle.sin_cos();
    let along: f64 = axis.iter().zip(x).map(|(a, x)| a * x).sum();
    let swung = crate::lagrangian::recursion::cross(axis, x);
    std::array::from_fn(|i| cosine * x[i] + sine * swung[i] + (1.0 - cosine) * along * axis[i])
}

/// A link of a tree, independent of the rest of the crate: the values of its keys, and its mass as points.
struct Limb {
    parent: usize,
    xyz: [f64; 3],
    rpy: [f64; 3],
    axis: [f64; 3],
    slides: bool,
    /// Coordinate, ratio and offset.
    drive: (usize, f64, f64),
    points: Vec<(f64, [f64; 3])>,
}

impl Limb {
    fn drawn(k: usize, rng: &mut impl Rng) -> Self {
        let parent = rng.random_range(0..=k);
        let aligned = rng.random_range(0..2) == 0;
        let mut draw = |size: f64| rng.random_range(-size..size);
        let [xyz, rpy, axis] = [0.4, 3.0, 1.0].map(|size| [draw(size), draw(size), draw(size)]);
        let axis = if aligned { [0.0, -1.0, 0.0] } else { axis };
        let rpy = if aligned { [PI / 2.0, 0.0, -PI / 2.0] } else { rpy };
        let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let points = (0..5).map(|_| (1.0 + draw(0.9), [draw(0.3), draw(0.3), draw(0.3)])).collect();
        let drive = if k == 3 { (0, draw(2.0), draw(1.0)) } else { (k - usize::from(k > 3), 1.0, 0.0) };
        Self { parent, xyz, rpy, axis: axis.map(|x| x / length), slides: draw(1.0) > 0.3, drive, points }
    }

    fn keys(&self) -> String {
        let Self { parent, xyz, rpy, axis, slides, drive, .. } = self;
        let mimic = match drive {
            (_, 1.0, 0.0) => String::new(),
            (leader, ratio, offset) => {
                format!(r#", "mimic": "limb{leader}", "ratio": {ratio}, "offset": {offset}"#)
            }
        };
        let keys =
            format!(r#""xyz": {xyz:?}, "rpy": {rpy:?}, "axis": {axis:?}, "prismatic": {slides}, "parent": {parent}"#);
        format!("{{{keys}{mimic}}}")
    }

    /// Values of the ten constants.
    fn constants(&self) -> [f64; 10] {
        let sum = |of: &dyn Fn([f64; 3]) -> f64| self.points.iter().map(|(m, x)| m * of(*x)).sum::<f64>();
        [
            sum(&|_| 1.0),
            sum(&|x| x[0]),
            sum(&|x| x[1]),
            sum(&|x| x[2]),
            sum(&|x| x[1] * x[1] + x[2] * x[2]),
            sum(&|x| -x[0] * x[1]),
            sum(&|x| -x[0] * x[2]),
            sum(&|x| x[0] * x[0] + x[2] * x[2]),
            sum(&|x| -x[1] * x[2]),
            sum(&|x| x[0] * x[0] + x[1] * x[1]),
        ]
    }
}

/// Positions of all points of a tree.
fn points(limbs: &[Limb], q: &[f64]) -> Vec<(f64, [f64; 3])> {
    let place = |mut k: usize, mut x: [f64; 3]| {
        loop {
            let Limb { parent, xyz, rpy, axis, slides, drive: (at, ratio, offset), .. } = &limbs[k];
            let moved = ratio * q[*at] + offset;
            x = match slides {
                true => std::array::from_fn(|i| x[i] + moved * axis[i]),
                false => turn(*axis, moved, x),
            };
            let base = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let turned = (0..3).fold(x, |x, i| turn(base[i], rpy[i], x));
            x = std::array::from_fn(|i| turned[i] + xyz[i]);
            match parent.checked_sub(1) {
                Some(before) => k = before,
                None => return x,
            }
        }
    };
    limbs.iter().enumerate().flat_map(|(k, limb)| limb.points.iter().map(move |(m, x)| (*m, place(k, *x)))).collect()
}

#[test]
fn a_tree_has_the_energy_of_its_points() {
    let mut rng = crate::random::RngStream::Region.generator(23);
    let n = 5;
    for _ in 0..20 {
        let limbs: Vec<Limb> = (0..=n).map(|k| Limb::drawn(k, &mut rng)).collect();
        let rows: Vec<String> = limbs
            .iter()
            .enumerate()
            .map(|(k, limb)| limb.keys().replacen('{', &format!(r#"{{"name": "limb{k}", "#), 1))
            .collect();
        let constants =
            limbs.iter().enumerate().flat_map(|(k, limb)| inertia_symbols(k + 1).into_iter().zip(limb.constants()));
        let constants: Vec<(String, f64)> = constants.collect();
        let pairs: Vec<(&str, f64)> = constants.iter().map(|(name, x)| (name.as_str(), *x)).collect();
        let tree = instance(r#"{"gravity": [1, -2, -9]}"#, &format!("[{}]", rows.join(", ")), &pairs).build().unwrap();
        let [q, v] = [2.0, 1.0].map(|size| -> Vec<f64> { (0..n).map(|_| rng.random_range(-size..size)).collect() });
        let mut terms = crate::lagrangian::Terms::default();
        tree.terms(&q, &v, crate::lagrangian::Request::LAGRANGIAN, &mut terms).unwrap();
        let at = |time: f64| points(&limbs, &q.iter().zip(&v).map(|(q, v)| q + v * time).collect::<Vec<_>>());
        let h = 1e-4;
        let near = [at(-2.0 * h), at(-h), at(h), at(2.0 * h)];
        let own = |(k, (mass, x)): (usize, (f64, [f64; 3]))| {
            let speed = |i: usize| {
                let [a, b, c, d] = near.each_ref().map(|points| points[k].1[i]);
                (8.0 * (c - b) - d + a) / (12.0 * h)
            };
            let square: f64 = (0..3).map(|i| speed(i).powi(2)).sum();
            mass * (square / 2.0 + x[0] - 2.0 * x[1] - 9.0 * x[2])
        };
        let expected: f64 = at(0.0).into_iter().enumerate().map(own).sum();
        assert!((terms.lagrangian[0] - expected).abs() < 1e-8 * expected.abs().max(10.0), "{rows:?}");
    }
}

#[test]
fn rows_and_places_of_the_same_joints_are_the_same_arm() {
    let rows = r#"[{"d": 0.4, "theta": 0.3}, {"a": 0.1, "alpha": "pi/2"}, {"a": 0.3, "alpha": 0.7, "d": 0.2, "prismatic": true}]"#;
    let (sine, cosine) = 0.7f64.sin_cos();
    let placed = format!(
        r#"[{{"xyz": [0, 0, 0.4], "rpy": [0, 0, 0.3]}}, {{"xyz": [0.1, 0, 0], "rpy": ["pi/2", 0, 0]}},
            {{"xyz": [0.3, {}, {}], "rpy": [0.7, 0, 0], "prismatic": true}}]"#,
        -0.2 * sine,
        0.2 * cosine
    );
    let pairs = [("m2", 2.0), ("mx2", 0.3), ("mz3", 0.4), ("Ixy3", 0.01), ("Iyy1", 0.4)];
    let state: [&[f64]; 3] = [&[0.4, -1.1, 0.3], &[0.8, 1.7, -0.2], &[-0.6, 2.3, 0.5]];
    let [by_rows, by_places] = [rows, &placed].map(|links| forces(&instance("{}", links, &pairs), state));
    close(&by_places, &by_rows);
}
