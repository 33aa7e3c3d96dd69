use super::*;
use crate::lagrangian::{
    Accelerations, EulerLagrange, ExpressionLagrangian, Interruptible, Mechanics, MechanicsError, Request,
    SystemInstance, Terms, WithForces,
};
use std::sync::atomic::{AtomicBool, Ordering};

type Model = Box<dyn EulerLagrange<f64>>;

const NAMES: [&str; 3] = ["x", "y", "z"];

/// States that do not satisfy any constraints.
fn states(count: usize) -> (Vec<f64>, Vec<f64>) {
    let number = |k: usize, by: f64| (by * k as f64 + 0.3).sin();
    ((0..count).map(|k| number(k, 0.37)).collect(), (0..count).map(|k| 2.0 * number(k, 0.71)).collect())
}

/// A model with coordinates `x`, `y`, `z` in which two of them attract each other.
fn free() -> Mechanics<ExpressionLagrangian, f64> {
    let lagrangian = "m*(x_dot^2 + y_dot^2 + z_dot^2)/2 + x_dot*y_dot*cos(z)/2 - g*z";
    Mechanics::new(ExpressionLagrangian::new(&NAMES, &["m", "g"], lagrangian).unwrap(), [2.0, 9.8])
}

/// The same model with constraints, which have a separate parameter `c = 0.7`.
fn constrained(
    formulas: &[(&str, &str)],
) -> Constrained<Mechanics<ExpressionLagrangian, f64>, ExpressionConstraints, f64> {
    Constrained::new(free(), ExpressionConstraints::new(&NAMES, &["c"], formulas).unwrap(), [0.7]).unwrap()
}

/// Compares the accelerations of the program with those of the terms.
fn check(name: &str, model: &dyn EulerLagrange<f64>, (q, v): (&[f64], &[f64])) {
    let mut a = vec![0.0; q.len()];
    assert!(Accelerations::new(model).is_solved(q, v, &mut a), "{name}: no program");
    let exact = model.acceleration(q, v).unwrap();
    let size = exact.iter().fold(1.0, |size: f64, a| size.max(a.abs()));
    for (a, b) in a.iter().zip(&exact) {
        assert!((a - b).abs() < 1e-11 * size, "{name}: {a} {b}");
    }
}

#[test]
fn accelerations_under_constraints_are_those_of_the_terms() {
    for (n, batch) in [(1, 3), (2, 70), (7, 9), (40, 2)] {
        let name = format!("cartesian-chain-{n}");
        // Rods that are stretched pull as well.
        let (q, v) = states(2 * n * batch);
        check(&name, &*SystemInstance::named(&name, &[]).unwrap().build().unwrap(), (&q, &v));
    }
    for name in ["chaplygin-sleigh", "rolling-disk", "rigid-body", "heavy-top", "four-bar-linkage", "particle-on-torus"]
    {
        let model: Model = SystemInstance::named(name, &[]).unwrap().build().unwrap();
        let (mut q, v) = states(3 * model.coordinates());
        if model.coordinates() == 9 {
            // Close to a rotation matrix.
            q.iter_mut().enumerate().for_each(|(k, q)| *q = 0.1 * *q + if k % 9 % 4 == 0 { 1.0 } else { 0.0 });
        }
        check(name, &*model, (&q, &v));
    }
    let (q, v) = states(9);
    for formulas in [
        &[("blade", "y_dot*cos(z) - x_dot*sin(z)")][..],
        &[("drive", "x_dot*cos(y) - c*y_dot*x + z_dot - sin(x) - c")],
        &[("drive", "z_dot - c*x_dot*y - x*z"), ("surface", "x^2*y + c*exp(z) - y")],
    ] {
        check(&format!("{formulas:?}"), &constrained(formulas), (&q, &v));
    }
}

#[test]
fn dependent_rows_and_singular_masses_are_left_to_the_terms() {
    let parallel = [("one", "x^2 + y^2 - c"), ("other", "x^2 + y^2 + c*(z - 1)^2 - c")];
    let vanishing = [("one", "x^2 + y^2 + z^2 - c"), ("other", "x*y*z_dot")];
    for (formulas, q) in [(parallel, [0.4, 0.3, 1.0]), (vanishing, [0.0, 0.0, 1.0]), (vanishing, [f64::NAN, 1.0, 0.0])]
    {
        let model = constrained(&formulas);
        assert!(model.solved().is_some());
        let (mut terms, mut a, v) = (Terms::default(), [0.0; 3], [0.1, -0.2, 0.3]);
        let expected = model.terms(&q, &v, Request::ACCELERATION, &mut terms);
        assert!(expected.is_err(), "{formulas:?}");
        let mut accelerations = Accelerations::new(&model);
        assert!(!accelerations.is_solved(&q, &v, &mut a));
        let found = accelerations.at(&q, &v, &mut a);
        assert_eq!(format!("{found:?}"), format!("{expected:?}"));
        // Reuses the buffers for another state of the same model.
        accelerations.at(&[0.4, 0.3, 0.5], &v, &mut a).unwrap();
        check("another", &model, (&[0.4, 0.3, 0.5], &v));
    }
    let nearly = constrained(&[("one", "x + y"), ("other", "x + 1.001*y")]);
    assert!(!Accelerations::new(&nearly).is_solved(&[0.0; 3], &[0.0; 3], &mut [0.0; 3]));
    // With the coordinate time as parameter there is no mass matrix.
    let clock: Model = SystemInstance::named("schwarzschild-by-clock", &[]).unwrap().build().unwrap();
    let (q, v, mut a) = ([0.0, 8.0, 1.3, 0.4], [1.0, 0.05, 0.01, 0.04], [0.0; 4]);
    Accelerations::new(&*clock).at(&q, &v, &mut a).unwrap();
    for (a, b) in a.iter().zip(clock.acceleration(&q, &v).unwrap()) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
}

#[test]
fn models_around_constraints_and_beneath_them_keep_their_answers() {
    let surface = || ExpressionConstraints::new(&NAMES, &[], &[("surface", "x^2 + y^2 + z - 1")]).unwrap();
    let push = |_: &[f64], v: &[f64], force: &mut [f64]| force.iter_mut().zip(v).for_each(|(f, v)| *f = -v);
    let around = WithForces::new(Constrained::new(free(), surface(), []).unwrap(), push);
    let within = Constrained::new(WithForces::new(free(), push), surface(), []).unwrap();
    let (q, v, mut a) = ([0.3, 0.2, 0.4], [1.0, -1.0, 0.5], [[0.0; 3]; 2]);
    Accelerations::new(&around).at(&q, &v, &mut a[0]).unwrap();
    Accelerations::new(&within).at(&q, &v, &mut a[1]).unwrap();
    assert!(around.solved().is_none() && within.solved().is_none() && a[0] == a[1]);
    // A second layer of constraints is rejected as always.
    let alone = Constrained::new(free(), surface(), []).unwrap();
    let twice = Constrained::new(&alone as &dyn EulerLagrange<f64>, surface(), []).unwrap();
    assert!(matches!(Accelerations::new(&twice).at(&q, &v, &mut a[0]), Err(MechanicsError::Shape { .. })));
    let flag = AtomicBool::new(false);
    let stopped = Interruptible::new(&alone, &flag);
    check("with a flag", &stopped, (&q, &v));
    flag.store(true, Ordering::Relaxed);
    assert_eq!(Accelerations::new(&stopped).at(&q, &v, &mut a[0]), Err(MechanicsError::Interrupted));
}

#[test]
fn programs_are_those_of_the_rows_that_act() {
    let repeated = constrained(&[("one", "x^2 + y^2 - c"), ("same", "2*c - 2*x^2 - 2*y^2"), ("two", "z_dot - x_dot")]);
    let (q, v) = ([0.8, 0.2, 0.1, 0.3, 0.9, -0.4], [0.5, 0.1, 0.2, 0.3, 0.4, 0.1]);
    // This holds whichever programs were recorded.
    assert!(repeated.solved().is_some());
    let kept = repeated.independent(&q, &v).unwrap();
    assert_eq!((kept.names().len(), kept.redundant().len()), (2, 1));
    check("without the repeated one", &kept, (&q, &v));
}

/// Constraints without programs.
struct Plain<'a>(&'a dyn Manifold<f64>);

impl Manifold<f64> for Plain<'_> {
    fn coordinates(&self) -> usize {
        self.0.coordinates()
    }
    fn names(&self) -> &[String] {
        self.0.names()
    }
    fn redundant(&self) -> &[String] {
        self.0.redundant()
    }
    fn is_holonomic(&self, row: usize) -> bool {
        self.0.is_holonomic(row)
    }
    fn rows(&self, q: &[f64], v: &[f64], rows: &mut ManifoldRows<f64>) {
        self.0.rows(q, v, rows);
    }
    fn rate_gradients(&self, q: &[f64], v: &[f64], gradients: &mut Vec<f64>) {
        self.0.rate_gradients(q, v, gradients);
    }
    fn pull_back(&self, state: (&[f64], &[f64]), along: RowAdjoint<'_, f64>, by: (&mut [f64], &mut [f64])) {
        self.0.pull_back(state, along, by);
    }
}

#[test]
fn states_are_brought_to_the_constraints_as_without_programs() {
    let close = |name: &str, manifold: &dyn Manifold<f64>, (q, v): (&[f64], &[f64])| {
        let programs = manifold.programs().unwrap();
        assert!(programs.correction(false).is_some() && programs.correction(true).is_some(), "{name}");
        let mut found = [[q.to_vec(), v.to_vec()], [q.to_vec(), v.to_vec()]];
        let [[q, v], [plain_q, plain_v]] = &mut found;
        let (ours, plain) = (project(manifold, q, v), project(&Plain(manifold), plain_q, plain_v));
        match (ours, plain) {
            (Ok(ours), Ok(plain)) => {
                assert!(ours.iter().zip(plain).all(|(a, b)| (a - b).abs() < 1e-11 * (1.0 + b)), "{name}");
                let [a, b] = found.map(|state| state.concat());
                assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-11 * (1.0 + b.abs())), "{name}");
            }
            (Err(ours), Err(plain)) => assert_eq!(ours.row, plain.row, "{name}"),
            (ours, plain) => panic!("{name}: {ours:?} {plain:?}"),
        }
    };
    for n in [1, 2, 5, 30] {
        let name = format!("cartesian-chain-{n}");
        let model: Model = SystemInstance::named(&name, &[]).unwrap().build().unwrap();
        let (noise, v) = states(2 * n);
        let q: Vec<f64> =
            (0..2 * n).map(|i| 0.1 * noise[i] + if i % 2 == 0 { 0.0 } else { -1.0 - (i / 2) as f64 }).collect();
        close(&name, model.manifold().unwrap(), (&q, &v));
    }
    for name in ["chaplygin-sleigh", "rolling-disk", "particle-on-ellipsoid", "particle-on-torus"] {
        let model: Model = SystemInstance::named(name, &[]).unwrap().build().unwrap();
        let (q, v) = states(model.coordinates());
        close(name, model.manifold().unwrap(), (&q, &v));
    }
    let (q, v) = ([0.6, 0.5, 0.4], [0.3, 0.2, -0.1]);
    for formulas in [
        &[("drive", "z_dot - c*x_dot*y - x*z"), ("surface", "x^2*y + c*exp(z) - 2")][..],
        // The first two are equivalent, the next two contradict each other, and the last one vanishes identically.
        &[("one", "x^2 + y^2 - c"), ("same", "2*x^2 + 2*y^2 - 2*c"), ("blade", "z_dot - x_dot")],
        &[("one", "x^2 + y^2 - c"), ("other", "x^2 + y^2 - 2*c")],
        &[("one", "z - c"), ("none", "(x - 0.6)^2 + (y - 0.5)^2")],
    ] {
        close(&format!("{formulas:?}"), &constrained(formulas), (&q, &v));
    }
}

#[test]
fn corrections_by_programs_are_least_changes() {
    let model: Model = SystemInstance::named("cartesian-chain-12", &[]).unwrap().build().unwrap();
    let (manifold, n) = (model.manifold().unwrap(), 24);
    let (q, v) = states(n);
    let mut rows = ManifoldRows::default();
    manifold.rows(&q, &v, &mut rows);
    for (of_rates, defects) in [(false, &rows.values), (true, &rows.rates)] {
        let (exact, _) = along_rows(n, &rows.matrix, defects);
        let (mut change, mut guards, mut missed, mut squares) = ([0.0; 24], [0.0; 24], [0.0; 12], [0.0; 12]);
        let mut program = manifold.programs().unwrap().correction(of_rates).unwrap();
        let outputs: &mut [&mut [f64]] = &mut [&mut change, &mut guards, &mut missed, &mut squares];
        program.evaluate(1, &[&q, &v], &[], outputs).unwrap();
        assert!(change.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-12 * (1.0 + b.abs())));
        assert!(missed.iter().zip(defects).all(|(a, b)| (a - b).abs() < 1e-13 * (1.0 + b.abs())));
        for (row, square) in rows.matrix.chunks_exact(n).zip(squares) {
            assert!((dot(row, row) - square).abs() < 1e-13 * square);
        }
    }
}
