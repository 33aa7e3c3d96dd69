//! Replay of a program: over a batch, each operation on all lanes of a chunk, or for numbers of any kind, one at a time.

use super::run::{Kind, Run};
use super::single::Rows;
use super::{FEW_LANES, LANES, Program, Row};
use crate::linalg::Buffer;
use crate::ops::{Binary, Unary};
use crate::scalar::{
    Column, Real, Scalar, copy_column, cos_lanes, exp_lanes, in_lanes, ln_lanes, sin_cos_lanes, sin_lanes, sqrt_lanes,
    tanh_lanes, vectorized,
};
use crate::tape::{TapeError, check_length};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Largest size in bytes of the rows of a chunk of [`LANES`] lanes: larger programs would leave the second cache.
const CHUNK: usize = 1 << 19;

/// Fields up to this width are written column by column.
const NARROW: usize = 16;

/// Number of functions of a single state from which vectorized calls are faster.
const TOGETHER: usize = 4;

/// Buffers for replaying a [`Program`]: the rows of one chunk of lanes, so that repeated replays allocate nothing. A clone starts
/// afresh.
#[derive(Debug)]
pub struct Replay<S> {
    program: Arc<Program<S>>,
    rows: Buffer<S>,
    /// Lanes and parameters for which the uniform rows were computed last.
    uniform: (usize, Vec<S>),
    /// Rows of a single state, of a small program.
    single: Option<Rows<S>>,
}

impl<S: Scalar> Clone for Replay<S> {
    fn clone(&self) -> Self {
        Self::new(Arc::clone(&self.program))
    }
}

impl<S: Scalar> Replay<S> {
    /// Buffers for a program.
    pub fn new(program: Arc<Program<S>>) -> Self {
        Self { rows: Buffer::default(), uniform: (0, Vec::new()), single: None, program }
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
        let program = &*self.program;
        check_length("parameters", program.parameters, parameters.len())?;
        if lanes == 1
            && let Some(single) = &program.single
        {
            check_length("inputs of a state", program.inputs, inputs.iter().map(|field| field.len()).sum())?;
            check_length("outputs of a state", program.outputs.len(), outputs.iter().map(|field| field.len()).sum())?;
            self.single.get_or_insert_default().evaluate(single, inputs, parameters, outputs);
            return Ok(());
        }
        let columns = |length: usize| length / lanes.max(1);
        let width = inputs.iter().map(|field| columns(field.len())).sum();
        check_length("inputs of a state", program.inputs, width)?;
        check_length("inputs", lanes * width, inputs.iter().map(|field| field.len()).sum())?;
        let width = outputs.iter().map(|field| columns(field.len())).sum();
        check_length("outputs of a state", program.outputs.len(), width)?;
        check_length("outputs", lanes * width, outputs.iter().map(|field| field.len()).sum())?;
        let batch = Batch { inputs, lanes, parameters };
        let rows = program.uniform_rows + program.lane_rows;
        let many = if rows * LANES * size_of::<S>() <= CHUNK { lanes - lanes % LANES } else { 0 };
        // The last states of a batch of whole chunks fill one more where few lanes would need as much time.
        let many = if many > 0 && lanes - many > LANES / 2 { lanes } else { many };
        self.chunks::<LANES>(0..many, &batch, outputs);
        let few = if lanes - many == 1 { many } else { lanes };
        self.chunks::<FEW_LANES>(many..few, &batch, outputs);
        self.chunks::<1>(few..lanes, &batch, outputs);
        Ok(())
    }

    /// Computes some states of a batch in chunks of `W`.
    fn chunks<const W: usize>(
        &mut self,
        states: core::ops::Range<usize>,
        batch: &Batch<'_, S>,
        outputs: &mut [&mut [S]],
    ) {
        if states.is_empty() {
            return;
        }
        let program = &*self.program;
        let rows: &mut [Row<S, W>] = self.rows.lanes(program.uniform_rows + program.lane_rows);
        if self.uniform.0 != W || self.uniform.1 != batch.parameters {
            compute(program, &program.uniform, &Chunk { batch, start: states.start, end: states.end }, rows);
            self.uniform.0 = W;
            self.uniform.1.clear();
            self.uniform.1.extend_from_slice(batch.parameters);
        }
        for start in states.clone().step_by(W) {
            compute(program, &program.lanes, &Chunk { batch, start, end: states.end }, rows);
            let mut next = 0;
            for field in outputs.iter_mut() {
                let width = field.len() / batch.lanes;
                let wanted = &program.outputs[next..next + width];
                next += width;
                let field = &mut field[start * width..];
                if const { W == 1 } {
                    for k in 0..width {
                        field[k] = rows[wanted[k] as usize][0];
                    }
                    continue;
                }
                let count = W.min(states.end - start);
                if width > NARROW {
                    write_rows(rows, wanted, &mut field[..count * width]);
                    continue;
                }
                for (column, &row) in wanted.iter().enumerate() {
                    let to = Column::new(&mut field[..], column, width);
                    copy_column(count, to, Column::all(&rows[row as usize]));
                }
            }
        }
    }
}

/// Writes rows of the program as columns of a wide field, a few lanes at a time: each row is read once, and the results of a state are
/// contiguous.
#[inline(never)]
fn write_rows<S: Scalar, const W: usize>(rows: &[Row<S, W>], wanted: &[u32], field: &mut [S]) {
    let width = wanted.len();
    for (group, states) in field.chunks_mut(FEW_LANES * width).enumerate() {
        let count = states.len() / width;
        for (column, &row) in wanted.iter().enumerate() {
            let lanes = &rows[row as usize][group * FEW_LANES..][..count];
            for l in 0..count {
                states[l * width + column] = lanes[l];
            }
        }
    }
}

/// The inputs of a batch of states.
struct Batch<'a, S> {
    /// Lane inputs: fields `(lanes, width)` side by side.
    inputs: &'a [&'a [S]],
    /// Number of lanes.
    lanes: usize,
    /// Parameters.
    parameters: &'a [S],
}

/// Reads some of the states; lanes past the end repeat the last state.
struct Chunk<'a, S> {
    batch: &'a Batch<'a, S>,
    start: usize,
    end: usize,
}

/// Computes the rows of some runs in order.
fn compute<S: Scalar, const W: usize>(
    program: &Program<S>,
    runs: &[Run],
    chunk: &Chunk<'_, S>,
    rows: &mut [Row<S, W>],
) {
    // A single lane gains nothing from the widest vectors: one copy of the interpreter fewer.
    if const { W == 1 } {
        in_lanes::<1, _>(
            #[inline(always)]
            || perform_all(program, runs, chunk, rows),
        );
    } else {
        vectorized(
            #[inline(always)]
            || perform_all(program, runs, chunk, rows),
        );
    }
}

#[inline(always)]
fn perform_all<S: Scalar, const W: usize>(
    program: &Program<S>,
    runs: &[Run],
    chunk: &Chunk<'_, S>,
    rows: &mut [Row<S, W>],
) {
    for run in runs {
        perform(program, run, chunk, rows);
    }
}

#[inline(always)]
fn perform<S: Scalar, const W: usize>(program: &Program<S>, run: &Run, chunk: &Chunk<'_, S>, rows: &mut [Row<S, W>]) {
    let (out, operands) = (run.out as usize, &program.operands[run.operands.clone()]);
    match run.kind {
        Kind::Input => {
            for k in 0..operands.len() {
                load(chunk, operands[k] as usize, &mut rows[out + k]);
            }
        }
        Kind::Parameter => {
            for k in 0..operands.len() {
                rows[out + k] = [chunk.batch.parameters[operands[k] as usize]; W];
            }
        }
        Kind::Constant => {
            for k in 0..operands.len() {
                rows[out + k] = [program.constants[operands[k] as usize]; W];
            }
        }
        Kind::Unary(Unary::Neg) => map(run, operands, rows, |x| -x),
        Kind::Unary(Unary::Recip) => map(run, operands, rows, S::recip),
        Kind::Unary(Unary::Sqrt) => map(run, operands, rows, S::sqrt),
        Kind::Unary(Unary::Abs) => map(run, operands, rows, S::abs),
        Kind::Unary(Unary::Powi(2)) => map(run, operands, rows, |x| x * x),
        Kind::Unary(f) => functions(f, operands, out, rows),
        Kind::SinCos => sines(operands, out, rows),
        Kind::Binary(Binary::Add) => zip(run, operands, rows, |a, b| a + b),
        Kind::Binary(Binary::Sub) => zip(run, operands, rows, |a, b| a - b),
        Kind::Binary(Binary::Mul) => zip(run, operands, rows, |a, b| a * b),
        Kind::Binary(Binary::Div) => zip(run, operands, rows, |a, b| a / b),
        Kind::Binary(Binary::Max) => zip(run, operands, rows, |a, b| Binary::Max.value(a, b)),
        Kind::Binary(Binary::Min) => zip(run, operands, rows, |a, b| Binary::Min.value(a, b)),
        Kind::Binary(f) => functions_of_two(f, operands, out, rows),
        Kind::Select => {
            for k in 0..operands.len() / 3 {
                let (before, y) = rows.split_at_mut(out + k);
                let [c, a, b] = [0, 1, 2].map(|i| &before[operands[3 * k + i] as usize]);
                for l in 0..W {
                    y[0][l] = c[l].select(a[l], b[l]);
                }
            }
        }
    }
}

/// One input of all lanes.
#[inline(always)]
fn load<S: Scalar, const W: usize>(chunk: &Chunk<'_, S>, mut index: usize, out: &mut Row<S, W>) {
    let states = W.min(chunk.end - chunk.start);
    for field in chunk.batch.inputs {
        let width = field.len() / chunk.batch.lanes;
        if index >= width {
            index -= width;
            continue;
        }
        let field = Column::new(&field[chunk.start * width..], index, width);
        copy_column(states, Column::all(&mut out[..]), field);
        break;
    }
    let last = out[states - 1];
    for l in states..W {
        out[l] = last;
    }
}

#[inline(always)]
fn map<S: Scalar, const W: usize>(run: &Run, operands: &[u32], rows: &mut [Row<S, W>], f: impl Fn(S) -> S) {
    if run.chained {
        for k in 0..operands.len() {
            let (before, y) = rows.split_at_mut(run.out as usize + k);
            let (x, y) = (&before[operands[k] as usize], &mut y[0]);
            for l in 0..W {
                y[l] = f(x[l]);
            }
        }
        return;
    }
    let (before, after) = rows.split_at_mut(run.out as usize);
    let after = &mut after[..operands.len()];
    for k in 0..operands.len() {
        let (x, y) = (&before[operands[k] as usize], &mut after[k]);
        for l in 0..W {
            y[l] = f(x[l]);
        }
    }
}

#[inline(always)]
fn zip<S: Scalar, const W: usize>(run: &Run, operands: &[u32], rows: &mut [Row<S, W>], f: impl Fn(S, S) -> S) {
    let pairs = operands.as_chunks::<2>().0;
    if run.chained {
        for k in 0..pairs.len() {
            let (before, y) = rows.split_at_mut(run.out as usize + k);
            let (a, b, y) = (&before[pairs[k][0] as usize], &before[pairs[k][1] as usize], &mut y[0]);
            for l in 0..W {
                y[l] = f(a[l], b[l]);
            }
        }
        return;
    }
    let (before, after) = rows.split_at_mut(run.out as usize);
    let after = &mut after[..pairs.len()];
    for k in 0..pairs.len() {
        let (a, b, y) = (&before[pairs[k][0] as usize], &before[pairs[k][1] as usize], &mut after[k]);
        for l in 0..W {
            y[l] = f(a[l], b[l]);
        }
    }
}

/// A function that is a call: for a whole row, or for single states for a whole run.
#[inline(never)]
fn functions<S: Scalar, const W: usize>(f: Unary, operands: &[u32], out: usize, rows: &mut [Row<S, W>]) {
    if const { W == 1 } && operands.len() >= TOGETHER {
        let mut y = [<S as Real>::zero(); LANES];
        for (chunk, operands) in operands.chunks(LANES).enumerate() {
            let x = gathered(operands, rows);
            value(f, &x[..operands.len()], &mut y[..operands.len()]);
            let rows = &mut rows[out + chunk * LANES..][..operands.len()];
            rows.iter_mut().zip(&y).for_each(|(row, &y)| *row = [y; W]);
        }
        return;
    }
    for (k, &x) in operands.iter().enumerate() {
        let (before, y) = rows.split_at_mut(out + k);
        value(f, &before[x as usize], &mut y[0]);
    }
}

/// Sines and cosines.
#[inline(never)]
fn sines<S: Scalar, const W: usize>(operands: &[u32], out: usize, rows: &mut [Row<S, W>]) {
    if const { W == 1 } && operands.len() >= TOGETHER {
        let (mut sin, mut cos) = ([<S as Real>::zero(); LANES], [<S as Real>::zero(); LANES]);
        for (chunk, operands) in operands.chunks(LANES).enumerate() {
            let x = gathered(operands, rows);
            sin_cos_lanes(&x[..operands.len()], &mut sin, &mut cos);
            for (k, pair) in rows[out + 2 * chunk * LANES..][..2 * operands.len()].chunks_exact_mut(2).enumerate() {
                (pair[0], pair[1]) = ([sin[k]; W], [cos[k]; W]);
            }
        }
        return;
    }
    for (k, &x) in operands.iter().enumerate() {
        let (before, after) = rows.split_at_mut(out + 2 * k);
        let (sin, cos) = after.split_at_mut(1);
        sin_cos_lanes(&before[x as usize], &mut sin[0], &mut cos[0]);
    }
}

/// The first lanes of the operands of a part of a run.
fn gathered<S: Scalar, const W: usize>(operands: &[u32], rows: &[Row<S, W>]) -> [S; LANES] {
    let mut x = [<S as Real>::zero(); LANES];
    x.iter_mut().zip(operands).for_each(|(x, &row)| *x = rows[row as usize][0]);
    x
}

/// `out = f(x)`.
pub(super) fn value<S: Scalar>(f: Unary, x: &[S], out: &mut [S]) {
    match f {
        Unary::Exp => exp_lanes(x, out),
        Unary::Ln => ln_lanes(x, out),
        Unary::Sqrt => sqrt_lanes(x, out),
        Unary::Sin => sin_lanes(x, out),
        Unary::Cos => cos_lanes(x, out),
        Unary::Tanh => tanh_lanes(x, out),
        _ => out.iter_mut().zip(x).for_each(|(out, &x)| *out = f.value(x)),
    }
}

/// A function of two numbers that is a call.
#[inline(never)]
fn functions_of_two<S: Scalar, const W: usize>(f: Binary, operands: &[u32], out: usize, rows: &mut [Row<S, W>]) {
    for (k, pair) in operands.chunks_exact(2).enumerate() {
        let (before, y) = rows.split_at_mut(out + k);
        let (a, b) = (&before[pair[0] as usize], &before[pair[1] as usize]);
        (0..W).for_each(|l| y[0][l] = f.value(a[l], b[l]));
    }
}

/// An operation of a program on numbers of any kind.
pub(super) struct Step<'a> {
    pub kind: Kind,
    /// First row that it fills.
    pub out: usize,
    /// The rows that it reads, or the index that it names.
    pub operands: &'a [u32],
}

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
        for step in self.steps() {
            self.interpret_step(&step, inputs, parameters, &mut rows);
        }
        Ok(self.outputs.iter().map(|&row| rows[row as usize]).collect())
    }

    /// The operations one by one.
    pub(super) fn steps(&self) -> impl DoubleEndedIterator<Item = Step<'_>> {
        self.uniform.iter().chain(&self.lanes).flat_map(|run| {
            let operands = self.operands[run.operands.clone()].chunks_exact(run.kind.arity());
            operands.enumerate().map(|(k, operands)| {
                let out = run.out as usize + k * run.kind.rows();
                Step { kind: run.kind, out, operands }
            })
        })
    }

    /// Fills the rows of one operation.
    pub(super) fn interpret_step<R: Real>(&self, step: &Step<'_>, inputs: &[R], parameters: &[R], rows: &mut [R]) {
        let first = step.operands[0] as usize;
        let row = |k: usize| rows[step.operands[k] as usize];
        rows[step.out] = match step.kind {
            Kind::Input => inputs[first],
            Kind::Parameter => parameters[first],
            Kind::Constant => R::constant(self.constants[first].cast()),
            Kind::Unary(f) => f.evaluate(row(0)),
            Kind::Binary(f) => f.evaluate(row(0), row(1)),
            Kind::Select => row(0).select(row(1), row(2)),
            Kind::SinCos => {
                let (sin, cos) = row(0).sin_cos();
                rows[step.out + 1] = cos;
                sin
            }
        };
    }
}
