//! Operations of a recorded Lagrangian, each with its rules.
//!
//! With `y = phi(x)`, adjoints `A = dL/dy`, mixed channels `y[s]`, `y[t]`, `y[st]` and their adjoints `B`:
//!
//! | rule | |
//! |---|---|
//! | value | `y = phi(x)` |
//! | tangent | `y[u] = phi' x[u]` |
//! | adjoint | `A_x += phi' A` |
//! | contraction | `D2L[u, w] += A phi''[x[u], x[w]]` |
//! | mixed channel | `y[st] = phi' x[st] + phi''[x[s], x[t]]` |
//! | its reverse | `Bs += phi' Bs + A phi''[., x[t]]`, `Bt += phi' Bt + A phi''[x[s], .]`, `B0 += phi' B0 + phi''[x[s]] Bs + phi''[x[t]] Bt + A (phi''[x[st]] + phi'''[x[s], x[t]])` |

mod contraction;
mod dense;
mod elementwise;
mod function;
mod linear;

pub(super) use dense::Dense;
pub(super) use elementwise::Elementwise;
pub(super) use function::{Function, PARTIALS, Product};
pub(super) use linear::{Combination, Gather, Input, Select};

use super::kernel::{add_product, add_product3};
use super::value::{Dependence, Mixed, Order, Store, Value, View};
use super::{Depth, MixedDirections};
use crate::scalar::{Real, Scalar, in_vectors};
use alloc::vec::Vec;
use contraction::{Contraction, ROWS};

/// An operation; operands are values before it.
#[derive(Clone, Debug)]
pub(super) enum Operation<S> {
    /// Coordinate or velocity.
    Input(Input),
    /// A parameter, the same for all states.
    Parameter(usize),
    /// A constant.
    Constant(S),
    /// A function of one number on all units of a value.
    Elementwise(Elementwise),
    /// Product of two numbers.
    Product(Product),
    /// Linear combination of one or two numbers.
    Combination(Combination<S>),
    /// Any other function of two numbers.
    Function(Function),
    /// Recorded branch.
    Select(Select),
    /// `W x + b`.
    Dense(Dense),
    /// Numbers put side by side.
    Gather(Gather),
}

impl<S> Operation<S> {
    /// Visits the values that the operation reads.
    pub fn operands(&self, mut visit: impl FnMut(usize)) {
        match self {
            Self::Input(_) | Self::Parameter(_) | Self::Constant(_) => {}
            Self::Elementwise(op) => visit(op.x),
            Self::Product(op) => [op.a, op.b].into_iter().for_each(visit),
            Self::Combination(op) => op.operands().iter().copied().for_each(visit),
            Self::Function(op) => [op.a, op.b].into_iter().for_each(visit),
            Self::Select(op) => core::iter::once(op.condition).chain(op.branches).for_each(visit),
            Self::Dense(op) => visit(op.x),
            Self::Gather(op) => op.sources.iter().for_each(|&(value, _)| visit(value)),
        }
    }
}

/// Data of the forward sweep.
pub(super) struct Forward<'a, S> {
    pub values: &'a [Value],
    pub store: Store<'a, S>,
    pub depth: Depth,
    pub slopes: &'a mut [Vec<S>; 3],
    pub partials: &'a mut [S],
    pub parameters: &'a [S],
    pub q: &'a [S],
    pub v: &'a [S],
    pub scale: &'a [S],
}

/// The data that the forward sweep keeps for later sweeps.
pub(super) struct Kept<'a, S> {
    pub values: &'a [Value],
    pub forward: View<'a, S>,
    pub slopes: &'a [Vec<S>; 3],
    pub partials: &'a [S],
    pub parameters: &'a [S],
    pub scale: &'a [S],
}

/// Data of the reverse sweep of the value.
pub(super) struct Reverse<'a, S> {
    pub kept: Kept<'a, S>,
    /// `dL/dy` of every value.
    pub adjoints: Store<'a, S>,
    pub depth: Depth,
    pub second: &'a mut SecondOrder<S>,
}

/// Data of the mixed sweep.
pub(super) struct MixedForward<'a, S> {
    pub kept: Kept<'a, S>,
    pub mixed: Store<'a, S>,
    pub order: Order,
    pub directions: &'a MixedDirections<S>,
    /// Velocities.
    pub v: &'a [S],
}

/// Data of the reverse of the mixed sweep.
pub(super) struct MixedReverse<'a, S> {
    pub kept: Kept<'a, S>,
    /// `dL/dy` of every value.
    pub value_adjoints: View<'a, S>,
    pub mixed: View<'a, S>,
    pub adjoints: Store<'a, S>,
    pub order: Order,
    pub gradient: &'a mut [S],
    /// Derivatives by the scaled state, `(lanes, n)` each, if they are requested.
    pub inputs: Option<(&'a mut [S], &'a mut [S])>,
    /// `true` if the second direction moves along `(v, 0)`.
    pub moving: bool,
}

/// Calls the rule of whichever operation it is.
macro_rules! rule {
    ($operation:expr, $out:expr, $sweep:expr, $rule:ident, $parameter:expr, $constant:expr) => {
        match $operation {
            Operation::Input(op) => op.$rule($out, $sweep),
            Operation::Parameter(index) => $parameter(*index, $out, $sweep),
            Operation::Constant(value) => $constant(*value, $out, $sweep),
            Operation::Elementwise(op) => op.$rule($out, $sweep),
            Operation::Product(op) => op.$rule($out, $sweep),
            Operation::Combination(op) => op.$rule($out, $sweep),
            Operation::Function(op) => op.$rule($out, $sweep),
            Operation::Select(op) => op.$rule($out, $sweep),
            Operation::Dense(op) => op.$rule($out, $sweep),
            Operation::Gather(op) => op.$rule($out, $sweep),
        }
    };
}

impl<S: Scalar> Operation<S> {
    /// Value and tangents.
    pub fn forward(&self, out: usize, sweep: &mut Forward<'_, S>) {
        let fill = |value: S, out: usize, sweep: &mut Forward<'_, S>| sweep.store.all_mut(out).fill(value);
        let parameter =
            |index: usize, out: usize, sweep: &mut Forward<'_, S>| fill(sweep.parameters[index], out, sweep);
        rule!(self, out, sweep, forward, parameter, fill);
    }
    /// Adjoints of the operands and the contribution to the second derivatives.
    pub fn reverse(&self, out: usize, sweep: &mut Reverse<'_, S>) {
        rule!(self, out, sweep, reverse, |_, _, _| {}, |_, _, _| {});
    }
    /// Mixed channels.
    pub fn mixed(&self, out: usize, sweep: &mut MixedForward<'_, S>) {
        rule!(self, out, sweep, mixed, |_, _, _| {}, |_, _, _| {});
    }
    /// Adjoints of the operands' mixed channels.
    pub fn mixed_reverse(&self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let parameter = |index: usize, out: usize, sweep: &mut MixedReverse<'_, S>| {
            if let Some(value) = sweep.channels(out).value {
                sweep.gradient[index] += super::kernel::sum(sweep.adjoints.plane_mut(out, value));
            }
        };
        rule!(self, out, sweep, mixed_reverse, parameter, |_, _, _| {});
    }
}

impl<S: Scalar> MixedReverse<'_, S> {
    /// `true` if adjoints of a value lead to a requested result.
    pub fn wants(&self, value: usize) -> bool {
        let value = &self.kept.values[value];
        value.trainable || (self.inputs.is_some() && value.kind != Dependence::Constant)
    }
    pub fn channels(&self, value: usize) -> Mixed {
        self.kept.values[value].mixed(self.order)
    }
}

/// Accumulates second derivatives in planes with one number per state.
#[derive(Clone, Debug, Default)]
pub(super) struct SecondOrder<S> {
    pub n: usize,
    pub lanes: usize,
    /// `M_ij`, `i <= j`, row after row of the triangle.
    pub mass: Vec<S>,
    /// `c_i`.
    pub drift: Vec<S>,
    curvature: Vec<S>,
    along: Vec<S>,
}

impl<S: Scalar> SecondOrder<S> {
    /// Empties the sums for a chunk.
    pub fn start(&mut self, n: usize, lanes: usize, drift: bool) {
        (self.n, self.lanes) = (n, lanes);
        let zero = <S as Real>::zero();
        self.mass.clear();
        self.mass.resize(n * (n + 1) / 2 * lanes, zero);
        self.drift.clear();
        self.drift.resize(if drift { n * lanes } else { 0 }, zero);
    }
    /// Number of the pair `i <= j`.
    pub fn pair(n: usize, i: usize, j: usize) -> usize {
        i * n - i * (i + 1) / 2 + j
    }
    fn mass_plane(&mut self, i: usize, j: usize) -> &mut [S] {
        let at = Self::pair(self.n, i, j) * self.lanes;
        &mut self.mass[at..at + self.lanes]
    }
    fn drift_plane(&mut self, i: usize) -> &mut [S] {
        &mut self.drift[i * self.lanes..(i + 1) * self.lanes]
    }

    /// Adds `k x[u] x[w]` of a value `x` of one unit, `k` a plane.
    pub fn add_square(&mut self, x: usize, forward: View<'_, S>, k: &[S]) {
        let directions = forward.layout.directions(x);
        for (at, &i) in directions.iter().enumerate().filter(|(_, i)| **i > 0) {
            let xi = forward.plane(x, 1 + at);
            for (at, &j) in directions.iter().enumerate().skip(at) {
                add_product3(self.mass_plane(i - 1, j - 1), k, xi, forward.plane(x, 1 + at));
            }
            if let (Some(drift), false) = (forward.tangent(x, 0), self.drift.is_empty()) {
                add_product3(self.drift_plane(i - 1), k, xi, drift);
            }
        }
    }

    /// Adds `k (x[u] y[w] + x[w] y[u])` of two values of one unit.
    pub fn add_cross(&mut self, (x, y): (usize, usize), forward: View<'_, S>, k: &[S]) {
        for (at, &i) in forward.layout.directions(x).iter().enumerate().filter(|(_, i)| **i > 0) {
            let xi = forward.plane(x, 1 + at);
            for (at, &j) in forward.layout.directions(y).iter().enumerate().filter(|(_, j)| **j > 0) {
                let (yj, pair) = (forward.plane(y, 1 + at), (i.min(j) - 1, i.max(j) - 1));
                add_product3(self.mass_plane(pair.0, pair.1), k, xi, yj);
                if i == j {
                    add_product3(self.mass_plane(pair.0, pair.1), k, xi, yj);
                }
            }
        }
        if self.drift.is_empty() {
            return;
        }
        for (a, b) in [(x, y), (y, x)] {
            let Some(drift) = forward.tangent(b, 0) else { continue };
            for (at, &i) in forward.layout.directions(a).iter().enumerate().filter(|(_, i)| **i > 0) {
                add_product3(self.drift_plane(i - 1), k, forward.plane(a, 1 + at), drift);
            }
        }
    }

    /// Adds `sum over units of adjoint d2 x[u] x[w]` of a value `x` of several units, state by state.
    pub fn add_block(&mut self, (x, units): (usize, usize), forward: View<'_, S>, adjoint: &[S], d2: &[S]) {
        let (n, lanes) = (self.n, self.lanes);
        let directions = forward.layout.directions(x);
        let drifts = usize::from(directions.first() == Some(&0));
        let velocities = &directions[drifts..];
        let x = &forward.all(x)[lanes * units..];
        super::kernel::resize(&mut self.curvature, units);
        super::kernel::resize(&mut self.along, ROWS * units);
        let (curvature, along) = (&mut self.curvature[..units], &mut self.along[..ROWS * units]);
        let (mass, drift) = (&mut self.mass, &mut self.drift);
        in_vectors(Contraction { velocities, drifts, n, lanes, x, adjoint, d2, curvature, along, mass, drift });
    }
}

/// `out += x y`, unless `y` is not carried.
fn add_if<S: Scalar>(out: &mut [S], x: &[S], y: Option<&[S]>) {
    if let Some(y) = y {
        add_product(out, x, y);
    }
}

/// `out += x y`, unless one of them is not carried.
fn add_if_both<S: Scalar>(out: &mut [S], x: Option<&[S]>, y: Option<&[S]>) {
    if let Some(x) = x {
        add_if(out, x, y);
    }
}
