//! Rules of operations that are linear in their operands: every channel is a sum of shares of the operands' channels. Such are coordinates and velocities,
//! numbers of several values put side by side, single numbers taken out of a value, and sums with factors.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::{Column, Real, Scalar, update_column, update2};
use crate::tape::engine::kernel::add_scaled;
use crate::tape::engine::value::{Mixed, View};
use alloc::vec::Vec;

/// Operands of one unit, and their shares: `add(target, view, source, k)` adds the share of operand `k`, and of its adjoint, whose
/// factor may depend on the forward values of `view`.
pub(super) struct Linear<'a, A> {
    pub operands: &'a [usize],
    pub add: A,
}

impl<A> Linear<'_, A> {
    pub fn forward<S: Scalar>(&self, out: usize, sweep: &mut Forward<'_, S>)
    where
        A: Fn(&mut [S], View<'_, S>, &[S], usize),
    {
        let (lanes, layout) = (sweep.store.lanes, sweep.store.layout);
        let (before, planes) = sweep.store.split(out);
        planes.fill(<S as Real>::zero());
        let channels = core::iter::once(None).chain(layout.directions(out).iter().map(Some));
        for (direction, plane) in channels.zip(planes.chunks_exact_mut(lanes)) {
            for (k, &x) in self.operands.iter().enumerate() {
                let of = |&direction: &usize| before.tangent(x, direction);
                if let Some(source) = direction.map_or_else(|| Some(before.plane(x, 0)), of) {
                    (self.add)(plane, before, source, k);
                }
            }
        }
    }

    pub fn reverse<S: Scalar>(&self, out: usize, sweep: &mut Reverse<'_, S>)
    where
        A: Fn(&mut [S], View<'_, S>, &[S], usize),
    {
        let forward = sweep.kept.forward;
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        for (k, &x) in self.operands.iter().enumerate() {
            (self.add)(before.plane_mut(x, 0), forward, adjoint, k);
        }
    }

    pub fn mixed<S: Scalar>(&self, out: usize, sweep: &mut MixedForward<'_, S>)
    where
        A: Fn(&mut [S], View<'_, S>, &[S], usize),
    {
        let (kept, lanes) = (&sweep.kept, sweep.mixed.lanes);
        let to = kept.values[out].mixed(sweep.order);
        let (before, planes) = sweep.mixed.split(out);
        planes.fill(<S as Real>::zero());
        for (k, &x) in self.operands.iter().enumerate() {
            let from = kept.values[x].mixed(sweep.order);
            for channel in [|m: &Mixed| m.s, |m: &Mixed| m.t, |m: &Mixed| m.st] {
                if let (Some(to), Some(from)) = (channel(&to), channel(&from)) {
                    (self.add)(&mut planes[to * lanes..][..lanes], kept.forward, before.plane(x, from), k);
                }
            }
        }
    }

    pub fn mixed_reverse<S: Scalar>(&self, out: usize, sweep: &mut MixedReverse<'_, S>)
    where
        A: Fn(&mut [S], View<'_, S>, &[S], usize),
    {
        let (own, lanes, forward) = (sweep.channels(out), sweep.adjoints.lanes, sweep.kept.forward);
        for (k, &x) in self.operands.iter().enumerate() {
            if !sweep.wants(x) {
                continue;
            }
            let to = sweep.channels(x);
            let (mut before, adjoint) = sweep.adjoints.reverse(out);
            for channel in [|m: &Mixed| m.value, |m: &Mixed| m.s, |m: &Mixed| m.t] {
                if let (Some(own), Some(to)) = (channel(&own), channel(&to)) {
                    (self.add)(before.plane_mut(x, to), forward, &adjoint[own * lanes..][..lanes], k);
                }
            }
        }
    }
}

/// `factor a`, or `factor a + factor_b b`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Combination<S> {
    operands: [usize; 2],
    factors: [S; 2],
    count: usize,
}

impl<S: Scalar> Combination<S> {
    pub fn new((a, factor): (usize, S), b: Option<(usize, S)>) -> Self {
        let (second, by) = b.unwrap_or((a, factor));
        Self { operands: [a, second], factors: [factor, by], count: if b.is_some() { 2 } else { 1 } }
    }
    #[allow(clippy::type_complexity)]
    fn linear(&self) -> Linear<'_, impl Fn(&mut [S], View<'_, S>, &[S], usize)> {
        let add =
            |target: &mut [S], _: View<'_, S>, source: &[S], k: usize| add_scaled(target, self.factors[k], source);
        Linear { operands: self.operands(), add }
    }
    pub fn forward(&self, out: usize, sweep: &mut Forward<'_, S>) {
        self.linear().forward(out, sweep);
    }
    pub fn reverse(&self, out: usize, sweep: &mut Reverse<'_, S>) {
        self.linear().reverse(out, sweep);
    }
    pub fn mixed(&self, out: usize, sweep: &mut MixedForward<'_, S>) {
        self.linear().mixed(out, sweep);
    }
    pub fn mixed_reverse(&self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        self.linear().mixed_reverse(out, sweep);
    }
}

impl<S> Combination<S> {
    pub fn operands(&self) -> &[usize] {
        &self.operands[..self.count]
    }
}

/// Input `index` of a state `(q, v)`: a coordinate below `n`, a velocity from there on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input {
    pub index: usize,
}

impl Input {
    /// Copies the column and places its tangents: `v_i` along `(v, 0)`, `s_i` along `e_i`.
    pub fn forward<S: Scalar>(self, out: usize, sweep: &mut Forward<'_, S>) {
        let n = sweep.scale.len();
        let (field, column) = if self.index < n { (sweep.q, self.index) } else { (sweep.v, self.index - n) };
        let lanes = sweep.store.lanes;
        let directions = sweep.store.layout.directions(out);
        let planes = sweep.store.all_mut(out);
        let (value, tangents) = planes.split_at_mut(lanes);
        update_column(lanes, Column::all(value), Column::new(field, column, n), |to, x| *to = x);
        for (plane, &direction) in tangents.chunks_exact_mut(lanes).zip(directions) {
            match direction {
                0 if self.index < n => {
                    update_column(lanes, Column::all(plane), Column::new(sweep.v, column, n), |to, v| *to = v);
                }
                0 => plane.fill(<S as Real>::zero()),
                _ => plane.fill(sweep.scale[column]),
            }
        }
    }

    pub fn reverse<S: Scalar>(self, _out: usize, _sweep: &mut Reverse<'_, S>) {}

    /// `x_s = (0, s)`, `x_t = tau (v, 0) + (0, t)`, `x_st = -tau (s, 0)`; a first derivative has `x_st = (0, s)`.
    pub fn mixed<S: Scalar>(self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let n = sweep.kept.scale.len();
        let channels = sweep.kept.values[out].mixed(sweep.order);
        let (directions, zero) = (sweep.directions, <S as Real>::zero());
        let (position, column) = (self.index < n, self.index % n);
        let scale = sweep.kept.scale[column];
        let mut place = |channel: Option<usize>, field: &[S], factor: S| {
            if let Some(channel) = channel {
                let plane = sweep.mixed.plane_mut(out, channel);
                if factor == zero {
                    plane.fill(zero);
                } else {
                    let (rows, field) = (plane.len(), Column::new(field, column, n));
                    update_column(rows, Column::all(plane), field, |to, x| *to = factor * x);
                }
            }
        };
        let moving = if directions.moving { <S as Real>::one() } else { zero };
        if position {
            place(channels.t, sweep.v, moving);
            place(channels.st, &directions.s, if sweep.order == super::Order::Second { -moving * scale } else { zero });
        } else {
            place(channels.s, &directions.s, scale);
            place(channels.t, &directions.t, scale);
            place(channels.st, &directions.s, if sweep.order == super::Order::First { scale } else { zero });
        }
    }

    /// Adjoints of the scaled state; the second direction holds `v` itself if it is moving.
    pub fn mixed_reverse<S: Scalar>(self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let n = sweep.kept.scale.len();
        let channels = sweep.channels(out);
        let (position, column) = (self.index < n, self.index % n);
        let scale = sweep.kept.scale[column];
        let Some((dq, dv)) = &mut sweep.inputs else { return };
        let mut add = |field: &mut [S], channel: Option<usize>| {
            if let Some(channel) = channel {
                let plane = sweep.adjoints.plane_mut(out, channel);
                let (rows, field) = (plane.len(), Column::new(field, column, n));
                update_column(rows, field, Column::all(plane), |to, b| *to += scale * b);
            }
        };
        if position {
            add(dq, channels.value);
            if sweep.moving {
                add(dv, channels.t);
            }
        } else {
            add(dv, channels.value);
        }
    }
}

/// Unit by unit: the value and its unit that each comes from.
#[derive(Clone, Debug)]
pub(crate) struct Gather {
    pub sources: Vec<(usize, usize)>,
}

/// One unit of a plane.
fn column<S>(plane: &[S], unit: usize, lanes: usize) -> Column<&[S]> {
    Column::new(plane, unit, plane.len() / lanes)
}

/// One unit of a plane, for writing.
fn column_mut<S>(plane: &mut [S], unit: usize, lanes: usize) -> Column<&mut [S]> {
    let units = plane.len() / lanes;
    Column::new(plane, unit, units)
}

/// Copies a unit; missing ones are zero, from a column that does not advance.
fn copy<S: Scalar>(lanes: usize, to: Column<&mut [S]>, from: Option<Column<&[S]>>) {
    match from {
        Some(from) => update_column(lanes, to, from, |to, x| *to = x),
        None => update_column(lanes, to, Column::new(&[<S as Real>::zero()], 0, 0), |to, zero| *to = zero),
    }
}

impl Gather {
    pub fn forward<S: Scalar>(&self, out: usize, sweep: &mut Forward<'_, S>) {
        let (lanes, layout) = (sweep.store.lanes, sweep.store.layout);
        let (before, planes) = sweep.store.split(out);
        let size = self.sources.len() * lanes;
        let channels = core::iter::once(None).chain(layout.directions(out).iter().map(Some));
        for (direction, plane) in channels.zip(planes.chunks_exact_mut(size)) {
            let of = |x| direction.map_or_else(|| Some(before.plane(x, 0)), |&direction| before.tangent(x, direction));
            for (to, &(value, unit)) in self.sources.iter().enumerate() {
                copy(lanes, column_mut(plane, to, lanes), of(value).map(|from| column(from, unit, lanes)));
            }
        }
    }

    pub fn reverse<S: Scalar>(&self, out: usize, sweep: &mut Reverse<'_, S>) {
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        let lanes = before.lanes;
        for (from, &(value, unit)) in self.sources.iter().enumerate() {
            let target = column_mut(before.plane_mut(value, 0), unit, lanes);
            update_column(lanes, target, column(adjoint, from, lanes), |sum, a| *sum += a);
        }
    }

    pub fn mixed<S: Scalar>(&self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let (order, values, lanes) = (sweep.order, sweep.kept.values, sweep.mixed.lanes);
        let own = values[out].mixed(order);
        let (before, planes) = sweep.mixed.split(out);
        let size = self.sources.len() * lanes;
        for channel in [|m: &Mixed| m.s, |m: &Mixed| m.t, |m: &Mixed| m.st] {
            let Some(plane) = channel(&own).map(|channel| &mut planes[channel * size..][..size]) else { continue };
            for (to, &(value, unit)) in self.sources.iter().enumerate() {
                let from =
                    channel(&values[value].mixed(order)).map(|from| column(before.plane(value, from), unit, lanes));
                copy(lanes, column_mut(plane, to, lanes), from);
            }
        }
    }

    pub fn mixed_reverse<S: Scalar>(&self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let own = sweep.channels(out);
        let size = self.sources.len() * sweep.adjoints.lanes;
        for (from, &(value, unit)) in self.sources.iter().enumerate() {
            if !sweep.wants(value) {
                continue;
            }
            let to = sweep.channels(value);
            let (mut before, adjoint) = sweep.adjoints.reverse(out);
            let lanes = before.lanes;
            for channel in [|m: &Mixed| m.value, |m: &Mixed| m.s, |m: &Mixed| m.t] {
                if let (Some(own), Some(to)) = (channel(&own), channel(&to)) {
                    let target = column_mut(before.plane_mut(value, to), unit, lanes);
                    let source = column(&adjoint[own * size..][..size], from, lanes);
                    update_column(lanes, target, source, |sum, b| *sum += b);
                }
            }
        }
    }
}

/// The first branch where the condition is positive, the second where it is not; `NaN` where it is `NaN`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Select {
    pub condition: usize,
    pub branches: [usize; 2],
}

impl Select {
    #[allow(clippy::type_complexity)]
    fn linear<S: Scalar>(&self) -> Linear<'_, impl Fn(&mut [S], View<'_, S>, &[S], usize)> {
        let add = |target: &mut [S], forward: View<'_, S>, source: &[S], branch: usize| {
            let (condition, zero) = (forward.plane(self.condition, 0), <S as Real>::zero());
            update2(target, condition, source, |out, c, w| {
                *out += if branch == 0 { c.select(w, zero) } else { c.select(zero, w) };
            });
        };
        Linear { operands: &self.branches, add }
    }
    pub fn forward<S: Scalar>(&self, out: usize, sweep: &mut Forward<'_, S>) {
        self.linear().forward(out, sweep);
    }
    pub fn reverse<S: Scalar>(&self, out: usize, sweep: &mut Reverse<'_, S>) {
        self.linear().reverse(out, sweep);
    }
    pub fn mixed<S: Scalar>(&self, out: usize, sweep: &mut MixedForward<'_, S>) {
        self.linear().mixed(out, sweep);
    }
    pub fn mixed_reverse<S: Scalar>(&self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        self.linear().mixed_reverse(out, sweep);
    }
}
