//! One branch on a batch: the forward pass over all channels and the reverse pass of the value.

use crate::network::depth::Depth;
use crate::network::planes::{add_to_rows, dot, resize};
use crate::network::{Branch, Layer};
use crate::scalar::{Scalar, vectorized};

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

impl<S: Scalar> Hidden<S> {
    fn new(layer: &Layer) -> Self {
        Self {
            width: layer.outputs,
            z: Vec::new(),
            h: Vec::new(),
            slope: Default::default(),
            adjoint: Vec::new(),
            z_adjoint: Vec::new(),
        }
    }

    /// Value and tangents of the layer; the activations' tangents only if `passes_tangents`.
    fn forward(
        &mut self,
        layer: &Layer,
        weights: &[S],
        input: &[S],
        (batch, channels, depth): (usize, usize, Depth),
        passes_tangents: bool,
    ) {
        let (rows, size) = (channels * batch, batch * self.width);
        resize(&mut self.z, channels * size);
        resize(&mut self.h, channels * size);
        layer.apply(weights, rows, input, &mut self.z);
        let (z, tangents) = self.z.split_at_mut(size);
        if layer.bias.is_some() {
            let bias = &weights[layer.bias_range()];
            vectorized(
                #[inline(always)]
                || add_to_rows(z, bias),
            );
        }
        let (h, h_tangents) = self.h.split_at_mut(size);
        let kept = depth.slopes();
        for slope in &mut self.slope[..kept] {
            resize(slope, size);
        }
        let [d1, d2, d3] = &mut self.slope;
        let activation = layer.activation;
        match kept {
            0 => activation.value(z, h),
            1 => activation.jet1(z, h, d1),
            2 => activation.jet2(z, h, d1, d2),
            _ => activation.jet3(z, h, d1, d2, d3),
        }
        if passes_tangents {
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
}

/// The hidden layers of a branch, input to output.
#[derive(Clone, Debug)]
pub(super) struct BranchPlanes<S> {
    pub(super) hidden: Vec<Hidden<S>>,
}

impl<S: Scalar> BranchPlanes<S> {
    pub(super) fn new(branch: &Branch) -> Self {
        Self { hidden: branch.hidden().iter().map(Hidden::new).collect() }
    }

    /// Forward pass from the features `phi`, `(channels, batch, features)`.
    pub(super) fn forward(
        &mut self,
        branch: &Branch,
        weights: &[S],
        phi: &[S],
        batch: usize,
        channels: usize,
        depth: Depth,
    ) {
        let layers = branch.hidden();
        for (l, layer) in layers.iter().enumerate() {
            let (before, after) = self.hidden.split_at_mut(l);
            let input = before.last().map_or(phi, |previous| &previous.h);
            // Nothing reads the activations' tangents of the last hidden layer: the output is linear.
            let passes_tangents = channels > 1 && l + 1 < layers.len();
            after[0].forward(layer, weights, input, (batch, channels, depth), passes_tangents);
        }
    }

    /// Adds the branch's output `w.h` to `lagrangian`, `(batch)`.
    pub(super) fn add_value(&self, branch: &Branch, weights: &[S], phi: &[S], lagrangian: &mut [S]) {
        let output = &weights[branch.output_range()];
        let last = self.hidden.last().map_or(phi, |hidden| &hidden.h);
        vectorized(
            #[inline(always)]
            || {
                for (sum, h) in lagrangian.iter_mut().zip(last.chunks_exact(output.len())) {
                    *sum += dot(h, output);
                }
            },
        );
    }

    /// Reverse pass: leaves `dL/dh` and `dL/dz` in every hidden layer and adds `dL/d phi` to `phi_adjoint`.
    pub(super) fn reverse(&mut self, branch: &Branch, weights: &[S], batch: usize, phi_adjoint: &mut [S]) {
        let output = &weights[branch.output_range()];
        match self.hidden.last_mut() {
            Some(last) => {
                resize(&mut last.adjoint, batch * output.len());
                last.adjoint.chunks_exact_mut(output.len()).for_each(|row| row.copy_from_slice(output));
            }
            None => add_to_rows(phi_adjoint, output),
        }
        for (l, layer) in branch.hidden().iter().enumerate().rev() {
            let (before, after) = self.hidden.split_at_mut(l);
            let hidden = &mut after[0];
            resize(&mut hidden.z_adjoint, batch * hidden.width);
            vectorized(
                #[inline(always)]
                || {
                    for ((out, &a), &d1) in hidden.z_adjoint.iter_mut().zip(&hidden.adjoint).zip(&hidden.slope[0]) {
                        *out = a * d1;
                    }
                },
            );
            match before.last_mut() {
                Some(previous) => {
                    resize(&mut previous.adjoint, batch * layer.inputs);
                    layer.pull_back(weights, batch, false, &hidden.z_adjoint, &mut previous.adjoint);
                }
                None => layer.pull_back(weights, batch, true, &hidden.z_adjoint, phi_adjoint),
            }
        }
    }
}
