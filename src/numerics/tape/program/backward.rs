//! Reverse replay of one chunk: each operation's adjoint over all lanes, last operation first.

use super::{Instruction, LANES, Node, Row, elementary};
use crate::ops::{Binary, Unary};
use crate::scalar::{Real, Scalar, vectorized};

/// Depends on lane inputs.
pub(in crate::numerics::tape) const INPUTS: u8 = 1;
/// Depends on parameters.
pub(in crate::numerics::tape) const PARAMETERS: u8 = 2;

/// Values of the forward replay and the adjoints being gathered.
pub(in crate::numerics::tape) struct Sweep<'a, S> {
    /// Dependence of each row: bits of [`INPUTS`] and [`PARAMETERS`].
    pub(in crate::numerics::tape) reach: &'a [u8],
    /// The adjoints asked for, the same bits: rows that reach none of them are left out.
    pub(in crate::numerics::tape) wanted: u8,
    /// Uniform rows (empty while they themselves are swept).
    pub(in crate::numerics::tape) uniform: &'a [Row<S>],
    /// Rows of the section being swept.
    pub(in crate::numerics::tape) rows: &'a [Row<S>],
    /// Adjoints of the uniform rows.
    pub(in crate::numerics::tape) uniform_adjoints: &'a mut [Row<S>],
    /// Adjoints of the section being swept.
    pub(in crate::numerics::tape) adjoints: &'a mut [Row<S>],
}

/// `weight * partial`, but 0 where the weight is exactly 0, whatever the partial derivative: a select, not a branch.
#[inline(always)]
fn masked<S: Scalar>(weight: S, partial: S) -> S {
    let product = weight * partial;
    let zero = <S as Real>::zero();
    if weight == zero { zero } else { product }
}

/// Where contributions go.
struct Targets<'a, S> {
    reach: &'a [u8],
    wanted: u8,
    /// Adjoints of the uniform rows.
    uniform: &'a mut [Row<S>],
    /// Adjoints of the rows before the one that is swept.
    before: &'a mut [Row<S>],
}

impl<S: Scalar> Targets<'_, S> {
    /// The adjoint of a row, unless nothing asked for depends on it.
    #[inline(always)]
    fn of(&mut self, row: u32) -> Option<&mut Row<S>> {
        let (row, base) = (row as usize, self.uniform.len());
        if self.reach[row] & self.wanted == 0 {
            None
        } else if row < base {
            Some(&mut self.uniform[row])
        } else {
            Some(&mut self.before[row - base])
        }
    }
    /// Adds `f(w)` of each lane to the adjoint of a row.
    #[inline(always)]
    fn add(&mut self, row: u32, w: &Row<S>, f: impl Fn(S) -> S) {
        if let Some(target) = self.of(row) {
            for l in 0..LANES {
                target[l] += f(w[l]);
            }
        }
    }
    /// Adds `f(w, x)` of each lane to the adjoint of a row.
    #[inline(always)]
    fn add_with(&mut self, row: u32, w: &Row<S>, x: &Row<S>, f: impl Fn(S, S) -> S) {
        if let Some(target) = self.of(row) {
            for l in 0..LANES {
                target[l] += f(w[l], x[l]);
            }
        }
    }
    /// Adds `f(w, x, y)` of each lane to the adjoint of a row.
    #[inline(always)]
    fn add_with_two(&mut self, row: u32, w: &Row<S>, (x, y): (&Row<S>, &Row<S>), f: impl Fn(S, S, S) -> S) {
        if let Some(target) = self.of(row) {
            for l in 0..LANES {
                target[l] += f(w[l], x[l], y[l]);
            }
        }
    }
}

/// Everything one operation reads and writes.
struct Step<'a, S> {
    uniform: &'a [Row<S>],
    rows: &'a [Row<S>],
    /// First row of the operation in its section.
    out: usize,
    /// Adjoints of the operation's rows.
    weights: &'a [Row<S>],
    targets: Targets<'a, S>,
}

impl<S: Scalar> Sweep<'_, S> {
    /// Sweeps the instructions backwards.
    pub(in crate::numerics::tape) fn run(&mut self, program: &[Instruction<S>]) {
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
        let base = self.uniform.len();
        let out = instruction.out as usize - base;
        // Operands precede the operation.
        let (before, weights) = self.adjoints.split_at_mut(out);
        let uniform = if base == 0 { &mut [] } else { &mut *self.uniform_adjoints };
        let targets = Targets { reach: self.reach, wanted: self.wanted, uniform, before };
        Step { uniform: self.uniform, rows: self.rows, out, weights, targets }.run(&instruction.node);
    }
}

impl<'a, S: Scalar> Step<'a, S> {
    #[inline(always)]
    fn value(&self, row: u32) -> &'a Row<S> {
        let (row, base) = (row as usize, self.uniform.len());
        if row < base { &self.uniform[row] } else { &self.rows[row - base] }
    }

    #[inline(always)]
    fn run(mut self, node: &Node<S>) {
        match node {
            Node::Input(_) | Node::Parameter(_) | Node::Constant(_) | Node::Dense(_) => {}
            Node::Unary(f, a) => self.unary(*f, *a),
            Node::SinCos(a) => {
                let (s, c) = (&self.rows[self.out], &self.rows[self.out + 1]);
                let (ws, wc) = (&self.weights[0], &self.weights[1]);
                if let Some(target) = self.targets.of(*a) {
                    for l in 0..LANES {
                        target[l] += masked(ws[l], c[l]) - masked(wc[l], s[l]);
                    }
                }
            }
            Node::Binary(f, a, b) => self.binary(*f, *a, *b),
            Node::Select(c, a, b) => {
                let (w, c) = (&self.weights[0], self.value(*c));
                let zero = <S as Real>::zero();
                let share = |w: S, yes: S| if w == zero { zero } else { yes };
                self.targets.add_with(*a, w, c, |w, c| share(w, c.select(w, zero)));
                self.targets.add_with(*b, w, c, |w, c| share(w, c.select(zero, w)));
            }
        }
    }

    #[inline(always)]
    fn unary(&mut self, f: Unary, a: u32) {
        let (w, x, y) = (&self.weights[0], self.value(a), &self.rows[self.out]);
        let targets = &mut self.targets;
        match f {
            Unary::Neg => targets.add(a, w, |w| -w),
            Unary::Recip => targets.add_with_two(a, w, (x, y), |w, x, y| masked(w, Unary::Recip.first(x, y))),
            Unary::Sqrt => targets.add_with_two(a, w, (x, y), |w, x, y| masked(w, Unary::Sqrt.first(x, y))),
            Unary::Abs => targets.add_with_two(a, w, (x, y), |w, x, y| masked(w, Unary::Abs.first(x, y))),
            Unary::Exp => targets.add_with(a, w, y, masked),
            Unary::Ln => targets.add_with_two(a, w, (x, y), |w, x, y| masked(w, Unary::Ln.first(x, y))),
            Unary::Ln1p => targets.add_with_two(a, w, (x, y), |w, x, y| masked(w, Unary::Ln1p.first(x, y))),
            Unary::Tan => targets.add_with_two(a, w, (x, y), |w, x, y| masked(w, Unary::Tan.first(x, y))),
            Unary::Atan => targets.add_with_two(a, w, (x, y), |w, x, y| masked(w, Unary::Atan.first(x, y))),
            Unary::Powi(2) => targets.add_with(a, w, x, |w, x| masked(w, x + x)),
            _ => {
                let mut partials = *y;
                elementary::first(f, x, y, &mut partials);
                targets.add_with(a, w, &partials, masked);
            }
        }
    }

    #[inline(always)]
    fn binary(&mut self, f: Binary, a: u32, b: u32) {
        let (w, x, y, out) = (&self.weights[0], self.value(a), self.value(b), &self.rows[self.out]);
        let targets = &mut self.targets;
        match f {
            Binary::Add => {
                targets.add(a, w, |w| w);
                targets.add(b, w, |w| w);
            }
            Binary::Sub => {
                targets.add(a, w, |w| w);
                targets.add(b, w, |w| -w);
            }
            Binary::Mul => {
                targets.add_with(a, w, y, masked);
                targets.add_with(b, w, x, masked);
            }
            Binary::Div => {
                let first = |y: S, out: S| Binary::Div.first(out, y, out);
                targets.add_with_two(a, w, (y, out), |w, y, out| masked(w, first(y, out).0));
                targets.add_with_two(b, w, (y, out), |w, y, out| masked(w, first(y, out).1));
            }
            _ => {
                let (mut first, mut second) = (*x, *y);
                elementary::first_of_two(f, &mut first, &mut second, out);
                targets.add_with(a, w, &first, masked);
                targets.add_with(b, w, &second, masked);
            }
        }
    }
}
