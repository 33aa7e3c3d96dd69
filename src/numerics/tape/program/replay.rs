//! Replay of a program over a batch: forward, then reverse.

use super::backward::{INPUTS, PARAMETERS, Sweep};
use super::forward::{Environment, forward};
use super::{LANES, Node, Program, Row};
use crate::linalg::Buffer;
use crate::scalar::{Column, Real, Scalar, copy_column};
use crate::tape::error::{TapeError, check_length};
use std::sync::Arc;

/// Buffers for replaying a [`Program`]; they grow to the largest batch seen and are reused after that, so repeated
/// replays of a size allocate nothing. A clone starts afresh.
#[derive(Debug)]
pub struct Replay<S> {
    program: Arc<Program<S>>,
    lanes: Option<usize>,
    uniform: Buffer<S>,
    /// Values of the lane rows, chunk after chunk.
    values: Buffer<S>,
    adjoints: Buffer<S>,
    uniform_adjoints: Buffer<S>,
    parameters: Vec<S>,
}

impl<S: Scalar> Clone for Replay<S> {
    fn clone(&self) -> Self {
        Self::new(Arc::clone(&self.program))
    }
}

impl<S: Scalar> Replay<S> {
    /// Buffers for a program.
    pub fn new(program: Arc<Program<S>>) -> Self {
        let zero = <S as Real>::zero();
        Self {
            lanes: None,
            uniform: Buffer::default(),
            values: Buffer::default(),
            adjoints: Buffer::default(),
            uniform_adjoints: Buffer::default(),
            parameters: vec![zero; program.parameters],
            program,
        }
    }

    /// Computes `outputs` `(lanes, outputs)` from `inputs` `(lanes, inputs)` and `parameters`, all row-major.
    ///
    /// # Errors
    /// [`TapeError::Shape`] if a slice has the wrong length.
    pub fn forward(
        &mut self,
        lanes: usize,
        inputs: &[S],
        parameters: &[S],
        outputs: &mut [S],
    ) -> Result<(), TapeError> {
        check_length("inputs", lanes * self.program.inputs, inputs.len())?;
        check_length("outputs", lanes * self.program.outputs.len(), outputs.len())?;
        self.run(lanes, &[inputs], parameters, &mut [outputs], true)?;
        self.lanes = Some(lanes);
        Ok(())
    }
    /// Computes outputs without keeping what a reverse replay needs, so that the rows of one chunk serve all.
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
        let columns = |length: usize| length / lanes.max(1);
        let width = inputs.iter().map(|field| columns(field.len())).sum();
        check_length("inputs of a state", self.program.inputs, width)?;
        check_length("inputs", lanes * width, inputs.iter().map(|field| field.len()).sum())?;
        let width = outputs.iter().map(|field| columns(field.len())).sum();
        check_length("outputs of a state", self.program.outputs.len(), width)?;
        check_length("outputs", lanes * width, outputs.iter().map(|field| field.len()).sum())?;
        self.run(lanes, inputs, parameters, outputs, false)
    }

    /// Replays all chunks; each in rows of its own if they are to be kept.
    fn run(
        &mut self,
        lanes: usize,
        inputs: &[&[S]],
        parameters: &[S],
        outputs: &mut [&mut [S]],
        keep: bool,
    ) -> Result<(), TapeError> {
        let program = Arc::clone(&self.program);
        self.lanes = None;
        check_length("parameters", program.parameters, parameters.len())?;
        let rows = program.lane_rows;
        let chunks = if keep { lanes.div_ceil(LANES) } else { 1 };
        let all: &mut [Row<S>] = self.values.lanes(chunks * rows);
        let uniform: &mut [Row<S>] = self.uniform.lanes(program.uniform_rows);
        self.parameters.copy_from_slice(parameters);
        let environment = Environment { uniform: &[], inputs: &[], lanes, start: 0, parameters };
        forward(&program.uniform, &environment, uniform);
        for (chunk, start) in (0..lanes).step_by(LANES).enumerate() {
            let environment = Environment { uniform, inputs, lanes, start, parameters };
            let first = if keep { chunk * rows } else { 0 };
            let values = &mut all[first..first + rows];
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

    /// Adjoints of the last forward replay: from `output_adjoints` `(lanes, outputs)` to `input_adjoints`
    /// `(lanes, inputs)` and `parameter_adjoints` `(parameters)`, summed over the lanes in a fixed order.
    ///
    /// # Errors
    /// [`TapeError::NoForward`] without a forward replay before it, [`TapeError::Shape`] for wrong lengths.
    pub fn reverse(
        &mut self,
        output_adjoints: &[S],
        input_adjoints: &mut [S],
        parameter_adjoints: &mut [S],
    ) -> Result<(), TapeError> {
        self.sweep(output_adjoints, Some(input_adjoints), Some(parameter_adjoints))
    }
    /// [`Replay::reverse`] for the inputs alone: what does not depend on them is not swept.
    ///
    /// # Errors
    /// As [`Replay::reverse`].
    pub fn reverse_inputs(&mut self, output_adjoints: &[S], input_adjoints: &mut [S]) -> Result<(), TapeError> {
        self.sweep(output_adjoints, Some(input_adjoints), None)
    }
    /// [`Replay::reverse`] for the parameters alone: what does not depend on them is not swept.
    ///
    /// # Errors
    /// As [`Replay::reverse`].
    pub fn reverse_parameters(&mut self, output_adjoints: &[S], parameter_adjoints: &mut [S]) -> Result<(), TapeError> {
        self.sweep(output_adjoints, None, Some(parameter_adjoints))
    }

    fn sweep(
        &mut self,
        output_adjoints: &[S],
        mut by_input: Option<&mut [S]>,
        by_parameter: Option<&mut [S]>,
    ) -> Result<(), TapeError> {
        let program = Arc::clone(&self.program);
        let lanes = self.lanes.ok_or(TapeError::NoForward)?;
        check_length("output adjoints", lanes * program.outputs.len(), output_adjoints.len())?;
        let mut wanted = 0;
        if let Some(target) = &mut by_input {
            check_length("input adjoints", lanes * program.inputs, target.len())?;
            wanted |= INPUTS;
        }
        let parameter_adjoints = match by_parameter {
            Some(target) => {
                check_length("parameter adjoints", program.parameters, target.len())?;
                wanted |= PARAMETERS;
                target
            }
            None => &mut [],
        };
        let zero = <S as Real>::zero();
        let (rows, base, width) = (program.lane_rows, program.uniform_rows, program.outputs.len());
        let uniform: &[Row<S>] = self.uniform.lanes(base);
        let values: &[Row<S>] = self.values.lanes(lanes.div_ceil(LANES) * rows);
        let adjoints: &mut [Row<S>] = self.adjoints.lanes(rows);
        let uniform_adjoints: &mut [Row<S>] = self.uniform_adjoints.lanes(base);
        uniform_adjoints.fill([zero; LANES]);
        parameter_adjoints.fill(zero);
        if let Some(target) = &mut by_input {
            target.fill(zero);
        }
        for (chunk, start) in (0..lanes).step_by(LANES).enumerate() {
            let count = LANES.min(lanes - start);
            adjoints.fill([zero; LANES]);
            for (column, &row) in program.outputs.iter().enumerate() {
                let row = row as usize;
                let target = if row < base { &mut uniform_adjoints[row] } else { &mut adjoints[row - base] };
                for (lane, value) in target[..count].iter_mut().enumerate() {
                    *value += output_adjoints[(start + lane) * width + column];
                }
            }
            let mut sweep = Sweep {
                reach: &program.reach,
                wanted,
                uniform,
                rows: &values[chunk * rows..(chunk + 1) * rows],
                uniform_adjoints,
                adjoints,
            };
            sweep.run(&program.lanes);
            let Some(target) = &mut by_input else { continue };
            for instruction in &program.lanes {
                if let Node::Input(index) = instruction.node {
                    let source = &adjoints[instruction.out as usize - base];
                    for (lane, &value) in source[..count].iter().enumerate() {
                        target[(start + lane) * program.inputs + index as usize] = value;
                    }
                }
            }
        }
        if wanted & PARAMETERS == 0 {
            return Ok(());
        }
        // Uniform rows: sum over the lanes once, then sweep once.
        for row in uniform_adjoints.iter_mut() {
            let sum = pairwise(row);
            row.fill(zero);
            row[0] = sum;
        }
        let mut sweep = Sweep {
            reach: &program.reach,
            wanted,
            uniform: &[],
            rows: uniform,
            uniform_adjoints: &mut [],
            adjoints: uniform_adjoints,
        };
        sweep.run(&program.uniform);
        for instruction in &program.uniform {
            if let Node::Parameter(index) = instruction.node {
                parameter_adjoints[index as usize] += uniform_adjoints[instruction.out as usize][0];
            }
        }
        Ok(())
    }
}

/// Sum over the lanes of a chunk by halves: a fixed order with a small error.
pub(in crate::numerics::tape) fn pairwise<S: Scalar>(row: &Row<S>) -> S {
    let mut sums = *row;
    let mut half = LANES / 2;
    while half > 0 {
        for l in 0..half {
            let other = sums[l + half];
            sums[l] += other;
        }
        half /= 2;
    }
    sums[0]
}
