//! A program as a function of numbers of any kind, one at a time.

use super::{Instruction, Node, Program};
use crate::scalar::{Real, Scalar};
use crate::tape::error::{TapeError, check_length};

impl<S: Scalar> Program<S> {
    /// The outputs at inputs and parameters of any kind: forward numbers give derivatives, tracers of another recording
    /// give a program of derivatives. Constants are converted to the scalar of `R`.
    ///
    /// # Errors
    /// [`TapeError::Shape`] for slices of the wrong length.
    pub fn interpret<R: Real>(&self, inputs: &[R], parameters: &[R]) -> Result<Vec<R>, TapeError> {
        check_length("inputs", self.inputs, inputs.len())?;
        check_length("parameters", self.parameters, parameters.len())?;
        let mut rows = vec![R::zero(); self.uniform_rows + self.lane_rows];
        for Instruction { node, out } in self.uniform.iter().chain(&self.lanes) {
            let out = *out as usize;
            let row = |a: u32| rows[a as usize];
            rows[out] = match *node {
                Node::Input(index) => inputs[index as usize],
                Node::Parameter(index) => parameters[index as usize],
                Node::Constant(value) => R::constant(value.cast()),
                Node::Unary(f, a) => f.evaluate(row(a)),
                Node::Binary(f, a, b) => f.evaluate(row(a), row(b)),
                Node::Select(c, a, b) => row(c).select(row(a), row(b)),
                Node::SinCos(a) => {
                    let (sin, cos) = row(a).sin_cos();
                    rows[out + 1] = cos;
                    sin
                }
                Node::Dense(_) => unreachable!("programs of rows are recorded without blocks"),
            };
        }
        Ok(self.outputs.iter().map(|&row| rows[row as usize]).collect())
    }
}
