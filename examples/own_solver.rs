//! A user's Lagrangian in a user's solver: a pendulum hanging from a cart, by the Dopri5 of `ode_solvers`.
//!
//! Energy and horizontal momentum are conserved; both are compared with their values at the start.

use lnn::lagrangian::{EulerLagrange, Lagrangian, Mechanics, Request, RightHandSide, Terms};
use lnn::scalar::Real;
use nalgebra::SVector;
use ode_solvers::{Dopri5, System};

/// Coordinates: place of the cart in m, angle of the pendulum in rad. Parameters: cart, bob (kg), rod (m), g (m/s^2).
struct CartAndPendulum;

impl Lagrangian for CartAndPendulum {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let [cart, bob, rod, g] = [p[0], p[1], p[2], p[3]];
        let (sin, cos) = (q[1].sin(), q[1].cos());
        let bob_speed_squared = (v[0] + rod * v[1] * cos).sqr() + (rod * v[1] * sin).sqr();
        (cart * v[0].sqr() + bob * bob_speed_squared) * R::half() + bob * g * rod * cos
    }
}

struct Motion<'r, 'a>(&'r RightHandSide<'a, f64>);

impl System<f64, SVector<f64, 4>> for Motion<'_, '_> {
    fn system(&self, _t: f64, x: &SVector<f64, 4>, dx: &mut SVector<f64, 4>) {
        self.0.evaluate(x.as_slice(), dx.as_mut_slice());
    }
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = Mechanics::new(CartAndPendulum, vec![1.5, 0.6, 0.9, 9.81]);
    let motion = model.rhs();
    let start = SVector::from([0.0, 2.5, 0.3, 0.0]);
    let mut solver = Dopri5::new(Motion(&motion), 0.0, 20.0, 0.05, start, 1e-11, 1e-11);
    solver.set_output(ode_solvers::OutputType::Sparse);
    let work = solver.integrate();
    motion.outcome()?;
    println!("{}", work?);

    // Conserved quantities of all states at once.
    let (q, v): (Vec<_>, Vec<_>) = solver.y_out().iter().map(|x| ([x[0], x[1]], [x[2], x[3]])).unzip();
    let mut terms = Terms::default();
    model.terms(q.as_flattened(), v.as_flattened(), Request::ENERGY, &mut terms)?;
    let spread = |x: &mut dyn Iterator<Item = f64>| {
        let (low, high) = x.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        high - low
    };
    let energy = spread(&mut terms.energy.iter().copied());
    let momentum = spread(&mut terms.momentum.iter().step_by(2).copied());
    println!("{} states, energy constant to {energy:.1e} J, momentum to {momentum:.1e} kg m/s", q.len());
    // 3,000 steps, each allowed an error of 1e-11 (1 + |x|).
    assert!(q.len() > 100 && energy < 1e-7 && momentum < 1e-7, "not conserved");
    Ok(())
}
