//! A compiled formula, evaluated over numbers of any kind.

use super::token::Number;
use crate::ops::{Binary, Unary};
use crate::scalar::{Real, Scalar};

/// Where a number is.
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

/// An operation and the register that takes its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Instruction {
    pub operation: Operation,
    pub out: u32,
}

/// A program of operations on registers with one result, a function of parameters, coordinates and velocities.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    instructions: Vec<Instruction>,
    numbers: Vec<Number>,
    registers: usize,
    result: Operand,
}

/// Programs of at most so many registers keep them on the stack.
const FEW: usize = 16;

impl Formula {
    pub(super) fn new(instructions: Vec<Instruction>, numbers: Vec<Number>, registers: u32, result: Operand) -> Self {
        Self { instructions, numbers, registers: registers as usize, result }
    }

    /// The value; `NaN` where a parameter, a coordinate or a velocity is missing.
    pub fn evaluate<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        if self.registers <= FEW {
            self.run(&mut [R::zero(); FEW], parameters, q, v)
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
