//! Rayleigh dissipation of a chunk of states: friction `-dD/dv` beside the forces of `L`.
//!
//! ```text
//! D(q, v) = sum_k A_k ln cosh(y_k),    A_k = softplus(gamma_k + w_k.f(q)),    y_k = b_k.(v/s),
//! ```
//!
//! `f(q)` the input features made of coordinates. `A_k > 0` and `ln cosh` is convex and even, so `D` is convex in `v` and the
//! power `v.dD/dv = sum_k A_k y_k tanh(y_k)` is a sum of numbers none of which is negative, in floating point too: whatever the
//! parameters, friction only takes energy away. A unit is viscous for small `|y|` (`dD/dy = A y`) and a dry friction of
//! constant size for large `|y|` (`dD/dy = +-A`). All numbers here are in scaled coordinates, as those of a [`Chunk`]:
//! `dD/d(v_i/s_i) = s_i dD/dv_i`.
//!
//! Source of the dissipation function: Rayleigh, Theory of Sound (1877), 81; Goldstein, Classical Mechanics, 1.5.

use crate::network::planes::{dot, resize};
use crate::network::{Activation, Chunk, DissipationLayout};
use crate::scalar::{Real, Scalar, vectorized};

/// Dissipation of the states of a chunk; buffers are reused from call to call.
#[derive(Clone, Debug)]
pub struct Dissipation<S> {
    layout: DissipationLayout,
    /// `gamma_k + w_k.f`, `(batch, K)`, `A_k` and its derivative.
    strength: [Vec<S>; 3],
    /// `y_k`, `(batch, K)`, `tanh(y_k)` and its derivative.
    direction: [Vec<S>; 3],
    /// Adjoints of one state's features, then those of its scaled coordinates and velocities.
    adjoint: Vec<S>,
    pulled: Vec<S>,
    /// `dD/d(v/s)`, `(batch, n)`: minus the generalized force.
    pub gradient: Vec<S>,
    /// Power taken away, `v.dD/dv`, `(batch)`, never negative.
    pub power: Vec<S>,
}

/// The parameters of all units.
#[derive(Clone, Copy)]
struct Parameters<'a, S> {
    gamma: &'a [S],
    /// `(K, F)`.
    weight: &'a [S],
    /// `(K, n)`.
    direction: &'a [S],
}

impl<'a, S> Parameters<'a, S> {
    fn of(layout: &DissipationLayout, weights: &'a [S]) -> Self {
        Self {
            gamma: &weights[layout.gamma_range()],
            weight: &weights[layout.weight_range()],
            direction: &weights[layout.direction_range()],
        }
    }
}

impl<S: Scalar> Dissipation<S> {
    /// The dissipation of the networks that `chunk` evaluates, if they have one.
    pub fn new(chunk: &Chunk<S>) -> Option<Self> {
        let layout = chunk.layout.dissipation?;
        Some(Self {
            layout,
            strength: Default::default(),
            direction: Default::default(),
            adjoint: Vec::new(),
            pulled: Vec::new(),
            gradient: Vec::new(),
            power: Vec::new(),
        })
    }

    /// Evaluates the states of `chunk`, which must have been evaluated itself (to any depth) with the same `weights`, all
    /// flat parameters of the network.
    ///
    /// Fills the public fields and keeps what the gradients need.
    pub fn evaluate(&mut self, chunk: &Chunk<S>, weights: &[S]) {
        let DissipationLayout { units, coordinates: n, .. } = self.layout;
        let parameters = Parameters::of(&self.layout, weights);
        let size = chunk.batch * units;
        let [z, strength, slope] = &mut self.strength;
        let [y, tanh, sech2] = &mut self.direction;
        for buffer in [&mut *z, &mut *strength, &mut *slope, &mut *y, &mut *tanh, &mut *sech2] {
            resize(buffer, size);
        }
        vectorized(
            #[inline(always)]
            || {
                for (state, (z, y)) in z.chunks_exact_mut(units).zip(y.chunks_exact_mut(units)).enumerate() {
                    let (features, velocity) = inputs(&self.layout, chunk, state);
                    pre_activations(&parameters, (features, velocity), z, y);
                }
            },
        );
        Activation::Softplus.jet1(z, strength, slope);
        Activation::Tanh.jet1(y, tanh, sech2);
        resize(&mut self.gradient, chunk.batch * n);
        resize(&mut self.power, chunk.batch);
        let rows = strength.chunks_exact(units).zip(y.chunks_exact(units).zip(tanh.chunks_exact(units)));
        let sums = self.gradient.chunks_exact_mut(n).zip(&mut self.power);
        vectorized(
            #[inline(always)]
            || {
                for ((strength, (y, tanh)), (gradient, power)) in rows.zip(sums) {
                    gradient.fill(<S as Real>::zero());
                    *power = <S as Real>::zero();
                    for (k, b) in parameters.direction.chunks_exact(n).enumerate() {
                        let force = strength[k] * tanh[k];
                        *power += force * y[k];
                        gradient.iter_mut().zip(b).for_each(|(sum, &b)| *sum += force * b);
                    }
                }
            },
        );
    }

    /// Adds to `gradient`, flat over all parameters of the network, the derivative of `sum_j u_j.dD/d(v/s)` by the
    /// parameters of the dissipation.
    ///
    /// `states` are the states of the chunk that the rows of `u`, `(states, n)` in scaled coordinates, belong to. The chunk
    /// is the one last evaluated, with these `weights`.
    pub fn add_gradient(&self, chunk: &Chunk<S>, weights: &[S], states: &[usize], u: &[S], gradient: &mut [S]) {
        let DissipationLayout { units, features: width, coordinates: n, offset } = self.layout;
        let directions = Parameters::of(&self.layout, weights).direction;
        let (gamma, rest) = gradient[offset..].split_at_mut(units);
        let (weight, direction) = rest.split_at_mut(units * width);
        vectorized(
            #[inline(always)]
            || {
                for (&state, u) in states.iter().zip(u.chunks_exact(n)) {
                    let (features, velocity) = inputs(&self.layout, chunk, state);
                    for (k, b) in directions.chunks_exact(n).enumerate() {
                        let at = state * units + k;
                        let along = dot(b, u);
                        let of_gamma = self.strength[2][at] * self.direction[1][at] * along;
                        gamma[k] += of_gamma;
                        let row = &mut weight[k * width..(k + 1) * width];
                        row.iter_mut().zip(features).for_each(|(sum, &f)| *sum += of_gamma * f);
                        let of_u = self.strength[1][at] * self.direction[1][at];
                        let of_velocity = self.strength[1][at] * self.direction[2][at] * along;
                        let row = &mut direction[k * n..(k + 1) * n];
                        for ((sum, &u), &v) in row.iter_mut().zip(u).zip(velocity) {
                            *sum += of_u * u + of_velocity * v;
                        }
                    }
                }
            },
        );
    }

    /// Adds to `dq` and `dv`, `(batch, n)` over the whole chunk, the derivative of `sum_j u_j.dD/d(v/s)` by the scaled
    /// coordinates `q/s` and velocities `v/s`; `u` as in [`Dissipation::add_gradient`].
    pub fn add_input_gradient(
        &mut self,
        chunk: &Chunk<S>,
        weights: &[S],
        states: &[usize],
        u: &[S],
        (dq, dv): (&mut [S], &mut [S]),
    ) {
        let DissipationLayout { units, features: width, coordinates: n, .. } = self.layout;
        let parameters = Parameters::of(&self.layout, weights);
        for (&state, u) in states.iter().zip(u.chunks_exact(n)) {
            self.adjoint.clear();
            self.adjoint.resize(width + n, <S as Real>::zero());
            let (of_features, of_velocity) = self.adjoint.split_at_mut(width);
            let pairs = parameters.weight.chunks_exact(width).zip(parameters.direction.chunks_exact(n));
            for (k, (w, b)) in pairs.enumerate() {
                let at = state * units + k;
                let along = dot(b, u);
                let of_gamma = self.strength[2][at] * self.direction[1][at] * along;
                of_features.iter_mut().zip(w).for_each(|(sum, &w)| *sum += of_gamma * w);
                let of_y = self.strength[1][at] * self.direction[2][at] * along;
                of_velocity.iter_mut().zip(b).for_each(|(sum, &b)| *sum += of_y * b);
            }
            resize(&mut self.pulled, 2 * n);
            let (pulled_q, pulled_v) = self.pulled.split_at_mut(n);
            chunk.features.pull_back(&chunk.architecture, state, &self.adjoint, pulled_q, pulled_v);
            let row = state * n..(state + 1) * n;
            dq[row.clone()].iter_mut().zip(pulled_q).for_each(|(sum, &mut x)| *sum += x);
            dv[row].iter_mut().zip(pulled_v).for_each(|(sum, &mut x)| *sum += x);
        }
    }
}

/// Features made of coordinates and scaled velocities of one state.
#[inline(always)]
fn inputs<'a, S>(layout: &DissipationLayout, chunk: &'a Chunk<S>, state: usize) -> (&'a [S], &'a [S]) {
    let n = layout.coordinates;
    let features = &chunk.features.value[state * chunk.layout.features..][..layout.features];
    (features, &chunk.features.velocity[state * n..(state + 1) * n])
}

/// `gamma_k + w_k.f` and `b_k.(v/s)` of one state.
#[inline(always)]
fn pre_activations<S: Scalar>(
    parameters: &Parameters<'_, S>,
    (features, velocity): (&[S], &[S]),
    z: &mut [S],
    y: &mut [S],
) {
    let units = parameters.gamma.iter().zip(parameters.weight.chunks_exact(features.len()));
    let units = units.zip(parameters.direction.chunks_exact(velocity.len()));
    for (((&gamma, w), b), (z, y)) in units.zip(z.iter_mut().zip(y)) {
        *z = gamma + dot(w, features);
        *y = dot(b, velocity);
    }
}
