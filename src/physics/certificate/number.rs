//! The number that a Lagrangian is evaluated with: its value, its first and its second derivatives along the velocities, each as a
//! first-order form over a box of states.

use super::affine;
use super::form;
use super::function::{Derivatives, derivatives, real_power};
use super::interval::Interval;
use crate::ops::Unary;
use crate::scalar::Real;
use std::cell::{Cell, RefCell};
use std::fmt::{Debug, Formatter};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// Memory of all numbers of one evaluation.
///
/// A number is a block of [`Arena::parts`] forms of [`Arena::stride`] numbers: the value, `n` first derivatives, and of the second ones
/// those with `j <= i`, row by row.
pub struct Arena {
    /// Directions of the derivatives.
    n: usize,
    stride: usize,
    parts: usize,
    forms: RefCell<Vec<f64>>,
    /// Set when a value was read, on which the Lagrangian may then branch unseen.
    read: Cell<bool>,
    /// Bits of the axes that a function depended on where it is not known.
    blamed: Cell<u64>,
}

impl Arena {
    /// For `n` coordinates and `axes` axes of the box.
    pub fn new(n: usize, axes: usize) -> Self {
        let parts = 1 + n + n * (n + 1) / 2;
        Self { n, stride: axes + 2, parts, forms: RefCell::default(), read: Cell::new(false), blamed: Cell::new(0) }
    }
    /// Forgets all numbers.
    pub fn clear(&self) {
        self.forms.borrow_mut().clear();
        self.read.set(false);
        self.blamed.set(0);
    }
    /// `true` if a value was read since.
    pub fn was_read(&self) -> bool {
        self.read.get()
    }
    /// Bits of the axes along which a box has to be cut for what is not known to become so.
    pub fn blamed(&self) -> u64 {
        self.blamed.get()
    }
    /// Notes the axes on which a form depends.
    fn blame(&self, form: &[f64]) {
        if !form::deviation(form).is_finite() {
            // Those to blame for it have been noted where it came from.
            return;
        }
        let slopes = form[1..form.len() - 1].iter().enumerate().filter(|(_, slope)| **slope != 0.0);
        self.blamed.set(slopes.fold(self.blamed.get(), |bits, (axis, _)| bits | 1 << (axis % 64)));
    }
    /// Forms of a number.
    pub fn parts(&self) -> usize {
        self.parts
    }
    /// Numbers of a form.
    pub fn stride(&self) -> usize {
        self.stride
    }
    /// Number of doubles of a number.
    fn block(&self) -> usize {
        self.parts * self.stride
    }
    /// Makes `count` numbers; `fill` is given all earlier blocks and the new ones, zeros.
    pub fn make(&self, count: usize, fill: impl FnOnce(&[f64], &mut [f64])) -> u32 {
        let mut forms = self.forms.borrow_mut();
        let (start, block) = (forms.len(), self.block());
        forms.resize(start + count * block, 0.0);
        let (earlier, new) = forms.split_at_mut(start);
        fill(earlier, new);
        (start / block) as u32
    }
    /// Reads the forms of a number, one after the other.
    pub fn look<T>(&self, index: u32, read: impl FnOnce(&[f64]) -> T) -> T {
        read(of(&self.forms.borrow(), index, self.block()))
    }
    /// Place of the second derivative along `i` and `j`.
    pub fn second(&self, i: usize, j: usize) -> usize {
        let (i, j) = (i.max(j), i.min(j));
        1 + self.n + i * (i + 1) / 2 + j
    }
    /// A number with a given form as its value, whose derivative along `direction` is 1.
    pub fn variable(&self, value: &[f64], direction: Option<usize>) -> Number<'_> {
        let index = self.make(1, |_, new| {
            new[..self.stride].copy_from_slice(value);
            if let Some(i) = direction {
                new[(1 + i) * self.stride] = 1.0;
            }
        });
        Number::Variable(self, index)
    }
    /// A number of which nothing is known.
    fn unknown(&self) -> Number<'_> {
        Number::Variable(self, self.make(1, |_, new| new.fill(f64::NAN)))
    }
}

/// The block of a number.
fn of(forms: &[f64], index: u32, block: usize) -> &[f64] {
    &forms[index as usize * block..(index as usize + 1) * block]
}

/// A constant that lies in an interval, or a number of an [`Arena`].
#[derive(Clone, Copy)]
pub enum Number<'a> {
    Constant(Interval),
    Variable(&'a Arena, u32),
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
            Variable(arena, index) => arena.look(index, |forms| form::range(&forms[..arena.stride])),
        }
    }

    /// A function of one number by its derivatives.
    fn chain(self, derivatives: impl Fn(Interval) -> Derivatives) -> Self {
        let (arena, index) = match self {
            Constant(x) => return Constant(derivatives(x)[0]),
            Variable(arena, index) => (arena, index),
        };
        let (n, stride, block) = (arena.n, arena.stride, arena.block());
        let made = arena.make(1, |earlier, new| {
            let old = of(earlier, index, block);
            let part = |k: usize| &old[k * stride..(k + 1) * stride];
            let z = part(0);
            let (at, over) = (derivatives(Interval::point(z[0])), derivatives(form::range(z)));
            form::set_function(&mut new[..stride], z, &at, &over, 0);
            if !over.iter().all(|x| x.is_bounded()) {
                arena.blame(z);
            }
            if (1..=n).all(|i| form::is_zero(part(i))) && (1 + n..arena.parts).all(|k| form::is_zero(part(k))) {
                return;
            }
            let mut slopes = vec![0.0; (2 + n) * stride];
            let (first, rest) = slopes.split_at_mut(stride);
            let (second, bent) = rest.split_at_mut(stride);
            form::set_function(first, z, &at, &over, 1);
            form::set_function(second, z, &at, &over, 2);
            for (i, bent) in bent.chunks_exact_mut(stride).enumerate() {
                form::add_product(bent, second, part(1 + i));
            }
            for k in 1..arena.parts {
                form::add_product(&mut new[k * stride..(k + 1) * stride], first, part(k));
            }
            for i in 0..n {
                for j in 0..=i {
                    let k = arena.second(i, j);
                    let bent = &bent[i * stride..(i + 1) * stride];
                    form::add_product(&mut new[k * stride..(k + 1) * stride], bent, part(1 + j));
                }
            }
        });
        Variable(arena, made)
    }

    /// `sum_k s_k x_k` of a few numbers of an arena.
    fn combine(arena: &'a Arena, terms: &[(Interval, u32)], constant: Interval) -> Self {
        let (stride, block) = (arena.stride, arena.block());
        let made = arena.make(1, |earlier, new| {
            if constant != Interval::ZERO {
                form::set_constant(&mut new[..stride], constant);
            }
            for &(factor, index) in terms {
                let forms = of(earlier, index, block).chunks_exact(stride);
                new.chunks_exact_mut(stride).zip(forms).for_each(|(new, old)| form::add_multiple(new, factor, old));
            }
        });
        Variable(arena, made)
    }

    /// The sign, if it is the same on the whole box: `Some(true)` above 0, `Some(false)` at or below.
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

    /// A number of which nothing is known: what is left of a branch that the box does not decide by these numbers.
    fn undecided(by: &[Self]) -> Self {
        let mut found = Constant(Interval::ENTIRE);
        for x in by {
            if let Variable(arena, index) = x {
                arena.look(*index, |forms| arena.blame(&forms[..arena.stride]));
                found = arena.unknown();
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
/// Exact where one of the two is 0.
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
            (Variable(arena, a), Variable(_, b)) => {
                let (n, stride, block) = (arena.n, arena.stride, arena.block());
                let made = arena.make(1, |earlier, new| {
                    let (a, b) = (of(earlier, a, block), of(earlier, b, block));
                    let part = |of_b: bool, k: usize| &(if of_b { b } else { a })[k * stride..(k + 1) * stride];
                    for (k, out) in new.chunks_exact_mut(stride).enumerate() {
                        form::add_product(out, part(false, 0), part(true, k));
                        if k > 0 {
                            form::add_product(out, part(false, k), part(true, 0));
                        }
                    }
                    for i in 0..n {
                        for j in 0..=i {
                            let k = arena.second(i, j);
                            let out = &mut new[k * stride..(k + 1) * stride];
                            form::add_product(out, part(false, 1 + i), part(true, 1 + j));
                            form::add_product(out, part(false, 1 + j), part(true, 1 + i));
                        }
                    }
                });
                Variable(arena, made)
            }
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
            self.chain(|x| derivatives(Unary::$name, x))
        }
    )*};
}

impl Real for Number<'_> {
    type Scalar = f64;

    fn constant(value: f64) -> Self {
        Constant(Interval::point(value))
    }
    /// A value of the box; that it was read is remembered, for nothing is proven of a Lagrangian that may branch on it.
    fn primal(self) -> f64 {
        if let Variable(arena, _) = self {
            arena.read.set(true);
        }
        self.range().middle()
    }
    fn is_exact_zero(self) -> bool {
        match self {
            Constant(x) => x == Interval::ZERO,
            Variable(arena, index) => arena.look(index, form::is_zero),
        }
    }
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self::of(f64::from(numerator)) / Self::of(f64::from(denominator))
    }
    crate::ops::unary_methods! { methods }
    fn powi(self, exponent: i32) -> Self {
        self.chain(|x| derivatives(Unary::Powi(exponent), x))
    }
    fn powf(self, exponent: Self) -> Self {
        match exponent {
            Constant(p) if p.is_point() && p.low.fract() == 0.0 && p.low.abs() < 1e9 => self.powi(p.low as i32),
            Constant(p) if p.is_point() => self.chain(|x| real_power(x, p.low)),
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
        affine::map(weights, bias, x)
    }
}
