//! Replay of a program: over a batch, each operation on all lanes of a chunk, or for numbers of any kind, one at a time.

use super::{Instruction, LANES, Node, Program, Row};
use crate::linalg::Buffer;
use crate::ops::{Binary, Unary};
use crate::scalar::{
    Column, Real, Scalar, copy_column, cos_lanes, exp_lanes, ln_lanes, sin_cos_lanes, sin_lanes, sqrt_lanes,
    tanh_lanes, vectorized,
};
use crate::tape::{TapeError, check_length};
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

/// Data that an instruction may read besides the rows of its own section.
struct Environment<'a, S> {
    /// Uniform rows (empty while they themselves are computed).
    pub(super) uniform: &'a [Row<S>],
    /// Lane inputs: fields `(lanes, width)` side by side; lanes past the end repeat the last state.
    pub(super) inputs: &'a [&'a [S]],
    /// Number of lanes of the batch.
    pub(super) lanes: usize,
    /// First lane of the chunk.
    pub(super) start: usize,
    /// Parameters.
    pub(super) parameters: &'a [S],
}

/// Computes the rows of `program` in order.
fn forward<S: Scalar>(program: &[Instruction<S>], environment: &Environment<'_, S>, rows: &mut [Row<S>]) {
    let uniform = environment.uniform;
    let base = uniform.len();
    vectorized(
        #[inline(always)]
        || {
            for instruction in program {
                let (before, after) = rows.split_at_mut(instruction.out as usize - base);
                let get = |row: u32| {
                    let row = row as usize;
                    if row < base { &uniform[row] } else { &before[row - base] }
                };
                let Some((out, rest)) = after.split_first_mut() else { continue };
                match &instruction.node {
                    Node::Input(index) => load(environment, *index as usize, out),
                    Node::Parameter(index) => fill(environment.parameters[*index as usize], out),
                    Node::Constant(value) => fill(*value, out),
                    Node::Unary(f, a) => unary(*f, get(*a), out),
                    Node::SinCos(a) => {
                        if let Some(cos) = rest.first_mut() {
                            sin_cos(get(*a), out, cos);
                        }
                    }
                    Node::Binary(f, a, b) => binary(*f, get(*a), get(*b), out),
                    Node::Select(c, a, b) => {
                        let (c, a, b) = (get(*c), get(*a), get(*b));
                        for l in 0..LANES {
                            out[l] = c[l].select(a[l], b[l]);
                        }
                    }
                    Node::Dense(_) => unreachable!("programs of rows are recorded without blocks"),
                }
            }
        },
    );
}

/// One input of all lanes.
#[inline(always)]
fn load<S: Scalar>(environment: &Environment<'_, S>, mut index: usize, out: &mut Row<S>) {
    let states = LANES.min(environment.lanes - environment.start);
    for field in environment.inputs {
        let width = field.len() / environment.lanes;
        if index >= width {
            index -= width;
            continue;
        }
        let field = Column::new(&field[environment.start * width..], index, width);
        copy_column(states, Column::all(&mut out[..]), field);
        break;
    }
    let last = out[states - 1];
    for l in states..LANES {
        out[l] = last;
    }
}

#[inline(always)]
fn fill<S: Scalar>(value: S, out: &mut Row<S>) {
    for l in 0..LANES {
        out[l] = value;
    }
}

#[inline(always)]
fn map<S: Scalar>(x: &Row<S>, out: &mut Row<S>, f: impl Fn(S) -> S) {
    for l in 0..LANES {
        out[l] = f(x[l]);
    }
}

/// The cheap functions are compiled in place; the others are calls for a whole row.
#[inline(always)]
fn unary<S: Scalar>(f: Unary, x: &Row<S>, out: &mut Row<S>) {
    match f {
        Unary::Neg => map(x, out, |x| -x),
        Unary::Recip => map(x, out, S::recip),
        Unary::Sqrt => map(x, out, S::sqrt),
        Unary::Abs => map(x, out, S::abs),
        Unary::Powi(2) => map(x, out, |x| x * x),
        _ => value(f, x, out),
    }
}

#[inline(always)]
fn binary<S: Scalar>(f: Binary, a: &Row<S>, b: &Row<S>, out: &mut Row<S>) {
    #[inline(always)]
    fn zip<S: Scalar>(a: &Row<S>, b: &Row<S>, out: &mut Row<S>, f: impl Fn(S, S) -> S) {
        for l in 0..LANES {
            out[l] = f(a[l], b[l]);
        }
    }
    match f {
        Binary::Add => zip(a, b, out, |a, b| a + b),
        Binary::Sub => zip(a, b, out, |a, b| a - b),
        Binary::Mul => zip(a, b, out, |a, b| a * b),
        Binary::Div => zip(a, b, out, |a, b| a / b),
        Binary::Max => zip(a, b, out, |a, b| Binary::Max.value(a, b)),
        Binary::Min => zip(a, b, out, |a, b| Binary::Min.value(a, b)),
        Binary::Powf | Binary::Atan2 => value_of_two(f, a, b, out),
    }
}

/// `out = f(x)`.
#[inline(never)]
pub(super) fn value<S: Scalar>(f: Unary, x: &Row<S>, out: &mut Row<S>) {
    match f {
        Unary::Exp => exp_lanes(x, out),
        Unary::Ln => ln_lanes(x, out),
        Unary::Sqrt => sqrt_lanes(x, out),
        Unary::Sin => sin_lanes(x, out),
        Unary::Cos => cos_lanes(x, out),
        Unary::Tanh => tanh_lanes(x, out),
        _ => (0..LANES).for_each(|l| out[l] = f.value(x[l])),
    }
}

/// Sine and cosine.
#[inline(never)]
pub(super) fn sin_cos<S: Scalar>(x: &Row<S>, sin: &mut Row<S>, cos: &mut Row<S>) {
    sin_cos_lanes(x, sin, cos);
}

/// `out = f(a, b)`.
#[inline(never)]
fn value_of_two<S: Scalar>(f: Binary, a: &Row<S>, b: &Row<S>, out: &mut Row<S>) {
    (0..LANES).for_each(|l| out[l] = f.value(a[l], b[l]));
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
