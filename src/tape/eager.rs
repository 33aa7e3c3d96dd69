//! The eager tape: nodes with their partial derivatives, one reverse sweep.

use super::error::TapeError;
use super::var::Var;
use crate::scalar::Real;
use std::cell::{Cell, RefCell};

/// One recorded operation: up to two arguments and the partial derivatives by them (24 bytes for `f64`).
#[derive(Clone, Copy)]
struct Node<T> {
    arguments: [u32; 2],
    partials: [T; 2],
}

/// A tape over numbers `T`. Life: recording (operations on [`Var`]s), reversal ([`Tape::reverse`], any number of
/// times), reset ([`Tape::reset`], which keeps the memory and costs nothing).
///
/// Identifier 0 stands for constants, which are never recorded.
pub struct Tape<T> {
    nodes: RefCell<Vec<Node<T>>>,
    limit: u32,
    error: Cell<Option<TapeError>>,
    peak: usize,
}

/// Size of a tape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Statistics {
    /// Nodes recorded since the last reset, variables included.
    pub nodes: usize,
    /// Most nodes ever recorded between resets.
    pub peak: usize,
    /// Bytes held.
    pub bytes: usize,
}

/// Derivatives of one output by everything on the tape; a buffer to be reused.
#[derive(Clone, Debug, Default)]
pub struct Adjoints<T> {
    values: Vec<T>,
}

impl<T: Real> Default for Tape<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Tape<T> {
    /// An empty tape.
    pub fn new() -> Self {
        Self::with_limit(u32::MAX)
    }
    /// An empty tape that reports [`TapeError::Full`] past `limit` nodes.
    pub fn with_limit(limit: u32) -> Self {
        let constant = Node { arguments: [0; 2], partials: [T::zero(); 2] };
        Self { nodes: RefCell::new(vec![constant]), limit, error: Cell::new(None), peak: 0 }
    }
    /// A new independent variable.
    #[inline]
    pub fn variable(&self, value: T) -> Var<'_, T> {
        self.push(value, [0; 2], [T::zero(); 2])
    }
    /// Records an operation.
    #[inline(always)]
    pub(super) fn push(&self, value: T, arguments: [u32; 2], partials: [T; 2]) -> Var<'_, T> {
        let mut nodes = self.nodes.borrow_mut();
        let id = nodes.len();
        if id >= self.limit as usize {
            drop(nodes);
            return self.fail(TapeError::Full { limit: self.limit });
        }
        nodes.push(Node { arguments, partials });
        Var::recorded(self, id as u32, value)
    }
    /// Keeps the first error and answers with `NaN`.
    #[cold]
    pub(super) fn fail<'a>(&self, error: TapeError) -> Var<'a, T> {
        if self.error.get().is_none() {
            self.error.set(Some(error));
        }
        Var::not_a_number()
    }
    /// The first error since the last reset.
    ///
    /// # Errors
    /// That error.
    pub fn check(&self) -> Result<(), TapeError> {
        self.error.get().map_or(Ok(()), Err)
    }
    /// Reverse sweep: derivatives of `output` by everything recorded before it.
    ///
    /// Cost: one visit of each node up to the output. A constant output has derivatives 0.
    ///
    /// # Errors
    /// The first error of the recording; [`TapeError::Foreign`] if `output` belongs to another tape.
    pub fn reverse(&self, output: Var<'_, T>, adjoints: &mut Adjoints<T>) -> Result<(), TapeError> {
        self.check()?;
        let nodes = self.nodes.borrow();
        let values = &mut adjoints.values;
        values.clear();
        values.resize(nodes.len(), T::zero());
        let Some(tape) = output.tape() else { return Ok(()) };
        if !std::ptr::eq(tape, self) {
            return Err(TapeError::Foreign);
        }
        let last = output.id() as usize;
        values[last] = T::one();
        for (index, node) in nodes[..=last].iter().enumerate().skip(1).rev() {
            let weight = values[index];
            if weight.is_exact_zero() {
                continue;
            }
            // Identifier 0 is a sink that nobody reads: cheaper than a branch.
            let ([a, b], [da, db]) = (node.arguments, node.partials);
            values[a as usize] += da * weight;
            values[b as usize] += db * weight;
        }
        Ok(())
    }
    /// Forgets everything recorded and any error, and keeps the memory. No variable can outlive it.
    pub fn reset(&mut self) {
        let nodes = self.nodes.get_mut();
        self.peak = self.peak.max(nodes.len() - 1);
        nodes.truncate(1);
        self.error.set(None);
    }
    /// Size of the tape.
    pub fn statistics(&self) -> Statistics {
        let nodes = self.nodes.borrow();
        Statistics {
            nodes: nodes.len() - 1,
            peak: self.peak.max(nodes.len() - 1),
            bytes: nodes.capacity() * size_of::<Node<T>>(),
        }
    }
}

impl<T: Real> Adjoints<T> {
    /// An empty buffer.
    pub fn new() -> Self {
        Self { values: Vec::new() }
    }
    /// Derivative of the last sweep's output by `variable`; 0 for constants and for what was recorded later.
    #[inline]
    pub fn of(&self, variable: Var<'_, T>) -> T {
        match variable.id() {
            0 => T::zero(),
            id => self.values.get(id as usize).copied().unwrap_or_else(T::zero),
        }
    }
}
