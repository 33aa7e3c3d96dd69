//! Products of two numbers: `phi'' = 1` across the operands.

use super::{Forward, MixedForward, MixedReverse, Reverse, add_if, add_if_both};
use crate::scalar::{Real, Scalar, update2, vectorized};
use crate::tape::engine::Depth;

/// `a b`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Product {
    pub a: usize,
    pub b: usize,
}

impl Product {
    pub fn forward<S: Scalar>(self, out: usize, sweep: &mut Forward<'_, S>) {
        let (lanes, layout) = (sweep.store.lanes, sweep.store.layout);
        let (before, planes) = sweep.store.split(out);
        let (a, b) = (before.plane(self.a, 0), before.plane(self.b, 0));
        let (value, tangents) = planes.split_at_mut(lanes);
        vectorized(
            #[inline(always)]
            || update2(value, a, b, |y, a, b| *y = a * b),
        );
        tangents.fill(<S as Real>::zero());
        for (&direction, plane) in layout.directions(out).iter().zip(tangents.chunks_exact_mut(lanes)) {
            add_if(plane, b, before.tangent(self.a, direction));
            add_if(plane, a, before.tangent(self.b, direction));
        }
    }

    pub fn reverse<S: Scalar>(self, out: usize, sweep: &mut Reverse<'_, S>) {
        let forward = sweep.kept.forward;
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        add_if(before.plane_mut(self.a, 0), adjoint, Some(forward.plane(self.b, 0)));
        add_if(before.plane_mut(self.b, 0), adjoint, Some(forward.plane(self.a, 0)));
        if sweep.depth >= Depth::MassMatrix {
            sweep.second.add_cross((self.a, self.b), forward, adjoint);
        }
    }

    pub fn mixed<S: Scalar>(self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let (forward, lanes) = (sweep.kept.forward, sweep.mixed.lanes);
        let [to, ca, cb] = [out, self.a, self.b].map(|value| sweep.kept.values[value].mixed(sweep.order));
        let (before, planes) = sweep.mixed.split(out);
        planes.fill(<S as Real>::zero());
        let of = |value: usize, channel: Option<usize>| channel.map(|channel| before.plane(value, channel));
        let (a, b) = (forward.plane(self.a, 0), forward.plane(self.b, 0));
        for (to, of_a, of_b) in [(to.s, ca.s, cb.s), (to.t, ca.t, cb.t), (to.st, ca.st, cb.st)] {
            if let Some(to) = to {
                let plane = &mut planes[to * lanes..][..lanes];
                add_if(plane, b, of(self.a, of_a));
                add_if(plane, a, of(self.b, of_b));
            }
        }
        if let Some(st) = to.st {
            let plane = &mut planes[st * lanes..][..lanes];
            add_if_both(plane, of(self.a, ca.s), of(self.b, cb.t));
            add_if_both(plane, of(self.a, ca.t), of(self.b, cb.s));
        }
    }

    pub fn mixed_reverse<S: Scalar>(self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        for (x, y) in [(self.a, self.b), (self.b, self.a)] {
            if sweep.wants(x) {
                add_to_factor((x, y), out, sweep);
            }
        }
    }
}

/// Adjoints of the factor `x`, which stands beside `y`.
fn add_to_factor<S: Scalar>((x, y): (usize, usize), out: usize, sweep: &mut MixedReverse<'_, S>) {
    let [own, cx, cy] = [out, x, y].map(|value| sweep.channels(value));
    let (factor, mixed, lanes) = (sweep.kept.forward.plane(y, 0), sweep.mixed, sweep.adjoints.lanes);
    let of_y = |channel: Option<usize>| channel.map(|channel| mixed.plane(y, channel));
    let outer = sweep.value_adjoints.plane(out, 0);
    let (mut before, adjoints) = sweep.adjoints.reverse(out);
    let of_out = |channel: Option<usize>| channel.map(|channel| &adjoints[channel * lanes..][..lanes]);
    if let Some(value) = cx.value {
        let plane = before.plane_mut(x, value);
        add_if(plane, factor, of_out(own.value));
        add_if_both(plane, of_out(own.s), of_y(cy.s));
        add_if_both(plane, of_out(own.t), of_y(cy.t));
        add_if(plane, outer, of_y(cy.st));
    }
    for (own, of_x, other) in [(own.s, cx.s, cy.t), (own.t, cx.t, cy.s)] {
        if let Some(channel) = of_x {
            let plane = before.plane_mut(x, channel);
            add_if(plane, factor, of_out(own));
            add_if(plane, outer, of_y(other));
        }
    }
}
