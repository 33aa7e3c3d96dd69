//! Recorded branches: linear in the branch that is taken, nothing flows to the condition.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::{Real, Scalar};
use crate::tape::engine::value::Mixed;

/// `a` where the condition is positive, `b` where it is not; `NaN` where it is `NaN`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Select {
    pub condition: usize,
    pub a: usize,
    pub b: usize,
}

/// `out += w` where the branch is taken: `first` tells which one is asked about.
fn add_taken<S: Scalar>(out: &mut [S], condition: &[S], w: &[S], first: bool) {
    let zero = <S as Real>::zero();
    for ((out, &c), &w) in out.iter_mut().zip(condition).zip(w) {
        *out += if first { c.select(w, zero) } else { c.select(zero, w) };
    }
}

impl Select {
    fn branches(self) -> [(usize, bool); 2] {
        [(self.a, true), (self.b, false)]
    }

    pub fn forward<S: Scalar>(self, out: usize, sweep: &mut Forward<'_, S>) {
        let (lanes, layout) = (sweep.store.lanes, sweep.store.layout);
        let (before, planes) = sweep.store.split(out);
        let channels = std::iter::once(None).chain(layout.directions(out).iter().map(Some));
        let condition = before.plane(self.condition, 0);
        planes.fill(<S as Real>::zero());
        for (direction, plane) in channels.zip(planes.chunks_exact_mut(lanes)) {
            let of = |x| direction.map_or_else(|| Some(before.plane(x, 0)), |&direction| before.tangent(x, direction));
            for (x, first) in self.branches() {
                if let Some(x) = of(x) {
                    add_taken(plane, condition, x, first);
                }
            }
        }
    }

    pub fn reverse<S: Scalar>(self, out: usize, sweep: &mut Reverse<'_, S>) {
        let condition = sweep.forward.plane(self.condition, 0);
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        for (x, first) in self.branches() {
            add_taken(before.plane_mut(x, 0), condition, adjoint, first);
        }
    }

    pub fn mixed<S: Scalar>(self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let (order, values, lanes) = (sweep.order, sweep.values, sweep.mixed.lanes);
        let condition = sweep.forward.plane(self.condition, 0);
        let to = values[out].mixed(order);
        let (before, planes) = sweep.mixed.split(out);
        planes.fill(<S as Real>::zero());
        for (x, first) in self.branches() {
            let from = values[x].mixed(order);
            for channel in [|m: &Mixed| m.s, |m: &Mixed| m.t, |m: &Mixed| m.st] {
                if let (Some(to), Some(from)) = (channel(&to), channel(&from)) {
                    add_taken(&mut planes[to * lanes..][..lanes], condition, before.plane(x, from), first);
                }
            }
        }
    }

    pub fn mixed_reverse<S: Scalar>(self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let condition = sweep.forward.plane(self.condition, 0);
        let (to, lanes) = (sweep.channels(out), sweep.adjoints.lanes);
        for (x, first) in self.branches() {
            if !sweep.wants(x) {
                continue;
            }
            let from = sweep.channels(x);
            let (mut before, adjoint) = sweep.adjoints.reverse(out);
            for channel in [|m: &Mixed| m.value, |m: &Mixed| m.s, |m: &Mixed| m.t] {
                if let (Some(to), Some(from)) = (channel(&to), channel(&from)) {
                    add_taken(before.plane_mut(x, from), condition, &adjoint[to * lanes..][..lanes], first);
                }
            }
        }
    }
}
