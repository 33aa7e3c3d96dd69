//! The Lagrangian of a network, and its dissipation, over [`Real`]: evaluated as they stand on floats and forward numbers, recorded
//! as blocks on the tape.

use crate::lagrangian::Lagrangian;
use crate::network::structure::State;
use crate::network::{Architecture, Layer, Layout, LinearMap};
use crate::scalar::Real;

impl Lagrangian for Architecture {
    fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// `L` of states in physical units; `parameters` are the flat weights. Angles are taken as they are, not wrapped.
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let layout = Layout::new(self);
        let (positions, velocities) = (self.position_features_of(q), self.scaled_velocities(v));
        let outputs = |features: &[R]| {
            let mut branches = layout
                .branches
                .iter()
                .map(|branch| branch.layers.iter().fold(features.to_vec(), |h, layer| evaluate(layer, parameters, &h)));
            let first = branches.next().unwrap_or_default();
            branches.fold(first, |sum, more| sum.iter().zip(&more).map(|(&a, &b)| a + b).collect())
        };
        let state = State {
            positions: &positions,
            velocities: &velocities,
            constants: &parameters[layout.constants.clone()],
            alpha: self.alpha,
            time_like: self.time_like,
        };
        let learned = self.form.lagrangian(outputs, state);
        if self.form.known.is_some() { learned + self.known_lagrangian(parameters, q, v) } else { learned }
    }
}

impl Architecture {
    /// The Rayleigh dissipation `D = sum_k softplus(gamma_k + w_k.f(q)) ln cosh(b_k.(v/s))` of states in physical units, with the
    /// [joint friction](super::JointFriction) beside it; 0 for a network without friction. Friction is the generalized force `-dD/dv`.
    ///
    /// `f(q)` are the input features made of coordinates, `parameters` the flat weights. The unit of `D` is that of `L` per
    /// unit of time. Angles are taken as they are, not wrapped.
    pub fn rayleigh_dissipation<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let layout = Layout::new(self);
        let (positions, velocities) = (self.position_features_of(q), self.scaled_velocities(v));
        let joints = &parameters[layout.joint_friction.clone()];
        let sizes = self.form.sizes.as_ref();
        let size = |i: usize| sizes.map_or(1.0, |sizes| sizes.friction[i]);
        let joint = (!joints.is_empty()).then(|| self.form.joint_friction.dissipation(joints, &velocities, size));
        let Some(dissipation) = layout.dissipation else { return joint.unwrap_or(R::zero()) };
        let gamma = &parameters[dissipation.gamma_range()];
        let strength = R::affine(&parameters[dissipation.weight_range()], gamma, &positions);
        let along = R::affine(&parameters[dissipation.direction_range()], &[], &velocities);
        let (strength, along) = (strength.into_iter().map(R::softplus), along.into_iter().map(R::ln_cosh));
        let (strength, along): (Vec<R>, Vec<R>) = (strength.collect(), along.collect());
        strength
            .into_iter()
            .zip(along)
            .fold(joint.unwrap_or(R::zero()), |sum, (strength, along)| sum + strength * along)
    }
}

/// `act(W x + b)`.
fn evaluate<R: Real>(layer: &Layer, parameters: &[R], x: &[R]) -> Vec<R> {
    let (weights, bias) = (&parameters[layer.weight_range()], &parameters[layer.bias_range()]);
    let mut z: Vec<R> = match layer.map {
        LinearMap::Dense => R::affine(weights, bias, x),
        LinearMap::Diagonal => weights.iter().zip(x).map(|(&gamma, &x)| gamma * x).collect(),
        LinearMap::Scalar => x.iter().map(|&x| weights[0] * x).collect(),
    };
    if layer.map != LinearMap::Dense {
        z.iter_mut().zip(bias).for_each(|(z, &b)| *z += b);
    }
    z.into_iter().map(|z| layer.activation.apply(z)).collect()
}
