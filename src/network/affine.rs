//! The three products of an affine map with a batch; a "pass" through the network is one of them per layer.

use crate::linalg::{MatMut, MatRef, gemm};
use crate::network::Layer;
use crate::scalar::{Real, Scalar};

impl Layer {
    fn matrix<'a, S>(&self, weights: &'a [S]) -> MatRef<'a, S> {
        MatRef::new(&weights[self.weight_range()], self.outputs, self.inputs)
    }

    /// `output = input W^T` for `rows` rows; the bias is left to the caller.
    pub(super) fn apply<S: Scalar>(&self, weights: &[S], rows: usize, input: &[S], output: &mut [S]) {
        let output = MatMut::new(output, rows, self.outputs);
        gemm(output, false, <S as Real>::one(), MatRef::new(input, rows, self.inputs), self.matrix(weights).t());
    }

    /// `below = adjoint W`: adjoints of the inputs from those of the outputs.
    pub(super) fn pull_back<S: Scalar>(&self, weights: &[S], rows: usize, adjoint: &[S], below: &mut [S]) {
        let below = MatMut::new(below, rows, self.inputs);
        gemm(below, false, <S as Real>::one(), MatRef::new(adjoint, rows, self.outputs), self.matrix(weights));
    }

    /// `gradient of W += adjoint^T input`, `gradient` flat over all parameters.
    pub(super) fn add_weight_gradient<S: Scalar>(&self, rows: usize, adjoint: &[S], input: &[S], gradient: &mut [S]) {
        let gradient = MatMut::new(&mut gradient[self.weight_range()], self.outputs, self.inputs);
        let adjoint = MatRef::new(adjoint, rows, self.outputs).t();
        gemm(gradient, true, <S as Real>::one(), adjoint, MatRef::new(input, rows, self.inputs));
    }
}
