//! The graph of a program while it is recorded: every expression once.

use super::Tracer;
use crate::ops::{Binary, Unary};
use crate::scalar::Scalar;
use crate::tape::block::BlockOp;
use crate::tape::error::TapeError;
use std::cell::{Cell, RefCell};
use std::collections::HashMap;

/// One operation; operands are rows.
#[derive(Clone, Debug)]
pub(in crate::tape) enum Node<S> {
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
    /// Operation on blocks of rows.
    Block(BlockOp<S>),
}

impl<S> Node<S> {
    /// Rows that it fills.
    pub(in crate::tape) fn rows(&self) -> usize {
        match self {
            Self::SinCos(_) => 2,
            Self::Block(op) => op.rows(),
            _ => 1,
        }
    }
    /// Visits the rows that it reads.
    pub(in crate::tape) fn operands(&self, mut visit: impl FnMut(u32)) {
        match self {
            Self::Input(_) | Self::Parameter(_) | Self::Constant(_) => {}
            Self::Unary(_, a) | Self::SinCos(a) => visit(*a),
            Self::Binary(_, a, b) => [*a, *b].into_iter().for_each(visit),
            Self::Select(c, a, b) => [*c, *a, *b].into_iter().for_each(visit),
            Self::Block(op) => op.operands(visit),
        }
    }
    /// The same operation on renumbered rows (the first row of a block stands for the block).
    pub(in crate::tape) fn renumbered(&self, to: impl Fn(u32) -> u32) -> Self
    where
        S: Clone,
    {
        match self {
            Self::Input(_) | Self::Parameter(_) | Self::Constant(_) => self.clone(),
            Self::Unary(f, a) => Self::Unary(*f, to(*a)),
            Self::SinCos(a) => Self::SinCos(to(*a)),
            Self::Binary(f, a, b) => Self::Binary(*f, to(*a), to(*b)),
            Self::Select(c, a, b) => Self::Select(to(*c), to(*a), to(*b)),
            Self::Block(op) => Self::Block(op.renumbered(to)),
        }
    }
}

/// What identifies an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
pub(in crate::tape) struct Graph<S> {
    /// Operations in the order of recording.
    pub(in crate::tape) nodes: Vec<Node<S>>,
    /// First row of each operation.
    pub(in crate::tape) first: Vec<u32>,
    /// Operation of each row.
    pub(in crate::tape) node_of_row: Vec<u32>,
    known: HashMap<Key, u32>,
}

/// Records a [`Program`](super::Program); also the place where block operations are called.
#[derive(Debug)]
pub struct Recorder<S> {
    graph: RefCell<Graph<S>>,
    error: Cell<Option<TapeError>>,
    parameters: usize,
}

impl<S: Scalar> Recorder<S> {
    pub(super) fn new(parameters: usize) -> Self {
        let graph = Graph { nodes: Vec::new(), first: Vec::new(), node_of_row: Vec::new(), known: HashMap::new() };
        Self { graph: RefCell::new(graph), error: Cell::new(None), parameters }
    }
    /// Number of parameters of the program.
    pub(in crate::tape) fn parameters(&self) -> usize {
        self.parameters
    }
    /// Keeps the first error.
    #[cold]
    pub(in crate::tape) fn latch(&self, error: TapeError) {
        if self.error.get().is_none() {
            self.error.set(Some(error));
        }
    }
    pub(super) fn finish(self) -> Result<Graph<S>, TapeError> {
        self.error.get().map_or_else(|| Ok(self.graph.into_inner()), Err)
    }
    /// First row of the operation, recorded now unless the same expression was before.
    pub(in crate::tape) fn row(&self, node: Node<S>) -> u32 {
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
            Node::Block(_) => None,
        };
        if let Some(&row) = key.as_ref().and_then(|key| graph.known.get(key)) {
            return row;
        }
        let (row, index) = (graph.node_of_row.len(), graph.nodes.len() as u32);
        if row + node.rows() > u32::MAX as usize {
            drop(graph);
            self.latch(TapeError::Full { limit: u32::MAX });
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
    pub(in crate::tape) fn tracer(&self, row: u32) -> Tracer<'_, S> {
        Tracer::recorded(self, row)
    }
    /// The row that holds a number; constants get one.
    pub(in crate::tape) fn row_of(&self, number: Tracer<'_, S>) -> u32 {
        match number.recorder() {
            None => self.row(Node::Constant(number.constant_value())),
            Some(recorder) => {
                if !std::ptr::eq(recorder, self) {
                    self.latch(TapeError::MixedTapes);
                    recorder.latch(TapeError::MixedTapes);
                }
                number.row()
            }
        }
    }
    /// The operation that fills a row, if it is the negation of another row: that row.
    pub(super) fn negated(&self, row: u32) -> Option<u32> {
        let graph = self.graph.borrow();
        match graph.nodes[graph.node_of_row[row as usize] as usize] {
            Node::Unary(Unary::Neg, a) => Some(a),
            _ => None,
        }
    }
}
