//! Input features of the network.
//!
//! Every coordinate gives one feature `q_i/s_i`, or two, `sin q_i` and `cos q_i`, when it is an embedded angle; every velocity
//! gives `v_i/s_i`. Cyclic coordinates give none. Those of a [`Radial`] group come last, two features each.

use crate::network::{Architecture, Radial};
use crate::scalar::Real;

impl Architecture {
    /// Input features made of coordinates: two per embedded angle and radial coordinate, one per other coordinate, none of cyclic
    /// ones.
    pub(crate) fn position_features(&self) -> usize {
        let seen = (0..self.coordinates).filter(|i| !self.form.cyclic.contains(i));
        seen.map(|i| if self.embeds(i) || self.form.is_radial(i) { 2 } else { 1 }).sum()
    }

    /// `true` if coordinate `i` enters by its sine and cosine.
    pub(crate) fn embeds(&self, i: usize) -> bool {
        self.embed_periodic && self.periodic[i]
    }

    /// Features made of the coordinates `q`, of length `n` in physical units.
    pub(super) fn position_features_of<R: Real>(&self, q: &[R]) -> Vec<R> {
        let mut features = Vec::with_capacity(self.position_features() + self.coordinates);
        let single = |i: usize| !self.form.cyclic.contains(&i) && !self.form.is_radial(i);
        for (i, &q) in q.iter().enumerate().filter(|(i, _)| single(*i)) {
            if self.embeds(i) {
                let (sin, cos) = q.sin_cos();
                features.extend([sin, cos]);
            } else {
                features.push(q / R::of(self.scale[i]));
            }
        }
        self.form.radial.iter().for_each(|group| group.add_features(q, &mut features));
        features
    }

    /// `v_i/s_i`.
    pub(super) fn scaled_velocities<R: Real>(&self, v: &[R]) -> Vec<R> {
        v.iter().zip(&self.scale).map(|(&v, &s)| v / R::of(s)).collect()
    }
}

impl Radial {
    /// `(x_i/R) ln(R/u)` and `u x_i/R^2` of every coordinate of the group.
    fn add_features<R: Real>(&self, q: &[R], features: &mut Vec<R>) {
        let unit = R::of(self.unit);
        let square = self.coordinates.iter().fold(R::zero(), |sum, &i| sum + q[i].sqr());
        let near = unit / square.sqrt();
        let far = -near.ln();
        for &i in &self.coordinates {
            let direction = q[i] / unit * near;
            features.extend([direction * far, direction * near]);
        }
    }
}
