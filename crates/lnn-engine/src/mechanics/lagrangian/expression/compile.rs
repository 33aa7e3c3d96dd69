//! Compiles trees of names to one program of operations, in which equal parts are shared.

use super::parse::Number;
use super::{Expression, ExpressionError, Node, PI};
use crate::lagrangian::thresholds::{MOST_OPERATIONS, STACK_REGISTERS};
use crate::names::unknown;
use crate::ops::{Binary, Unary};
use crate::platform::Map;
use crate::scalar::{Real, Scalar};
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;

/// The meaning of a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// The index of a parameter.
    Parameter(usize),
    /// The index of a coordinate.
    Position(usize),
    /// The index of a coordinate whose velocity is meant.
    Velocity(usize),
    /// A formula that is already compiled.
    Value(Value),
}

/// A value of the program that is being compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Value(u32);

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Entry {
    Parameter(u32),
    Position(u32),
    Velocity(u32),
    Number(u32),
    Pi,
    Unary(Unary, Value),
    Binary(Binary, Value, Value),
}

/// Compiles formulas into a common list of operations.
#[derive(Default)]
pub struct Compiler {
    entries: Vec<Entry>,
    known: Map<Entry, Value>,
    numbers: Vec<Number>,
    places: Map<(u64, u64, u32), u32>,
    /// `true` if a value depends on velocities.
    moving: Vec<bool>,
}

impl Compiler {
    /// Adds a formula whose names are defined in `scope`; with `still`, velocities are rejected.
    ///
    /// # Errors
    /// A name is not in scope or not allowed, or the program becomes too long.
    pub fn add(
        &mut self,
        expression: &Expression,
        scope: &BTreeMap<String, Meaning>,
        still: bool,
    ) -> Result<Value, ExpressionError> {
        let mut values: Vec<Value> = Vec::with_capacity(expression.nodes.len());
        for node in &expression.nodes {
            let at = |operand: &u32| values[*operand as usize];
            let value = match node {
                Node::Number(text) => Number::parse(text).map_or(Value(0), |number| self.number(number)),
                Node::Pi => self.entry(Entry::Pi),
                Node::Name(name, column) => {
                    let value = self.named(name, scope).map_err(|problem| ExpressionError::new(*column, problem))?;
                    if still && self.moves(value) {
                        let problem =
                            format!("expected only coordinates and parameters, but `{name}` is or contains a velocity");
                        return Err(ExpressionError::new(*column, problem));
                    }
                    value
                }
                Node::Unary(function, a) => self.unary(*function, at(a)),
                Node::Binary(Binary::Powf, a, b) => self.power(at(a), at(b)),
                Node::Binary(function, a, b) => self.binary(*function, at(a), at(b)),
            };
            if self.entries.len() > MOST_OPERATIONS {
                let problem = format!("expected a system of at most {MOST_OPERATIONS} operations");
                return Err(ExpressionError::new(1, problem));
            }
            values.push(value);
        }
        values.last().copied().ok_or_else(|| ExpressionError::new(1, "expected a formula, found nothing"))
    }

    fn named(&mut self, name: &str, scope: &BTreeMap<String, Meaning>) -> Result<Value, String> {
        match scope.get(name) {
            Some(Meaning::Value(value)) => Ok(*value),
            Some(meaning) => Ok(self.meaning(*meaning)),
            None => Err(unknown("name", name, scope.keys().map(String::as_str).chain([PI]))),
        }
    }

    /// Returns the value of an input.
    pub fn meaning(&mut self, meaning: Meaning) -> Value {
        match meaning {
            Meaning::Parameter(i) => self.entry(Entry::Parameter(i as u32)),
            Meaning::Position(i) => self.entry(Entry::Position(i as u32)),
            Meaning::Velocity(i) => self.entry(Entry::Velocity(i as u32)),
            Meaning::Value(value) => value,
        }
    }

    /// Returns `true` if a value depends on velocities.
    pub fn moves(&self, value: Value) -> bool {
        self.moving[value.0 as usize]
    }

    /// Adds a number that is exact in every precision.
    pub fn constant(&mut self, value: f64) -> Value {
        self.number(Number::exact(value))
    }

    fn number(&mut self, number: Number) -> Value {
        let numbers = &mut self.numbers;
        let place = *self.places.entry(number.bits()).or_insert_with(|| {
            numbers.push(number);
            numbers.len() as u32 - 1
        });
        self.entry(Entry::Number(place))
    }

    fn number_of(&self, value: Value) -> Option<Number> {
        match self.entries[value.0 as usize] {
            Entry::Number(place) => Some(self.numbers[place as usize]),
            _ => None,
        }
    }

    /// Adds a function of one value.
    pub fn unary(&mut self, function: Unary, a: Value) -> Value {
        self.entry(Entry::Unary(function, a))
    }

    /// Adds a function of two values. Division by a power of two becomes multiplication by its reciprocal, which is equally exact.
    pub fn binary(&mut self, function: Binary, a: Value, b: Value) -> Value {
        match (function, self.number_of(b).and_then(Number::exact_reciprocal)) {
            (Binary::Div, Some(reciprocal)) => {
                let factor = self.number(reciprocal);
                self.binary(Binary::Mul, a, factor)
            }
            (Binary::Add | Binary::Mul, _) => self.entry(Entry::Binary(function, a.min(b), a.max(b))),
            _ => self.entry(Entry::Binary(function, a, b)),
        }
    }

    /// Adds `a^b`, as multiplications for integer exponents and a square root for one half.
    fn power(&mut self, a: Value, b: Value) -> Value {
        let exponent = match self.entries[b.0 as usize] {
            Entry::Unary(Unary::Neg, b) => self.number_of(b).and_then(Number::integer).and_then(i32::checked_neg),
            _ => self.number_of(b).and_then(Number::integer),
        };
        match exponent {
            Some(1) => a,
            Some(2) => self.binary(Binary::Mul, a, a),
            Some(exponent) => self.unary(Unary::Powi(exponent), a),
            None if self.number_of(b).is_some_and(|b| b.is(0.5)) => self.unary(Unary::Sqrt, a),
            None => self.entry(Entry::Binary(Binary::Powf, a, b)),
        }
    }

    fn entry(&mut self, entry: Entry) -> Value {
        if let Some(known) = self.known.get(&entry) {
            return *known;
        }
        let moving = match entry {
            Entry::Velocity(_) => true,
            Entry::Unary(_, a) => self.moves(a),
            Entry::Binary(_, a, b) => self.moves(a) || self.moves(b),
            _ => false,
        };
        let value = Value(self.entries.len() as u32);
        self.entries.push(entry);
        self.moving.push(moving);
        self.known.insert(entry, value);
        value
    }

    /// Returns `true` if a value depends on neither coordinates nor velocities.
    pub fn is_constant(&self, value: Value) -> bool {
        let entries = self.entries.iter().zip(self.needed(value)).filter(|(_, needed)| *needed);
        entries.into_iter().all(|(entry, _)| !matches!(entry, Entry::Position(_) | Entry::Velocity(_)))
    }

    /// Returns the degree of a value in the velocities, 0 or 1, as its operations show; `None` if it is not linear in them.
    pub fn velocity_degree(&self, value: Value) -> Option<u8> {
        let mut degrees: Vec<Option<u8>> = Vec::with_capacity(value.0 as usize + 1);
        for entry in &self.entries[..=value.0 as usize] {
            let degree = |value: Value| degrees[value.0 as usize];
            let found = match *entry {
                Entry::Velocity(_) => Some(1),
                Entry::Parameter(_) | Entry::Position(_) | Entry::Number(_) | Entry::Pi => Some(0),
                Entry::Unary(Unary::Neg, a) => degree(a),
                Entry::Binary(Binary::Add | Binary::Sub, a, b) => degree(a).zip(degree(b)).map(|(a, b)| a.max(b)),
                Entry::Binary(Binary::Mul, a, b) => {
                    degree(a).zip(degree(b)).map(|(a, b)| a + b).filter(|degree| *degree <= 1)
                }
                Entry::Binary(Binary::Div, a, b) if degree(b) == Some(0) => degree(a),
                _ => operands(*entry).into_iter().flatten().all(|a| degree(a) == Some(0)).then_some(0),
            };
            degrees.push(found);
        }
        degrees[value.0 as usize]
    }

    /// Returns the velocities that a value depends on, by the index of their coordinate.
    pub fn velocities(&self, value: Value) -> Vec<usize> {
        self.given(value, |entry| if let Entry::Velocity(i) = entry { Some(*i as usize) } else { None })
    }

    /// Returns the indices of the coordinates that a value depends on.
    pub fn positions(&self, value: Value) -> Vec<usize> {
        self.given(value, |entry| if let Entry::Position(i) = entry { Some(*i as usize) } else { None })
    }

    /// Returns what `pick` selects from the entries that a value depends on.
    fn given(&self, value: Value, pick: impl Fn(&Entry) -> Option<usize>) -> Vec<usize> {
        let entries = self.entries.iter().zip(self.needed(value)).filter(|(_, needed)| *needed);
        entries.filter_map(|(entry, _)| pick(entry)).collect()
    }

    /// Returns which entries a value depends on.
    fn needed(&self, value: Value) -> Vec<bool> {
        let mut needed = vec![false; self.entries.len()];
        needed[value.0 as usize] = true;
        for at in (0..self.entries.len()).rev().filter(|at| *at <= value.0 as usize) {
            if needed[at] {
                for operand in operands(self.entries[at]).into_iter().flatten() {
                    needed[operand.0 as usize] = true;
                }
            }
        }
        needed
    }

    /// Returns the program of one value; registers are reused once their contents are no longer needed.
    pub fn formula(&self, value: Value) -> Formula {
        let needed = self.needed(value);
        let mut last_use = vec![0; self.entries.len()];
        for (at, entry) in self.entries.iter().enumerate().filter(|(at, _)| needed[*at]) {
            for operand in operands(*entry).into_iter().flatten() {
                last_use[operand.0 as usize] = at;
            }
        }
        last_use[value.0 as usize] = usize::MAX;
        let mut places: Vec<Operand> = Vec::with_capacity(self.entries.len());
        let (mut free, mut registers, mut instructions) = (Vec::new(), 0, Vec::new());
        for (at, entry) in self.entries.iter().enumerate() {
            let place = |value: Value| places[value.0 as usize];
            let operation = match *entry {
                _ if !needed[at] => {
                    places.push(Operand::Pi);
                    continue;
                }
                Entry::Unary(function, a) => Operation::Unary(function, place(a)),
                Entry::Binary(function, a, b) => Operation::Binary(function, place(a), place(b)),
                Entry::Parameter(i) => {
                    places.push(Operand::Parameter(i));
                    continue;
                }
                Entry::Position(i) => {
                    places.push(Operand::Position(i));
                    continue;
                }
                Entry::Velocity(i) => {
                    places.push(Operand::Velocity(i));
                    continue;
                }
                Entry::Number(i) => {
                    places.push(Operand::Number(i));
                    continue;
                }
                Entry::Pi => {
                    places.push(Operand::Pi);
                    continue;
                }
            };
            let mut ended: Vec<Value> = operands(*entry).into_iter().flatten().collect();
            ended.dedup();
            for operand in ended.into_iter().filter(|operand| last_use[operand.0 as usize] == at) {
                if let Operand::Register(register) = places[operand.0 as usize] {
                    free.push(register);
                }
            }
            let out = free.pop().unwrap_or_else(|| {
                registers += 1;
                registers - 1
            });
            instructions.push(Instruction { operation, out });
            places.push(Operand::Register(out));
        }
        Formula::new(instructions, self.numbers.clone(), registers, places[value.0 as usize])
    }
}

/// Returns the operands of an operation.
fn operands(entry: Entry) -> [Option<Value>; 2] {
    match entry {
        Entry::Unary(_, a) => [Some(a), None],
        Entry::Binary(_, a, b) => [Some(a), Some(b)],
        _ => [None, None],
    }
}

impl Value {
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
}

/// The source of an operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operand {
    Register(u32),
    Parameter(u32),
    Position(u32),
    Velocity(u32),
    Number(u32),
    Pi,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    Unary(Unary, Operand),
    Binary(Binary, Operand, Operand),
}

/// An operation and the register for its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Instruction {
    pub operation: Operation,
    pub out: u32,
}

/// A program of register operations with one result, a function of parameters, coordinates and velocities.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    instructions: Vec<Instruction>,
    numbers: Vec<Number>,
    registers: usize,
    result: Operand,
}

impl Formula {
    pub(super) fn new(instructions: Vec<Instruction>, numbers: Vec<Number>, registers: u32, result: Operand) -> Self {
        Self { instructions, numbers, registers: registers as usize, result }
    }

    /// Evaluates the program; returns `NaN` if a parameter, a coordinate or a velocity is missing.
    pub fn evaluate<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        if self.registers <= STACK_REGISTERS {
            self.run(&mut [R::zero(); STACK_REGISTERS], parameters, q, v)
        } else {
            self.run(&mut vec![R::zero(); self.registers], parameters, q, v)
        }
    }

    fn run<R: Real>(&self, registers: &mut [R], parameters: &[R], q: &[R], v: &[R]) -> R {
        for Instruction { operation, out } in &self.instructions {
            let read = |operand: Operand| self.read(operand, registers, parameters, q, v);
            let value = match *operation {
                Operation::Unary(function, a) => function.evaluate(read(a)),
                Operation::Binary(function, a, b) => function.evaluate(read(a), read(b)),
            };
            registers[*out as usize] = value;
        }
        self.read(self.result, registers, parameters, q, v)
    }

    #[inline]
    fn read<R: Real>(&self, operand: Operand, registers: &[R], parameters: &[R], q: &[R], v: &[R]) -> R {
        let of = |list: &[R], i: u32| list.get(i as usize).copied().unwrap_or_else(|| R::constant(R::Scalar::nan()));
        match operand {
            Operand::Register(i) => registers[i as usize],
            Operand::Parameter(i) => of(parameters, i),
            Operand::Position(i) => of(q, i),
            Operand::Velocity(i) => of(v, i),
            Operand::Number(i) => R::constant(self.numbers[i as usize].value()),
            Operand::Pi => R::constant(R::Scalar::pi()),
        }
    }
}
