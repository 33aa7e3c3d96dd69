//! A stiff model in another crate's implicit solver: the Radau method of the crate `differential-equations`, with exact Jacobians.
//!
//! Two carts on springs are joined by a damper so strong that they soon move as one. An explicit method would need a step for each ten
//! millionths of a second.

use differential_equations::linalg::Matrix;
use differential_equations::prelude::{IVP, ImplicitRungeKutta, ODE};
use lnn::lagrangian::{Dissipation, EulerLagrange, Lagrangian, Mechanics, Rayleigh, RightHandSide, WithForces};
use lnn::scalar::Real;

/// Unit masses on springs of unit stiffness.
struct Carts;

impl Lagrangian for Carts {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        q.iter().zip(v).fold(R::zero(), |l, (q, v)| l + (v.sqr() - q.sqr()) * R::half())
    }
}

/// A damper of 1e5 N s/m between them.
struct Damper;

impl Dissipation for Damper {
    fn dissipation<R: Real>(&self, _: &[R], v: &[R]) -> R {
        (v[0] - v[1]).sqr() * R::of(5e4)
    }
}

struct Motion<'a>(RightHandSide<'a, f64>);

impl ODE<f64, [f64; 4]> for Motion<'_> {
    fn diff(&self, _t: f64, x: &[f64; 4], dx: &mut [f64; 4]) {
        self.0.evaluate(x, dx);
    }
    fn jacobian(&self, _t: f64, x: &[f64; 4], matrix: &mut Matrix<f64>) {
        let mut exact = [0.0; 16];
        self.0.jacobian(x, &mut exact);
        (0..16).for_each(|k| matrix[(k / 4, k % 4)] = exact[k]);
    }
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = WithForces::new(Mechanics::<_, f64>::new(Carts, []), Rayleigh(Damper));
    let motion = Motion(model.rhs());
    let solver = ImplicitRungeKutta::radau5().rtol(1e-9).atol(1e-10);
    let solution = IVP::ode(&motion, 0.0, 3.0, [1.0, 0.0, 1.0, -1.0]).method(solver).solve();
    motion.0.outcome()?;
    let solution = solution.map_err(|error| format!("{error:?}"))?;
    let (t, x) = (solution.t[solution.t.len() - 1], solution.y[solution.y.len() - 1]);
    // Their mean moves as a cart alone; their distance creeps, at a rate of one in 2e5.
    let (error, distance) = ((x[0] + x[1]) / 2.0 - 0.5 * t.cos(), x[0] - x[1]);
    println!("{} steps; the mean is off by {error:.1e}", solution.t.len());
    assert!(t == 3.0 && solution.t.len() < 1000 && error.abs() < 1e-5 && (distance - 1.0).abs() < 1e-4, "{x:?}");
    Ok(())
}
