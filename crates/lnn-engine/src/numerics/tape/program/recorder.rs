//! The graph of a program while it is recorded: every expression once.

use super::Tracer;
use crate::ops::{Binary, Unary};
use crate::platform::SmallKeyMap;
use crate::scalar::{Real, Scalar};
use crate::tape::TapeError;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};

/// One operation; operands are rows.
#[derive(Clone, Debug)]
pub(in crate::numerics::tape) enum Node<S> {
    /// Lane input.
    Input(u32),
    /// Parameter, uniform over the lanes.
    Parameter(u32),
    /// Constant.
    Constant(S),
    /// Function of one row.
    Unary(Unary, u32),
    /// Sine and cosine of one row: two rows, each the derivative of the other.
    SinCos(u32),
    /// Function of two rows.
    Binary(Binary, u32, u32),
    /// Recordable branch.
    Select(u32, u32, u32),
    /// `W x + b` on rows, one row per output.
    Dense(Dense),
}

/// A dense layer: the positions of its inputs, weights and biases.
#[derive(Clone, Debug)]
pub(in crate::numerics::tape) struct Dense {
    /// Rows of the inputs.
    pub(in crate::numerics::tape) inputs: Vec<u32>,
    /// Number of outputs.
    pub(in crate::numerics::tape) outputs: usize,
    /// First parameter of `W`, `(outputs, inputs)` row-major.
    pub(in crate::numerics::tape) weights: usize,
    /// First parameter of `b`, `(outputs)`.
    pub(in crate::numerics::tape) bias: Option<usize>,
}

impl<S> Node<S> {
    /// Rows that it fills.
    pub(in crate::numerics::tape) fn rows(&self) -> usize {
        match self {
            Self::SinCos(_) => 2,
            Self::Dense(dense) => dense.outputs,
            _ => 1,
        }
    }
    /// Visits the rows that it reads.
    pub(in crate::numerics::tape) fn operands(&self, mut visit: impl FnMut(u32)) {
        match self {
            Self::Input(_) | Self::Parameter(_) | Self::Constant(_) => {}
            Self::Unary(_, a) | Self::SinCos(a) => visit(*a),
            Self::Binary(_, a, b) => [*a, *b].into_iter().for_each(visit),
            Self::Select(c, a, b) => [*c, *a, *b].into_iter().for_each(visit),
            Self::Dense(dense) => dense.inputs.iter().copied().for_each(visit),
        }
    }
}

/// Identity of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Key {
    Input(u32),
    Parameter(u32),
    Constant(u64, u64),
    Unary(Unary, u32),
    SinCos(u32),
    Binary(Binary, u32, u32),
    Select(u32, u32, u32),
}

/// The recorded expressions.
#[derive(Debug)]
pub(in crate::numerics::tape) struct Graph<S> {
    /// Operations in the order of recording.
    pub(in crate::numerics::tape) nodes: Vec<Node<S>>,
    /// First row of each operation.
    pub(in crate::numerics::tape) first: Vec<u32>,
    /// Operation of each row.
    pub(in crate::numerics::tape) node_of_row: Vec<u32>,
    known: SmallKeyMap<Key, u32>,
}

/// Bit of a row that names a parameter which is not recorded yet: most weights of a network are read by blocks alone.
pub(super) const PARAMETER: u32 = 1 << 31;

/// Records a [`Program`](super::Program).
#[derive(Debug)]
pub struct Recorder<S> {
    graph: RefCell<Graph<S>>,
    error: Cell<Option<TapeError>>,
    /// `true` if dense layers are recorded as blocks.
    blocks: bool,
    /// Rows at most.
    limit: u32,
}

impl<S: Scalar> Recorder<S> {
    pub(in crate::numerics::tape) fn new(blocks: bool) -> Self {
        Self::within(PARAMETER, blocks)
    }
    /// A recorder of at most `limit` rows.
    pub(in crate::numerics::tape) fn within(limit: u32, blocks: bool) -> Self {
        let graph =
            Graph { nodes: Vec::new(), first: Vec::new(), node_of_row: Vec::new(), known: SmallKeyMap::default() };
        Self { graph: RefCell::new(graph), error: Cell::new(None), blocks, limit }
    }
    /// The numbers of lane inputs `first..first + count`.
    pub(in crate::numerics::tape) fn inputs(&self, first: usize, count: usize) -> Vec<Tracer<'_, S>> {
        (first..first + count).map(|i| self.tracer(self.row(Node::Input(i as u32)))).collect()
    }
    /// The numbers of all parameters; each is recorded when it is first used by itself.
    pub(in crate::numerics::tape) fn parameters(&self, count: usize) -> Vec<Tracer<'_, S>> {
        (0..count as u32).map(|i| self.tracer(i | PARAMETER)).collect()
    }
    /// Keeps the first error.
    #[cold]
    pub(in crate::numerics::tape) fn latch(&self, error: TapeError) {
        if self.error.get().is_none() {
            self.error.set(Some(error));
        }
    }
    pub(in crate::numerics::tape) fn finish(self) -> Result<Graph<S>, TapeError> {
        self.error.get().map_or_else(|| Ok(self.graph.into_inner()), Err)
    }
    /// First row of the operation, recorded now unless the same expression was before.
    pub(in crate::numerics::tape) fn row(&self, node: Node<S>) -> u32 {
        let mut graph = self.graph.borrow_mut();
        let key = match &node {
            Node::Input(i) => Some(Key::Input(*i)),
            Node::Parameter(i) => Some(Key::Parameter(*i)),
            Node::Constant(value) => {
                let (high, low) = value.parts();
                Some(Key::Constant(high.to_bits(), low.to_bits()))
            }
            Node::Unary(f, a) => Some(Key::Unary(*f, *a)),
            Node::SinCos(a) => Some(Key::SinCos(*a)),
            // Sums and products commute to the bit.
            Node::Binary(f @ (Binary::Add | Binary::Mul), a, b) => Some(Key::Binary(*f, *a.min(b), *a.max(b))),
            Node::Binary(f, a, b) => Some(Key::Binary(*f, *a, *b)),
            Node::Select(c, a, b) => Some(Key::Select(*c, *a, *b)),
            Node::Dense(_) => None,
        };
        if let Some(&row) = key.as_ref().and_then(|key| graph.known.get(key)) {
            return row;
        }
        let (row, index) = (graph.node_of_row.len(), graph.nodes.len() as u32);
        if row + node.rows() > self.limit as usize {
            drop(graph);
            self.latch(TapeError::Full { limit: self.limit });
            return 0;
        }
        graph.node_of_row.resize(row + node.rows(), index);
        graph.first.push(row as u32);
        graph.nodes.push(node);
        if let Some(key) = key {
            graph.known.insert(key, row as u32);
        }
        row as u32
    }
    /// The row of an expression, as a number.
    pub(in crate::numerics::tape) fn tracer(&self, row: u32) -> Tracer<'_, S> {
        Tracer::recorded(self, row)
    }
    /// The row of a number; constants get one.
    pub(in crate::numerics::tape) fn row_of(&self, number: Tracer<'_, S>) -> u32 {
        match number.recorder() {
            None => self.row(Node::Constant(number.constant_value())),
            Some(recorder) => {
                if !core::ptr::eq(recorder, self) {
                    self.latch(TapeError::MixedTapes);
                    recorder.latch(TapeError::MixedTapes);
                }
                match number.row() {
                    row if row & PARAMETER == 0 => row,
                    row => self.row(Node::Parameter(row & !PARAMETER)),
                }
            }
        }
    }
    /// The start of a stretch of parameters, if the numbers are one.
    fn stretch(&self, numbers: &[Tracer<'_, S>]) -> Option<usize> {
        let place = |number: &Tracer<'_, S>| {
            let own = number.recorder().is_some_and(|recorder| core::ptr::eq(recorder, self));
            (own && number.row() & PARAMETER != 0).then(|| (number.row() & !PARAMETER) as usize)
        };
        let start = place(numbers.first()?)?;
        let consecutive = numbers.iter().enumerate().all(|(k, number)| place(number) == Some(start + k));
        consecutive.then_some(start)
    }
    /// A dense layer as one block, if this recorder takes blocks and the weights are stretches of the parameters.
    pub(super) fn dense<'t>(
        &'t self,
        weights: &[Tracer<'t, S>],
        bias: &[Tracer<'t, S>],
        x: &[Tracer<'t, S>],
    ) -> Option<Vec<Tracer<'t, S>>> {
        if !self.blocks {
            return None;
        }
        let start = self.stretch(weights)?;
        let bias = if bias.is_empty() { None } else { Some(self.stretch(bias)?) };
        let inputs = x.iter().map(|&x| self.row_of(x)).collect();
        let outputs = weights.len() / x.len();
        let first = self.row(Node::Dense(Dense { inputs, outputs, weights: start, bias }));
        Some((0..outputs as u32).map(|k| self.tracer(first + k)).collect())
    }
    /// The operation that fills a row, if it is the negation of another row: that row.
    pub(super) fn negated(&self, row: u32) -> Option<u32> {
        self.looked_up(row, |_, node| match node {
            Node::Unary(Unary::Neg, a) => Some(*a),
            _ => None,
        })
    }
    /// The operation that fills a row, if it is a product: its factors.
    pub(super) fn factors(&self, row: u32) -> Option<[Tracer<'_, S>; 2]> {
        self.looked_up(row, |graph, node| match node {
            Node::Binary(Binary::Mul, a, b) => {
                Some([*a, *b].map(|row| match graph.nodes[graph.node_of_row[row as usize] as usize] {
                    Node::Constant(value) => Tracer::constant(value),
                    _ => self.tracer(row),
                }))
            }
            _ => None,
        })
    }
    /// Looks up the operation that fills a row.
    fn looked_up<T>(&self, row: u32, look: impl FnOnce(&Graph<S>, &Node<S>) -> Option<T>) -> Option<T> {
        if row & PARAMETER != 0 {
            return None;
        }
        let graph = self.graph.borrow();
        look(&graph, &graph.nodes[graph.node_of_row[row as usize] as usize])
    }
}
