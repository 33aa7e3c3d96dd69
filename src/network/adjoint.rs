//! Parameter gradients by the adjoint identity: reverse mode over one forward jet, whatever `n` is.
//!
//! A loss `l(a, M)` with `lam = M^-1 dl/da` has the parameter gradient
//! `d/dtheta { D_(lam,0) L - D2L[(0,lam),(v,a)] + sum_ij G_ij D2L[(0,e_i),(0,e_j)] }`, `G = dl/dM` at fixed `a`
//! (the first two terms: Hamzaogullari and Ozakin, eqs. A.8 and A.9). On a surface `x(s,t)` with `x_s = (0, s)`,
//! `x_t = tau (v, 0) + (0, t)` and `x_st = -tau (s, 0)` every term is one mixed Taylor coefficient
//! `L_st = D2L[x_s, x_t] + DL[x_st]`: the first two with `s = -lam`, `t = a`, `tau = 1`; a term `gamma u u^T` of `G`
//! with `s = gamma u`, `t = u`, `tau = 0`. The tangents `z[s]`, `z[t]` are combinations of those the evaluation left, and
//! the adjoint of the mixed channel is the `dL/dz` it left: one forward pass, three reverse passes and four for the
//! weights, beside the `n + 3` of the evaluation.
//!
//! The same sweep, carried on to the features, gives the derivatives by the state: with `lam`, `a` held fixed, those of
//! `s = -lam`, `t = a`, `tau = 1` are `u da/dq` and `u da/dv` of `u = dl/da`, the explicit `v` of `x_t` included.

use crate::network::branch::Hidden;
use crate::network::planes::{add_rows, plane};
use crate::network::{Branch, Chunk};
use crate::scalar::{Real, Scalar, vectorized};

/// A list of mixed Taylor coefficients `L_st` whose sum is differentiated; vectors are in scaled coordinates.
#[derive(Clone, Debug, Default)]
pub struct Jets<S> {
    /// Which state of the chunk each jet starts from.
    pub state: Vec<usize>,
    /// Velocity direction `s`, `(jets, n)`.
    pub s: Vec<S>,
    /// Velocity direction `t`, `(jets, n)`.
    pub t: Vec<S>,
    /// Whether the second direction moves along `(v, 0)` too (`tau`), for all jets of the list.
    pub moving: bool,
}

impl<S> Jets<S> {
    /// Forgets all jets; keeps the buffers.
    pub fn clear(&mut self, moving: bool) {
        self.state.clear();
        self.s.clear();
        self.t.clear();
        self.moving = moving;
    }
}

/// Buffers of one hidden layer, planes `(channel, jet, unit)`.
#[derive(Clone, Debug, Default)]
struct JetPlanes<S> {
    /// Pre-activation tangents `z[s]`, `z[t]`, `z[st]`.
    z: Vec<S>,
    /// Activations `h`, `h[s]`, `h[t]`, `h[st]`.
    h: Vec<S>,
    /// Adjoints of `h`, `h[s]`, `h[t]`.
    h_adjoint: Vec<S>,
    /// Adjoints of `z`, `z[s]`, `z[t]`, `z[st]`.
    z_adjoint: Vec<S>,
}

/// Workspace of [`Adjoint::add_gradient`]; buffers are reused from call to call.
#[derive(Clone, Debug)]
pub struct Adjoint<S> {
    phi: Vec<S>,
    /// Adjoints of the features' channels value, `s`, `t`; empty if nobody asks.
    phi_adjoint: Vec<S>,
    /// Hidden layers of each branch.
    branches: Vec<Vec<JetPlanes<S>>>,
}

impl<S: Scalar> Adjoint<S> {
    /// A workspace for the networks that `chunk` evaluates.
    pub fn new(chunk: &Chunk<S>) -> Self {
        let branches = chunk.branches.iter().map(|planes| vec![JetPlanes::default(); planes.hidden.len()]).collect();
        Self { phi: Vec::new(), phi_adjoint: Vec::new(), branches }
    }

    /// Adds to `gradient` the derivative of `sum of L_st over jets` by every parameter.
    ///
    /// `chunk` must have been evaluated with `weights` to [`Depth::Training`](crate::network::Depth::Training).
    pub fn add_gradient(&mut self, chunk: &Chunk<S>, weights: &[S], jets: &Jets<S>, gradient: &mut [S]) {
        if !jets.state.is_empty() {
            self.phi_adjoint.clear();
            self.sweep(chunk, weights, jets, gradient);
        }
    }

    /// [`add_gradient`](Self::add_gradient) that also adds to `dq`, `dv`, both `(batch, n)`, the derivatives by the scaled
    /// states `q_i/s_i`, `v_i/s_i` of the chunk, the jets' directions `s` and `t` held fixed.
    ///
    /// With `s = -M^-1 u`, `t = a` and moving jets these are `u da/dq` and `u da/dv` of the accelerations
    /// `a = M^-1 (g - c)`.
    pub fn add_gradient_and_inputs(
        &mut self,
        chunk: &Chunk<S>,
        weights: &[S],
        jets: &Jets<S>,
        gradient: &mut [S],
        (dq, dv): (&mut [S], &mut [S]),
    ) {
        if jets.state.is_empty() {
            return;
        }
        let (n, width, count) = (chunk.architecture.coordinates, chunk.layout.features, jets.state.len());
        self.phi_adjoint.clear();
        self.phi_adjoint.resize(3 * count * width, <S as Real>::zero());
        self.sweep(chunk, weights, jets, gradient);
        for (j, &state) in jets.state.iter().enumerate() {
            let row = |channel: usize| plane(plane(&self.phi_adjoint, channel, count * width), j, width);
            let adjoint = [row(0), row(2), plane(&chunk.phi_adjoint, state, width)];
            let s = jets.moving.then(|| &jets.s[j * n..][..n]);
            let range = state * n..(state + 1) * n;
            let inputs = (&mut dq[range.clone()], &mut dv[range]);
            chunk.features.pull_back_jet(&chunk.architecture, state, adjoint, s, inputs);
        }
    }

    /// One forward and one reverse pass over the jets; the latter reaches the features if `phi_adjoint` has room for them.
    fn sweep(&mut self, chunk: &Chunk<S>, weights: &[S], jets: &Jets<S>, gradient: &mut [S]) {
        self.fill_feature_planes(chunk, jets);
        let branches = chunk.layout.branches.iter().zip(&chunk.branches);
        for ((branch, planes), layers) in branches.zip(&mut self.branches) {
            let (n, batch) = (chunk.architecture.coordinates, chunk.batch);
            let sweep = Sweep { branch, hidden: &planes.hidden, phi: &self.phi, weights, jets, n, batch };
            for l in 0..layers.len() {
                sweep.forward_layer(layers, l);
            }
            sweep.add_output_gradient(layers, gradient);
            for l in (0..layers.len()).rev() {
                sweep.reverse_layer(layers, l);
                sweep.add_layer_gradient(layers, l, gradient);
            }
            if let (Some(first), false) = (layers.first(), self.phi_adjoint.is_empty()) {
                let rows = 3 * jets.state.len();
                branch.layers[0].pull_back(weights, rows, true, &first.z_adjoint, &mut self.phi_adjoint);
            }
        }
    }

    /// Feature channels value, `s`, `t`, `st`.
    fn fill_feature_planes(&mut self, chunk: &Chunk<S>, jets: &Jets<S>) {
        let (n, width) = (chunk.architecture.coordinates, chunk.layout.features);
        let size = jets.state.len() * width;
        let zero = <S as Real>::zero();
        self.phi.resize(4 * size, zero);
        for (j, &state) in jets.state.iter().enumerate() {
            let (s, t) = (&jets.s[j * n..][..n], &jets.t[j * n..][..n]);
            let velocity = &chunk.features.velocity[state * n..][..n];
            let drift = |factor: &[S], i: usize| if jets.moving { factor[i] } else { zero };
            let (arch, features) = (&chunk.architecture, &chunk.features);
            let row = |k: usize| k * size + j * width..k * size + (j + 1) * width;
            self.phi[row(0)].copy_from_slice(&features.value[state * width..][..width]);
            features.tangent(arch, state, |_| zero, |i| s[i], &mut self.phi[row(1)]);
            features.tangent(arch, state, |i| drift(velocity, i), |i| t[i], &mut self.phi[row(2)]);
            features.tangent(arch, state, |i| -drift(s, i), |_| zero, &mut self.phi[row(3)]);
        }
    }
}

/// One branch of an evaluated chunk with the jets that start from its states.
struct Sweep<'a, S> {
    branch: &'a Branch,
    hidden: &'a [Hidden<S>],
    /// Feature channels `(4, jets, features)`.
    phi: &'a [S],
    weights: &'a [S],
    jets: &'a Jets<S>,
    n: usize,
    batch: usize,
}

impl<S: Scalar> Sweep<'_, S> {
    fn forward_layer(&self, layers: &mut [JetPlanes<S>], l: usize) {
        let (jets, n, batch) = (self.jets, self.n, self.batch);
        let count = jets.state.len();
        let layer = self.branch.layers[l];
        let hidden = &self.hidden[l];
        let size = count * hidden.width;
        let (before, after) = layers.split_at_mut(l);
        let input = before.last().map_or(self.phi, |previous| &previous.h);
        let out = &mut after[0];
        let zero = <S as Real>::zero();
        out.z.resize(3 * size, zero);
        out.h.resize(4 * size, zero);
        layer.apply(self.weights, count, plane(input, 3, count * layer.inputs), &mut out.z[2 * size..]);
        vectorized(
            #[inline(always)]
            || {
                for (j, &state) in jets.state.iter().enumerate() {
                    let (s, t) = (&jets.s[j * n..][..n], &jets.t[j * n..][..n]);
                    forward_row(hidden, batch, (j, state, count), (s, t, jets.moving), &mut out.z, &mut out.h);
                }
            },
        );
    }

    /// The output layer is linear: its gradient is the sum of `h[st]`.
    fn add_output_gradient(&self, layers: &[JetPlanes<S>], gradient: &mut [S]) {
        let output = self.branch.output_range();
        let last = layers.last().map_or(self.phi, |layer| &layer.h);
        let mixed = plane(last, 3, self.jets.state.len() * output.len());
        vectorized(
            #[inline(always)]
            || add_rows(mixed, &mut gradient[output]),
        );
    }

    /// Adjoints of a layer's pre-activations from those of its activations.
    fn reverse_layer(&self, layers: &mut [JetPlanes<S>], l: usize) {
        let count = self.jets.state.len();
        let is_last = l + 1 == layers.len();
        let layer = &mut layers[l];
        let hidden = &self.hidden[l];
        layer.z_adjoint.resize(4 * count * hidden.width, <S as Real>::zero());
        let above = if is_last { &[] } else { layer.h_adjoint.as_slice() };
        vectorized(
            #[inline(always)]
            || {
                for (j, &state) in self.jets.state.iter().enumerate() {
                    reverse_row(hidden, (j, state, count), &layer.z, above, &mut layer.z_adjoint);
                }
            },
        );
    }

    /// Weight and bias gradients of a layer, and the adjoints of the activations below it.
    fn add_layer_gradient(&self, layers: &mut [JetPlanes<S>], l: usize, gradient: &mut [S]) {
        let count = self.jets.state.len();
        let shape = self.branch.layers[l];
        let (before, after) = layers.split_at_mut(l);
        let layer = &after[0];
        let input = before.last().map_or(self.phi, |previous| &previous.h);
        shape.add_weight_gradient(4 * count, &layer.z_adjoint, input, gradient);
        if shape.bias.is_some() {
            // A bias enters the value channel alone.
            let value = plane(&layer.z_adjoint, 0, count * shape.outputs);
            vectorized(
                #[inline(always)]
                || add_rows(value, &mut gradient[shape.bias_range()]),
            );
        }
        if let Some(previous) = before.last_mut() {
            previous.h_adjoint.resize(3 * count * shape.inputs, <S as Real>::zero());
            shape.pull_back(self.weights, 3 * count, false, &layer.z_adjoint, &mut previous.h_adjoint);
        }
    }
}

/// `h[s] = act' z[s]`, `h[t] = act' z[t]`, `h[st] = act' z[st] + act'' z[s] z[t]` of jet `j`.
#[inline(always)]
fn forward_row<S: Scalar>(
    hidden: &Hidden<S>,
    batch: usize,
    (j, state, count): (usize, usize, usize),
    (s, t, moving): (&[S], &[S], bool),
    z: &mut [S],
    h: &mut [S],
) {
    let (width, size, source) = (hidden.width, count * hidden.width, batch * hidden.width);
    let tangent = |k: usize| plane(plane(&hidden.z, 1 + k, source), state, width);
    let (zs, rest) = z.split_at_mut(size);
    let (zt, zst) = rest.split_at_mut(size);
    let range = j * width..(j + 1) * width;
    let (zs, zt, zst) = (&mut zs[range.clone()], &mut zt[range.clone()], &zst[range.clone()]);
    for (z, &e) in zs.iter_mut().zip(tangent(0)) {
        *z = s[0] * e;
    }
    if moving {
        for ((z, &e), &v) in zt.iter_mut().zip(tangent(0)).zip(tangent(s.len())) {
            *z = v + t[0] * e;
        }
    } else {
        for (z, &e) in zt.iter_mut().zip(tangent(0)) {
            *z = t[0] * e;
        }
    }
    for i in 1..s.len() {
        for ((zs, zt), &e) in zs.iter_mut().zip(zt.iter_mut()).zip(tangent(i)) {
            *zs += s[i] * e;
            *zt += t[i] * e;
        }
    }
    let d1 = &plane(&hidden.slope[0], state, width)[..width];
    let d2 = &plane(&hidden.slope[1], state, width)[..width];
    h[range.clone()].copy_from_slice(plane(&hidden.h, state, width));
    let (hs, rest) = h[size..].split_at_mut(size);
    let (ht, hst) = rest.split_at_mut(size);
    let (hs, ht, hst) = (&mut hs[range.clone()][..width], &mut ht[range.clone()][..width], &mut hst[range][..width]);
    let (zs, zt, zst) = (&zs[..width], &zt[..width], &zst[..width]);
    for u in 0..width {
        hs[u] = d1[u] * zs[u];
        ht[u] = d1[u] * zt[u];
        hst[u] = d1[u] * zst[u] + d2[u] * (zs[u] * zt[u]);
    }
}

/// Adjoints of `z`, `z[s]`, `z[t]`, `z[st]` of jet `j`; `above` holds those of `h`, `h[s]`, `h[t]`, empty for zeros.
#[inline(always)]
fn reverse_row<S: Scalar>(
    hidden: &Hidden<S>,
    (j, state, count): (usize, usize, usize),
    z: &[S],
    above: &[S],
    z_adjoint: &mut [S],
) {
    let (width, size) = (hidden.width, count * hidden.width);
    let source = |planes| -> &[S] { &plane(planes, state, width)[..width] };
    let [d1, d2, d3] = &hidden.slope;
    let (d1, d2, d3, a) = (source(d1), source(d2), source(d3), source(&hidden.adjoint));
    let jet = |planes, k| -> &[S] { &plane(plane(planes, k, size), j, width)[..width] };
    let (zs, zt, zst) = (jet(z, 0), jet(z, 1), jet(z, 2));
    let (bar, rest) = z_adjoint.split_at_mut(size);
    let (bar_s, rest) = rest.split_at_mut(size);
    let (bar_t, bar_st) = rest.split_at_mut(size);
    let range = j * width..(j + 1) * width;
    bar_st[range.clone()].copy_from_slice(source(&hidden.z_adjoint));
    let (bar, bar_s, bar_t) =
        (&mut bar[range.clone()][..width], &mut bar_s[range.clone()][..width], &mut bar_t[range][..width]);
    if above.is_empty() {
        for u in 0..width {
            let curved = d2[u] * a[u];
            bar_s[u] = curved * zt[u];
            bar_t[u] = curved * zs[u];
            bar[u] = curved * zst[u] + d3[u] * a[u] * (zs[u] * zt[u]);
        }
    } else {
        let (h0, hs, ht) = (jet(above, 0), jet(above, 1), jet(above, 2));
        for u in 0..width {
            let curved = d2[u] * a[u];
            bar_s[u] = d1[u] * hs[u] + curved * zt[u];
            bar_t[u] = d1[u] * ht[u] + curved * zs[u];
            let first = d1[u] * h0[u] + d2[u] * (zs[u] * hs[u] + zt[u] * ht[u]);
            bar[u] = first + curved * zst[u] + d3[u] * a[u] * (zs[u] * zt[u]);
        }
    }
}
