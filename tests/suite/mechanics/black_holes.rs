//! Black holes in several charts: the same metric, the same constants of motion, Carter's among them.

use lnn::lagrangian::systems::{KerrGeodesic, KerrSchild};
use lnn::lagrangian::{Request, SystemInstance, Terms};
use lnn::rollout::{RolloutOptions, rollout};
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn given(list: &[(&str, &str)]) -> Vec<(String, String)> {
    list.iter().map(|&(s, t)| (s.into(), t.into())).collect()
}

fn dd(x: f64) -> Dd {
    Dd::of_f64(x)
}

/// A state in the coordinates of Boyer and Lindquist in those of Kerr and Schild: `x + i y = (r + i a) e^(i p) sin theta`, `z = r cos theta`,
/// `p' = phi' + a r'/Delta`, `t' + 2 M r r'/Delta`; the azimuth at the place itself is free by symmetry.
fn cartesian(mass: Dd, spin: Dd, q: &[Dd], v: &[Dd]) -> (Vec<Dd>, Vec<Dd>) {
    let (r, (sin, cos), (sin_phi, cos_phi)) = (q[1], q[2].sin_cos(), q[3].sin_cos());
    let delta = r * r - dd(2.0) * mass * r + spin * spin;
    let turn = v[3] + spin * v[1] / delta;
    let (across, along) = (r * cos_phi - spin * sin_phi, r * sin_phi + spin * cos_phi);
    let (x, y) = (across * sin, along * sin);
    let x_dot = v[1] * cos_phi * sin + across * cos * v[2] - y * turn;
    let y_dot = v[1] * sin_phi * sin + along * cos * v[2] + x * turn;
    let t_dot = v[0] + dd(2.0) * mass * r * v[1] / delta;
    (vec![q[0], x, y, r * cos], vec![t_dot, x_dot, y_dot, v[1] * cos - r * sin * v[2]])
}

#[test]
fn both_charts_of_kerr_have_one_metric_and_the_same_constants() {
    let mut rng = ChaCha8Rng::seed_from_u64(71);
    for (mass, spin) in [("1", "0.9"), ("1.5", "-0.7"), ("2", "0")] {
        let list = given(&[("M", mass), ("a", spin)]);
        let polar = SystemInstance::<Dd>::named("kerr-geodesic", &list).unwrap();
        let flat = SystemInstance::<Dd>::named("kerr-cartesian", &list).unwrap();
        let (m, a) = (polar.parameters[0], polar.parameters[1]);
        for _ in 0..50 {
            let mut draw = |low: f64, high: f64| dd(rng.random_range(low..high));
            let q = [draw(-5.0, 5.0), draw(4.2, 20.0), draw(0.2, 2.9), draw(-3.0, 3.0)];
            let v = [draw(0.5, 3.0), draw(-0.5, 0.5), draw(-0.1, 0.1), draw(-0.1, 0.1)];
            let (x, u) = cartesian(m, a, &q, &v);
            let terms = |system: &lnn::lagrangian::SystemInstance<Dd>, q: &[Dd], v: &[Dd]| {
                let mut terms = Terms::default();
                system.build().unwrap().terms(q, v, Request::ALL, &mut terms).unwrap();
                terms
            };
            let (here, there) = (terms(&polar, &q, &v), terms(&flat, &x, &u));
            let near = |a: Dd, b: Dd, what: &str| {
                assert!((a - b).to_f64().abs() < 1e-25 * (1.0 + b.to_f64().abs()), "a = {spin}, {what}: {a} {b}");
            };
            near(here.lagrangian[0], there.lagrangian[0], "L");
            near(here.momentum[0], there.momentum[0], "p_t");
            near(here.momentum[3], x[1] * there.momentum[2] - x[2] * there.momentum[1], "p_phi");
            let carter = KerrGeodesic.carter(&polar.parameters, &q, &v).unwrap();
            near(carter, KerrSchild::Kerr.carter(&flat.parameters, &x, &u).unwrap(), "K");
            // The mass shell in both charts.
            let (mut v, mut u) = (v.to_vec(), u);
            polar.impose_constraint(&q, &mut v).unwrap();
            let shell = cartesian(m, a, &q, &v).1;
            u[1..].copy_from_slice(&shell[1..]);
            flat.impose_constraint(&x, &mut u).unwrap();
            near(u[0], shell[0], "t'");
        }
    }
}

#[test]
fn without_spin_and_charge_all_holes_are_schwarzschilds() {
    let mut rng = ChaCha8Rng::seed_from_u64(72);
    let pairs = [
        ("kerr-geodesic", [("a", "0")], "schwarzschild-geodesic"),
        ("kerr-cartesian", [("a", "0")], "schwarzschild-cartesian"),
        ("reissner-nordstrom-cartesian", [("Q", "0")], "schwarzschild-cartesian"),
    ];
    for (name, list, plain) in pairs {
        let (hole, plain) = (
            SystemInstance::<Dd>::named(name, &given(&list)).unwrap(),
            SystemInstance::<Dd>::named(plain, &[]).unwrap(),
        );
        let bounds = plain.system.validation(4);
        for _ in 0..20 {
            let mut draw = |bounds: &[(f64, f64)]| -> Vec<Dd> {
                bounds.iter().map(|b| dd(if b.0 < b.1 { rng.random_range(b.0..b.1) } else { b.0 })).collect()
            };
            let (q, mut v) = (draw(&bounds.positions), draw(&bounds.velocities));
            plain.impose_constraint(&q, &mut v).unwrap();
            let mut same = v.clone();
            hole.impose_constraint(&q, &mut same).unwrap();
            let [a, b] = [&hole, &plain].map(|system| system.exact_acceleration(&q, &v).unwrap());
            for (a, b) in a.iter().chain(&same).zip(b.iter().chain(&v)) {
                assert!((*a - *b).to_f64().abs() < 1e-27 * (1.0 + b.to_f64().abs()), "{name}: {a} {b}");
            }
        }
    }
}

/// `g = eta + f l l` of a place on the equator, a tilted one, and through the horizon: what the tensor says there.
#[test]
fn free_fall_passes_the_horizon() {
    let system = SystemInstance::<f64>::named("schwarzschild-cartesian", &[]).unwrap();
    let exact = system.build().unwrap();
    let q = [0.0, 2.4, 3.2, 3.0];
    let mut v = [0.0, 0.0, 0.0, 0.0];
    system.impose_constraint(&q, &mut v).unwrap();
    let r0: f64 = 5.0;
    // From rest at r0: proper time sqrt(r0^3/(8 M)) (h + sin h), r = r0 (1 + cos h)/2.
    let h = (2.0 * 1.5 / r0 - 1.0_f64).acos();
    let time = (r0.powi(3) / 8.0).sqrt() * (h + h.sin());
    let run = rollout(&*exact, &q, &v, &RolloutOptions::reference(time, time / 8.0));
    assert_eq!(run.stop, None);
    let (end, _) = run.trajectory.state(8);
    let r = end[1..].iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((r - 1.5).abs() < 1e-9, "{r}");
    assert!((end[1] / end[2] - 0.75).abs() < 1e-9 && (end[3] / end[2] - 3.0 / 3.2).abs() < 1e-9);
}
