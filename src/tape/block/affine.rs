//! Affine map of a block: one matrix product for all channels and lanes.

use crate::linalg::{MatMut, MatRef, gemm};
use crate::scalar::{Real, Scalar};
use crate::tape::program::{LANES, Row, pairwise};

/// `Y = W X + b`: `W` `(outputs, inputs)` row-major from parameter `weights` on, `b` from `bias` on, channel 0 only.
#[derive(Clone, Copy, Debug)]
pub(in crate::tape) struct Affine {
    pub(super) input: u32,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    pub(super) channels: usize,
    pub(super) weights: usize,
    pub(super) bias: Option<usize>,
}

impl Affine {
    pub(super) fn forward<S: Scalar>(&self, x: &[Row<S>], parameters: &[S], y: &mut [Row<S>]) {
        let (columns, one) = (self.channels * LANES, <S as Real>::one());
        let weights = MatRef::new(&parameters[self.weights..], self.outputs, self.inputs);
        let x = MatRef::new(x.as_flattened(), self.inputs, columns);
        gemm(MatMut::new(y.as_flattened_mut(), self.outputs, columns), false, one, weights, x);
        if let Some(bias) = self.bias {
            for (row, &shift) in y.iter_mut().step_by(self.channels).zip(&parameters[bias..]) {
                row.iter_mut().for_each(|value| *value += shift);
            }
        }
    }

    /// `X' += W^T Y'`.
    pub(super) fn reverse_input<S: Scalar>(&self, parameters: &[S], y_adjoint: &[Row<S>], x_adjoint: &mut [Row<S>]) {
        let columns = self.channels * LANES;
        let weights = MatRef::new(&parameters[self.weights..], self.outputs, self.inputs);
        let y = MatRef::new(y_adjoint.as_flattened(), self.outputs, columns);
        let target = MatMut::new(x_adjoint.as_flattened_mut(), self.inputs, columns);
        gemm(target, true, <S as Real>::one(), weights.t(), y);
    }

    /// `W' += Y' X^T`, `b' +=` sums of the rows of `Y'` in channel 0.
    pub(super) fn reverse_parameters<S: Scalar>(
        &self,
        x: &[Row<S>],
        y_adjoint: &[Row<S>],
        parameter_adjoints: &mut [S],
    ) {
        let columns = self.channels * LANES;
        let y = MatRef::new(y_adjoint.as_flattened(), self.outputs, columns);
        let x = MatRef::new(x.as_flattened(), self.inputs, columns);
        let target = &mut parameter_adjoints[self.weights..];
        gemm(MatMut::new(target, self.outputs, self.inputs), true, <S as Real>::one(), y, x.t());
        if let Some(bias) = self.bias {
            let rows = y_adjoint.iter().step_by(self.channels);
            for (target, row) in parameter_adjoints[bias..].iter_mut().zip(rows) {
                *target += pairwise(row);
            }
        }
    }
}
