//! Forward replay of one chunk: each operation over all lanes.

use super::{Instruction, LANES, Node, Row};
use crate::ops::{Binary, Unary};
use crate::scalar::{
    Column, Scalar, copy_column, cos_lanes, exp_lanes, ln_lanes, sin_cos_lanes, sin_lanes, sqrt_lanes, tanh_lanes,
    vectorized,
};

/// Data that an instruction may read besides the rows of its own section.
pub(super) struct Environment<'a, S> {
    /// Uniform rows (empty while they themselves are computed).
    pub(super) uniform: &'a [Row<S>],
    /// Lane inputs: fields `(lanes, width)` side by side; lanes past the end repeat the last state.
    pub(super) inputs: &'a [&'a [S]],
    /// Number of lanes of the batch.
    pub(super) lanes: usize,
    /// First lane of the chunk.
    pub(super) start: usize,
    /// Parameters.
    pub(super) parameters: &'a [S],
}

/// Computes the rows of `program` in order.
pub(super) fn forward<S: Scalar>(program: &[Instruction<S>], environment: &Environment<'_, S>, rows: &mut [Row<S>]) {
    let uniform = environment.uniform;
    let base = uniform.len();
    vectorized(
        #[inline(always)]
        || {
            for instruction in program {
                let (before, after) = rows.split_at_mut(instruction.out as usize - base);
                let get = |row: u32| {
                    let row = row as usize;
                    if row < base { &uniform[row] } else { &before[row - base] }
                };
                let Some((out, rest)) = after.split_first_mut() else { continue };
                match &instruction.node {
                    Node::Input(index) => load(environment, *index as usize, out),
                    Node::Parameter(index) => fill(environment.parameters[*index as usize], out),
                    Node::Constant(value) => fill(*value, out),
                    Node::Unary(f, a) => unary(*f, get(*a), out),
                    Node::SinCos(a) => {
                        if let Some(cos) = rest.first_mut() {
                            sin_cos(get(*a), out, cos);
                        }
                    }
                    Node::Binary(f, a, b) => binary(*f, get(*a), get(*b), out),
                    Node::Select(c, a, b) => {
                        let (c, a, b) = (get(*c), get(*a), get(*b));
                        for l in 0..LANES {
                            out[l] = c[l].select(a[l], b[l]);
                        }
                    }
                    Node::Dense(_) => unreachable!("programs of rows are recorded without blocks"),
                }
            }
        },
    );
}

/// One input of all lanes.
#[inline(always)]
fn load<S: Scalar>(environment: &Environment<'_, S>, mut index: usize, out: &mut Row<S>) {
    let states = LANES.min(environment.lanes - environment.start);
    for field in environment.inputs {
        let width = field.len() / environment.lanes;
        if index >= width {
            index -= width;
            continue;
        }
        let field = Column::new(&field[environment.start * width..], index, width);
        copy_column(states, Column::all(&mut out[..]), field);
        break;
    }
    let last = out[states - 1];
    for l in states..LANES {
        out[l] = last;
    }
}

#[inline(always)]
fn fill<S: Scalar>(value: S, out: &mut Row<S>) {
    for l in 0..LANES {
        out[l] = value;
    }
}

#[inline(always)]
fn map<S: Scalar>(x: &Row<S>, out: &mut Row<S>, f: impl Fn(S) -> S) {
    for l in 0..LANES {
        out[l] = f(x[l]);
    }
}

/// The cheap functions are compiled in place; the others are calls for a whole row.
#[inline(always)]
fn unary<S: Scalar>(f: Unary, x: &Row<S>, out: &mut Row<S>) {
    match f {
        Unary::Neg => map(x, out, |x| -x),
        Unary::Recip => map(x, out, S::recip),
        Unary::Sqrt => map(x, out, S::sqrt),
        Unary::Abs => map(x, out, S::abs),
        Unary::Powi(2) => map(x, out, |x| x * x),
        _ => value(f, x, out),
    }
}

#[inline(always)]
fn binary<S: Scalar>(f: Binary, a: &Row<S>, b: &Row<S>, out: &mut Row<S>) {
    #[inline(always)]
    fn zip<S: Scalar>(a: &Row<S>, b: &Row<S>, out: &mut Row<S>, f: impl Fn(S, S) -> S) {
        for l in 0..LANES {
            out[l] = f(a[l], b[l]);
        }
    }
    match f {
        Binary::Add => zip(a, b, out, |a, b| a + b),
        Binary::Sub => zip(a, b, out, |a, b| a - b),
        Binary::Mul => zip(a, b, out, |a, b| a * b),
        Binary::Div => zip(a, b, out, |a, b| a / b),
        Binary::Max => zip(a, b, out, |a, b| Binary::Max.value(a, b)),
        Binary::Min => zip(a, b, out, |a, b| Binary::Min.value(a, b)),
        Binary::Powf | Binary::Atan2 => value_of_two(f, a, b, out),
    }
}

/// `out = f(x)`.
#[inline(never)]
pub(super) fn value<S: Scalar>(f: Unary, x: &Row<S>, out: &mut Row<S>) {
    match f {
        Unary::Exp => exp_lanes(x, out),
        Unary::Ln => ln_lanes(x, out),
        Unary::Sqrt => sqrt_lanes(x, out),
        Unary::Sin => sin_lanes(x, out),
        Unary::Cos => cos_lanes(x, out),
        Unary::Tanh => tanh_lanes(x, out),
        _ => (0..LANES).for_each(|l| out[l] = f.value(x[l])),
    }
}

/// Sine and cosine.
#[inline(never)]
pub(super) fn sin_cos<S: Scalar>(x: &Row<S>, sin: &mut Row<S>, cos: &mut Row<S>) {
    sin_cos_lanes(x, sin, cos);
}

/// `out = f(a, b)`.
#[inline(never)]
pub(super) fn value_of_two<S: Scalar>(f: Binary, a: &Row<S>, b: &Row<S>, out: &mut Row<S>) {
    (0..LANES).for_each(|l| out[l] = f.value(a[l], b[l]));
}
