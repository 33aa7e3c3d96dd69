//! First and second derivatives of a recorded function, operation by operation, without zeros.
//!
//! With the adjoints `w` of one reverse sweep, the tangents `t` of all values along some directions and the tangents `z` of the adjoints, an
//! operation `y = f(a, ..)` adds
//!
//! ```text
//! t_y = f' t_a,    w_a += f' w_y,    z_a += f' z_y + w_y f'' t_a.
//! ```
//!
//! Tangents are lists of the directions along which a value varies. Those of adjoints are kept as sums of a few lists with factors, as long
//! as that takes fewer products: an operation with one operand then multiplies a factor instead of a list. On numbers of another recording
//! the result is a program of the derivatives, without zeros and constants.

use super::Program;
use super::replay::Step;
use super::run::Kind;
use crate::ops::{Binary, Unary};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Numbers by increasing direction; those left out are zero.
type Sparse<R> = Vec<(u32, R)>;

/// Directions along which second derivatives are taken, and which of them are wanted.
#[derive(Debug)]
pub struct Directions<R> {
    /// How fast each input moves along which directions.
    pub seeds: Vec<Sparse<R>>,
    /// Inputs for second derivatives, with their own directions: for two such inputs, the derivative is stored with the later one.
    pub rows: Vec<Option<u32>>,
    /// Directions from here on belong to no single input: derivatives along them are kept with every input.
    pub shared: u32,
    /// Numbers of tangents at most.
    pub budget: usize,
}

/// The derivatives of a function at a point.
#[derive(Debug)]
pub struct Derivatives<R> {
    pub value: R,
    /// By every input.
    pub first: Vec<R>,
    /// Second derivatives by every input and along the requested directions.
    pub second: Vec<Sparse<R>>,
}

impl<S: Scalar> Program<S> {
    /// Value and first derivatives of the only output, and second ones along directions; `None` if those take more tangents than allowed.
    pub fn derivatives<R: Real>(
        &self,
        inputs: &[R],
        parameters: &[R],
        directions: Option<&Directions<R>>,
    ) -> Option<Derivatives<R>> {
        let rows = self.uniform_rows + self.lane_rows;
        let mut values = vec![R::zero(); rows];
        self.steps().for_each(|step| self.interpret_step(&step, inputs, parameters, &mut values));
        let mut sweep =
            Sweep { program: self, values, directions, last: vec![None; rows], tangents: Vec::new(), spent: 0 };
        if directions.is_some() {
            sweep.forward()?;
        }
        sweep.reverse()
    }
}

/// The tangents of an adjoint: long lists with factors, each by its number, and the sum of short ones.
#[derive(Clone)]
struct Curve<R> {
    /// A factor of 1 is `None`.
    long: Vec<(usize, Option<R>)>,
    short: Sparse<R>,
}

impl<R> Curve<R> {
    /// An empty sum of tangents.
    fn none() -> Self {
        Self { long: Vec::new(), short: Vec::new() }
    }
    fn is_empty(&self) -> bool {
        self.long.is_empty() && self.short.is_empty()
    }
}

/// Shorter lists are multiplied at once.
const LONG: usize = 4;
/// Most lists in a sum.
const LISTS: usize = 8;

/// Partial derivatives of an operation by its operands.
enum Partials<R> {
    /// `y = f(a)`, `f'`.
    One(Unary, R),
    /// `y = f(a, b)` with both first derivatives.
    Two(Binary, (R, R)),
}

struct Sweep<'a, S, R> {
    program: &'a Program<S>,
    values: Vec<R>,
    directions: Option<&'a Directions<R>>,
    /// The last own direction among the inputs that a value depends on and by which second derivatives are requested.
    last: Vec<Option<u32>>,
    /// Tangents of all values, and then sums that were computed for adjoints.
    tangents: Vec<Sparse<R>>,
    spent: usize,
}

impl<S: Scalar, R: Real> Sweep<'_, S, R> {
    /// `x x` is a square.
    fn partials(&self, step: &Step<'_>) -> Option<Partials<R>> {
        let row = |k: usize| self.values[step.operands[k] as usize];
        let y = self.values[step.out];
        match step.kind {
            Kind::Unary(f) => Some(Partials::One(f, f.first(row(0), y))),
            Kind::Binary(Binary::Mul) if step.operands[0] == step.operands[1] => {
                Some(Partials::One(Unary::Powi(2), Unary::Powi(2).first(row(0), y)))
            }
            Kind::Binary(f) => Some(Partials::Two(f, f.first(row(0), row(1), y))),
            _ => None,
        }
    }

    /// Tangents of all values.
    fn forward(&mut self) -> Option<()> {
        let directions = self.directions?;
        self.tangents = vec![Vec::new(); self.values.len()];
        for step in self.program.steps() {
            let mut last = None;
            let mut tangent = Vec::new();
            let operand = |k: usize| step.operands[k] as usize;
            match step.kind {
                Kind::Input => {
                    last = directions.rows[operand(0)];
                    tangent = directions.seeds[operand(0)].clone();
                }
                Kind::Parameter | Kind::Constant => continue,
                Kind::SinCos => {
                    let (sin, cos) = (self.values[step.out], self.values[step.out + 1]);
                    last = self.last[operand(0)];
                    self.last[step.out + 1] = last;
                    let mut of_cos = Vec::new();
                    add(&mut tangent, cos, &self.tangents[operand(0)], |_| true);
                    add(&mut of_cos, -sin, &self.tangents[operand(0)], |_| true);
                    self.spent += of_cos.len();
                    self.tangents[step.out + 1] = of_cos;
                }
                Kind::Select => {
                    last = self.last[operand(1)].max(self.last[operand(2)]);
                    let condition = self.values[operand(0)];
                    let (a, b) = (&self.tangents[operand(1)], &self.tangents[operand(2)]);
                    tangent = joined(a, b, |a, b| condition.select(a, b));
                }
                Kind::Unary(_) | Kind::Binary(_) => match self.partials(&step) {
                    Some(Partials::One(_, first)) => {
                        last = self.last[operand(0)];
                        add(&mut tangent, first, &self.tangents[operand(0)], |_| true);
                    }
                    Some(Partials::Two(_, (a, b))) => {
                        last = self.last[operand(0)].max(self.last[operand(1)]);
                        add(&mut tangent, a, &self.tangents[operand(0)], |_| true);
                        add(&mut tangent, b, &self.tangents[operand(1)], |_| true);
                    }
                    None => {}
                },
            }
            self.spent += tangent.len();
            (self.last[step.out], self.tangents[step.out]) = (last, tangent);
            if self.spent > directions.budget {
                return None;
            }
        }
        Some(())
    }

    /// Adjoints of all values, and their tangents.
    fn reverse(mut self) -> Option<Derivatives<R>> {
        let program = self.program;
        let inputs = program.inputs;
        let output = program.outputs[0] as usize;
        let mut adjoints = vec![R::zero(); self.values.len()];
        let mut curved: Vec<Curve<R>> = vec![Curve::none(); self.values.len()];
        let mut derivatives = Derivatives {
            value: self.values[output],
            first: vec![R::zero(); inputs],
            second: vec![Vec::new(); inputs],
        };
        adjoints[output] = R::one();
        // Uniform rows are not needed.
        for step in program.steps().rev().take_while(|step| step.out >= program.uniform_rows) {
            let (w, z) = (adjoints[step.out], core::mem::replace(&mut curved[step.out], Curve::none()));
            let operand = |k: usize| step.operands[k] as usize;
            if step.kind == Kind::Input {
                derivatives.first[operand(0)] = w;
                derivatives.second[operand(0)] = self.sum(z, step.out);
                continue;
            }
            if step.kind == Kind::SinCos {
                let (sin, cos) = (self.values[step.out], self.values[step.out + 1]);
                let other = adjoints[step.out + 1];
                let z_cos = core::mem::replace(&mut curved[step.out + 1], Curve::none());
                let x = operand(0);
                let (z, z_cos) = (self.passed_on(z, step.out, 1), self.passed_on(z_cos, step.out + 1, 1));
                adjoints[x] += w * cos - other * sin;
                self.curve(&mut curved, x, (Some(cos), &z), None);
                self.curve(&mut curved, x, (Some(-sin), &z_cos), Some((-(w * sin + other * cos), x)));
                continue;
            }
            if w.is_exact_zero() && z.is_empty() {
                continue;
            }
            if step.kind == Kind::Select {
                let condition = self.values[operand(0)];
                let z = self.sum(z, step.out);
                for (x, of_first) in [(operand(1), true), (operand(2), false)] {
                    let pick = |w: R| match of_first {
                        true => condition.select(w, R::zero()),
                        false => condition.select(R::zero(), w),
                    };
                    adjoints[x] += pick(w);
                    let picked = z.iter().map(|&(direction, z)| (direction, pick(z))).collect();
                    let picked = self.kept(picked);
                    self.curve(&mut curved, x, (None, &picked), None);
                }
                continue;
            }
            let second = self.directions.is_some();
            match self.partials(&step) {
                Some(Partials::One(f, first)) => {
                    let x = operand(0);
                    let z = self.passed_on(z, step.out, 1);
                    adjoints[x] += w * first;
                    let bend = second.then(|| w * f.second(self.values[x], self.values[step.out], first));
                    self.curve(&mut curved, x, (Some(first), &z), bend.map(|bend| (bend, x)));
                }
                Some(Partials::Two(f, first)) => {
                    let (a, b) = (operand(0), operand(1));
                    adjoints[a] += w * first.0;
                    adjoints[b] += w * first.1;
                    if second {
                        let (aa, ab, bb) = f.second(self.values[a], self.values[b], self.values[step.out], first);
                        let ways = [a, b].iter().filter(|&&x| self.last[x].is_some()).count();
                        let z = self.passed_on(z, step.out, ways);
                        let of_a = (!matches!(f, Binary::Add | Binary::Sub)).then_some(first.0);
                        let of_b = (f != Binary::Add).then_some(first.1);
                        self.curve(&mut curved, a, (of_a, &z), Some((w * aa, a)));
                        self.curve(&mut curved, a, (None, &Curve::none()), Some((w * ab, b)));
                        self.curve(&mut curved, b, (of_b, &z), Some((w * bb, b)));
                        self.curve(&mut curved, b, (None, &Curve::none()), Some((w * ab, a)));
                    }
                }
                None => {}
            }
            if self.directions.is_some_and(|directions| self.spent > directions.budget) {
                return None;
            }
        }
        Some(derivatives)
    }

    /// Adds `factor z` and `bend t`, as far as they contribute to a requested second derivative.
    fn curve(
        &mut self,
        curved: &mut [Curve<R>],
        x: usize,
        (factor, z): (Option<R>, &Curve<R>),
        bend: Option<(R, usize)>,
    ) {
        let (Some(directions), Some(last)) = (self.directions, self.last[x]) else { return };
        let keep = |direction: u32| direction <= last || direction >= directions.shared;
        let Curve { long, short } = &mut curved[x];
        let before = short.len();
        add(short, factor.unwrap_or(R::one()), &z.short, keep);
        let passed = z.long.iter().map(|&(list, own)| (list, product(factor, own)));
        for (list, factor) in passed.chain(bend.map(|(bend, list)| (list, Some(bend)))) {
            let tangents = &self.tangents[list];
            if tangents.len() < LONG {
                add(short, factor.unwrap_or(R::one()), tangents, keep);
                continue;
            }
            let is_wanted = keep(tangents[0].0) || tangents.last().is_some_and(|(direction, _)| keep(*direction));
            if !is_wanted || factor.is_some_and(R::is_exact_zero) {
                continue;
            }
            self.spent += 1;
            match long.iter_mut().find(|(of, _)| *of == list) {
                Some((_, own)) => *own = Some(own.unwrap_or(R::one()) + factor.unwrap_or(R::one())),
                None => long.push((list, factor)),
            }
        }
        long.retain(|(_, factor)| !factor.is_some_and(R::is_exact_zero));
        self.spent += short.len().saturating_sub(before);
    }

    /// The list of the tangents, as far as it contributes to a second derivative by the inputs of row `x`.
    fn sum(&mut self, z: Curve<R>, x: usize) -> Sparse<R> {
        let (Some(directions), Some(last)) = (self.directions, self.last[x]) else { return Vec::new() };
        let mut sum = z.short;
        for (list, factor) in z.long {
            let keep = |direction: u32| direction <= last || direction >= directions.shared;
            add(&mut sum, factor.unwrap_or(R::one()), &self.tangents[list], keep);
        }
        self.spent += sum.len();
        sum
    }

    /// A list without a factor.
    fn kept(&mut self, list: Sparse<R>) -> Curve<R> {
        if list.len() < LONG {
            return Curve { long: Vec::new(), short: list };
        }
        self.tangents.push(list);
        Curve { long: vec![(self.tangents.len() - 1, None)], short: Vec::new() }
    }

    /// The tangents of the adjoint of row `x` that continue to `ways` operands: added now if that takes no more products than later.
    fn passed_on(&mut self, z: Curve<R>, x: usize, ways: usize) -> Curve<R> {
        let is_plain = z.long.iter().all(|(_, factor)| factor.is_none());
        let later = match z.long.len() {
            0 => z.short.len() < LONG,
            1 => z.short.len() < LONG,
            count => ways < 2 && !is_plain && count <= LISTS,
        };
        if later {
            return z;
        }
        let sum = self.sum(z, x);
        self.kept(sum)
    }
}

/// The product of factors that may be 1.
fn product<R: Real>(a: Option<R>, b: Option<R>) -> Option<R> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a * b),
        (a, b) => a.or(b),
    }
}

/// `to += factor from`, of the directions that are kept.
fn add<R: Real>(to: &mut Sparse<R>, factor: R, from: &Sparse<R>, keep: impl Fn(u32) -> bool) {
    if factor.is_exact_zero() || from.is_empty() {
        return;
    }
    let mut sum = Vec::with_capacity(to.len() + from.len());
    let mut own = to.iter().copied().peekable();
    for &(direction, x) in from.iter().filter(|(direction, _)| keep(*direction)) {
        while let Some(before) = own.next_if(|(of, _)| *of < direction) {
            sum.push(before);
        }
        let known = own.next_if(|(of, _)| *of == direction);
        let term = factor * x;
        sum.push((direction, known.map_or(term, |(_, known)| known + term)));
    }
    sum.extend(own);
    sum.retain(|(_, x)| !x.is_exact_zero());
    *to = sum;
}

/// `f(a, b)` along all directions of either.
fn joined<R: Real>(a: &Sparse<R>, b: &Sparse<R>, f: impl Fn(R, R) -> R) -> Sparse<R> {
    let mut directions: Vec<u32> = a.iter().chain(b).map(|(direction, _)| *direction).collect();
    directions.sort_unstable();
    directions.dedup();
    let of = |list: &Sparse<R>, direction: u32| {
        list.binary_search_by_key(&direction, |(of, _)| *of).map_or(R::zero(), |at| list[at].1)
    };
    directions.into_iter().map(|direction| (direction, f(of(a, direction), of(b, direction)))).collect()
}
