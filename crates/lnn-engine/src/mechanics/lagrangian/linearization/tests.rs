use super::*;
use crate::lagrangian::{
    Description, Dissipation, Interruptible, Lagrangian, Mechanics, Rayleigh, System, SystemInstance, WithForces,
    constrained_descriptions, project,
};
use crate::scalar::Dd;
use std::borrow::Cow;

type Given = Vec<(String, String)>;

/// Builds the same model with another number type and one changed parameter.
trait Family {
    fn model<S: Scalar>(&self, changed: Option<(usize, S)>) -> Box<dyn EulerLagrange<S>>;
    fn parameters(&self) -> usize;
}

/// A system with the values of its parameters.
struct Of<'a>(&'a System);

impl Family for Of<'_> {
    fn model<S: Scalar>(&self, changed: Option<(usize, S)>) -> Box<dyn EulerLagrange<S>> {
        let mut configured = SystemInstance::<S>::new(Cow::Owned(self.0.clone()), &Given::new()).unwrap();
        if let Some((k, by)) = changed {
            configured.parameters[k] += by;
        }
        configured.build().unwrap()
    }
    fn parameters(&self) -> usize {
        self.0.parameters.len()
    }
}

/// Derivative of the accelerations by a small displacement of `x`, exact to 20 digits.
fn slope(f: impl Fn(Dd) -> Vec<Dd>) -> Vec<f64> {
    let h = Dd::of_f64(1e-9);
    let (ahead, behind) = (f(h), f(-h));
    ahead.iter().zip(&behind).map(|(&a, &b)| ((a - b) / (h + h)).to_f64()).collect()
}

/// Compares every derivative with differences of double-double accelerations.
fn check(name: &str, family: &impl Family, (q, v): (&[f64], &[f64]), tolerance: f64) {
    let n = q.len();
    let model = family.model::<f64>(None);
    let wide = family.model::<Dd>(None);
    let mut linearizer = Linearizer::new(&*model);
    let found = linearizer.at(q, v).unwrap().clone();
    let lift = |x: &[f64]| x.iter().map(|&x| Dd::of_f64(x)).collect::<Vec<_>>();
    let size = found.by_q.iter().chain(&found.by_v).fold(1.0f64, |size, x| size.max(x.abs()));
    let near = |what: &str, found: f64, exact: f64| {
        assert!((found - exact).abs() <= tolerance * size.max(exact.abs()), "{name}, {what}: {found} for {exact}");
    };
    for j in 0..n {
        for (of_v, field) in [(false, &found.by_q), (true, &found.by_v)] {
            let exact = slope(|h| {
                let mut state = [lift(q), lift(v)];
                state[usize::from(of_v)][j] += h;
                wide.acceleration(&state[0], &state[1]).unwrap()
            });
            (0..n).for_each(|i| near(&format!("velocity {of_v} {i} {j}"), field[i * n + j], exact[i]));
        }
        let exact = slope(|h| {
            let push = move |_: &[Dd], _: &[Dd], force: &mut [Dd]| force[j] = h;
            WithForces::new(&*wide, push).acceleration(&lift(q), &lift(v)).unwrap_or_default()
        });
        if !exact.is_empty() {
            (0..n).for_each(|i| near("force", found.by_force[i * n + j], exact[i]));
        }
    }
    let w: Vec<f64> = (0..n).map(|i| 0.7 - 0.4 * i as f64).collect();
    let gradient = linearizer.gradient(q, v, &w).unwrap();
    for j in 0..n {
        for (left, right) in
            [(&gradient.by_q, &found.by_q), (&gradient.by_v, &found.by_v), (&gradient.by_force, &found.by_force)]
        {
            near("gradient", left[j], (0..n).map(|i| w[i] * right[i * n + j]).sum());
        }
    }
    assert_eq!(gradient.by_parameters.len(), family.parameters(), "{name}");
    for k in 0..family.parameters() {
        let exact = slope(|h| family.model(Some((k, h))).acceleration(&lift(q), &lift(v)).unwrap());
        near(&format!("parameter {k}"), gradient.by_parameters[k], exact.iter().zip(&w).map(|(a, w)| a * w).sum());
    }
}

#[test]
fn every_system_of_the_catalogue_is_linearized_exactly() {
    for system in System::unconstrained() {
        let n = system.size.default();
        let bounds = system.training(n);
        let within = |sides: &[(f64, f64)]| -> Vec<f64> {
            sides.iter().enumerate().map(|(i, b)| b.0 + (b.1 - b.0) * (0.57 + 0.03 * i as f64)).collect()
        };
        check(&system.name, &Of(system), (&within(&bounds.positions), &within(&bounds.velocities)), 1e-12);
    }
}

#[test]
fn systems_under_constraints_are_linearized_exactly() {
    for description in constrained_descriptions() {
        let system = description.compile().unwrap();
        let model = Of(&system).model::<f64>(None);
        let n = model.coordinates();
        if n > 6 {
            continue;
        }
        let bounds = system.validation(n);
        // The first of some states that can be projected onto the constraints.
        let allowed = (0..50).find_map(|k| {
            let within = |sides: &[(f64, f64)], by: f64| -> Vec<f64> {
                let part = |i: usize| (by * (k + 1) as f64 * (i + 1) as f64).fract();
                sides.iter().enumerate().map(|(i, b)| b.0 + part(i) * (b.1 - b.0)).collect()
            };
            let (mut q, mut v) = (within(&bounds.positions, 0.618), within(&bounds.velocities, 0.377));
            project(model.manifold()?, &mut q, &mut v).is_ok().then_some((q, v))
        });
        let (q, v) = allowed.unwrap();
        check(&system.name, &Of(&system), (&q, &v), 1e-10);
    }
}

#[test]
fn friction_shares_its_parameters_with_the_lagrangian_also_where_it_vanishes() {
    for c in ["0.3", "0"] {
        let text = format!(
            r#"{{"name": "arm", "lagrangian": "m*a_dot^2/2 + b_dot^2*(1 + a^2) + m*cos(a - b)",
            "dissipation": "c*(b_dot - a_dot)^2*m*(2 + sin(b))", "coordinates": [
            {{"name": "a", "bounds": [-1, 1], "velocity_bounds": [-1, 1]}},
            {{"name": "b", "bounds": [-1, 1], "velocity_bounds": [-1, 1]}}],
            "parameters": {{"m": {{"default": 3}}, "c": {{"default": {c}, "range": "at least 0"}}}}}}"#
        );
        let system = serde_json::from_str::<Description>(&text).unwrap().system().unwrap();
        check(c, &Of(&system), (&[0.4, -0.3], &[0.7, 0.2]), 1e-13);
    }
}

/// Two masses joined by a spring, under a force `-v^3` that is given in three ways.
struct Pair;

impl Lagrangian for Pair {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        v[0].sqr() + v[1].sqr() * (R::one() + q[0].sqr()) - (q[0] - q[1]).powi(4)
    }
}

struct Cubic;

impl Dissipation for Cubic {
    fn dissipation<R: Real>(&self, q: &[R], v: &[R]) -> R {
        (v[0].powi(4) * q[1].cos() + v[1].powi(4)) * R::of(0.25)
    }
}

/// A model that provides no derivatives.
struct Plain<M>(M);

impl<M: EulerLagrange<f64>> EulerLagrange<f64> for Plain<M> {
    fn coordinates(&self) -> usize {
        self.0.coordinates()
    }
    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        self.0.terms(q, v, request, terms)
    }
}

#[test]
fn functions_given_as_values_are_differentiated_numerically() {
    let pair = || Mechanics::<_, f64>::new(Pair, []);
    let exact = WithForces::new(pair(), Rayleigh(Cubic));
    let closure = |q: &[f64], v: &[f64], force: &mut [f64]| {
        force[0] = -v[0].powi(3) * q[1].cos();
        force[1] = -v[1].powi(3);
    };
    let by_closure = WithForces::new(pair(), closure);
    let plain = Plain(WithForces::new(pair(), Rayleigh(Cubic)));
    let (q, v, w) = ([0.3, -0.5, 1.2, 0.9], [1.0, 0.4, -0.7, 0.2], [0.3, 1.0, -0.4, 0.6]);
    let mut linearizer = Linearizer::new(&exact);
    let (expected, gradient) =
        (linearizer.at(&q, &v).unwrap().clone(), linearizer.gradient(&q, &v, &w).unwrap().clone());
    for model in [&by_closure as &dyn EulerLagrange<f64>, &plain] {
        let mut linearizer = Linearizer::new(model);
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-10 * (1.0 + b.abs()));
        let found = linearizer.at(&q, &v).unwrap();
        assert!(near(&found.by_q, &expected.by_q) && near(&found.by_v, &expected.by_v), "{found:?}, {expected:?}");
        assert_eq!(found.by_force, expected.by_force);
        let found = linearizer.gradient(&q, &v, &w).unwrap();
        assert!(near(&found.by_q, &gradient.by_q) && near(&found.by_v, &gradient.by_v));
    }
}

/// A Lagrangian with reversed sign.
struct Turned;

impl Lagrangian for Turned {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        -Pair.lagrangian(p, q, v)
    }
}

#[test]
fn what_is_not_positive_definite_and_what_is_interrupted_get_a_second_look() {
    let (pair, turned) = (Mechanics::<_, f64>::new(Pair, []), Mechanics::<_, f64>::new(Turned, []));
    let (q, v) = ([0.3, -0.5], [1.0, 0.4]);
    assert!([&pair as &dyn EulerLagrange<f64>, &turned].iter().all(|model| Linearizer::new(*model).whole.is_some()));
    let (mut ours, mut theirs) = (Linearizer::new(&turned), Linearizer::new(&pair));
    let (found, expected) = (ours.at(&q, &v).unwrap(), theirs.at(&q, &v).unwrap());
    let near = |a: &[f64], b: &[f64], sign: f64| a.iter().zip(b).all(|(a, b)| (a - sign * b).abs() < 1e-13);
    assert!(near(&found.by_q, &expected.by_q, 1.0) && near(&found.by_v, &expected.by_v, 1.0));
    assert!(near(&found.by_force, &expected.by_force, -1.0), "{found:?}, {expected:?}");
    let flag = core::sync::atomic::AtomicBool::new(false);
    let interruptible = Interruptible::new(&pair, &flag);
    let mut linearizer = Linearizer::new(&interruptible);
    assert!(linearizer.at(&q, &v).is_ok());
    flag.store(true, core::sync::atomic::Ordering::Relaxed);
    assert!(matches!(linearizer.at(&q, &v), Err(MechanicsError::Interrupted)));
}

#[test]
fn a_batch_is_its_states_and_failures_are_named() {
    let model = Of(&System::unconstrained()[0]).model::<f64>(None);
    let (q, v) = ([0.3, 0.1, -1.0, 2.0, 0.7, 0.4], [1.0, -2.0, 0.2, 0.3, 0.0, 0.5]);
    let mut linearizer = Linearizer::new(&*model);
    let all = linearizer.at(&q, &v).unwrap().clone();
    for row in 0..3 {
        let at = row * 2..row * 2 + 2;
        let one = linearizer.at(&q[at.clone()], &v[at]).unwrap();
        assert!(one.by_q.iter().zip(&all.by_q[row * 4..]).all(|(a, b)| (a - b).abs() < 1e-13));
    }
    assert_eq!(linearizer.at(&[], &[]).unwrap(), &Linearization::default());
    let broken = linearizer.at(&[0.3, 0.1, f64::NAN, 1.0], &[0.0; 4]).unwrap_err();
    assert_eq!(broken.row(), Some(1));
    assert!(matches!(linearizer.gradient(&q, &v, &[1.0]), Err(MechanicsError::Shape { .. })));
}
