//! The network as a [`Lagrangian`] over [`Real`]: slow, obvious, good for any derivative.

use crate::lagrangian::Lagrangian;
use crate::network::features::features;
use crate::network::{Architecture, Layout};
use crate::scalar::Real;

impl Lagrangian for Architecture {
    fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// `L` of states in physical units; `parameters` are the flat weights. Angles are taken as they are, not wrapped.
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let layout = Layout::new(self);
        let mut h = features(self, q, v);
        let velocities = &h[layout.position_features..];
        let quadratic = velocities.iter().fold(R::zero(), |sum, &v| sum + v * v) * R::from_f64(self.alpha);
        let last = layout.layers.len() - 1;
        for (k, layer) in layout.layers.iter().enumerate() {
            let rows = parameters[layer.weight_range()].chunks_exact(layer.inputs);
            let mut z: Vec<R> =
                rows.map(|row| row.iter().zip(&h).fold(R::zero(), |sum, (&w, &h)| sum + w * h)).collect();
            for (z, &b) in z.iter_mut().zip(&parameters[layer.bias_range()]) {
                *z += b;
            }
            h = if k == last { z } else { z.into_iter().map(|z| self.activation.apply(z)).collect() };
        }
        h[0] + quadratic
    }
}
