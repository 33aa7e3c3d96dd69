//! Sums, differences, negations and constant factors.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::Scalar;
use crate::tape::engine::kernel::{add_scaled, map};
use crate::tape::engine::value::Mixed;

/// `factor a`, or `factor a + factor_b b`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Combination<S> {
    pub a: usize,
    pub factor: S,
    pub b: Option<(usize, S)>,
}

impl<S: Scalar> Combination<S> {
    fn terms(&self) -> impl Iterator<Item = (usize, S)> {
        [Some((self.a, self.factor)), self.b].into_iter().flatten()
    }

    pub fn forward(&self, out: usize, sweep: &mut Forward<'_, S>) {
        let (lanes, layout) = (sweep.store.lanes, sweep.store.layout);
        let (before, planes) = sweep.store.split(out);
        let channels = std::iter::once(None).chain(layout.directions(out).iter().map(Some));
        for (direction, plane) in channels.zip(planes.chunks_exact_mut(lanes)) {
            let of = |x| direction.map_or_else(|| Some(before.plane(x, 0)), |&direction| before.tangent(x, direction));
            let mut terms = self.terms().filter_map(|(x, factor)| Some((of(x)?, factor)));
            match terms.next() {
                Some((x, factor)) => map(plane, x, |x| factor * x),
                None => plane.fill(<S as crate::scalar::Real>::zero()),
            }
            terms.for_each(|(x, factor)| add_scaled(plane, factor, x));
        }
    }

    pub fn reverse(&self, out: usize, sweep: &mut Reverse<'_, S>) {
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        self.terms().for_each(|(x, factor)| add_scaled(before.plane_mut(x, 0), factor, adjoint));
    }

    pub fn mixed(&self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let (order, values, lanes) = (sweep.order, sweep.values, sweep.mixed.lanes);
        let to = values[out].mixed(order);
        let (before, planes) = sweep.mixed.split(out);
        planes.fill(<S as crate::scalar::Real>::zero());
        for (x, factor) in self.terms() {
            let from = values[x].mixed(order);
            for channel in [|m: &Mixed| m.s, |m: &Mixed| m.t, |m: &Mixed| m.st] {
                if let (Some(to), Some(from)) = (channel(&to), channel(&from)) {
                    add_scaled(&mut planes[to * lanes..][..lanes], factor, before.plane(x, from));
                }
            }
        }
    }

    pub fn mixed_reverse(&self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let to = sweep.channels(out);
        let lanes = sweep.adjoints.lanes;
        for (x, factor) in self.terms() {
            if !sweep.wants(x) {
                continue;
            }
            let from = sweep.channels(x);
            let (mut before, adjoint) = sweep.adjoints.reverse(out);
            for channel in [|m: &Mixed| m.value, |m: &Mixed| m.s, |m: &Mixed| m.t] {
                if let (Some(to), Some(from)) = (channel(&to), channel(&from)) {
                    add_scaled(before.plane_mut(x, from), factor, &adjoint[to * lanes..][..lanes]);
                }
            }
        }
    }
}
