//! Runs: like operations behind one another, which the interpreter decides on once.

use super::{Graph, Node};
use crate::ops::{Binary, Unary};
use crate::scalar::Scalar;
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::ops::Range;

/// In runs of at least this many operations, no operation reads a result of the same run.
const UNCHAINED: usize = 6;

/// The kind of an operation, without its operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Lane input.
    Input,
    /// Parameter.
    Parameter,
    /// Constant.
    Constant,
    /// Function of one row.
    Unary(Unary),
    /// Sine and cosine of one row: two rows.
    SinCos,
    /// Function of two rows.
    Binary(Binary),
    /// Recordable branch.
    Select,
}

impl Kind {
    fn of<S>(node: &Node<S>) -> Self {
        match node {
            Node::Input(_) => Self::Input,
            Node::Parameter(_) => Self::Parameter,
            Node::Constant(_) => Self::Constant,
            Node::Unary(f, _) => Self::Unary(*f),
            Node::SinCos(_) => Self::SinCos,
            Node::Binary(f, ..) => Self::Binary(*f),
            Node::Select(..) => Self::Select,
            Node::Dense(_) => unreachable!("programs of rows are recorded without blocks"),
        }
    }
    /// Operands of an operation.
    pub fn arity(self) -> usize {
        match self {
            Self::Binary(_) => 2,
            Self::Select => 3,
            _ => 1,
        }
    }
    /// `true` if its operands are rows.
    pub fn reads_rows(self) -> bool {
        !matches!(self, Self::Input | Self::Parameter | Self::Constant)
    }
    /// Rows that an operation fills.
    pub fn rows(self) -> usize {
        if self == Self::SinCos { 2 } else { 1 }
    }
    /// `true` if the operations of a run are computed one after the other, so that one may read the result of another one. Functions are
    /// computed side by side.
    fn may_chain(self) -> bool {
        match self {
            Self::Binary(f) => matches!(f, Binary::Add | Binary::Sub | Binary::Mul),
            Self::Unary(f) => f == Unary::Neg,
            Self::Input | Self::Parameter | Self::Constant => true,
            Self::SinCos | Self::Select => false,
        }
    }
}

/// Like operations behind one another, which fill consecutive rows.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub kind: Kind,
    /// First row that is filled.
    pub out: u32,
    /// The range of the operands, operation by operation.
    pub operands: Range<usize>,
    /// `true` if an operation of the run reads the result of another one.
    pub chained: bool,
}

impl Run {
    /// Number of operations.
    pub fn count(&self) -> usize {
        self.operands.len() / self.kind.arity()
    }
}

/// From a graph to runs.
pub(super) struct Compiler<'g, S> {
    pub graph: &'g Graph<S>,
    /// First row of each operation that was placed.
    pub place: Vec<u32>,
    pub rows: u32,
    pub operands: Vec<u32>,
    pub constants: Vec<S>,
}

impl<S: Scalar> Compiler<'_, S> {
    /// The row of the program that a row of the graph became.
    pub fn row(&self, row: u32) -> u32 {
        let node = self.graph.node_of_row[row as usize] as usize;
        self.place[node] + (row - self.graph.first[node])
    }

    /// Places operations, which are given in the order of the recording.
    pub fn section(&mut self, nodes: &[usize]) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for (index, begins) in self.grouped(nodes) {
            let kind = Kind::of(&self.graph.nodes[index]);
            let own = self.operands.len();
            self.place[index] = self.rows;
            self.push_operands(index);
            let place = self.place[index];
            let reads_run = |run: &Run| kind.reads_rows() && self.operands[own..].iter().any(|&row| row >= run.out);
            match runs.last_mut() {
                Some(run) if run.kind == kind && !begins && (kind.may_chain() || !reads_run(run)) => {
                    run.chained |= reads_run(run);
                    run.operands.end = self.operands.len();
                }
                _ => runs.push(Run { kind, out: place, operands: own..self.operands.len(), chained: false }),
            }
            self.rows += kind.rows() as u32;
        }
        runs
    }

    fn push_operands(&mut self, index: usize) {
        match &self.graph.nodes[index] {
            Node::Input(index) | Node::Parameter(index) => self.operands.push(*index),
            Node::Constant(value) => {
                self.operands.push(self.constants.len() as u32);
                self.constants.push(*value);
            }
            node => node.operands(|row| {
                let row = self.row(row);
                self.operands.push(row);
            }),
        }
    }

    /// The operations grouped by kind, each as soon as its operands are available; the first ones of runs are marked.
    fn grouped(&self, nodes: &[usize]) -> Vec<(usize, bool)> {
        let count = self.graph.nodes.len();
        let (mut waiting, mut here) = (vec![0u32; count], vec![false; count]);
        let mut readers: Vec<Vec<u32>> = vec![Vec::new(); count];
        let node_of = |row: u32| self.graph.node_of_row[row as usize] as usize;
        for &index in nodes {
            here[index] = true;
            self.graph.nodes[index].operands(|row| {
                if here[node_of(row)] {
                    waiting[index] += 1;
                    readers[node_of(row)].push(index as u32);
                }
            });
        }
        let mut ready: Vec<(Kind, VecDeque<usize>)> = Vec::new();
        let add = |ready: &mut Vec<(Kind, VecDeque<usize>)>, index: usize| {
            let kind = Kind::of(&self.graph.nodes[index]);
            match ready.iter_mut().find(|(of, _)| *of == kind) {
                Some((_, queue)) => queue.push_back(index),
                None => ready.push((kind, VecDeque::from([index]))),
            }
        };
        nodes.iter().filter(|&&index| waiting[index] == 0).for_each(|&index| add(&mut ready, index));
        let mut ordered = Vec::with_capacity(nodes.len());
        while let Some(next) = (0..ready.len()).max_by_key(|&k| (ready[k].1.len(), ready.len() - k)) {
            let kind = ready[next].0;
            // Many that wait are worth a run without chains.
            let waiting_now = ready[next].1.len();
            let mut left = if kind.may_chain() && waiting_now < UNCHAINED { usize::MAX } else { waiting_now };
            let mut begins = true;
            while let Some(index) = (left > 0).then(|| ready[next].1.pop_front()).flatten() {
                ordered.push((index, begins));
                (left, begins) = (left - 1, false);
                for &reader in &readers[index] {
                    waiting[reader as usize] -= 1;
                    if waiting[reader as usize] == 0 {
                        add(&mut ready, reader as usize);
                    }
                }
            }
            if ready.iter().all(|(_, queue)| queue.is_empty()) {
                break;
            }
        }
        ordered
    }
}
