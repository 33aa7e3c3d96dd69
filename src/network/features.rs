//! Input features of the network and their derivatives along jet directions.
//!
//! Scaled states are `q_i/s_i`, `v_i/s_i`. Every coordinate gives one feature `q_i/s_i`, or two, `sin q_i` and `cos q_i`,
//! when it is an embedded angle; every velocity gives `v_i/s_i`. No feature mixes coordinates, and only those of embedded
//! angles are curved. The directions of the forward and adjoint identities never meet that curvature: in every second
//! derivative they take, one direction has no coordinate part. Derivatives of those identities by the state do.

use crate::network::Architecture;
use crate::scalar::{Real, Scalar};

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

/// Features over [`Real`], for evaluation by nested forward numbers or on the scalar tape.
///
/// `q` and `v` of length `n` in physical units.
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

/// Features of a batch with their derivatives along the scaled coordinates.
#[derive(Clone, Debug, Default)]
pub struct FeatureBatch<S> {
    /// Feature values `(batch, features)`.
    pub value: Vec<S>,
    /// `d feature / d(q_i/s_i)` of the position features `(batch, position_features)`.
    pub slope: Vec<S>,
    /// Scaled velocities `(batch, n)`.
    pub velocity: Vec<S>,
}

impl<S: Scalar> FeatureBatch<S> {
    /// Computes the features of states `q`, `v`, both `(batch, n)` in physical units.
    pub fn fill(&mut self, architecture: &Architecture, q: &[S], v: &[S]) {
        let n = architecture.coordinates;
        self.value.clear();
        self.slope.clear();
        self.velocity.clear();
        for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
            for (i, &q) in q.iter().enumerate() {
                let scale = S::of_f64(architecture.scale[i]);
                if architecture.embeds(i) {
                    let (sin, cos) = q.sin_cos();
                    self.value.extend([sin, cos]);
                    self.slope.extend([scale * cos, -scale * sin]);
                } else {
                    self.value.push(q / scale);
                    self.slope.push(<S as Real>::one());
                }
            }
            for (&v, &scale) in v.iter().zip(&architecture.scale) {
                let scaled = v / S::of_f64(scale);
                self.value.push(scaled);
                self.velocity.push(scaled);
            }
        }
    }

    /// Tangents of one state's features along the scaled direction `(position, velocity)`, `(features)`.
    ///
    /// `position(i)` and `velocity(i)` give the components of the direction.
    pub fn tangent(
        &self,
        architecture: &Architecture,
        state: usize,
        position: impl Fn(usize) -> S,
        velocity: impl Fn(usize) -> S,
        out: &mut [S],
    ) {
        let width = architecture.position_features();
        let slope = &self.slope[state * width..(state + 1) * width];
        let mut k = 0;
        for i in 0..architecture.coordinates {
            for _ in 0..if architecture.embeds(i) { 2 } else { 1 } {
                out[k] = slope[k] * position(i);
                k += 1;
            }
        }
        for i in 0..architecture.coordinates {
            out[width + i] = velocity(i);
        }
    }

    /// Pulls adjoints of the features back to `(dL/d(q/s), dL/d(v/s))` of one state.
    pub fn pull_back(&self, architecture: &Architecture, state: usize, adjoint: &[S], dq: &mut [S], dv: &mut [S]) {
        let width = architecture.position_features();
        let slope = &self.slope[state * width..(state + 1) * width];
        let mut k = 0;
        for (i, dq) in dq.iter_mut().enumerate() {
            *dq = <S as Real>::zero();
            for _ in 0..if architecture.embeds(i) { 2 } else { 1 } {
                *dq += slope[k] * adjoint[k];
                k += 1;
            }
        }
        dv.copy_from_slice(&adjoint[width..]);
    }

    /// Adds the derivatives of a mixed coefficient `L_st` of one state by its scaled `q` and `v` to `dq`, `dv`.
    ///
    /// A position feature `f` enters the channels value, `s`, `t`, `st` of the jet by `f`, 0, `tau f' v_i`,
    /// `-tau f' s_i`, a velocity feature by its value alone. `adjoint` holds the derivatives of `L_st` by the features'
    /// channels value, `t`, `st`; `s` is the jet's first direction if it is moving (`tau = 1`), `None` if not. Embedded
    /// angles have `f'' = -s_i^2 f`, other features none.
    pub fn pull_back_jet(
        &self,
        architecture: &Architecture,
        state: usize,
        [value, t, mixed]: [&[S]; 3],
        s: Option<&[S]>,
        (dq, dv): (&mut [S], &mut [S]),
    ) {
        let n = architecture.coordinates;
        let width = architecture.position_features();
        let slope = &self.slope[state * width..(state + 1) * width];
        let features = &self.value[state * (width + n)..][..width];
        let velocity = &self.velocity[state * n..][..n];
        let mut k = 0;
        for i in 0..n {
            let embedded = architecture.embeds(i);
            for _ in 0..if embedded { 2 } else { 1 } {
                dq[i] += slope[k] * value[k];
                if let Some(s) = s {
                    dv[i] += slope[k] * t[k];
                    if embedded {
                        let scale = S::of_f64(architecture.scale[i]);
                        dq[i] -= scale * scale * features[k] * (velocity[i] * t[k] - s[i] * mixed[k]);
                    }
                }
                k += 1;
            }
            dv[i] += value[width + i];
        }
    }
}
