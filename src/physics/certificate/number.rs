//! The number that a Lagrangian is evaluated with: its value, its first and its second derivatives along the velocities, each as a
//! form over a box of states.

use super::arena::{Arena, Place, width};
use super::function::Function;
use super::interval::Interval;
use super::thresholds::{LANES, UNDERFLOW};
use crate::linalg::{MatMut, MatRef, gemm};
use crate::ops::Unary;
use crate::scalar::{Elementary, Real, vectorized};
use std::fmt::{Debug, Formatter};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A constant that lies in an interval, or a number of an [`Arena`].
#[derive(Clone, Copy)]
pub enum Number<'a> {
    Constant(Interval),
    Variable(&'a Arena, Place),
}
use Number::{Constant, Variable};

impl Debug for Number<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.range())
    }
}

impl<'a> Number<'a> {
    /// Every value on the box.
    pub fn range(self) -> Interval {
        match self {
            Constant(x) => x,
            Variable(arena, place) => arena.range(place),
        }
    }

    /// A function of one number.
    fn apply(self, f: Function) -> Self {
        match self {
            Constant(x) => Constant(f.value(x)),
            Variable(arena, place) => Variable(arena, arena.function(f, place)),
        }
    }

    /// `constant + sum_k s_k x_k` of a few numbers of an arena.
    fn combine(arena: &'a Arena, terms: &[(Interval, Place)], constant: Interval) -> Self {
        Variable(arena, arena.combine(terms, constant))
    }

    /// The sign, if it is the same on the whole box: `Some(true)` if positive, `Some(false)` if not.
    fn positive(self) -> Option<bool> {
        let range = self.range();
        if range.low > 0.0 {
            Some(true)
        } else if range.high <= 0.0 {
            Some(false)
        } else {
            None
        }
    }

    /// The unbounded value (top): a branch that the box does not decide.
    fn undecided(by: &[Self]) -> Self {
        let mut found = Constant(Interval::ENTIRE);
        for x in by {
            if let Variable(arena, place) = x {
                arena.blame(*place);
                found = Variable(arena, arena.unknown());
            }
        }
        found
    }
}

const ONE: Interval = Interval::point(1.0);

impl Neg for Number<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        match self {
            Constant(x) => Constant(-x),
            Variable(arena, index) => Self::combine(arena, &[(-ONE, index)], Interval::ZERO),
        }
    }
}
impl Add for Number<'_> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        match (self, other) {
            (Constant(a), Constant(b)) => Constant(sum(a, b)),
            (Constant(c), x) | (x, Constant(c)) if c == Interval::ZERO => x,
            (Constant(c), Variable(arena, x)) | (Variable(arena, x), Constant(c)) => {
                Self::combine(arena, &[(ONE, x)], c)
            }
            (Variable(arena, a), Variable(_, b)) => Self::combine(arena, &[(ONE, a), (ONE, b)], Interval::ZERO),
        }
    }
}
/// Exact if one of the two is 0.
fn sum(a: Interval, b: Interval) -> Interval {
    if a == Interval::ZERO {
        b
    } else if b == Interval::ZERO {
        a
    } else {
        a + b
    }
}
impl Sub for Number<'_> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        match (self, other) {
            (Variable(arena, a), Variable(_, b)) => Self::combine(arena, &[(ONE, a), (-ONE, b)], Interval::ZERO),
            (Constant(c), Variable(arena, b)) => Self::combine(arena, &[(-ONE, b)], c),
            (a, Constant(c)) => a + Constant(-c),
        }
    }
}
impl Mul for Number<'_> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        match (self, other) {
            (Constant(a), Constant(b)) if a == ONE => Constant(b),
            (Constant(a), Constant(b)) if b == ONE => Constant(a),
            (Constant(a), Constant(b)) => Constant(a * b),
            (Constant(c), x) | (x, Constant(c)) if c == ONE => x,
            (Constant(c), Variable(arena, x)) | (Variable(arena, x), Constant(c)) => {
                Self::combine(arena, &[(c, x)], Interval::ZERO)
            }
            (Variable(arena, a), Variable(_, b)) => Variable(arena, arena.product(a, b)),
        }
    }
}
impl Div for Number<'_> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        match (self, other) {
            (Constant(a), Constant(b)) => Constant(a / b),
            (a, b) => a * b.recip(),
        }
    }
}
macro_rules! assign {
    ($($name:ident $method:ident $sign:tt)*) => {$(
        impl $name for Number<'_> {
            fn $method(&mut self, other: Self) {
                *self = *self $sign other;
            }
        }
    )*};
}
assign! { AddAssign add_assign + SubAssign sub_assign - MulAssign mul_assign * DivAssign div_assign / }

/// One method of `Real` per row of the table of operations.
macro_rules! methods {
    ($($name:ident $method:ident)*) => {$(
        fn $method(self) -> Self {
            self.apply(Function::Table(Unary::$name))
        }
    )*};
}

impl Real for Number<'_> {
    type Scalar = f64;

    fn constant(value: f64) -> Self {
        Constant(Interval::point(value))
    }
    /// A value of the box. Reading it is recorded, because nothing can be proven about a Lagrangian that may branch on it.
    fn primal(self) -> f64 {
        if let Variable(arena, _) = self {
            arena.note_read();
        }
        self.range().middle()
    }
    fn is_exact_zero(self) -> bool {
        match self {
            Constant(x) => x == Interval::ZERO,
            Variable(arena, place) => arena.is_zero(place),
        }
    }
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self::of(f64::from(numerator)) / Self::of(f64::from(denominator))
    }
    fn elementary<F: Elementary>(self, f: F) -> Self {
        match Unary::made(f) {
            Some(f @ (Unary::Gelu | Unary::XTanh)) => self.apply(Function::Table(f)),
            _ => f.value(self),
        }
    }
    lnn_engine::unary_methods! { methods }
    fn powi(self, exponent: i32) -> Self {
        self.apply(Function::Table(Unary::Powi(exponent)))
    }
    fn powf(self, exponent: Self) -> Self {
        match exponent {
            Constant(p) if p.is_point() && p.low.fract() == 0.0 && p.low.abs() < 1e9 => self.powi(p.low as i32),
            Constant(p) if p.is_point() => self.apply(Function::Power(p.low)),
            _ => (exponent * self.ln()).exp(),
        }
    }
    fn atan2(self, x: Self) -> Self {
        let (rise, run) = (self.range(), x.range());
        let quarter = Constant(Interval::pi() * Interval::point(0.5));
        if run.low > 0.0 {
            (self / x).atan()
        } else if rise.low > 0.0 {
            quarter - (x / self).atan()
        } else if rise.high < 0.0 {
            -quarter - (x / self).atan()
        } else {
            Self::undecided(&[self, x])
        }
    }
    fn max(self, other: Self) -> Self {
        match (self - other).positive() {
            Some(true) => self,
            Some(false) => other,
            None => Self::undecided(&[self, other]),
        }
    }
    fn min(self, other: Self) -> Self {
        match (self - other).positive() {
            Some(true) => other,
            Some(false) => self,
            None => Self::undecided(&[self, other]),
        }
    }
    fn select(self, if_positive: Self, otherwise: Self) -> Self {
        match self.positive() {
            Some(true) => if_positive,
            Some(false) => otherwise,
            None => Self::undecided(&[self]),
        }
    }
    fn affine(weights: &[Self], bias: &[Self], x: &[Self]) -> Vec<Self> {
        map(weights, bias, x)
    }
}

/// `W x + b`, `(outputs)`; `weights` is `W`, `(outputs, inputs)` row-major, `bias` is `b` or empty.
///
/// The polynomial of an output is the product of `W` with those of the inputs; its distance is the product of `|W|` with the distances of
/// the inputs and with the largest rounding error of such a sum in any order, `|error| <= gamma sum_j |W_ij| |x_j|`, `gamma = inputs
/// EPSILON / 2` to first order (Higham 2002, section 3.1), charged twice.
pub fn map<'a>(weights: &[Number<'a>], bias: &[Number<'a>], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let arena = x.iter().find_map(|x| if let Number::Variable(arena, _) = x { Some(*arena) } else { None });
    let exact: Option<Vec<f64>> = weights.iter().map(exact).collect();
    let constants: Option<Vec<Interval>> = bias.iter().map(constant).collect();
    match (arena, exact, constants) {
        (Some(arena), Some(weights), Some(bias)) => product(arena, &weights, &bias, x),
        _ => termwise(weights, bias, x),
    }
}

fn constant(x: &Number<'_>) -> Option<Interval> {
    if let Number::Constant(x) = x { Some(*x) } else { None }
}

fn exact(x: &Number<'_>) -> Option<f64> {
    constant(x).filter(|x| x.is_point()).map(|x| x.low)
}

/// Sums of products, one after the other.
fn termwise<'a>(weights: &[Number<'a>], bias: &[Number<'a>], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let rows = weights.chunks_exact(x.len().max(1)).enumerate();
    let start = |i: usize| bias.get(i).copied().unwrap_or(Number::Constant(Interval::ZERO));
    rows.map(|(i, row)| row.iter().zip(x).fold(start(i), |sum, (&w, &x)| sum + w * x)).collect()
}

fn product<'a>(arena: &'a Arena, weights: &[f64], bias: &[Interval], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let (rows, inputs, stride) = (arena.block(), x.len(), arena.basis.stride());
    let outputs = weights.len() / inputs;
    // Relative rounding error of a sum of `inputs` products, with a reserve for the sums of distances.
    let loss = (inputs + stride + 16) as f64 * f64::EPSILON;
    let columns = gathered(arena, x);
    let distances = distances(&columns, (inputs, stride), loss);
    let absolute: Vec<f64> = weights.iter().map(|w| w.abs()).collect();
    let times = |a: &[f64], w: &[f64]| {
        let rows = a.len() / inputs;
        let mut c = vec![0.0; rows * outputs];
        let (a, w) = (MatRef::new(a, rows, inputs), MatRef::new(w, outputs, inputs));
        gemm(MatMut::new(&mut c, rows, outputs), false, 1.0, a, w.t());
        c
    };
    let (sums, spreads) = (times(&columns, weights), times(&distances, &absolute));
    let lanes: Vec<usize> = (0..outputs).step_by(LANES).map(|first| LANES.min(outputs - first)).collect();
    let pack = arena.make(&lanes, |_, new| {
        let mut rest = new;
        for (&lanes, first) in lanes.iter().zip((0..).step_by(LANES)) {
            let width = width(lanes);
            let (pack, others) = rest.split_at_mut(rows * width);
            rest = others;
            let parts = pack.chunks_exact_mut(stride * width).zip(sums.chunks_exact(stride * outputs));
            for (part, (form, sums)) in parts.enumerate() {
                // A function that is 0 stays 0.
                if distances[part * inputs..(part + 1) * inputs].iter().all(|x| *x == 0.0) {
                    continue;
                }
                for (form, sums) in form.chunks_exact_mut(width).zip(sums.chunks_exact(outputs)) {
                    form[..lanes].copy_from_slice(&sums[first..first + lanes]);
                }
                for (lane, spread) in spreads[part * outputs + first..][..lanes].iter().enumerate() {
                    form[(stride - 1) * width + lane] = spread * (1.0 + loss) + UNDERFLOW;
                }
            }
            for (lane, bias) in bias.iter().skip(first).take(lanes).enumerate() {
                let last = (stride - 1) * width + lane;
                let sum = pack[lane] + bias.middle();
                let distance = pack[last] + bias.radius() + f64::EPSILON * sum.abs();
                (pack[lane], pack[last]) = (sum, distance * (1.0 + loss));
            }
        }
    });
    let place = |i: usize| Place { pack: pack + (i / LANES) as u32, lane: (i % LANES) as u32 };
    (0..outputs).map(|i| Number::Variable(arena, place(i))).collect()
}

/// The coefficients of numbers, `(parts x stride, numbers)`.
fn gathered(arena: &Arena, x: &[Number<'_>]) -> Vec<f64> {
    let (rows, inputs) = (arena.block(), x.len());
    let mut columns = vec![0.0; rows * inputs];
    let mut i = 0;
    while i < inputs {
        i += match x[i] {
            Number::Constant(value) => {
                (columns[i], columns[(arena.basis.stride() - 1) * inputs + i]) = (value.middle(), value.radius());
                1
            }
            Number::Variable(_, Place { pack, lane }) => {
                // Inputs in the same pack are copied together.
                let next = |(x, lane): (&Number<'_>, u32)| matches!(x, Number::Variable(_, place) if *place == Place { pack, lane });
                let run = x[i..].iter().zip(lane..).take_while(|pair| next(*pair)).count();
                arena.look(pack, |forms, width| {
                    for (row, form) in columns.chunks_exact_mut(inputs).zip(forms.chunks_exact(width)) {
                        row[i..i + run].copy_from_slice(&form[lane as usize..lane as usize + run]);
                    }
                });
                run
            }
        };
    }
    columns
}

/// Distances of the inputs and a bound of the rounding errors of their coefficients, `(parts, inputs)`.
fn distances(columns: &[f64], (inputs, stride): (usize, usize), loss: f64) -> Vec<f64> {
    let mut found = vec![0.0; columns.len() / stride];
    vectorized(
        #[inline(always)]
        || {
            for (found, part) in found.chunks_exact_mut(inputs).zip(columns.chunks_exact(stride * inputs)) {
                let (coefficients, distances) = part.split_at((stride - 1) * inputs);
                for row in coefficients.chunks_exact(inputs) {
                    found.iter_mut().zip(row).for_each(|(sum, x)| *sum += x.abs());
                }
                found.iter_mut().zip(distances).for_each(|(sum, r)| *sum = (r + loss * *sum) * (1.0 + loss));
            }
        },
    );
    found
}
