//! Single states of small programs: one operation after the other.
//!
//! A run is dispatched once for all its operations and lanes. For a single state with few operations that dispatch takes longer than the
//! operations. Here each operation is dispatched separately, and no index needs a check, because a byte addresses one of 256 rows. The
//! results are the same to the bit.

use super::Program;
use super::replay::value;
use super::run::Kind;
use crate::ops::{Binary, Unary};
use crate::scalar::{Real, Scalar, in_lanes, sin_cos_lane};
use alloc::boxed::Box;
use alloc::vec::Vec;

/// Rows of a program at most. One more takes the inputs that no operation reads.
const ROWS: usize = u8::MAX as usize;
/// Largest number of operations: a processor predicts only a limited number of jumps. According to `cargo bench --bench hessians -- "one
/// state, by the handle/"` a chain of two pendula is faster without runs, and one of four is not, though it takes fewer instructions.
const OPERATIONS: usize = 80;

/// Kind of an operation.
#[derive(Clone, Copy, Debug)]
enum Code {
    Add,
    Sub,
    Mul,
    Div,
    /// `a b + c`, as two roundings; `a b - c`; `c - a b`.
    MulAdd,
    MulSub,
    SubMul,
    Neg,
    Square,
    SinCos,
    Select,
    /// A function that is a call: the third operand selects it.
    Function,
}

/// An operation: its code, the row that it fills, and the rows that it reads.
#[derive(Clone, Copy, Debug)]
struct Operation {
    code: Code,
    out: u8,
    operands: [u8; 3],
}

/// The operations of a small program.
#[derive(Clone, Debug)]
pub(super) struct Single<S> {
    /// Row of each input and of each parameter.
    inputs: Vec<u8>,
    parameters: Vec<u8>,
    constants: Vec<(u8, S)>,
    /// Operations that depend on parameters alone, then those of the state.
    uniform: Vec<Operation>,
    lanes: Vec<Operation>,
    functions: Vec<Kind>,
    outputs: Vec<u8>,
}

impl<S: Scalar> Single<S> {
    /// The operations of a program; `None` for a larger one.
    pub fn new(program: &Program<S>) -> Option<Self> {
        let count = program.uniform_rows + program.lane_rows;
        if count > ROWS {
            return None;
        }
        let mut single = Self {
            inputs: vec![u8::MAX; program.inputs],
            parameters: vec![u8::MAX; program.parameters],
            constants: Vec::new(),
            uniform: Vec::new(),
            lanes: Vec::new(),
            functions: Vec::new(),
            outputs: program.outputs.iter().map(|&row| row as u8).collect(),
        };
        let mut fusion = Fusion::new(program, count);
        for step in program.steps() {
            let (out, named) = (step.out as u8, step.operands[0] as usize);
            match step.kind {
                Kind::Input => single.inputs[named] = out,
                Kind::Parameter => single.parameters[named] = out,
                Kind::Constant => single.constants.push((out, program.constants[named])),
                kind => {
                    let code = Code::of(kind);
                    let mut operands = [0, 1, 2].map(|k| step.operands.get(k).map_or(0, |&row| row as u8));
                    if matches!(code, Code::Function) {
                        operands[2] = single.functions.len() as u8;
                        single.functions.push(kind);
                    }
                    let is_uniform = step.out < program.uniform_rows;
                    let section = if is_uniform { &mut single.uniform } else { &mut single.lanes };
                    section.push(fusion.fused(Operation { code, out, operands }));
                }
            }
        }
        for section in [&mut single.uniform, &mut single.lanes] {
            section.retain(|operation| !fusion.is_fused[operation.out as usize]);
        }
        (single.lanes.len() <= OPERATIONS).then_some(single)
    }
}

impl Code {
    /// Returns the code of an operation on rows.
    fn of(kind: Kind) -> Self {
        match kind {
            Kind::Binary(Binary::Add) => Self::Add,
            Kind::Binary(Binary::Sub) => Self::Sub,
            Kind::Binary(Binary::Mul) => Self::Mul,
            Kind::Binary(Binary::Div) => Self::Div,
            Kind::Unary(Unary::Neg) => Self::Neg,
            Kind::Unary(Unary::Powi(2)) => Self::Square,
            Kind::SinCos => Self::SinCos,
            Kind::Select => Self::Select,
            _ => Self::Function,
        }
    }
}

/// Products with a single reader, a sum or difference, that computes them itself.
struct Fusion {
    uniform_rows: usize,
    /// Number of operations and outputs that read each row.
    readers: Vec<usize>,
    /// The two factors of each row that is a product and has only one reader.
    products: Vec<Option<[u8; 2]>>,
    /// Rows whose product is computed by their reader.
    is_fused: Vec<bool>,
}

impl Fusion {
    fn new<S: Scalar>(program: &Program<S>, rows: usize) -> Self {
        let mut readers = vec![0; rows];
        let read = program.steps().filter(|step| step.kind.reads_rows()).flat_map(|step| step.operands);
        read.chain(&program.outputs).for_each(|&row| readers[row as usize] += 1);
        Self { uniform_rows: program.uniform_rows, readers, products: vec![None; rows], is_fused: vec![false; rows] }
    }

    /// The factors of a row that an operation of another row may compute: both are uniform, or neither.
    fn product(&self, row: u8, out: u8) -> Option<[u8; 2]> {
        let is_uniform = |row: u8| (row as usize) < self.uniform_rows;
        self.products[row as usize].filter(|_| is_uniform(row) == is_uniform(out))
    }

    /// The operation, with a product that it alone reads.
    fn fused(&mut self, operation: Operation) -> Operation {
        let Operation { code, out, operands: [first, second, _] } = operation;
        let (row, [a, b], other) = match code {
            Code::Mul if self.readers[out as usize] == 1 => {
                self.products[out as usize] = Some([first, second]);
                return operation;
            }
            Code::Add | Code::Sub => match (self.product(first, out), self.product(second, out)) {
                (Some(factors), _) => (first, factors, second),
                (None, Some(factors)) => (second, factors, first),
                (None, None) => return operation,
            },
            _ => return operation,
        };
        self.is_fused[row as usize] = true;
        let code = match code {
            Code::Add => Code::MulAdd,
            _ if row == first => Code::MulSub,
            _ => Code::SubMul,
        };
        Operation { code, out, operands: [a, b, other] }
    }
}

/// The rows of a single state.
#[derive(Debug)]
pub(super) struct Rows<S> {
    rows: Box<[S; ROWS + 1]>,
    /// Parameters for which the uniform rows were computed last.
    parameters: Option<Vec<S>>,
}

impl<S: Scalar> Default for Rows<S> {
    fn default() -> Self {
        Self { rows: Box::new([<S as Real>::zero(); ROWS + 1]), parameters: None }
    }
}

impl<S: Scalar> Rows<S> {
    /// Computes the outputs of one state; the lengths of all fields are those of the program.
    pub fn evaluate(&mut self, program: &Single<S>, inputs: &[&[S]], parameters: &[S], outputs: &mut [&mut [S]]) {
        let are_known = self.parameters.as_deref() == Some(parameters);
        program.evaluate(&mut self.rows, inputs, (!are_known).then_some(parameters), outputs);
        if !are_known {
            let kept = self.parameters.get_or_insert_default();
            kept.clear();
            kept.extend_from_slice(parameters);
        }
    }
}

impl<S: Scalar> Single<S> {
    /// The outputs of one state, after the uniform rows of other parameters.
    fn evaluate(&self, rows: &mut [S; ROWS + 1], inputs: &[&[S]], parameters: Option<&[S]>, outputs: &mut [&mut [S]]) {
        if let Some(parameters) = parameters {
            self.parameters.iter().zip(parameters).for_each(|(&row, &p)| rows[row as usize] = p);
            self.constants.iter().for_each(|&(row, c)| rows[row as usize] = c);
            self.perform(&self.uniform, rows);
        }
        let mut next = 0;
        for field in inputs {
            let places = &self.inputs[next..][..field.len()];
            next += field.len();
            for k in 0..field.len() {
                rows[places[k] as usize] = field[k];
            }
        }
        self.perform(&self.lanes, rows);
        next = 0;
        for field in outputs {
            let places = &self.outputs[next..][..field.len()];
            next += field.len();
            for k in 0..field.len() {
                field[k] = rows[places[k] as usize];
            }
        }
    }

    /// Computes operations in order.
    fn perform(&self, operations: &[Operation], rows: &mut [S; ROWS + 1]) {
        in_lanes::<1, _>(
            #[inline(always)]
            || {
                for operation in operations {
                    let [first, second, third] = operation.operands;
                    let (a, b) = (rows[first as usize], rows[second as usize]);
                    rows[operation.out as usize] = match operation.code {
                        Code::Add => a + b,
                        Code::Sub => a - b,
                        Code::Mul => a * b,
                        Code::Div => a / b,
                        Code::MulAdd => a * b + rows[third as usize],
                        Code::MulSub => a * b - rows[third as usize],
                        Code::SubMul => rows[third as usize] - a * b,
                        Code::Neg => -a,
                        Code::Square => a * a,
                        Code::SinCos => {
                            let (sin, cos) = sin_cos_lane(a);
                            rows[operation.out as usize + 1] = cos;
                            sin
                        }
                        Code::Select => a.select(b, rows[third as usize]),
                        Code::Function => function(self.functions[third as usize], a, b),
                    };
                }
            },
        );
    }
}

#[inline(never)]
fn function<S: Scalar>(kind: Kind, a: S, b: S) -> S {
    match kind {
        Kind::Unary(f) => {
            let mut y = [a];
            value(f, &[a], &mut y);
            y[0]
        }
        Kind::Binary(f) => f.value(a, b),
        _ => unreachable!("a function of one or two numbers"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Replay, Tracer};
    use super::*;
    use std::sync::Arc;

    /// Every kind of operation, products that are joined and products that are not, an input that nothing reads.
    fn every_operation<'t>(x: &[Tracer<'t, f64>], p: &[Tracer<'t, f64>], rounds: usize) -> Vec<Tracer<'t, f64>> {
        let (mut a, mut b) = (x[0], x[1]);
        let mut outputs = vec![p[0] * p[1] + p[0], x[2] * Tracer::of(3.0)];
        for _ in 0..rounds {
            let (sin, cos) = (a * b).sin_cos();
            let shared = sin * p[1];
            (a, b) = (a * cos + shared, shared * b - a);
            a = a - b * cos + a.sqr() * sin - (-b);
            b = a.max(b) / (a.sqr() + Tracer::of(1.5)) + a.tanh() - b.abs().sqrt() + (p[0] * a).exp().recip();
            a = (a - b).select(a * b - p[0], b) + a.powi(3) * b;
            outputs.extend([a, b]);
        }
        outputs
    }

    #[test]
    fn a_single_state_has_the_bits_of_a_batch() {
        for rounds in [1, 2] {
            let program = Program::record(4, 2, |x, p| every_operation(x, p, rounds)).unwrap();
            let single = program.single.as_ref().expect("a small program");
            let joined = |o: &Operation| matches!(o.code, Code::MulAdd | Code::MulSub | Code::SubMul);
            assert!(single.lanes.iter().filter(|o| joined(o)).count() >= 3 * rounds);
            let outputs = program.outputs();
            let mut replay = Replay::new(Arc::new(program));
            for p in [[0.3, -1.1], [0.7, 0.2], [0.3, -1.1]] {
                let x = [[0.4, 1.7, -0.6, 9.0], [1e9, 0.3, 2.0, 9.0], [-2.0, f64::NAN, 0.1, 9.0]];
                let mut batch = vec![0.0; 3 * outputs];
                replay.evaluate(3, &[x.as_flattened()], &p, &mut [&mut batch]).unwrap();
                for (x, batch) in x.iter().zip(batch.chunks_exact(outputs)) {
                    let (mut first, mut others) = ([0.0], vec![0.0; outputs - 1]);
                    replay.evaluate(1, &[&x[..1], &x[1..]], &p, &mut [&mut first, &mut others]).unwrap();
                    let bits = |y: &f64| if y.is_nan() { u64::MAX } else { y.to_bits() };
                    assert!(
                        first.iter().chain(&others).map(bits).eq(batch.iter().map(bits)),
                        "{x:?} {others:?} {batch:?}"
                    );
                }
            }
            assert!(replay.evaluate(1, &[&[0.0; 3]], &[0.0; 2], &mut [&mut vec![0.0; outputs]]).is_err());
            assert!(replay.evaluate(1, &[&[0.0; 4]], &[0.0; 3], &mut [&mut vec![0.0; outputs]]).is_err());
            assert!(replay.evaluate(1, &[&[0.0; 4]], &[0.0; 2], &mut [&mut vec![0.0; outputs - 1]]).is_err());
        }
    }

    #[test]
    fn large_programs_keep_their_runs() {
        let program = Program::record(4, 2, |x, p| every_operation(x, p, 30)).unwrap();
        assert!(program.single.is_none());
        let program = Program::<f64>::record(100, 0, |x, _| x.windows(2).map(|x| x[0] + x[1]).collect()).unwrap();
        assert!(program.single.is_none());
    }
}
