//! Replay of a program over a batch.

use super::forward::{Environment, forward};
use super::{LANES, Program, Row};
use crate::linalg::Buffer;
use crate::scalar::{Column, Scalar, copy_column};
use crate::tape::error::{TapeError, check_length};
use std::sync::Arc;

/// Buffers for replaying a [`Program`]: the rows of one chunk of lanes, so that repeated replays allocate nothing. A clone starts
/// afresh.
#[derive(Debug)]
pub struct Replay<S> {
    program: Arc<Program<S>>,
    uniform: Buffer<S>,
    values: Buffer<S>,
}

impl<S: Scalar> Clone for Replay<S> {
    fn clone(&self) -> Self {
        Self::new(Arc::clone(&self.program))
    }
}

impl<S: Scalar> Replay<S> {
    /// Buffers for a program.
    pub fn new(program: Arc<Program<S>>) -> Self {
        Self { uniform: Buffer::default(), values: Buffer::default(), program }
    }

    /// Computes the outputs of all lanes from their inputs and the parameters.
    ///
    /// Inputs and outputs are fields, row-major matrices `(lanes, width)` side by side: the columns of the first field
    /// are the first inputs (outputs) of the program, and so on. Empty fields are left out.
    ///
    /// # Errors
    /// [`TapeError::Shape`] if the parameters or the fields together have the wrong length.
    pub fn evaluate(
        &mut self,
        lanes: usize,
        inputs: &[&[S]],
        parameters: &[S],
        outputs: &mut [&mut [S]],
    ) -> Result<(), TapeError> {
        let Self { program, uniform, values } = self;
        let columns = |length: usize| length / lanes.max(1);
        let width = inputs.iter().map(|field| columns(field.len())).sum();
        check_length("inputs of a state", program.inputs, width)?;
        check_length("inputs", lanes * width, inputs.iter().map(|field| field.len()).sum())?;
        let width = outputs.iter().map(|field| columns(field.len())).sum();
        check_length("outputs of a state", program.outputs.len(), width)?;
        check_length("outputs", lanes * width, outputs.iter().map(|field| field.len()).sum())?;
        check_length("parameters", program.parameters, parameters.len())?;
        let values: &mut [Row<S>] = values.lanes(program.lane_rows);
        let uniform: &mut [Row<S>] = uniform.lanes(program.uniform_rows);
        let environment = Environment { uniform: &[], inputs: &[], lanes, start: 0, parameters };
        forward(&program.uniform, &environment, uniform);
        for start in (0..lanes).step_by(LANES) {
            let environment = Environment { uniform, inputs, lanes, start, parameters };
            forward(&program.lanes, &environment, values);
            let mut next = program.outputs.iter().map(|&row| {
                let row = row as usize;
                if row < program.uniform_rows { &uniform[row] } else { &values[row - program.uniform_rows] }
            });
            for field in outputs.iter_mut() {
                let width = field.len() / lanes;
                for (column, source) in next.by_ref().take(width).enumerate() {
                    let to = Column::new(&mut field[start * width..], column, width);
                    copy_column(LANES.min(lanes - start), to, Column::all(source));
                }
            }
        }
        Ok(())
    }
}
