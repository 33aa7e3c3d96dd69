//! Roll-outs on constraints: order, drift of the constraint and of the energy, starts, failures.

use lnn::lagrangian::{
    Constrained, EulerLagrange, ExpressionConstraints, ExpressionLagrangian, InverseDynamics, ManifoldRows, Mechanics,
    MechanicsError, SystemInstance,
};
use lnn::rollout::{Driven, Integrator, RolloutError, RolloutOptions, Trajectory, rollout, rollout_fixed};
use lnn::scalar::{Dd, Real, Scalar};

const FIXED: [(Integrator, f64); 4] =
    [(Integrator::Midpoint, 2.0), (Integrator::Variational, 2.0), (Integrator::Gauss4, 4.0), (Integrator::Gauss6, 6.0)];

fn model(name: &str) -> Box<dyn EulerLagrange<f64>> {
    SystemInstance::<f64>::named(name, &[]).unwrap().build().unwrap()
}

/// Largest defect of constraints and of their rates over all samples.
fn defect(model: &dyn EulerLagrange<f64>, motion: &Trajectory<f64>) -> f64 {
    let mut rows = ManifoldRows::default();
    let states = (0..motion.len()).map(|k| {
        let (q, v) = motion.state(k);
        model.manifold().unwrap().rows(q, v, &mut rows);
        rows.values.iter().chain(&rows.rates).fold(0.0, |most: f64, x| most.max(x.abs()))
    });
    states.collect::<Vec<_>>().into_iter().fold(0.0, f64::max)
}

fn last(motion: &Trajectory<f64>) -> Vec<f64> {
    let (q, v) = motion.state(motion.len() - 1);
    [q, v].concat()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Starts on the constraints.
fn starts() -> [(&'static str, Vec<f64>, Vec<f64>); 4] {
    let (s, c) = 0.8f64.sin_cos();
    [
        ("cartesian-chain-2", vec![s, -c, s + c, -c - s], vec![c, s, c + 0.5 * s, s + 0.5 * c]),
        ("heavy-top", vec![1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c], {
            // Columns turn with the angular velocity (0.2, -0.3, 4) in space.
            let w = [0.2, -0.3, 4.0];
            let columns = [[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]];
            let turned = columns
                .map(|x: [f64; 3]| [w[1] * x[2] - w[2] * x[1], w[2] * x[0] - w[0] * x[2], w[0] * x[1] - w[1] * x[0]]);
            (0..9).map(|at| turned[at % 3][at / 3]).collect()
        }),
        ("chaplygin-sleigh", vec![0.0, 0.0, 0.8], vec![1.5 * c, 1.5 * s, -1.1]),
        ("schwarzschild-by-clock", vec![0.0, 8.0, 1.3, 0.4], vec![1.0, 0.05, 0.01, 0.04]),
    ]
}

#[test]
fn fixed_steps_have_their_order_and_stay_on_the_constraints() {
    for (name, q, v) in starts() {
        let model = model(name);
        let t_end = if name == "schwarzschild-by-clock" { 40.0 } else { 1.0 };
        let exact = last(&rollout(&*model, &q, &v, &RolloutOptions::reference(t_end, t_end)).complete().unwrap());
        for (method, order) in FIXED {
            let base = if order > 5.0 { 8.0 } else { 20.0 };
            let error = |steps: f64| {
                let options = RolloutOptions::new(t_end, t_end / base).method(method).step(t_end / steps);
                let motion = rollout_fixed(&*model, &q, &v, &options).complete().unwrap();
                let off = defect(&*model, &motion);
                assert!(off < 1e-12, "{name} {method:?}: {off:e} off the constraints");
                distance(&last(&motion), &exact)
            };
            let (coarse, fine) = (error(base), error(2.0 * base));
            let slope = (coarse / fine).log2();
            assert!((slope - order).abs() < 0.4 || fine < 3e-12, "{name} {method:?}: {slope} ({coarse:e}, {fine:e})");
        }
    }
}

#[test]
fn adaptive_steps_stay_on_the_constraints_with_their_tolerance() {
    for (name, q, v) in starts() {
        let model = model(name);
        let t_end = if name == "schwarzschild-by-clock" { 100.0 } else { 5.0 };
        let exact = rollout(&*model, &q, &v, &RolloutOptions::reference(t_end, t_end / 50.0)).complete().unwrap();
        for method in [Integrator::Dopri5, Integrator::Dop853] {
            for tolerance in [1e-5, 1e-8] {
                let options = RolloutOptions::new(t_end, t_end / 50.0).method(method).tolerances(tolerance, tolerance);
                let done = rollout(&*model, &q, &v, &options);
                let motion = done.trajectory;
                let (off, error) = (defect(&*model, &motion), distance(&last(&motion), &last(&exact)));
                assert!(done.stop.is_none() && motion.len() == 51);
                assert!(off < 1e-12, "{name} {method:?}: {off:e} off the constraints");
                assert!(error < 3e3 * tolerance, "{name} {method:?} {tolerance:e}: {error:e}");
                assert!(done.statistics.accepted < 3000, "{name}: {:?}", done.statistics);
            }
        }
    }
}

/// Over two hundred swings the symplectic forms keep the energy within a band and the rod to rounding; in double-double as well.
#[test]
fn energy_stays_in_its_band() {
    let pendulum = model("cartesian-chain-1");
    let (q, v) = ([0.6, -0.8], [0.0, 0.0]);
    for (method, bound) in [(Integrator::Midpoint, 2e-2), (Integrator::Gauss4, 2e-5)] {
        let options = RolloutOptions::new(400.0, 0.5).method(method).step(0.05);
        let motion = rollout(&*pendulum, &q, &v, &options).complete().unwrap();
        let energy = motion.energy.as_ref().unwrap();
        let worst = |part: &[f64]| part.iter().map(|e| (e - energy[0]).abs()).fold(0.0, f64::max);
        let (first, end) = (worst(&energy[..200]), worst(&energy[energy.len() - 200..]));
        assert!(first < bound && end < 1.5 * first, "{method:?}: {first:e} {end:e}");
        assert!(defect(&*pendulum, &motion) < 1e-12);
    }
    let wide = SystemInstance::<Dd>::named("cartesian-chain-1", &[]).unwrap().build().unwrap();
    let [q, v] = [q, v].map(|x| x.map(Dd::of));
    let q = [q[0], -(Dd::of(1.0) - q[0] * q[0]).sqrt()];
    let options = RolloutOptions::new(Dd::of(1.0), Dd::of(1.0)).method(Integrator::Gauss6).step(Dd::of(0.02));
    let end = rollout_fixed(&*wide, &q, &v, &options).complete().unwrap();
    let (q, _) = end.state(1);
    let length = (q[0] * q[0] + q[1] * q[1] - Dd::of(1.0)).to_f64().abs();
    assert!(length < 1e-27, "{length:e}");
}

#[test]
fn starts_are_brought_near_or_refused_with_their_distance() {
    let pendulum = model("cartesian-chain-1");
    for method in [Integrator::Dopri5, Integrator::Gauss4] {
        let options = RolloutOptions::new(1.0, 0.1).method(method);
        let near = rollout(&*pendulum, &[0.6003, -0.8], &[0.0, 0.0], &options).complete().unwrap();
        let (q, _) = near.state(0);
        assert!((q[0].hypot(q[1]) - 1.0).abs() < 1e-15 && (q[0] - 0.6003).abs() < 4e-4);
        match rollout(&*pendulum, &[0.66, -0.88], &[0.0, 0.0], &options).stop {
            Some(RolloutError::OffConstraints { constraint, distance, nearest }) => {
                assert_eq!(constraint, "rod 01");
                assert!((distance - 0.1).abs() < 1e-12 && (nearest[0] - 0.6).abs() < 1e-12);
            }
            other => panic!("{other:?}"),
        }
        // A velocity along the rod.
        match rollout(&*pendulum, &[0.6, -0.8], &[0.6, -0.8], &options).stop {
            Some(RolloutError::OffConstraints { distance, .. }) => assert!((distance - 1.0).abs() < 1e-12),
            other => panic!("{other:?}"),
        }
    }
}

/// A rhombus that folds flat: there its rows depend on each other, and the motion ends with that said.
#[test]
fn a_linkage_that_folds_stops_where_its_rows_lose_their_rank() {
    let names = ["x1", "y1", "x2", "y2"];
    let formula = "(x1_dot^2 + y1_dot^2 + x2_dot^2 + y2_dot^2)/2";
    let bars = [("a", "x1^2 + y1^2 - 1"), ("b", "(x2 - x1)^2 + (y2 - y1)^2 - 4"), ("c", "(x2 - 2)^2 + y2^2 - 1")];
    let free = Mechanics::<_, f64>::new(ExpressionLagrangian::new(&names, &[], formula).unwrap(), []);
    let model = Constrained::new(free, ExpressionConstraints::new(&names, &[], &bars).unwrap(), []).unwrap();
    // Both cranks turn alike with one radian per second: flat after one.
    let (s, c) = 1.0f64.sin_cos();
    let start = ([c, s, 2.0 + c, s], [s, -c, s, -c]);
    let options = RolloutOptions::new(2.0, 0.01).method(Integrator::Dopri5);
    let done = rollout(&model, &start.0, &start.1, &options);
    assert!(
        done.stop.is_none() || done.stop.as_ref().and_then(RolloutError::time).is_some_and(|t| (t - 1.0).abs() < 0.05)
    );
    // At rest in the flat position nothing tells the branches apart.
    let flat = rollout(&model, &[1.0, 0.0, 3.0, 0.0], &[0.0; 4], &options);
    assert!(matches!(flat.stop, Some(RolloutError::DependentConstraint { t: 0.0, .. })), "{:?}", flat.stop);
}

#[test]
fn forces_from_outside_act_within_the_constraints() {
    // A torque about the pivot lifts the bob by its work: F = (-y, x) f turns with constant power per angle.
    let pendulum = model("cartesian-chain-1");
    let push = |_: f64, q: &[f64], _: &[f64], force: &mut [f64]| (force[0], force[1]) = (-3.0 * q[1], 3.0 * q[0]);
    let driven = Driven::new(&*pendulum, &push);
    for method in [Integrator::Dop853, Integrator::Gauss6, Integrator::Variational] {
        let options = RolloutOptions::new(0.5, 0.005)
            .method(method)
            .step(method.is_structure_preserving().then_some(1e-3))
            .tolerances(1e-9, 1e-8);
        let motion = driven.rollout(&[0.0, -1.0], &[0.0, 0.0], &options).complete().unwrap();
        let energy = motion.energy.as_ref().unwrap();
        let end = last(&motion);
        let angle = end[0].atan2(-end[1]);
        let gained = energy[energy.len() - 1] - energy[0];
        assert!(angle > 0.1 && (gained - 3.0 * angle).abs() < 1e-5, "{method:?}: {gained} {angle}");
    }
}

/// Two wheels, `b = 2a + 0.3`, held by a formula.
fn gear(formula: &str) -> impl EulerLagrange<f64> {
    let lagrangian = ExpressionLagrangian::new(&["a", "b"], &[], "(a_dot^2 + 2*b_dot^2)/2 - 0.1*cos(a)").unwrap();
    let rows = ExpressionConstraints::new(&["a", "b"], &[], &[("gear", formula)]).unwrap();
    Constrained::new(Mechanics::<_, f64>::new(lagrangian, []), rows, []).unwrap()
}

#[test]
fn a_motion_ends_where_a_constraint_has_a_second_branch() {
    for method in Integrator::ALL {
        for sign in [1.0, -1.0] {
            let options = RolloutOptions::new(6.0, 0.02).method(method);
            // Wheels that turn on and on. The cosine vanishes with its gradient where b is a whole number of half turns.
            let (q, v) = ([0.0, 0.3], [sign * 1.0, sign * 2.0]);
            let stopped = rollout(&gear("cos(b) - cos(2*a + 0.3)"), &q, &v, &options);
            // The sine of the difference is regular wherever they are.
            let whole = rollout(&gear("sin(b - 2*a - 0.3)"), &q, &v, &options).complete().unwrap();
            let end = last(&whole);
            assert!((end[1] - 2.0 * end[0] - 0.3).abs() < 1e-9 && end[0] * sign > 4.0, "{method:?}: {end:?}");
            let Some(RolloutError::SecondBranch { t, constraint: 0, at, .. }) = stopped.stop else {
                panic!("{method:?}: {:?}", stopped.stop);
            };
            let edge = if sign < 0.0 { 0.0 } else { std::f64::consts::PI };
            let b = |time: f64| whole.q[2 * whole.t.iter().position(|x| *x >= time).unwrap() + 1];
            assert!(t <= at && (b(at) - edge).abs() < 0.06, "{method:?}: {t} {at}");
            assert!(stopped.trajectory.q.iter().skip(1).step_by(2).all(|b| sign * (edge - b) > -1e-6), "{method:?}");
        }
    }
}

/// A rod whose bob goes round and round has one branch, however far it turns in a step.
#[test]
fn a_motion_that_turns_far_in_a_step_has_one_branch() {
    let pendulum = model("cartesian-chain-1");
    for (method, dt) in [(Integrator::Gauss6, 0.2), (Integrator::Dop853, 1.0), (Integrator::Variational, 0.02)] {
        let options = RolloutOptions::new(4.0, dt).method(method);
        let motion = rollout(&*pendulum, &[0.0, -1.0], &[9.0, 0.0], &options);
        assert!(motion.stop.is_none(), "{method:?}: {:?}", motion.stop);
    }
}

/// Forces that move a state as it moves are those that act on it, to within what the constraints carry.
#[test]
fn inverse_dynamics_divides_forces_between_the_outside_and_the_constraints() {
    for (name, q, v) in starts() {
        let model = model(name);
        let n = q.len();
        let rows = {
            let mut rows = ManifoldRows::default();
            model.manifold().unwrap().rows(&q, &v, &mut rows);
            rows.matrix
        };
        let push: Vec<f64> = (0..n).map(|i| 0.3 * (1.7 * i as f64 + 1.0).sin()).collect();
        let force = |_: f64, _: &[f64], _: &[f64], force: &mut [f64]| force.copy_from_slice(&push);
        let Ok(a) = Driven::new(&*model, &force).acceleration(0.0, &q, &v) else { continue };
        let found = InverseDynamics::of(&*model, &q, &v, &a).unwrap();
        // The shortest force from outside that does the same: nothing along the rows, and the rest of the push.
        for row in rows.chunks(n) {
            let along: f64 = row.iter().zip(&found.external).map(|(a, f)| a * f).sum();
            assert!(along.abs() < 1e-9, "{name}: {along}");
        }
        let parts = found.external.iter().zip(&found.constraint).map(|(a, b)| a + b);
        assert!(parts.zip(&found.generalized).all(|(sum, all)| (sum - all).abs() < 1e-9), "{name}");
        let shortest = found.external.clone();
        let again = |_: f64, _: &[f64], _: &[f64], force: &mut [f64]| force.copy_from_slice(&shortest);
        let same = Driven::new(&*model, &again).acceleration(0.0, &q, &v).unwrap();
        assert!(distance(&same, &a) < 1e-8, "{name}: {same:?} {a:?}");
        let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        assert!(length(&found.external) <= length(&push) + 1e-9, "{name}");
        // An acceleration off the constraints is refused with its distance, 50 along the first row.
        let size = length(&rows[..n]).sqrt();
        let off: Vec<f64> = a.iter().zip(&rows[..n]).map(|(a, row)| a + 50.0 * row / size).collect();
        match InverseDynamics::of(&*model, &q, &v, &off) {
            Err(MechanicsError::OffConstraints { row: 0, distance, .. }) => {
                assert!((distance - 50.0).abs() < 1e-6, "{name}: {distance}");
            }
            other => panic!("{name}: {other:?}"),
        }
    }
}
