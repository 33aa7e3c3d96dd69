//! Numbers of several values put side by side, and single numbers taken out of a value.

use super::linear::Linear;
use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::{Column, Real, Scalar, update_column, update2};
use crate::tape::engine::value::{Mixed, View};

/// Unit by unit: the value and its unit that each comes from.
#[derive(Clone, Debug)]
pub(crate) struct Gather {
    pub sources: Vec<(usize, usize)>,
}

/// One unit of a plane.
fn column<S>(plane: &[S], unit: usize, lanes: usize) -> Column<&[S]> {
    Column::new(plane, unit, plane.len() / lanes)
}

/// The same, to be written.
fn column_mut<S>(plane: &mut [S], unit: usize, lanes: usize) -> Column<&mut [S]> {
    let units = plane.len() / lanes;
    Column::new(plane, unit, units)
}

/// Copies a unit; what is not there is zero, by a column that stays where it is.
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
        let channels = std::iter::once(None).chain(layout.directions(out).iter().map(Some));
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
