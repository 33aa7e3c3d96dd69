//! Input features of the network.
//!
//! Every coordinate gives one feature `q_i/s_i`, or two, `sin q_i` and `cos q_i`, when it is an embedded angle; every velocity
//! gives `v_i/s_i`.

use crate::network::Architecture;
use crate::scalar::Real;

impl Architecture {
    /// Input features made of coordinates: two per embedded angle, one per other coordinate.
    pub fn position_features(&self) -> usize {
        (0..self.coordinates).map(|i| if self.embeds(i) { 2 } else { 1 }).sum()
    }

    /// Whether coordinate `i` enters by its sine and cosine.
    pub fn embeds(&self, i: usize) -> bool {
        self.embed_periodic && self.periodic[i]
    }
}

/// Features of states `q`, `v` of length `n` in physical units.
pub fn features<R: Real>(architecture: &Architecture, q: &[R], v: &[R]) -> Vec<R> {
    let mut features = Vec::with_capacity(architecture.position_features() + architecture.coordinates);
    for (i, &q) in q.iter().enumerate() {
        if architecture.embeds(i) {
            let (sin, cos) = q.sin_cos();
            features.extend([sin, cos]);
        } else {
            features.push(q / R::from_f64(architecture.scale[i]));
        }
    }
    features.extend(v.iter().zip(&architecture.scale).map(|(&v, &s)| v / R::from_f64(s)));
    features
}
