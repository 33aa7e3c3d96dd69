//! Reverse replay of one chunk: each operation's adjoint over all lanes, last operation first.

use super::{Instruction, LANES, Node, Row, elementary};
use crate::ops::{Binary, Unary};
use crate::scalar::{Real, Scalar, vectorized};
use crate::tape::block::Scratch;

/// Depends on lane inputs.
pub(in crate::tape) const INPUTS: u8 = 1;
/// Depends on parameters.
pub(in crate::tape) const PARAMETERS: u8 = 2;

/// Values of the forward replay and the adjoints being gathered.
pub(in crate::tape) struct Sweep<'a, S> {
    /// What each row depends on: bits of [`INPUTS`] and [`PARAMETERS`].
    pub(in crate::tape) reach: &'a [u8],
    /// The adjoints asked for, the same bits: rows that reach none of them are left out.
    pub(in crate::tape) wanted: u8,
    /// Uniform rows (empty while they themselves are swept).
    pub(in crate::tape) uniform: &'a [Row<S>],
    /// Rows of the section being swept.
    pub(in crate::tape) rows: &'a [Row<S>],
    /// Adjoints of the uniform rows.
    pub(in crate::tape) uniform_adjoints: &'a mut [Row<S>],
    /// Adjoints of the section being swept.
    pub(in crate::tape) adjoints: &'a mut [Row<S>],
    /// Parameters.
    pub(in crate::tape) parameters: &'a [S],
    /// Adjoints of the parameters that block operations read.
    pub(in crate::tape) parameter_adjoints: &'a mut [S],
    /// Working space of block operations.
    pub(in crate::tape) scratch: &'a mut Scratch<S>,
}

/// `weight * partial`, but 0 where the weight is exactly 0, whatever the partial derivative: a select, not a branch.
#[inline(always)]
fn masked<S: Scalar>(weight: S, partial: S) -> S {
    let product = weight * partial;
    let zero = <S as Real>::zero();
    if weight == zero { zero } else { product }
}

impl<S: Scalar> Sweep<'_, S> {
    #[inline(always)]
    fn value(&self, row: u32) -> &Row<S> {
        let (row, base) = (row as usize, self.uniform.len());
        if row < base { &self.uniform[row] } else { &self.rows[row - base] }
    }
    /// Adds the contribution of each lane to the adjoint of a row, unless nothing asked for depends on it.
    #[inline(always)]
    fn add(&mut self, row: u32, contribution: impl Fn(usize) -> S) {
        let (row, base) = (row as usize, self.uniform.len());
        if self.reach[row] & self.wanted == 0 {
            return;
        }
        let mut sum = if row < base { self.uniform_adjoints[row] } else { self.adjoints[row - base] };
        for (l, target) in sum.iter_mut().enumerate() {
            *target += contribution(l);
        }
        *if row < base { &mut self.uniform_adjoints[row] } else { &mut self.adjoints[row - base] } = sum;
    }

    /// Sweeps the instructions backwards.
    pub(in crate::tape) fn run(&mut self, program: &[Instruction<S>]) {
        vectorized(
            #[inline(always)]
            || {
                for instruction in program.iter().rev() {
                    self.step(instruction);
                }
            },
        );
    }

    #[inline(always)]
    fn step(&mut self, instruction: &Instruction<S>) {
        if self.reach[instruction.out as usize] & self.wanted == 0 {
            return;
        }
        let out = instruction.out as usize - self.uniform.len();
        match &instruction.node {
            Node::Input(_) | Node::Parameter(_) | Node::Constant(_) => {}
            Node::Unary(f, a) => self.unary(*f, *a, out),
            Node::SinCos(a) => {
                let (ws, wc, s, c) = (self.adjoints[out], self.adjoints[out + 1], self.rows[out], self.rows[out + 1]);
                self.add(*a, |l| masked(ws[l], c[l]) - masked(wc[l], s[l]));
            }
            Node::Binary(f, a, b) => self.binary(*f, *a, *b, out),
            Node::Select(c, a, b) => {
                let (w, c) = (self.adjoints[out], *self.value(*c));
                let zero = <S as Real>::zero();
                let share = |w: S, yes: S| if w == zero { zero } else { yes };
                self.add(*a, |l| share(w[l], c[l].select(w[l], zero)));
                self.add(*b, |l| share(w[l], c[l].select(zero, w[l])));
            }
            Node::Block(op) => op.reverse(self, out),
        }
    }

    #[inline(always)]
    fn unary(&mut self, f: Unary, a: u32, out: usize) {
        let (w, x, y) = (self.adjoints[out], *self.value(a), self.rows[out]);
        match f {
            Unary::Neg => self.add(a, |l| -w[l]),
            Unary::Recip => self.add(a, |l| masked(w[l], Unary::Recip.first(x[l], y[l]))),
            Unary::Sqrt => self.add(a, |l| masked(w[l], Unary::Sqrt.first(x[l], y[l]))),
            Unary::Abs => self.add(a, |l| masked(w[l], Unary::Abs.first(x[l], y[l]))),
            Unary::Exp => self.add(a, |l| masked(w[l], y[l])),
            Unary::Ln => self.add(a, |l| masked(w[l], Unary::Ln.first(x[l], y[l]))),
            Unary::Ln1p => self.add(a, |l| masked(w[l], Unary::Ln1p.first(x[l], y[l]))),
            Unary::Tan => self.add(a, |l| masked(w[l], Unary::Tan.first(x[l], y[l]))),
            Unary::Atan => self.add(a, |l| masked(w[l], Unary::Atan.first(x[l], y[l]))),
            Unary::Powi(2) => self.add(a, |l| masked(w[l], x[l] + x[l])),
            _ => {
                let mut partials = y;
                elementary::first(f, &x, &y, &mut partials);
                self.add(a, |l| masked(w[l], partials[l]));
            }
        }
    }

    #[inline(always)]
    fn binary(&mut self, f: Binary, a: u32, b: u32, out: usize) {
        let w = self.adjoints[out];
        match f {
            Binary::Add => {
                self.add(a, |l| w[l]);
                self.add(b, |l| w[l]);
            }
            Binary::Sub => {
                self.add(a, |l| w[l]);
                self.add(b, |l| -w[l]);
            }
            Binary::Mul => {
                let (x, y) = (*self.value(a), *self.value(b));
                self.add(a, |l| masked(w[l], y[l]));
                self.add(b, |l| masked(w[l], x[l]));
            }
            Binary::Div => {
                let (y, b_row) = (self.rows[out], *self.value(b));
                let mut first = b_row;
                let mut second = y;
                for l in 0..LANES {
                    (first[l], second[l]) = Binary::Div.first(y[l], b_row[l], y[l]);
                }
                self.add(a, |l| masked(w[l], first[l]));
                self.add(b, |l| masked(w[l], second[l]));
            }
            _ => {
                let (mut first, mut second) = (*self.value(a), *self.value(b));
                elementary::first_of_two(f, &mut first, &mut second, &self.rows[out]);
                self.add(a, |l| masked(w[l], first[l]));
                self.add(b, |l| masked(w[l], second[l]));
            }
        }
    }
}
