//! Hand-written systems: every output against double-double, an independent table and closed forms.

use lnn::lagrangian::{self, Configured, EulerLagrange, Request, Terms};
use lnn::linalg::{self, Workspace};
use lnn::scalar::{Dd, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn cast<S: Scalar, T: Scalar>(x: &[S]) -> Vec<T> {
    x.iter().map(|x| x.cast()).collect()
}

/// The same system, with the same numbers, in another precision.
fn recast<S: Scalar, T: Scalar>(system: &Configured<S>) -> Configured<T> {
    Configured { system: system.system, coordinates: system.coordinates, parameters: cast(&system.parameters) }
}

/// Outputs of one state, by name.
fn outputs<S: Scalar>(system: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Vec<(&'static str, Vec<S>)> {
    let mut terms = Terms::default();
    system.terms(q, v, Request::ALL, &mut terms).unwrap();
    let n = q.len();
    let mut eigenvalues = vec![S::of_f64(0.0); n];
    linalg::eigenvalues(n, &terms.mass_matrix, &mut eigenvalues, &mut Workspace::new()).unwrap();
    vec![
        ("lagrangian", terms.lagrangian),
        ("momentum", terms.momentum),
        ("dl_dq", terms.dl_dq),
        ("mass_matrix", terms.mass_matrix),
        ("eigenvalues", eigenvalues),
        ("coriolis", terms.coriolis),
        ("acceleration", terms.acceleration),
        ("energy", terms.energy),
    ]
}

fn largest(x: &[Dd]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.to_f64().abs()))
}

/// What a relative perturbation of the inputs (angles: reduced ones) does to each output, largest component.
fn input_conditions(system: &Configured<Dd>, q: &[Dd], v: &[Dd], base: &[(&str, Vec<Dd>)]) -> Vec<f64> {
    let step = Dd::of_f64(2f64.powi(-45));
    let n = q.len();
    let mut conditions = vec![0f64; base.len()];
    let inputs = 2 * n + system.parameters.len();
    for k in 0..inputs {
        let (mut q, mut v, mut moved) = (q.to_vec(), v.to_vec(), system.clone());
        let x = if k < n {
            &mut q[k]
        } else if k < 2 * n {
            &mut v[k - n]
        } else {
            &mut moved.parameters[k - 2 * n]
        };
        let size = x.to_f64().abs().min(2.0 * std::f64::consts::PI);
        *x += Dd::of_f64(size) * step;
        let changed = outputs(&*moved.build().unwrap(), &q, &v);
        for ((condition, (_, a)), (_, b)) in conditions.iter_mut().zip(&changed).zip(base) {
            let difference: Vec<Dd> = a.iter().zip(b).map(|(&a, &b)| (a - b) / step).collect();
            *condition += largest(&difference);
        }
    }
    conditions
}

/// Worst R of every output of a system over random states.
fn accuracy<S: Scalar>(name: &str, given: &[(&str, &str)], rng: &mut ChaCha8Rng) -> Vec<(&'static str, f64)> {
    let given: Vec<(String, String)> = given.iter().map(|&(s, t)| (s.into(), t.into())).collect();
    let system = lagrangian::configure::<S>(name, &given).unwrap();
    let wide: Configured<Dd> = recast(&system);
    let n = system.coordinates;
    let (narrow, judge) = (system.build().unwrap(), wide.build().unwrap());
    let bounds = (system.system.validation)(n);
    let periodic: Vec<bool> = (system.system.coordinates)(n).iter().map(|c| c.periodic).collect();
    let mut worst: Vec<(&'static str, f64)> = Vec::new();
    let eps = S::EPSILON.to_f64();
    for case in 0..60 {
        let shift = [0.0, 1024.0, 1048576.0, 1099511627776.0][case % 4];
        let q: Vec<S> = (0..n)
            .map(|i| {
                let (low, high) = bounds.positions[i];
                S::of_f64(rng.random_range(low..high) + if periodic[i] { shift } else { 0.0 })
            })
            .collect();
        let v: Vec<S> = bounds.velocities.iter().map(|&(low, high)| S::of_f64(rng.random_range(low..high))).collect();
        let found = outputs(&*narrow, &q, &v);
        let (q, v): (Vec<Dd>, Vec<Dd>) = (cast(&q), cast(&v));
        let exact = outputs(&*judge, &q, &v);
        let conditions = input_conditions(&wide, &q, &v, &exact);
        let kappa = linalg::condition_number(n, &exact[3].1, &mut Workspace::new()).unwrap();
        for (((name, a), (_, b)), condition) in found.iter().zip(&exact).zip(conditions) {
            let error = largest(&a.iter().zip(b).map(|(&a, &b)| a.cast::<Dd>() - b).collect::<Vec<_>>());
            // An acceleration is the solution of a system of equations: its condition is that of M.
            let solved = if *name == "acceleration" { kappa } else { 1.0 };
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
    let systems: [(&str, &[(&str, &str)]); 8] = [
        ("double-pendulum", &[]),
        ("double-pendulum", &[("m1", "1e-3"), ("m2", "7.5"), ("l1", "0.3"), ("l2", "2")]),
        ("triple-pendulum", &[]),
        ("triple-pendulum", &[("m2", "0.1"), ("l3", "3.3")]),
        ("n-pendulum", &[]),
        ("n-pendulum", &[("n", "1"), ("l", "0.7")]),
        ("spring-pendulum", &[]),
        ("sphere-geodesic", &[("R", "6.371")]),
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
    let table = include_str!("data/mechanics.csv");
    let numbers = |text: &str| -> Vec<Dd> { text.split(' ').map(|t| Dd::of_f64(t.parse().unwrap())).collect() };
    let mut current: Vec<(&'static str, Vec<Dd>)> = Vec::new();
    let (mut checked, mut worst, mut kappa, mut exact) = (0, 0f64, 1.0, Vec::new());
    for line in table.lines() {
        let field: Vec<&str> = line.split(',').collect();
        if field[0] == "s" {
            let given: Vec<(String, String)> =
                field[3].split(' ').filter_map(|p| p.split_once('=')).map(|(s, t)| (s.into(), t.into())).collect();
            // Parameters are binary fractions: the same in every precision.
            let system: Configured<Dd> = recast(&lagrangian::configure::<f64>(field[2], &given).unwrap());
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
        let mut error = (values[index] - expected).to_f64().abs() / scale;
        if field[2] == "acceleration" {
            error = error.max((exact[index] - expected).to_f64().abs() / scale);
        }
        assert!(error < 1e-28, "{line}: {error:e}");
        worst = worst.max(error);
        checked += 1;
    }
    println!("{checked} numbers, worst {worst:e}");
    assert!(checked > 400);
}

#[test]
fn closed_forms_agree_in_double_double() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    for system in lagrangian::systems() {
        for n in match system.size {
            lagrangian::system::Size::Fixed(n) => n..=n,
            lagrangian::system::Size::Chosen { least, .. } => least..=8,
        } {
            let given = [("n".to_string(), n.to_string())];
            let given = if matches!(system.size, lagrangian::system::Size::Fixed(_)) { &given[..0] } else { &given };
            let configured = lagrangian::configure::<Dd>(system.name, given).unwrap();
            let built = configured.build().unwrap();
            let bounds = (system.validation)(n);
            for _ in 0..5 {
                let mut draw =
                    |b: &[(f64, f64)]| b.iter().map(|b| Dd::of_f64(rng.random_range(b.0..b.1))).collect::<Vec<Dd>>();
                let (q, v) = (draw(&bounds.positions), draw(&bounds.velocities));
                let mut terms = Terms::default();
                built.terms(&q, &v, Request::ACCELERATION, &mut terms).unwrap();
                assert!(terms.energy.is_empty() && terms.momentum.is_empty() && terms.lagrangian.is_empty());
                let exact = configured.exact_acceleration(&q, &v).unwrap();
                let kappa = linalg::condition_number(n, &terms.mass_matrix, &mut Workspace::new()).unwrap();
                for (&a, &b) in terms.acceleration.iter().zip(&exact) {
                    assert!((a - b).to_f64().abs() < 1e-28 * kappa * largest(&exact), "{} {n}", system.name);
                }
            }
        }
    }
}

#[test]
fn batches_replayed_agree_with_single_states_and_requests_with_each_other() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    for system in lagrangian::systems() {
        let n = system.size.default();
        let built = lagrangian::build::<f64>(system.name, &[]).unwrap();
        let bounds = (system.validation)(n);
        let batch = 150;
        let mut draw = |b: &[(f64, f64)]| -> Vec<f64> {
            (0..batch).flat_map(|_| b.iter().map(|b| rng.random_range(b.0..b.1)).collect::<Vec<f64>>()).collect()
        };
        let (q, v) = (draw(&bounds.positions), draw(&bounds.velocities));
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
    let spring = lagrangian::build::<f64>("spring-pendulum", &[]).unwrap();
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
        let exact = lagrangian::exact_acceleration("spring-pendulum", &[], &[r, 0.5], &[1.0, 0.25]).unwrap();
        for (a, b) in terms.acceleration.iter().zip(exact) {
            assert!((a - b).abs() <= 1e-14 * b.abs(), "r = 2^-{k}: {a} {b}");
        }
    }
}
