//! Motion that loses energy, with friction that is known.

use lnn::lagrangian::{EulerLagrange, MechanicsError, Request, Terms, configure};
use lnn::linalg::Workspace;

/// A chain of pendula with friction in its joints, viscous and nearly dry.
pub struct Damped {
    /// The chain without friction.
    pub exact: Box<dyn EulerLagrange<f64>>,
}

impl Damped {
    /// N m s.
    const VISCOUS: f64 = 0.3;
    /// N m, and the velocity in rad/s at which dry friction is nearly fully there.
    const DRY: (f64, f64) = (1.0, 0.5);

    /// `n` pendula of 1 m and 1 kg in the Earth's gravity.
    pub fn chain(n: usize) -> Self {
        let configured = configure("n-pendulum", &[("n".to_string(), n.to_string())]).unwrap();
        Self { exact: configured.build().unwrap() }
    }

    /// Torque that resists joint `i`, and the velocity of its bending.
    fn joint(v: &[f64], i: usize) -> (f64, f64) {
        let bend = if i == 0 { v[0] } else { v[i] - v[i - 1] };
        (Self::VISCOUS * bend + Self::DRY.0 * (bend / Self::DRY.1).tanh(), bend)
    }
}

impl EulerLagrange<f64> for Damped {
    fn coordinates(&self) -> usize {
        self.exact.coordinates()
    }
    fn conserves_energy(&self) -> bool {
        false
    }
    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        let n = self.coordinates();
        self.exact.terms(q, v, request, terms)?;
        if request.includes(Request::FORCE) {
            for v in v.chunks_exact(n) {
                let joints: Vec<(f64, f64)> = (0..n).map(|i| Self::joint(v, i)).collect();
                terms.dissipation.push(joints.iter().map(|(torque, bend)| torque * bend).sum());
                let above = joints.iter().skip(1).map(|joint| joint.0).chain([0.0]);
                terms.force.extend(joints.iter().zip(above).map(|(below, above)| above - below.0));
            }
        }
        terms.complete(n, v, request, &mut Workspace::new())
    }
}
