//! From a recording to operations on whole vectors.

use super::Depth;
use super::operation::{Combination, Dense, Elementwise, Function, Gather, Input, Operation, Product, Select};
use super::value::{Dependence, Layout, Order, Value};
use crate::ops::{Binary, Unary};
use crate::platform::Map;
use crate::scalar::{Real, Scalar};
use crate::tape::TapeError;
use crate::tape::program::{Graph, Node, Recorder, Tracer};
use alloc::vec::Vec;

/// A recorded function `L(q, v)` with parameters, ready to be evaluated by an [`Evaluation`](super::Evaluation).
#[derive(Clone, Debug)]
pub struct Recorded<S> {
    pub(super) operations: Vec<Operation<S>>,
    pub(super) values: Vec<Value>,
    pub(super) output: usize,
    /// Value of each input, coordinates first; `None` where the function does not depend on it.
    pub(super) inputs: Vec<Option<usize>>,
    pub(super) scale: Vec<S>,
    pub(super) parameters: usize,
    /// Numbers per state of derivatives of elementwise functions, and functions of two numbers.
    pub(super) slopes: usize,
    pub(super) functions: usize,
    pub(super) forward: [Layout; 3],
    pub(super) adjoint: Layout,
    pub(super) mixed: [Layout; 2],
}

impl<S: Scalar> Recorded<S> {
    /// Records `f(parameters, q, v)` for `n = scale.len()` coordinates; derivatives will be taken by `q_i/s_i` and
    /// `v_i/s_i`.
    ///
    /// # Errors
    /// [`TapeError::DataDependentBranch`] if `f` reads a value, [`TapeError::MixedTapes`] if it uses numbers of another
    /// recording.
    pub fn new<F>(scale: Vec<S>, parameters: usize, f: F) -> Result<Self, TapeError>
    where
        F: for<'t> FnOnce(&[Tracer<'t, S>], &[Tracer<'t, S>], &[Tracer<'t, S>]) -> Tracer<'t, S>,
    {
        let n = scale.len();
        let recorder = Recorder::new(true);
        let output = {
            let (q, v) = (recorder.inputs(0, n), recorder.inputs(n, n));
            recorder.row_of(f(&recorder.parameters(parameters), &q, &v))
        };
        let graph = recorder.finish()?;
        let mut compiler = Compiler::new(&graph, n);
        let output = compiler.run(output);
        let Compiler { operations, mut values, inputs, slopes, functions, .. } = compiler;
        mark(&operations, &mut values, output);
        let forward =
            [Depth::Gradient, Depth::MassMatrix, Depth::Motion].map(|depth| Layout::forward(&values, depth, n));
        let mixed = [Order::First, Order::Second].map(|order| Layout::new(&values, |value| value.mixed(order).count));
        let adjoint = Layout::new(&values, |_| 1);
        Ok(Self { operations, values, output, inputs, scale, parameters, slopes, functions, forward, adjoint, mixed })
    }

    /// Number of coordinates `n`.
    pub(crate) fn coordinates(&self) -> usize {
        self.scale.len()
    }
    /// Number of parameters.
    pub(crate) fn parameters(&self) -> usize {
        self.parameters
    }
    /// Scales `s_i` of the coordinates.
    pub(crate) fn scale(&self) -> &[S] {
        &self.scale
    }
    /// Offset among the parameters, rows and columns of every weight matrix, in order.
    pub(crate) fn matrices(&self) -> Vec<(usize, usize, usize)> {
        let dense = |operation: &Operation<S>| match operation {
            Operation::Dense(dense) => Some((dense.weights, dense.outputs, dense.inputs)),
            _ => None,
        };
        let mut matrices: Vec<_> = self.operations.iter().filter_map(dense).collect();
        matrices.sort_unstable();
        matrices.dedup();
        matrices
    }
    pub(super) fn layout(&self, depth: Depth) -> &Layout {
        &self.forward[match depth {
            Depth::Value | Depth::Gradient => 0,
            Depth::MassMatrix => 1,
            Depth::Motion | Depth::Training => 2,
        }]
    }
    pub(super) fn mixed_layout(&self, order: Order) -> &Layout {
        &self.mixed[usize::from(order == Order::Second)]
    }
}

/// Determines which values reach the output linearly, and which adjoints need no zeros.
fn mark<S: Scalar>(operations: &[Operation<S>], values: &mut [Value], output: usize) {
    let mut readers = vec![0usize; values.len()];
    values.iter_mut().for_each(|value| value.is_output = false);
    let mut is_output = vec![true; values.len()];
    readers[output] += 1;
    for (out, operation) in operations.iter().enumerate().rev() {
        operation.operands(|x| readers[x] += 1);
        match operation {
            Operation::Elementwise(op) => is_output[op.x] = false,
            Operation::Function(op) => (is_output[op.a], is_output[op.b]) = (false, false),
            Operation::Product(op) => match (values[op.a].kind, values[op.b].kind) {
                // A constant factor has no second derivative, but its adjoint needs the other factor.
                (Dependence::Constant, _) => {
                    (is_output[op.a], is_output[op.b]) = (false, is_output[op.b] && is_output[out])
                }
                (_, Dependence::Constant) => {
                    (is_output[op.a], is_output[op.b]) = (is_output[op.a] && is_output[out], false)
                }
                _ => (is_output[op.a], is_output[op.b]) = (false, false),
            },
            Operation::Select(op) => op.branches.into_iter().for_each(|x| is_output[x] &= is_output[out]),
            _ => operation.operands(|x| is_output[x] &= is_output[out]),
        }
    }
    for operation in operations {
        let reader = match operation {
            Operation::Elementwise(op) => Some(op.x),
            Operation::Dense(op) => Some(op.x),
            _ => None,
        };
        if let Some(x) = reader {
            values[x].in_place = readers[x] == 1;
        }
    }
    values.iter_mut().zip(is_output).for_each(|(value, is_output)| value.is_output = is_output);
}

struct Compiler<'g, S> {
    graph: &'g Graph<S>,
    n: usize,
    operations: Vec<Operation<S>>,
    values: Vec<Value>,
    inputs: Vec<Option<usize>>,
    slopes: usize,
    functions: usize,
    /// Value and unit of each row.
    place: Vec<Option<(usize, usize)>>,
    /// Single components extracted from values with several units.
    taken: Map<(usize, usize), usize>,
    needed: Vec<bool>,
}

impl<'g, S: Scalar> Compiler<'g, S> {
    fn new(graph: &'g Graph<S>, n: usize) -> Self {
        let rows = graph.node_of_row.len();
        Self {
            graph,
            n,
            operations: Vec::new(),
            values: Vec::new(),
            inputs: vec![None; 2 * n],
            slopes: 0,
            functions: 0,
            place: vec![None; rows],
            taken: Map::new(),
            needed: vec![false; rows],
        }
    }

    fn node(&self, row: u32) -> &'g Node<S> {
        &self.graph.nodes[self.graph.node_of_row[row as usize] as usize]
    }

    /// Value of the output row.
    fn run(&mut self, output: u32) -> usize {
        self.needed[output as usize] = true;
        for (index, node) in self.graph.nodes.iter().enumerate().rev() {
            let first = self.graph.first[index] as usize;
            if self.needed[first..first + node.rows()].contains(&true) {
                node.operands(|row| self.needed[row as usize] = true);
            }
        }
        for index in 0..self.graph.nodes.len() {
            let first = self.graph.first[index] as usize;
            let rows = self.graph.nodes[index].rows();
            let waits = (first..first + rows).any(|row| self.needed[row] && self.place[row].is_none());
            if waits {
                self.add_node(index);
            }
        }
        self.number(output)
    }

    fn push(&mut self, operation: Operation<S>, units: usize, kind: Dependence) -> usize {
        let mut trainable = matches!(operation, Operation::Parameter(_) | Operation::Dense(_));
        let mut velocities = Vec::new();
        operation.operands(|x| {
            trainable |= self.values[x].trainable;
            velocities.extend(&self.values[x].velocities);
        });
        match &operation {
            Operation::Input(input) if kind == Dependence::Velocity => velocities.push(input.index - self.n),
            // No direction changes the argument of a condition.
            Operation::Select(op) => {
                velocities = op.branches.iter().flat_map(|&x| self.values[x].velocities.clone()).collect();
            }
            _ => {}
        }
        velocities.sort_unstable();
        velocities.dedup();
        self.operations.push(operation);
        self.values.push(Value { units, kind, velocities, is_output: false, trainable, in_place: false });
        self.values.len() - 1
    }

    fn kind_of(&self, values: &[usize]) -> Dependence {
        values.iter().map(|&value| self.values[value].kind).max().unwrap_or(Dependence::Constant)
    }

    /// The value of one unit that a row is.
    fn number(&mut self, row: u32) -> usize {
        // Operands precede their readers.
        let Some((value, unit)) = self.place[row as usize] else { return 0 };
        if self.values[value].units == 1 {
            return value;
        }
        if let Some(&known) = self.taken.get(&(value, unit)) {
            return known;
        }
        let kind = self.values[value].kind;
        let taken = self.push(Operation::Gather(Gather { sources: vec![(value, unit)] }), 1, kind);
        self.taken.insert((value, unit), taken);
        taken
    }

    fn elementwise(&mut self, f: Unary, x: usize) -> usize {
        let units = self.values[x].units;
        let slope = self.slopes;
        self.slopes += units;
        self.push(Operation::Elementwise(Elementwise { f, x, units, slope }), units, self.values[x].kind)
    }

    /// The function and the operand of a node that applies one, `x x` among them.
    fn function(node: &Node<S>) -> Option<(Unary, u32)> {
        match *node {
            Node::Unary(Unary::Neg, _) => None,
            Node::Unary(f, a) => Some((f, a)),
            Node::Binary(Binary::Mul, a, b) if a == b => Some((Unary::Powi(2), a)),
            _ => None,
        }
    }

    /// Applies a function to a whole value if the nodes from `index` on do so, unit by unit.
    fn add_run(&mut self, index: usize, f: Unary, a: u32) -> bool {
        let Some((value, 0)) = self.place[a as usize] else { return false };
        let units = self.values[value].units;
        let nodes = self.graph.nodes.get(index..index + units).unwrap_or(&[]);
        let fits = |(k, node): (usize, &Node<S>)| {
            let row = self.graph.first[index + k] as usize;
            Self::function(node).is_some_and(|(g, x)| g == f && self.place[x as usize] == Some((value, k)))
                && self.needed[row]
        };
        if units < 2 || nodes.len() < units || !nodes.iter().enumerate().all(fits) {
            return false;
        }
        let out = self.elementwise(f, value);
        for k in 0..units {
            self.place[self.graph.first[index + k] as usize] = Some((out, k));
        }
        true
    }

    fn add_node(&mut self, index: usize) {
        let first = self.graph.first[index] as usize;
        let node = &self.graph.nodes[index];
        if let Some((f, a)) = Self::function(node) {
            if !self.add_run(index, f, a) {
                let x = self.number(a);
                self.place[first] = Some((self.elementwise(f, x), 0));
            }
            return;
        }
        let constant = |compiler: &Self, row: u32| match compiler.node(row) {
            Node::Constant(value) => Some(*value),
            _ => None,
        };
        let one = <S as Real>::one();
        let value = match node {
            Node::Input(index) => {
                let index = *index as usize;
                let kind = if index < self.n { Dependence::Position } else { Dependence::Velocity };
                let value = self.push(Operation::Input(Input { index }), 1, kind);
                self.inputs[index] = Some(value);
                value
            }
            Node::Parameter(index) => self.push(Operation::Parameter(*index as usize), 1, Dependence::Constant),
            Node::Constant(value) => self.push(Operation::Constant(*value), 1, Dependence::Constant),
            Node::Unary(_, a) => self.combine(*a, -one, None),
            Node::SinCos(a) => {
                let x = self.number(*a);
                for (k, f) in [Unary::Sin, Unary::Cos].into_iter().enumerate() {
                    if self.needed[first + k] {
                        self.place[first + k] = Some((self.elementwise(f, x), 0));
                    }
                }
                return;
            }
            Node::Binary(Binary::Add, a, b) => self.combine(*a, one, Some((*b, one))),
            Node::Binary(Binary::Sub, a, b) => self.combine(*a, one, Some((*b, -one))),
            Node::Binary(Binary::Mul, a, b) => match (constant(self, *a), constant(self, *b)) {
                (Some(factor), _) => self.combine(*b, factor, None),
                (_, Some(factor)) => self.combine(*a, factor, None),
                _ => self.product(*a, *b),
            },
            Node::Binary(Binary::Div, a, b) => {
                let divisor = self.number(*b);
                let inverse = self.elementwise(Unary::Recip, divisor);
                let a = self.number(*a);
                let kind = self.kind_of(&[a, inverse]);
                self.push(Operation::Product(Product { a, b: inverse }), 1, kind)
            }
            Node::Binary(f, a, b) => {
                let (a, b) = (self.number(*a), self.number(*b));
                let number = self.functions;
                self.functions += 1;
                self.push(Operation::Function(Function { f: *f, a, b, number }), 1, self.kind_of(&[a, b]))
            }
            Node::Select(c, a, b) => {
                let [condition, a, b] = [*c, *a, *b].map(|row| self.number(row));
                self.push(Operation::Select(Select { condition, branches: [a, b] }), 1, self.kind_of(&[a, b]))
            }
            Node::Dense(dense) => {
                let x = self.vector(&dense.inputs);
                let (inputs, outputs) = (dense.inputs.len(), dense.outputs);
                let op = Dense { x, inputs, outputs, weights: dense.weights, bias: dense.bias };
                let value = self.push(Operation::Dense(op), outputs, self.values[x].kind);
                for k in 0..outputs {
                    self.place[first + k] = Some((value, k));
                }
                return;
            }
        };
        self.place[first] = Some((value, 0));
    }

    fn product(&mut self, a: u32, b: u32) -> usize {
        let (a, b) = (self.number(a), self.number(b));
        self.push(Operation::Product(Product { a, b }), 1, self.kind_of(&[a, b]))
    }

    fn combine(&mut self, a: u32, factor: S, b: Option<(u32, S)>) -> usize {
        let a = self.number(a);
        let b = b.map(|(b, factor)| (self.number(b), factor));
        let kind = b.map_or(self.values[a].kind, |(b, _)| self.kind_of(&[a, b]));
        self.push(Operation::Combination(Combination::new((a, factor), b)), 1, kind)
    }

    /// Returns the value that contains these rows in this order, and creates it if necessary.
    fn vector(&mut self, rows: &[u32]) -> usize {
        let places: Vec<(usize, usize)> = rows.iter().filter_map(|&row| self.place[row as usize]).collect();
        let (value, _) = places[0];
        let whole = self.values[value].units == rows.len();
        if whole && places.iter().enumerate().all(|(k, &place)| place == (value, k)) {
            return value;
        }
        let sources: Vec<usize> = places.iter().map(|place| place.0).collect();
        let kind = self.kind_of(&sources);
        self.push(Operation::Gather(Gather { sources: places }), rows.len(), kind)
    }
}
