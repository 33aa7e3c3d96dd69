//! The eager tape: nodes with their partial derivatives, one reverse sweep.

use super::error::TapeError;
use super::var::Var;
use crate::scalar::Real;
use std::cell::{Cell, RefCell};

/// One recorded operation: up to two arguments and the partial derivatives by them (24 bytes for `f64`).
#[derive(Clone, Copy)]
struct Node<T> {
    a: u32,
    b: u32,
    da: T,
    db: T,
}

/// Room for a node. Its parts are stored one by one: a copy of the whole passes through the stack, where a wide load
/// of numbers just stored in halves stalls.
struct Place<T> {
    a: Cell<u32>,
    b: Cell<u32>,
    da: Cell<T>,
    db: Cell<T>,
}

impl<T: Real> Place<T> {
    fn empty() -> Self {
        Self { a: Cell::new(0), b: Cell::new(0), da: Cell::new(T::zero()), db: Cell::new(T::zero()) }
    }
    #[inline(always)]
    fn set(&self, node: Node<T>) {
        self.a.set(node.a);
        self.b.set(node.b);
        self.da.set(node.da);
        self.db.set(node.db);
    }
    #[inline(always)]
    fn get(&self) -> Node<T> {
        Node { a: self.a.get(), b: self.b.get(), da: self.da.get(), db: self.db.get() }
    }
}

/// A tape over numbers `T`. Life: recording (operations on [`Var`]s), reversal ([`Tape::reverse`], any number of
/// times), reset ([`Tape::reset`], which keeps the memory).
///
/// Identifier 0 stands for constants, which are never recorded.
pub struct Tape<T> {
    /// Nodes `0..room`, written through shared references: recording is a comparison and two stores.
    room: Vec<Place<T>>,
    /// Nodes from `room` on; the next reset makes room for as many.
    overflow: RefCell<Vec<Node<T>>>,
    /// Nodes recorded, the constant at 0 included.
    count: Cell<u32>,
    limit: u32,
    error: Cell<Option<TapeError>>,
    peak: usize,
}

/// Room of a new tape, in nodes.
const FIRST_ROOM: u32 = 128;

/// One step of the sweep: the weight of a node goes to its arguments.
#[inline(always)]
fn propagate<T: Real>(values: &mut [T], index: usize, node: Node<T>) {
    let weight = values[index];
    if weight.is_exact_zero() {
        return;
    }
    // Identifier 0 is a sink that nobody reads: cheaper than a branch.
    values[node.a as usize] += node.da * weight;
    values[node.b as usize] += node.db * weight;
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
        let mut tape = Self {
            room: Vec::new(),
            overflow: RefCell::new(Vec::new()),
            count: Cell::new(1),
            limit,
            error: Cell::new(None),
            peak: 0,
        };
        tape.grow(limit.min(FIRST_ROOM));
        tape
    }
    /// Makes room for `count` nodes, at least the constant at 0.
    fn grow(&mut self, count: u32) {
        self.room.resize_with(count.max(1) as usize, Place::empty);
    }
    /// A new independent variable.
    #[inline]
    pub fn variable(&self, value: T) -> Var<'_, T> {
        self.push(value, (0, T::zero()), (0, T::zero()))
    }
    /// Records an operation: arguments with the partial derivatives by them.
    #[inline(always)]
    pub(super) fn push(&self, value: T, (a, da): (u32, T), (b, db): (u32, T)) -> Var<'_, T> {
        let (id, node) = (self.count.get(), Node { a, b, da, db });
        let Some(place) = self.room.get(id as usize) else { return self.push_beyond(value, node) };
        place.set(node);
        self.count.set(id + 1);
        Var::recorded(self, id, value)
    }
    /// Records an operation past the room.
    #[cold]
    #[inline(never)]
    fn push_beyond(&self, value: T, node: Node<T>) -> Var<'_, T> {
        let id = self.count.get();
        if id >= self.limit {
            return self.fail(TapeError::Full { limit: self.limit });
        }
        self.overflow.borrow_mut().push(node);
        self.count.set(id + 1);
        Var::recorded(self, id, value)
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
        let values = &mut adjoints.values;
        values.clear();
        values.resize(self.count.get() as usize, T::zero());
        let Some(tape) = output.tape() else { return Ok(()) };
        if !std::ptr::eq(tape, self) {
            return Err(TapeError::Foreign);
        }
        let last = output.id() as usize;
        let values = values.as_mut_slice();
        values[last] = T::one();
        let room = self.room.len();
        if last >= room {
            for (index, &node) in self.overflow.borrow()[..=last - room].iter().enumerate().rev() {
                propagate(values, room + index, node);
            }
        }
        for (index, node) in self.room[..room.min(last + 1)].iter().enumerate().skip(1).rev() {
            propagate(values, index, node.get());
        }
        Ok(())
    }
    /// Forgets everything recorded and any error, and keeps the memory: what was recorded once is recorded again
    /// without allocating. No variable can outlive it.
    pub fn reset(&mut self) {
        let count = self.count.replace(1);
        self.peak = self.peak.max(count as usize - 1);
        if count as usize > self.room.len() {
            *self.overflow.get_mut() = Vec::new();
            self.grow(count.checked_next_power_of_two().unwrap_or(count).min(self.limit));
        }
        self.error.set(None);
    }
    /// Size of the tape.
    pub fn statistics(&self) -> Statistics {
        let nodes = self.count.get() as usize - 1;
        Statistics {
            nodes,
            peak: self.peak.max(nodes),
            bytes: (self.room.capacity() + self.overflow.borrow().capacity()) * size_of::<Node<T>>(),
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
