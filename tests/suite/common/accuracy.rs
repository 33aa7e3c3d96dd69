//! Errors of a system's outputs in units of rounding and condition.

use lnn::lagrangian::{self, Bounds, EulerLagrange, Request, SystemInstance, Terms};
use lnn::linalg::{self, Workspace};
use lnn::scalar::{Dd, Scalar};
use rand::Rng;

pub fn cast<S: Scalar, T: Scalar>(x: &[S]) -> Vec<T> {
    x.iter().map(|x| x.cast()).collect()
}

pub fn configure<S: Scalar>(name: &str, given: &[(&str, &str)]) -> SystemInstance<S> {
    let given: Vec<(String, String)> = given.iter().map(|&(s, t)| (s.into(), t.into())).collect();
    lagrangian::SystemInstance::named(name, &given).unwrap()
}

/// The same system, with the same numbers, in another precision.
pub fn recast<S: Scalar, T: Scalar>(system: &SystemInstance<S>) -> SystemInstance<T> {
    SystemInstance {
        system: system.system.clone(),
        coordinates: system.coordinates,
        parameters: cast(&system.parameters),
    }
}

/// A random state of a box, on the mass shell if the system has one.
pub fn random_state<S: Scalar>(system: &SystemInstance<S>, bounds: &Bounds, rng: &mut impl Rng) -> (Vec<S>, Vec<S>) {
    let mut draw = |b: &[(f64, f64)]| b.iter().map(|b| S::of_f64(rng.random_range(b.0..=b.1))).collect::<Vec<S>>();
    let (q, mut v) = (draw(&bounds.positions), draw(&bounds.velocities));
    system.impose_constraint(&q, &mut v).unwrap();
    (q, v)
}

/// Outputs of one state, by name.
pub fn outputs<S: Scalar>(system: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Vec<(&'static str, Vec<S>)> {
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

pub fn largest(x: &[Dd]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.to_f64().abs()))
}

/// What relative perturbations of the inputs (angles: reduced ones) do to each component of each output, summed over
/// the inputs.
pub fn input_conditions(system: &SystemInstance<Dd>, q: &[Dd], v: &[Dd], base: &[(&str, Vec<Dd>)]) -> Vec<Vec<f64>> {
    let step = Dd::of_f64(2f64.powi(-50));
    let n = q.len();
    let mut conditions: Vec<Vec<f64>> = base.iter().map(|(_, b)| vec![0.0; b.len()]).collect();
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
        let angle = k < n && system.system.coordinates(n)[k].periodic;
        let size = x.to_f64().abs().min(if angle { 2.0 * std::f64::consts::PI } else { f64::INFINITY });
        *x += Dd::of_f64(size) * step;
        let changed = outputs(&*moved.build().unwrap(), &q, &v);
        for ((condition, (_, a)), (_, b)) in conditions.iter_mut().zip(&changed).zip(base) {
            for ((condition, &a), &b) in condition.iter_mut().zip(a).zip(b) {
                *condition += ((a - b) / step).to_f64().abs();
            }
        }
    }
    conditions
}
