//! Evaluation of a chunk of states by the forward identity: `n + 3` passes through the network.
//!
//! With `A = dL/dh` from one reverse sweep and `z[u]` the derivative of a layer's pre-activations along `u`,
//! `D2L[u, w] = sum over layers and units of A act''(z) z[u] z[w]`. `M` takes the directions `(0, e_i)`, `c` adds
//! `(v, 0)`; `p` and `g` fall out of the reverse sweep. All numbers here are in scaled coordinates.
//!
//! The branches of a network add up: so do their values, adjoints of the features and second derivatives.

use crate::network::branch::{BranchPlanes, Hidden};
use crate::network::depth::Depth;
use crate::network::features::FeatureBatch;
use crate::network::planes::{dot, plane, resize};
use crate::network::{Activation, Architecture, Layout};
use crate::scalar::{Real, Scalar, vectorized};

/// A chunk of states and everything computed of it; buffers are reused from call to call.
#[derive(Clone, Debug)]
pub struct Chunk<S> {
    pub(super) architecture: Architecture,
    pub(super) layout: Layout,
    pub(super) batch: usize,
    pub(super) features: FeatureBatch<S>,
    /// Features and their tangents `(channels, batch, features)`.
    phi: Vec<S>,
    pub(super) phi_adjoint: Vec<S>,
    pub(super) branches: Vec<BranchPlanes<S>>,
    row: [Vec<S>; 2],
    /// `L`, `(batch)`.
    pub lagrangian: Vec<S>,
    /// `dL/d(v/s)`, `(batch, n)`.
    pub momentum: Vec<S>,
    /// `dL/d(q/s)`, `(batch, n)`.
    pub dl_dq: Vec<S>,
    /// `d2L/d(v/s)2`, `(batch, n, n)`.
    pub mass_matrix: Vec<S>,
    /// `(d2L/d(v/s)d(q/s)) v/s`, `(batch, n)`.
    pub coriolis: Vec<S>,
}

impl<S: Scalar> Chunk<S> {
    /// An empty chunk for networks of this shape.
    pub fn new(architecture: &Architecture) -> Self {
        let layout = Layout::new(architecture);
        let branches = layout.branches.iter().map(BranchPlanes::new).collect();
        Self {
            architecture: architecture.clone(),
            layout,
            batch: 0,
            features: FeatureBatch::default(),
            phi: Vec::new(),
            phi_adjoint: Vec::new(),
            branches,
            row: Default::default(),
            lagrangian: Vec::new(),
            momentum: Vec::new(),
            dl_dq: Vec::new(),
            mass_matrix: Vec::new(),
            coriolis: Vec::new(),
        }
    }

    /// Number of coordinates `n`.
    pub fn coordinates(&self) -> usize {
        self.architecture.coordinates
    }

    /// Evaluates states `q`, `v`, both `(batch, n)` in physical units, with the flat parameters `weights`.
    ///
    /// Fills the public fields up to `depth`, in scaled coordinates.
    pub fn evaluate(&mut self, weights: &[S], q: &[S], v: &[S], depth: Depth) {
        self.batch = q.len() / self.architecture.coordinates;
        let n = self.architecture.coordinates;
        let channels = depth.channels(n);
        self.features.fill(&self.architecture, q, v);
        self.fill_feature_planes(channels);
        for (branch, planes) in self.layout.branches.iter().zip(&mut self.branches) {
            planes.forward(branch, weights, &self.phi, self.batch, channels, depth);
        }
        self.finish_value(weights);
        if depth >= Depth::Gradient {
            self.reverse(weights, channels);
        }
    }

    fn fill_feature_planes(&mut self, channels: usize) {
        let (n, width) = (self.architecture.coordinates, self.layout.features);
        let size = self.batch * width;
        let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
        resize(&mut self.phi, channels * size);
        self.phi[..size].copy_from_slice(&self.features.value);
        for k in 1..channels {
            for state in 0..self.batch {
                let out = &mut self.phi[k * size + state * width..][..width];
                let velocity = &self.features.velocity[state * n..][..n];
                if k <= n {
                    self.features.tangent(
                        &self.architecture,
                        state,
                        |_| zero,
                        |i| if i + 1 == k { one } else { zero },
                        out,
                    );
                } else {
                    self.features.tangent(&self.architecture, state, |i| velocity[i], |_| zero, out);
                }
            }
        }
    }

    /// `L = alpha |v/s|^2 + sum over branches of w.h`, the square of a time-like coordinate taken away.
    fn finish_value(&mut self, weights: &[S]) {
        let n = self.architecture.coordinates;
        let alpha = S::of_f64(self.architecture.alpha);
        self.lagrangian.clear();
        let time_like = self.architecture.time_like;
        self.lagrangian.extend(self.features.velocity.chunks_exact(n).map(|v| {
            let square = match time_like {
                Some(t) => dot(&v[..t], &v[..t]) + dot(&v[t + 1..], &v[t + 1..]) - v[t] * v[t],
                None => dot(v, v),
            };
            alpha * square
        }));
        for (branch, planes) in self.layout.branches.iter().zip(&self.branches) {
            planes.add_value(branch, weights, &self.phi, &mut self.lagrangian);
        }
    }

    fn reverse(&mut self, weights: &[S], channels: usize) {
        let (n, batch) = (self.architecture.coordinates, self.batch);
        let zero = <S as Real>::zero();
        let has_mass = channels > n;
        self.mass_matrix.clear();
        self.coriolis.clear();
        if has_mass {
            self.mass_matrix.resize(batch * n * n, zero);
        }
        if channels > n + 1 {
            self.coriolis.resize(batch * n, zero);
        }
        self.phi_adjoint.clear();
        self.phi_adjoint.resize(batch * self.layout.features, zero);
        for (branch, planes) in self.layout.branches.iter().zip(&mut self.branches) {
            planes.reverse(branch, weights, batch, &mut self.phi_adjoint);
            if !has_mass {
                continue;
            }
            for (layer, hidden) in branch.hidden().iter().zip(&planes.hidden).rev() {
                // A linear layer has no curvature.
                if layer.activation != Activation::Identity {
                    let (mass, coriolis) = (&mut self.mass_matrix, &mut self.coriolis);
                    vectorized(
                        #[inline(always)]
                        || add_second_derivatives(hidden, batch, n, &mut self.row, mass, coriolis),
                    );
                }
            }
        }
        self.finish_gradient(has_mass);
    }

    /// Pulls the adjoint of the features back to `p` and `g`; adds the terms of `alpha |v/s|^2`.
    fn finish_gradient(&mut self, has_mass: bool) {
        let (n, width) = (self.architecture.coordinates, self.layout.features);
        let twice = |i: usize| S::of_f64(2.0 * self.architecture.quadratic_factor(i));
        resize(&mut self.momentum, self.batch * n);
        resize(&mut self.dl_dq, self.batch * n);
        for state in 0..self.batch {
            let range = state * n..(state + 1) * n;
            let (dq, dv) = (&mut self.dl_dq[range.clone()], &mut self.momentum[range.clone()]);
            let adjoint = &self.phi_adjoint[state * width..(state + 1) * width];
            self.features.pull_back(&self.architecture, state, adjoint, dq, dv);
            for (i, (p, &v)) in dv.iter_mut().zip(&self.features.velocity[range]).enumerate() {
                *p += twice(i) * v;
                if has_mass {
                    self.mass_matrix[(state * n + i) * n + i] += twice(i);
                }
            }
        }
    }
}

/// Adds one layer's share of `M` and `c`: the forward identity.
#[inline(always)]
fn add_second_derivatives<S: Scalar>(
    hidden: &Hidden<S>,
    batch: usize,
    n: usize,
    [curvature, along]: &mut [Vec<S>; 2],
    mass: &mut [S],
    coriolis: &mut [S],
) {
    let width = hidden.width;
    let size = batch * width;
    resize(curvature, width);
    resize(along, width);
    for state in 0..batch {
        let row = |planes| -> &[S] { plane(planes, state, width) };
        let tangent = |k: usize| row(plane(&hidden.z, 1 + k, size));
        for ((c, &a), &d2) in curvature.iter_mut().zip(row(&hidden.adjoint)).zip(row(&hidden.slope[1])) {
            *c = a * d2;
        }
        let mass = &mut mass[state * n * n..(state + 1) * n * n];
        for i in 0..n {
            for ((s, &c), &z) in along.iter_mut().zip(&*curvature).zip(tangent(i)) {
                *s = c * z;
            }
            for j in i..n {
                let share = dot(along, tangent(j));
                mass[i * n + j] += share;
                if j > i {
                    mass[j * n + i] += share;
                }
            }
            if !coriolis.is_empty() {
                coriolis[state * n + i] += dot(along, tangent(n));
            }
        }
    }
}
