//! Programs: recorded once, replayed over the lanes of a batch.
//!
//! A row is one expression for [`LANES`] states side by side; rows that depend on parameters and constants alone are
//! uniform and computed once for the batch. The interpreter visits one operation at a time for one chunk of lanes, so
//! its cost per operation is shared by the lanes and the loops are SIMD. The chunk does not depend on the number of
//! threads: the same batch gives the same bytes.

mod recorder;
mod replay;
mod tracer;

pub(super) use recorder::{Graph, Node, Recorder};
pub use replay::Replay;
pub use tracer::Tracer;

use super::TapeError;
use crate::scalar::Scalar;

/// Lanes of a chunk.
pub const LANES: usize = 64;

/// One number for each lane of a chunk.
pub(super) type Row<S> = [S; LANES];

/// An operation and the first row it fills.
#[derive(Clone, Debug)]
pub(super) struct Instruction<S> {
    pub(super) node: Node<S>,
    pub(super) out: u32,
}

/// A recorded function of lane inputs and parameters; see [`Program::record`].
///
/// Only what the outputs need is kept, equal expressions are computed once, constants are folded.
#[derive(Clone, Debug)]
pub struct Program<S> {
    /// Rows below are uniform over the lanes.
    pub(super) uniform_rows: usize,
    pub(super) lane_rows: usize,
    pub(super) uniform: Vec<Instruction<S>>,
    pub(super) lanes: Vec<Instruction<S>>,
    pub(super) outputs: Vec<u32>,
    pub(super) inputs: usize,
    pub(super) parameters: usize,
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
        let recorder = Recorder::new(false);
        let outputs: Vec<u32> = {
            let (x, p) = (recorder.inputs(0, inputs), recorder.parameters(parameters));
            f(&x, &p).into_iter().map(|y| recorder.row_of(y)).collect()
        };
        let graph = recorder.finish()?;
        Ok(Self::compile(&graph, &outputs, inputs, parameters))
    }

    /// Keeps what the outputs need and sorts it: constants, other uniform rows, lane rows.
    fn compile(graph: &recorder::Graph<S>, outputs: &[u32], inputs: usize, parameters: usize) -> Self {
        let count = graph.nodes.len();
        let node_of = |row: u32| graph.node_of_row[row as usize] as usize;
        let mut needed = vec![false; count];
        for &row in outputs {
            needed[node_of(row)] = true;
        }
        let mut uniform = vec![false; count];
        for index in (0..count).rev() {
            if needed[index] {
                graph.nodes[index].operands(|row| needed[node_of(row)] = true);
            }
        }
        for (index, node) in graph.nodes.iter().enumerate() {
            let mut all = !matches!(node, Node::Input(_));
            node.operands(|row| all &= uniform[node_of(row)]);
            uniform[index] = all;
        }
        let mut place = vec![0u32; count];
        let mut rows = 0u32;
        let mut boundaries = [0usize; 3];
        for (section, boundary) in boundaries.iter_mut().enumerate() {
            for (index, node) in graph.nodes.iter().enumerate() {
                let home = match node {
                    Node::Constant(_) => 0,
                    _ if uniform[index] => 1,
                    _ => 2,
                };
                if needed[index] && home == section {
                    place[index] = rows;
                    rows += node.rows() as u32;
                }
            }
            *boundary = rows as usize;
        }
        let [_, uniform_rows, all_rows] = boundaries;
        let moved = |row: u32| place[node_of(row)] + (row - graph.first[node_of(row)]);
        let mut program = Self {
            uniform_rows,
            lane_rows: all_rows - uniform_rows,
            uniform: Vec::new(),
            lanes: Vec::new(),
            outputs: outputs.iter().map(|&row| moved(row)).collect(),
            inputs,
            parameters,
        };
        for (index, node) in graph.nodes.iter().enumerate().filter(|&(index, _)| needed[index]) {
            let instruction = Instruction { node: node.renumbered(moved), out: place[index] };
            if uniform[index] { &mut program.uniform } else { &mut program.lanes }.push(instruction);
        }
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
    /// Operations done for each lane, inputs included.
    pub fn lane_operations(&self) -> usize {
        self.lanes.len()
    }
    /// Operations done once for the batch, constants and parameters included.
    pub fn uniform_operations(&self) -> usize {
        self.uniform.len()
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
    /// As of [`Program::record`](Program::record).
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
