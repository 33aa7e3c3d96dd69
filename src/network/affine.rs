//! The three products of a layer's linear map with a batch; a "pass" through the network is one of them per layer.
//!
//! Biases are left to the caller: they enter the value channel alone, the products serve all channels at once.

use crate::linalg::{MatMut, MatRef, gemm};
use crate::network::planes::dot;
use crate::network::{Layer, LinearMap};
use crate::scalar::{Real, Scalar, vectorized};

impl Layer {
    fn matrix<'a, S>(&self, weights: &'a [S]) -> MatRef<'a, S> {
        MatRef::new(&weights[self.weight_range()], self.outputs, self.inputs)
    }

    /// `output = input W^T` for `rows` rows.
    pub(super) fn apply<S: Scalar>(&self, weights: &[S], rows: usize, input: &[S], output: &mut [S]) {
        if self.map != LinearMap::Dense {
            return self.stretch(weights, rows, false, input, output);
        }
        let output = MatMut::new(output, rows, self.outputs);
        gemm(output, false, <S as Real>::one(), MatRef::new(input, rows, self.inputs), self.matrix(weights).t());
    }

    /// `below = adjoint W`, or `below += adjoint W` to `accumulate`: adjoints of the inputs from those of the outputs.
    pub(super) fn pull_back<S: Scalar>(
        &self,
        weights: &[S],
        rows: usize,
        accumulate: bool,
        adjoint: &[S],
        below: &mut [S],
    ) {
        if self.map != LinearMap::Dense {
            return self.stretch(weights, rows, accumulate, adjoint, below);
        }
        let below = MatMut::new(below, rows, self.inputs);
        gemm(below, accumulate, <S as Real>::one(), MatRef::new(adjoint, rows, self.outputs), self.matrix(weights));
    }

    /// `gradient of W += adjoint^T input`, `gradient` flat over all parameters.
    pub(super) fn add_weight_gradient<S: Scalar>(&self, rows: usize, adjoint: &[S], input: &[S], gradient: &mut [S]) {
        let gradient = &mut gradient[self.weight_range()];
        let (adjoint, input) = (&adjoint[..rows * self.outputs], &input[..rows * self.inputs]);
        match self.map {
            LinearMap::Dense => {
                let gradient = MatMut::new(gradient, self.outputs, self.inputs);
                let adjoint = MatRef::new(adjoint, rows, self.outputs).t();
                gemm(gradient, true, <S as Real>::one(), adjoint, MatRef::new(input, rows, self.inputs));
            }
            LinearMap::Diagonal => vectorized(
                #[inline(always)]
                || {
                    for (z, x) in adjoint.chunks_exact(self.outputs).zip(input.chunks_exact(self.inputs)) {
                        for ((sum, &z), &x) in gradient.iter_mut().zip(z).zip(x) {
                            *sum += z * x;
                        }
                    }
                },
            ),
            LinearMap::Scalar => vectorized(
                #[inline(always)]
                || gradient[0] += dot(adjoint, input),
            ),
        }
    }

    /// `to = W from` or `to += W from` of the maps that mix no units and so are their own adjoints.
    fn stretch<S: Scalar>(&self, weights: &[S], rows: usize, accumulate: bool, from: &[S], to: &mut [S]) {
        let factors = &weights[self.weight_range()];
        let count = rows * self.outputs;
        // A single factor repeats from number to number, several from row to row.
        let (from, to) = (from[..count].chunks_exact(factors.len()), to[..count].chunks_exact_mut(factors.len()));
        vectorized(
            #[inline(always)]
            || {
                for (from, to) in from.zip(to) {
                    for ((to, &x), &factor) in to.iter_mut().zip(from).zip(factors) {
                        *to = if accumulate { *to + factor * x } else { factor * x };
                    }
                }
            },
        );
    }
}
