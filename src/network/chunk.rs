//! Evaluation of a chunk of states by the forward identity: `n + 3` passes through the network.
//!
//! With `A = dL/dh` from one reverse sweep and `z[u]` the derivative of a layer's pre-activations along `u`,
//! `D2L[u, w] = sum over layers and units of A act''(z) z[u] z[w]`. `M` takes the directions `(0, e_i)`, `c` adds
//! `(v, 0)`; `p` and `g` fall out of the reverse sweep. All numbers here are in scaled coordinates.
//!
//! Buffers are planes `(channel, state, unit)`, so that the channels of a layer lie side by side and one matrix product
//! serves them all.

use crate::network::features::FeatureBatch;
use crate::network::{Architecture, Layout};
use crate::scalar::{Real, Scalar, vectorized};

/// How far a chunk is evaluated; each step includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// `L`: one pass.
    Value,
    /// `p`, `g`: two passes.
    Gradient,
    /// `M`: `n + 2` passes.
    MassMatrix,
    /// `c`: `n + 3` passes.
    Motion,
    /// As `Motion`, keeping what the adjoint identity needs.
    Training,
}

/// What a hidden layer leaves behind.
#[derive(Clone, Debug)]
pub(super) struct Hidden<S> {
    pub(super) width: usize,
    /// Pre-activations and their tangents `(channels, batch, width)`.
    pub(super) z: Vec<S>,
    /// Activations and their tangents `(channels, batch, width)`.
    pub(super) h: Vec<S>,
    /// First, second and third derivative of the activation `(batch, width)`.
    pub(super) slope: [Vec<S>; 3],
    /// `dL/dh`, `(batch, width)`.
    pub(super) adjoint: Vec<S>,
    /// `dL/dz`, `(batch, width)`.
    pub(super) z_adjoint: Vec<S>,
}

/// A chunk of states and everything computed of it; buffers are reused from call to call.
#[derive(Clone, Debug)]
pub struct Chunk<S> {
    pub(super) architecture: Architecture,
    pub(super) layout: Layout,
    pub(super) batch: usize,
    pub(super) features: FeatureBatch<S>,
    /// Features and their tangents `(channels, batch, features)`.
    phi: Vec<S>,
    phi_adjoint: Vec<S>,
    pub(super) hidden: Vec<Hidden<S>>,
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

/// Plane `k` of a buffer of planes of `size` numbers.
#[inline(always)]
pub(super) fn plane<S>(planes: &[S], k: usize, size: usize) -> &[S] {
    &planes[k * size..(k + 1) * size]
}

fn resize<S: Scalar>(buffer: &mut Vec<S>, length: usize) {
    buffer.resize(length, <S as Real>::zero());
}

impl<S: Scalar> Chunk<S> {
    /// An empty chunk for networks of this shape.
    pub fn new(architecture: &Architecture) -> Self {
        let layout = Layout::new(architecture);
        let hidden = layout
            .hidden()
            .iter()
            .map(|layer| Hidden {
                width: layer.outputs,
                z: Vec::new(),
                h: Vec::new(),
                slope: Default::default(),
                adjoint: Vec::new(),
                z_adjoint: Vec::new(),
            })
            .collect();
        Self {
            architecture: architecture.clone(),
            layout,
            batch: 0,
            features: FeatureBatch::default(),
            phi: Vec::new(),
            phi_adjoint: Vec::new(),
            hidden,
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
        let channels = match depth {
            Depth::Value | Depth::Gradient => 1,
            Depth::MassMatrix => 1 + n,
            Depth::Motion | Depth::Training => 2 + n,
        };
        self.features.fill(&self.architecture, q, v);
        self.fill_feature_planes(channels);
        for l in 0..self.hidden.len() {
            self.forward_layer(weights, l, channels, depth);
        }
        self.finish_value(weights);
        if depth >= Depth::Gradient {
            self.reverse(weights, channels);
        }
    }

    fn fill_feature_planes(&mut self, channels: usize) {
        let (n, width) = (self.architecture.coordinates, self.layout.features());
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

    fn forward_layer(&mut self, weights: &[S], l: usize, channels: usize, depth: Depth) {
        let layer = self.layout.layers[l];
        let (before, after) = self.hidden.split_at_mut(l);
        let input = before.last().map_or(&self.phi, |previous| &previous.h);
        let hidden = &mut after[0];
        let (rows, size) = (channels * self.batch, self.batch * hidden.width);
        resize(&mut hidden.z, channels * size);
        resize(&mut hidden.h, channels * size);
        layer.apply(weights, rows, input, &mut hidden.z);
        let bias = &weights[layer.bias_range()];
        let (z, tangents) = hidden.z.split_at_mut(size);
        vectorized(
            #[inline(always)]
            || add_to_rows(z, bias),
        );
        let (h, h_tangents) = hidden.h.split_at_mut(size);
        let kept = match depth {
            Depth::Value => 0,
            Depth::Gradient => 1,
            Depth::MassMatrix | Depth::Motion => 2,
            Depth::Training => 3,
        };
        for slope in &mut hidden.slope[..kept] {
            resize(slope, size);
        }
        let [d1, d2, d3] = &mut hidden.slope;
        let activation = self.architecture.activation;
        match kept {
            0 => activation.value(z, h),
            1 => activation.jet1(z, h, d1),
            2 => activation.jet2(z, h, d1, d2),
            _ => activation.jet3(z, h, d1, d2, d3),
        }
        // Nothing reads the activations' tangents of the last hidden layer: the output is linear.
        if channels > 1 && l + 1 < self.layout.hidden().len() {
            vectorized(
                #[inline(always)]
                || {
                    for (h, z) in h_tangents.chunks_exact_mut(size).zip(tangents.chunks_exact(size)) {
                        for ((h, &z), &d1) in h.iter_mut().zip(z).zip(&*d1) {
                            *h = d1 * z;
                        }
                    }
                },
            );
        }
    }

    /// `L = w.h + alpha |v/s|^2`.
    fn finish_value(&mut self, weights: &[S]) {
        let n = self.architecture.coordinates;
        let alpha = S::of_f64(self.architecture.alpha);
        let output = &weights[self.layout.output_range()];
        let last = self.hidden.last().map_or(&self.phi, |hidden| &hidden.h);
        self.lagrangian.clear();
        vectorized(
            #[inline(always)]
            || {
                for (h, v) in last.chunks_exact(output.len()).zip(self.features.velocity.chunks_exact(n)) {
                    self.lagrangian.push(dot(h, output) + alpha * dot(v, v));
                }
            },
        );
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
        resize(&mut self.phi_adjoint, batch * self.layout.features());
        let output = &weights[self.layout.output_range()];
        let seed = match self.hidden.last_mut() {
            Some(last) => {
                resize(&mut last.adjoint, batch * output.len());
                &mut last.adjoint
            }
            None => &mut self.phi_adjoint,
        };
        seed.chunks_exact_mut(output.len()).for_each(|row| row.copy_from_slice(output));
        for l in (0..self.hidden.len()).rev() {
            let layer = self.layout.layers[l];
            let (before, after) = self.hidden.split_at_mut(l);
            let hidden = &mut after[0];
            if has_mass {
                let (mass, coriolis) = (&mut self.mass_matrix, &mut self.coriolis);
                vectorized(
                    #[inline(always)]
                    || add_second_derivatives(hidden, batch, n, &mut self.row, mass, coriolis),
                );
            }
            resize(&mut hidden.z_adjoint, batch * hidden.width);
            vectorized(
                #[inline(always)]
                || {
                    for ((out, &a), &d1) in hidden.z_adjoint.iter_mut().zip(&hidden.adjoint).zip(&hidden.slope[0]) {
                        *out = a * d1;
                    }
                },
            );
            let target = match before.last_mut() {
                Some(previous) => {
                    resize(&mut previous.adjoint, batch * layer.inputs);
                    &mut previous.adjoint
                }
                None => &mut self.phi_adjoint,
            };
            layer.pull_back(weights, batch, &hidden.z_adjoint, target);
        }
        self.finish_gradient(has_mass);
    }

    /// Pulls the adjoint of the features back to `p` and `g`; adds the terms of `alpha |v/s|^2`.
    fn finish_gradient(&mut self, has_mass: bool) {
        let (n, width) = (self.architecture.coordinates, self.layout.features());
        let twice_alpha = S::of_f64(2.0 * self.architecture.alpha);
        resize(&mut self.momentum, self.batch * n);
        resize(&mut self.dl_dq, self.batch * n);
        for state in 0..self.batch {
            let range = state * n..(state + 1) * n;
            let (dq, dv) = (&mut self.dl_dq[range.clone()], &mut self.momentum[range.clone()]);
            let adjoint = &self.phi_adjoint[state * width..(state + 1) * width];
            self.features.pull_back(&self.architecture, state, adjoint, dq, dv);
            for (p, &v) in dv.iter_mut().zip(&self.features.velocity[range]) {
                *p += twice_alpha * v;
            }
            if has_mass {
                for i in 0..n {
                    self.mass_matrix[(state * n + i) * n + i] += twice_alpha;
                }
            }
        }
    }
}

/// Adds `bias` to every row of a plane.
#[inline(always)]
fn add_to_rows<S: Scalar>(plane: &mut [S], bias: &[S]) {
    for row in plane.chunks_exact_mut(bias.len()) {
        for (z, &b) in row.iter_mut().zip(bias) {
            *z += b;
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

/// Dot product in independent partial sums of fixed order: vectorises, and errs less than a running sum.
#[inline(always)]
pub(super) fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    const LANES: usize = 16;
    let zero = <S as Real>::zero();
    let mut sums = [zero; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let mut rest = zero;
    for (&x, &y) in a_chunks.remainder().iter().zip(b_chunks.remainder()) {
        rest += x * y;
    }
    for (a, b) in a_chunks.zip(b_chunks) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    let mut width = LANES / 2;
    while width > 0 {
        for k in 0..width {
            sums[k] += sums[k + width];
        }
        width /= 2;
    }
    sums[0] + rest
}
