//! Programs: recorded once, replayed over the lanes of a batch.
//!
//! A row is one expression for several states side by side; rows that depend on parameters and constants alone are uniform and computed
//! once for the batch. The interpreter visits one run of like operations at a time for one chunk of lanes: [`LANES`] of a small program,
//! fewer of a large one whose rows would leave the caches, one of a single state. Its cost per operation is shared by the lanes and by the
//! run, and the loops are SIMD. The chunks do not depend on the number of threads: the same batch gives the same bytes.

mod recorder;
mod replay;
mod run;
mod second;
mod single;
mod tracer;

pub(super) use recorder::{Graph, Node, Recorder};
pub use replay::Replay;
pub(crate) use second::Directions;
pub use tracer::Tracer;

use recorder::PARAMETER;
use run::{Compiler, Run};
use single::Single;

use super::TapeError;
use crate::scalar::Scalar;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// Lanes of a chunk, for programs whose rows then stay in the nearest caches.
pub const LANES: usize = 64;
/// Lanes of the chunks of larger programs, and of few states.
pub(super) const FEW_LANES: usize = 8;

/// One number for each of `W` lanes.
pub(super) type Row<S, const W: usize> = [S; W];

/// A recorded function of lane inputs and parameters; see [`Program::record`].
///
/// Only what the outputs need is kept, equal expressions are computed once, constants are folded.
#[derive(Clone, Debug)]
pub struct Program<S> {
    /// Rows below are uniform over the lanes.
    uniform_rows: usize,
    lane_rows: usize,
    uniform: Vec<Run>,
    lanes: Vec<Run>,
    /// Operands: the rows that operations read, or the index of an input, a parameter or a constant.
    operands: Vec<u32>,
    constants: Vec<S>,
    outputs: Vec<u32>,
    inputs: usize,
    parameters: usize,
    /// For a small program, its operations for a single state.
    single: Option<Single<S>>,
}

impl<S: Scalar> Program<S> {
    /// Records `f(inputs, parameters)`, which returns the outputs.
    ///
    /// Inputs differ from lane to lane (a state), parameters are the same for all (masses, weights). `f` may itself use
    /// forward numbers over the [`Tracer`]s.
    ///
    /// # Errors
    /// [`TapeError::DataDependentBranch`] if `f` reads a value, [`TapeError::MixedTapes`] if it uses numbers of
    /// another recording.
    pub fn record<F>(inputs: usize, parameters: usize, f: F) -> Result<Self, TapeError>
    where
        F: for<'t> FnOnce(&[Tracer<'t, S>], &[Tracer<'t, S>]) -> Vec<Tracer<'t, S>>,
    {
        Self::record_within(PARAMETER, (inputs, parameters), |x, p| Some(f(x, p)))
    }

    /// As [`Program::record`], with at most `limit` rows; `None` for a function that gave up.
    ///
    /// # Errors
    /// The errors of [`Program::record`], and [`TapeError::Full`].
    pub fn record_within<F>(limit: u32, (inputs, parameters): (usize, usize), f: F) -> Result<Self, TapeError>
    where
        F: for<'t> FnOnce(&[Tracer<'t, S>], &[Tracer<'t, S>]) -> Option<Vec<Tracer<'t, S>>>,
    {
        let recorder = Recorder::within(limit, false);
        let outputs: Vec<u32> = {
            let (x, p) = (recorder.inputs(0, inputs), recorder.parameters(parameters));
            let outputs = f(&x, &p).ok_or(TapeError::Full { limit })?;
            outputs.into_iter().map(|y| recorder.row_of(y)).collect()
        };
        let graph = recorder.finish()?;
        Ok(Self::compile(&graph, &outputs, (inputs, parameters)))
    }

    /// Keeps what the outputs need and sorts it: uniform rows, lane rows.
    fn compile(graph: &Graph<S>, outputs: &[u32], (inputs, parameters): (usize, usize)) -> Self {
        let count = graph.nodes.len();
        let node_of = |row: u32| graph.node_of_row[row as usize] as usize;
        let mut needed = vec![false; count];
        for &row in outputs {
            needed[node_of(row)] = true;
        }
        for index in (0..count).rev() {
            if needed[index] {
                graph.nodes[index].operands(|row| needed[node_of(row)] = true);
            }
        }
        let mut uniform = vec![false; count];
        for (index, node) in graph.nodes.iter().enumerate() {
            let mut all = !matches!(node, Node::Input(_));
            node.operands(|row| all &= uniform[node_of(row)]);
            uniform[index] = all;
        }
        let section =
            |of: bool| (0..count).filter(|&index| needed[index] && uniform[index] == of).collect::<Vec<usize>>();
        let mut compiler =
            Compiler { graph, place: vec![0; count], rows: 0, operands: Vec::new(), constants: Vec::new() };
        let uniform_runs = compiler.section(&section(true));
        let uniform_rows = compiler.rows as usize;
        let lanes = compiler.section(&section(false));
        let mut program = Self {
            uniform_rows,
            lane_rows: compiler.rows as usize - uniform_rows,
            uniform: uniform_runs,
            lanes,
            outputs: outputs.iter().map(|&row| compiler.row(row)).collect(),
            operands: compiler.operands,
            constants: compiler.constants,
            inputs,
            parameters,
            single: None,
        };
        program.single = Single::new(&program);
        program
    }

    /// Number of lane inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }
    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }
    /// `true` if an output depends on no input.
    pub(crate) fn is_uniform(&self, output: usize) -> bool {
        (self.outputs[output] as usize) < self.uniform_rows
    }
    /// Operations done for each lane, inputs included.
    pub fn lane_operations(&self) -> usize {
        self.lanes.iter().map(Run::count).sum()
    }
    /// Operations done once for the batch, constants and parameters included.
    pub fn uniform_operations(&self) -> usize {
        self.uniform.iter().map(Run::count).sum()
    }
}

/// An operation; operands are rows, numbered in the order of the operations that fill them.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// Input by its index.
    Input(u32),
    /// Parameter by its index.
    Parameter(u32),
    /// A number.
    Constant(f64),
    /// A function of the operands, by its name in the table of operations, `Sin`, or `Powi(3)`; `SinCos` fills two rows.
    Function(String, Vec<u32>),
    /// `W x + b`: rows of `x`, number of outputs, first parameters of `W`, row-major, and of `b`.
    Dense(Vec<u32>, usize, usize, Option<usize>),
}

/// A recorded function of inputs and parameters with one result.
#[derive(Clone, Debug, PartialEq)]
pub struct Listing {
    /// Operations, each behind its operands.
    pub operations: Vec<Operation>,
    /// Row of the result.
    pub result: u32,
}

impl Listing {
    /// Records `f(inputs, parameters)`.
    ///
    /// # Errors
    /// The errors of [`Program::record`](Program::record).
    pub fn record<S: Scalar, F>(inputs: usize, parameters: usize, f: F) -> Result<Self, TapeError>
    where
        F: for<'t> FnOnce(&[Tracer<'t, S>], &[Tracer<'t, S>]) -> Tracer<'t, S>,
    {
        let recorder = Recorder::new(true);
        let result = {
            let (x, p) = (recorder.inputs(0, inputs), recorder.parameters(parameters));
            recorder.row_of(f(&x, &p))
        };
        let operations = recorder.finish()?.nodes.into_iter().map(|node| match node {
            Node::Input(index) => Operation::Input(index),
            Node::Parameter(index) => Operation::Parameter(index),
            Node::Constant(value) => Operation::Constant(value.to_f64()),
            Node::Unary(f, a) => Operation::Function(format!("{f:?}"), vec![a]),
            Node::SinCos(a) => Operation::Function("SinCos".to_string(), vec![a]),
            Node::Binary(f, a, b) => Operation::Function(format!("{f:?}"), vec![a, b]),
            Node::Select(c, a, b) => Operation::Function("Select".to_string(), vec![c, a, b]),
            Node::Dense(dense) => Operation::Dense(dense.inputs, dense.outputs, dense.weights, dense.bias),
        });
        Ok(Self { operations: operations.collect(), result })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Real;

    #[test]
    fn a_function_is_listed_with_its_layers() {
        let listing = Listing::record::<f64, _>(2, 4, |x, p| {
            let h = Real::affine(&p[..2], &p[2..3], x);
            h[0].powi(3) * p[3] + x[0].sin()
        });
        let Listing { operations, result } = listing.unwrap();
        assert_eq!(operations[..2], [Operation::Input(0), Operation::Input(1)]);
        assert!(operations.contains(&Operation::Dense(vec![0, 1], 1, 0, Some(2))), "{operations:?}");
        assert!(operations.contains(&Operation::Function("Powi(3)".to_string(), vec![2])), "{operations:?}");
        assert!(operations.contains(&Operation::Parameter(3)) && result as usize >= operations.len() - 1);
    }
}
