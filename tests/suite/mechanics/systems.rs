//! Hand-written systems: every output against double-double, an independent table and closed forms.

use crate::common::accuracy::{cast, configure, input_conditions, largest, outputs, random_state, recast};
use lnn::lagrangian::{self, Request, SystemInstance, Terms};
use lnn::linalg::{self, Workspace};
use lnn::scalar::{Dd, Scalar};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Worst R of every output of a system over random states.
fn accuracy<S: Scalar>(name: &str, given: &[(&str, &str)], rng: &mut ChaCha8Rng) -> Vec<(&'static str, f64)> {
    let system = configure::<S>(name, given);
    let wide: SystemInstance<Dd> = recast(&system);
    let n = system.coordinates;
    let (narrow, judge) = (system.build().unwrap(), wide.build().unwrap());
    let bounds = system.system.validation(n);
    let periodic: Vec<bool> = system.system.coordinates(n).iter().map(|c| c.periodic).collect();
    let mut worst: Vec<(&'static str, f64)> = Vec::new();
    let eps = S::epsilon().to_f64();
    for case in 0..60 {
        let shift = [0.0, 1024.0, 1048576.0, 1099511627776.0][case % 4];
        let (mut q, v) = random_state(&system, &bounds, rng);
        for (q, _) in q.iter_mut().zip(&periodic).filter(|(_, periodic)| **periodic) {
            *q += S::of_f64(shift);
        }
        let found = outputs(&*narrow, &q, &v);
        let (q, v): (Vec<Dd>, Vec<Dd>) = (cast(&q), cast(&v));
        let exact = outputs(&*judge, &q, &v);
        let conditions = input_conditions(&wide, &q, &v, &exact);
        let kappa = linalg::condition_number(n, &exact[3].1, &mut Workspace::new()).unwrap();
        for (((name, a), (_, b)), condition) in found.iter().zip(&exact).zip(conditions) {
            let error = largest(&a.iter().zip(b).map(|(&a, &b)| a.cast::<Dd>() - b).collect::<Vec<_>>());
            // An acceleration is the solution of a system of equations: its condition is that of M.
            let solved = if *name == "acceleration" { kappa } else { 1.0 };
            let condition = condition.iter().fold(0f64, |m, &c| m.max(c));
            let r = error / (eps * (condition + solved * largest(b)).max(f64::MIN_POSITIVE));
            match worst.iter_mut().find(|(n, _)| n == name) {
                Some((_, w)) => *w = w.max(r),
                None => worst.push((name, r)),
            }
        }
    }
    worst
}

#[test]
fn every_output_is_within_rounding_of_double_double() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let systems: [(&str, &[(&str, &str)]); 24] = [
        ("double-pendulum", &[]),
        ("double-pendulum", &[("m1", "1e-3"), ("m2", "7.5"), ("l1", "0.3"), ("l2", "2")]),
        ("triple-pendulum", &[]),
        ("triple-pendulum", &[("m2", "0.1"), ("l3", "3.3")]),
        ("n-pendulum", &[]),
        ("n-pendulum", &[("n", "1"), ("l", "0.7")]),
        ("spring-pendulum", &[]),
        ("sphere-geodesic", &[("R", "6.371")]),
        ("constant-force", &[("m", "3"), ("F", "0.1")]),
        ("harmonic-oscillator", &[("k", "17.3")]),
        ("kepler", &[]),
        ("kepler", &[("mu", "398.6")]),
        ("henon-heiles", &[]),
        ("lattice", &[]),
        ("lattice", &[("n", "3"), ("m", "2.5"), ("beta", "-0.7")]),
        ("cloth", &[("n", "1"), ("k", "7.1")]),
        ("charged-particle", &[]),
        ("charged-particle", &[("m", "0.3"), ("q", "-2"), ("B", "0.7"), ("E", "-3.1")]),
        // Slow particles: SI units.
        ("charged-particle", &[("c", "299792458")]),
        ("ads2-geodesic", &[]),
        ("ads3-geodesic", &[("L", "0.3")]),
        ("ads4-geodesic", &[]),
        ("schwarzschild-geodesic", &[]),
        ("schwarzschild-geodesic", &[("M", "0.1")]),
    ];
    for (name, given) in systems {
        for (precision, worst) in
            [("f64", accuracy::<f64>(name, given, &mut rng)), ("f32", accuracy::<f32>(name, given, &mut rng))]
        {
            println!("{name} {given:?} {precision}: {worst:.2?}");
            for (output, r) in worst {
                assert!(r < 3.0, "{name} {precision}: {output} R = {r}");
            }
        }
    }
}

#[test]
fn double_double_agrees_with_an_independent_table() {
    let table = include_str!("../../data/mechanics.csv");
    let numbers = |text: &str| -> Vec<Dd> { text.split(' ').map(|t| Dd::of_f64(t.parse().unwrap())).collect() };
    let mut current: Vec<(&'static str, Vec<Dd>)> = Vec::new();
    let (mut checked, mut worst, mut kappa, mut exact) = (0, 0f64, 1.0, Vec::new());
    for line in table.lines() {
        let field: Vec<&str> = line.split(',').collect();
        if field[0] == "s" {
            let given: Vec<(String, String)> =
                field[3].split(' ').filter_map(|p| p.split_once('=')).map(|(s, t)| (s.into(), t.into())).collect();
            // Parameters are binary fractions: the same in every precision.
            let system: SystemInstance<Dd> =
                recast(&lagrangian::SystemInstance::<f64>::named(field[2], &given).unwrap());
            let (q, v) = (numbers(field[4]), numbers(field[5]));
            current = outputs(&*system.build().unwrap(), &q, &v);
            exact = system.exact_acceleration(&q, &v).unwrap();
            kappa = linalg::condition_number(q.len(), &current[3].1, &mut Workspace::new()).unwrap();
            continue;
        }
        let (_, values) = current.iter().find(|(name, _)| *name == field[2]).unwrap();
        let index: usize = field[3].parse().unwrap();
        let expected = Dd::new(field[4].parse().unwrap(), field[5].parse().unwrap());
        let scale = largest(values) * if field[2] == "acceleration" { kappa } else { 1.0 };
        let mut error = (values[index] - expected).to_f64().abs();
        if field[2] == "acceleration" {
            error = error.max((exact[index] - expected).to_f64().abs());
        }
        if scale > 0.0 {
            error /= scale;
        } else {
            // What vanishes exactly is a remainder of numerical differentiation in the table.
            assert!(error < 1e-50, "{line}: {error:e}");
        }
        assert!(error < 1e-28, "{line}: {error:e}");
        worst = worst.max(error);
        checked += 1;
    }
    println!("{checked} numbers, worst {worst:e}");
    assert!(checked > 1800);
}

/// The acceleration of every system by Euler-Lagrange and by its closed form, within the rounding of `S` times the
/// condition of the acceleration and of `M`.
fn closed_forms_agree<S: Scalar>(rng: &mut ChaCha8Rng) {
    for system in lagrangian::System::unconstrained() {
        // Of a size that is chosen, all with up to twelve coordinates.
        for chosen in match system.size {
            lagrangian::Size::Fixed(n) => n..=n,
            lagrangian::Size::Chosen { least, .. } => least..=8,
        } {
            let (n, text) = (system.size.coordinates(chosen), chosen.to_string());
            if n > 12 {
                continue;
            }
            let given = [("n", text.as_str())];
            let given = if matches!(system.size, lagrangian::Size::Fixed(_)) { &given[..0] } else { &given };
            let configured = configure::<S>(&system.name, given);
            let wide: SystemInstance<Dd> = recast(&configured);
            let (built, judge) = (configured.build().unwrap(), wide.build().unwrap());
            let bounds = system.validation(n);
            for _ in 0..5 {
                let (q, v) = random_state(&configured, &bounds, rng);
                let mut terms = Terms::default();
                built.terms(&q, &v, Request::ACCELERATION, &mut terms).unwrap();
                assert!(terms.energy.is_empty() && terms.momentum.is_empty() && terms.lagrangian.is_empty());
                let exact = configured.exact_acceleration(&q, &v).unwrap();
                let kappa = linalg::condition_number(n, &terms.mass_matrix, &mut Workspace::new()).unwrap();
                let (q, v): (Vec<Dd>, Vec<Dd>) = (cast(&q), cast(&v));
                let base = outputs(&*judge, &q, &v);
                let conditions = input_conditions(&wide, &q, &v, &base);
                let at = base.iter().position(|(name, _)| *name == "acceleration").unwrap();
                let condition = conditions[at].iter().fold(0f64, |m, &c| m.max(c));
                let unit = S::epsilon().to_f64() * (condition + kappa * largest(&base[at].1));
                for (&a, &b) in terms.acceleration.iter().zip(&exact) {
                    let error = (a - b).to_f64().abs();
                    assert!(error <= 3.0 * unit, "{} {n} {}: {error:e} {unit:e}", system.name, S::NAME);
                }
            }
        }
    }
}

#[test]
fn closed_forms_agree_in_every_precision() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    closed_forms_agree::<Dd>(&mut rng);
    closed_forms_agree::<f64>(&mut rng);
    closed_forms_agree::<f32>(&mut rng);
}

#[test]
fn batches_replayed_agree_with_single_states_and_requests_with_each_other() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    for system in lagrangian::System::unconstrained() {
        let n = system.size.default();
        let configured = configure::<f64>(&system.name, &[]);
        let built = configured.build().unwrap();
        let bounds = system.validation(n);
        let batch = 150;
        let states = (0..batch).map(|_| random_state(&configured, &bounds, &mut rng));
        let (q, v): (Vec<_>, Vec<_>) = states.unzip();
        let (q, v) = (q.concat(), v.concat());
        let mut all = Terms::default();
        built.terms(&q, &v, Request::ALL, &mut all).unwrap();
        let close = |what: &str, a: &[f64], b: &[f64]| {
            assert_eq!(a.len(), b.len());
            let scale = b.iter().fold(0f64, |m, x| m.max(x.abs()));
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() <= 1e-12 * scale, "{} {what}: {a} {b}", system.name);
            }
        };
        for row in 0..batch {
            let mut one = Terms::default();
            built.terms(&q[row * n..][..n], &v[row * n..][..n], Request::ALL, &mut one).unwrap();
            close("mass", &one.mass_matrix, &all.mass_matrix[row * n * n..][..n * n]);
            close("momentum", &one.momentum, &all.momentum[row * n..][..n]);
            close("dl_dq", &one.dl_dq, &all.dl_dq[row * n..][..n]);
            close("coriolis", &one.coriolis, &all.coriolis[row * n..][..n]);
            close("acceleration", &one.acceleration, &all.acceleration[row * n..][..n]);
            close("energy", &one.energy, &all.energy[row..=row]);
        }
        for (request, rows) in [(Request::ENERGY, batch), (Request::ENERGY, 3), (Request::MOMENTUM | Request::DL_DQ, 2)]
        {
            let mut some = Terms::default();
            built.terms(&q[..rows * n], &v[..rows * n], request, &mut some).unwrap();
            close("momentum", &some.momentum, &all.momentum[..rows * n]);
            assert!(some.mass_matrix.is_empty() && some.acceleration.is_empty() && some.coriolis.is_empty());
            if request == Request::ENERGY {
                close("energy", &some.energy, &all.energy[..rows]);
                assert!(some.dl_dq.is_empty());
            } else {
                close("dl_dq", &some.dl_dq, &all.dl_dq[..rows * n]);
            }
        }
    }
}

#[test]
fn failures_name_the_row_and_leave_the_others() {
    let spring = lagrangian::SystemInstance::<f64>::named("spring-pendulum", &[]).unwrap().build().unwrap();
    let mut terms = Terms::default();
    let (q, v) = ([1.0, 0.5, 0.0, 0.5, 2.0, f64::NAN], [0.0; 6]);
    let error = spring.terms(&q, &v, Request::ALL, &mut terms).unwrap_err();
    assert_eq!(error, lagrangian::MechanicsError::Singular { row: 1, condition: f64::INFINITY });
    assert!(terms.acceleration[..2].iter().all(|a| a.is_finite()));
    assert!(terms.acceleration[2..].iter().all(|a| a.is_nan()));
    let error = spring.terms(&q[4..], &v[4..], Request::ENERGY, &mut terms).unwrap_err();
    assert!(matches!(error, lagrangian::MechanicsError::NotFinite { row: 0, .. }));
    assert!(matches!(
        spring.terms(&q[..3], &v[..2], Request::ALL, &mut terms),
        Err(lagrangian::MechanicsError::Shape { .. })
    ));
    // Close to the end of the chart the loss is graceful: units are scaled away.
    for k in 1..200 {
        let r = 2f64.powi(-k);
        spring.terms(&[r, 0.5], &[1.0, 0.25], Request::ACCELERATION, &mut terms).unwrap();
        let exact = lagrangian::SystemInstance::named("spring-pendulum", &[])
            .unwrap()
            .exact_acceleration(&[r, 0.5], &[1.0, 0.25])
            .unwrap();
        for (a, b) in terms.acceleration.iter().zip(exact) {
            assert!((a - b).abs() <= 1e-14 * b.abs(), "r = 2^-{k}: {a} {b}");
        }
    }
}
