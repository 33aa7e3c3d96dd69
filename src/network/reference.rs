//! The network as a [`Lagrangian`] over [`Real`]: slow, obvious, good for any derivative.

use crate::lagrangian::Lagrangian;
use crate::network::features::features;
use crate::network::{Architecture, Layer, Layout, LinearMap};
use crate::scalar::Real;

impl Lagrangian for Architecture {
    fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// `L` of states in physical units; `parameters` are the flat weights. Angles are taken as they are, not wrapped.
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let layout = Layout::new(self);
        let features = features(self, q, v);
        let velocities = &features[layout.position_features..];
        let quadratic = velocities.iter().fold(R::zero(), |sum, &v| sum + v * v) * R::from_f64(self.alpha);
        layout.branches.iter().fold(quadratic, |sum, branch| {
            let output = branch.layers.iter().fold(features.clone(), |h, layer| evaluate(layer, parameters, &h));
            sum + output[0]
        })
    }
}

/// `act(W x + b)`.
fn evaluate<R: Real>(layer: &Layer, parameters: &[R], x: &[R]) -> Vec<R> {
    let weights = &parameters[layer.weight_range()];
    let mut z: Vec<R> = match layer.map {
        LinearMap::Dense => weights
            .chunks_exact(layer.inputs)
            .map(|row| row.iter().zip(x).fold(R::zero(), |sum, (&w, &x)| sum + w * x))
            .collect(),
        LinearMap::Diagonal => weights.iter().zip(x).map(|(&gamma, &x)| gamma * x).collect(),
        LinearMap::Scalar => x.iter().map(|&x| weights[0] * x).collect(),
    };
    for (z, &b) in z.iter_mut().zip(&parameters[layer.bias_range()]) {
        *z += b;
    }
    z.into_iter().map(|z| layer.activation.apply(z)).collect()
}
