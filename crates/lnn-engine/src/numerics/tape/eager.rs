//! The eager tape: nodes with their partial derivatives, one reverse sweep.

use super::TapeError;
use super::var::Var;
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};

/// One recorded operation: two arguments and the partial derivatives by them (24 bytes for `f64`).
///
/// Its parts are stored one by one: a copy of the whole passes through the stack, where a wide load of numbers just
/// stored in halves stalls.
struct Node<T> {
    /// First argument in the low half, second in the high half.
    arguments: Cell<u64>,
    da: Cell<T>,
    db: Cell<T>,
}

/// Both arguments in one number.
#[inline(always)]
fn packed(a: u32, b: u32) -> u64 {
    u64::from(a) | u64::from(b) << 32
}

impl<T: Real> Node<T> {
    fn new(arguments: u64, da: T, db: T) -> Self {
        Self { arguments: Cell::new(arguments), da: Cell::new(da), db: Cell::new(db) }
    }
    /// The nodes of its arguments.
    #[inline(always)]
    fn arguments(&self) -> (usize, usize) {
        let both = self.arguments.get();
        (both as u32 as usize, (both >> 32) as usize)
    }
    /// Filling of unused room.
    fn empty() -> Self {
        Self::new(0, T::zero(), T::zero())
    }
}

/// A tape over numbers `T`. Life: recording (operations on [`Var`]s), reversal ([`Tape::reverse`], any number of
/// times), reset ([`Tape::reset`], which keeps the memory).
///
/// Identifier 0 denotes constants, which are never recorded.
pub struct Tape<T> {
    /// Nodes `0..room`, written through shared references: recording is a comparison and four stores.
    room: Vec<Node<T>>,
    /// Nodes beyond `room`; the next reset enlarges `room` by their number.
    overflow: RefCell<Vec<Node<T>>>,
    /// Nodes recorded, the constant at 0 included.
    count: Cell<u32>,
    limit: u32,
    error: Cell<Option<TapeError>>,
    peak: usize,
}

/// Number of nodes for which a new tape has room.
const FIRST_ROOM: u32 = 128;

/// Sweeps nodes, the last one first: the weight of each goes to its arguments, which precede it. `values` are the adjoints up to the last
/// node; returns those before the first one.
///
/// Arguments were mostly recorded just before, so the next weight is handed on in a register where it was just
/// computed: a number read back from memory right after it was written would cost more than everything else here.
/// Identifier 0 is a sink that is never read: it is cheaper than a branch.
#[inline]
fn sweep<'a, T: Real>(nodes: &[Node<T>], mut values: &'a mut [T]) -> &'a mut [T] {
    let Some(&(mut weight)) = values.last() else { return values };
    for node in nodes.iter().rev() {
        let Some((_, before)) = values.split_last_mut() else { return &mut [] };
        let Some(next) = before.len().checked_sub(1) else { return before };
        if weight.is_exact_zero() {
            weight = before[next];
        } else {
            let (a, b) = node.arguments();
            let first = before[a] + node.da.get() * weight;
            before[a] = first;
            let second = before[b] + node.db.get() * weight;
            before[b] = second;
            weight = if b == next {
                second
            } else if a == next {
                first
            } else {
                before[next]
            };
        }
        values = before;
    }
    values
}

/// Size of a tape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TapeSize {
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
        self.room.resize_with(count.max(1) as usize, Node::empty);
    }
    /// A new independent variable.
    #[inline]
    pub fn variable(&self, value: T) -> Var<'_, T> {
        self.push(value, (0, T::zero()), (0, T::zero()))
    }
    /// Records an operation: arguments with the partial derivatives by them.
    #[inline(always)]
    pub(super) fn push(&self, value: T, (a, da): (u32, T), (b, db): (u32, T)) -> Var<'_, T> {
        let (id, arguments) = (self.count.get(), packed(a, b));
        let Some(node) = self.room.get(id as usize) else {
            // The cold call answers with a bare number: a variable would come back through memory, and the compiler
            // would then keep every result there.
            return match self.push_beyond(arguments, da, db) {
                0 => Var::not_a_number(),
                id => Var::recorded(self, id, value),
            };
        };
        node.arguments.set(arguments);
        node.da.set(da);
        node.db.set(db);
        self.count.set(id + 1);
        Var::recorded(self, id, value)
    }
    /// Records an operation past the room: its identifier, 0 if the tape is full.
    #[cold]
    #[inline(never)]
    fn push_beyond(&self, arguments: u64, da: T, db: T) -> u32 {
        let id = self.count.get();
        if id >= self.limit {
            self.latch(TapeError::Full { limit: self.limit });
            return 0;
        }
        self.overflow.borrow_mut().push(Node::new(arguments, da, db));
        self.count.set(id + 1);
        id
    }
    /// Keeps the first error.
    #[cold]
    #[inline(never)]
    pub(super) fn latch(&self, error: TapeError) {
        if self.error.get().is_none() {
            self.error.set(Some(error));
        }
    }
    /// The first error since the last reset.
    ///
    /// # Errors
    /// Returns that error.
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
        if !core::ptr::eq(tape, self) {
            return Err(TapeError::Foreign);
        }
        let last = output.id() as usize;
        let room = self.room.len();
        let values = &mut values[..=last];
        values[last] = output.slope();
        let mut before = values;
        if last >= room {
            before = sweep(&self.overflow.borrow()[..=last - room], before);
        }
        sweep(&self.room[1..room.min(last + 1)], before);
        Ok(())
    }
    /// Discards the recording and any error, and keeps the memory: the next recording of the same size does not allocate. No variable can
    /// outlive it.
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
    pub fn statistics(&self) -> TapeSize {
        let nodes = self.count.get() as usize - 1;
        TapeSize {
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
    /// Derivative of the last sweep's output by `variable`; 0 for constants and for variables that were recorded later.
    ///
    /// Independent variables and results of operations on two variables have one. A result `f(x)` of one variable is
    /// not recorded (its derivative is carried along with the number), so only `x` has: `NaN`, unless `f' = 1`.
    #[inline]
    pub fn of(&self, variable: Var<'_, T>) -> T {
        match variable.id() {
            0 => T::zero(),
            _ if !(variable.slope() - T::one()).is_exact_zero() => T::constant(T::Scalar::nan()),
            id => self.values.get(id as usize).copied().unwrap_or_else(T::zero),
        }
    }
}
