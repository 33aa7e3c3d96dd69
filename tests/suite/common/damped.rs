//! Motion that loses energy, with friction that is known.

use lnn::lagrangian::{EulerLagrange, GeneralizedForce, SystemInstance, WithForces};

/// A chain of pendula with friction in its joints, viscous and nearly dry.
pub type Damped = WithForces<Box<dyn EulerLagrange<f64>>, Joints>;

/// Friction in the joints of a chain of pendula.
pub struct Joints;

impl Joints {
    /// N m s.
    const VISCOUS: f64 = 0.3;
    /// N m, and the velocity in rad/s at which dry friction is nearly fully there.
    const DRY: (f64, f64) = (1.0, 0.5);

    /// Torque that resists joint `i`.
    fn torque(v: &[f64], i: usize) -> f64 {
        let bend = if i == 0 { v[0] } else { v[i] - v[i - 1] };
        Self::VISCOUS * bend + Self::DRY.0 * (bend / Self::DRY.1).tanh()
    }
}

impl GeneralizedForce<f64> for Joints {
    fn force(&self, _q: &[f64], v: &[f64], force: &mut [f64]) {
        let n = v.len();
        for i in 0..n {
            let above = if i + 1 < n { Self::torque(v, i + 1) } else { 0.0 };
            force[i] = above - Self::torque(v, i);
        }
    }
}

/// `n` damped pendula of 1 m and 1 kg in the Earth's gravity.
pub fn chain(n: usize) -> Damped {
    let configured = SystemInstance::named("n-pendulum", &[("n".to_string(), n.to_string())]).unwrap();
    WithForces::new(configured.build().unwrap(), Joints)
}
