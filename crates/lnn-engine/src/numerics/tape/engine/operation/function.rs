//! Functions of two numbers: those of the table, by their partial derivatives, and products.

use super::{Forward, MixedForward, MixedReverse, Reverse, add_if, add_if_both};
use crate::ops::Binary;
use crate::scalar::{Real, Scalar, update2, vectorized};
use crate::tape::engine::kernel::{add_product, add_product3, partials};
use crate::tape::engine::{Depth, STATES};

/// `f(a, b)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Function {
    pub f: Binary,
    pub a: usize,
    pub b: usize,
    /// Index of the function among those of its Lagrangian, which locates its partial derivatives.
    pub number: usize,
}

/// Partial derivatives that are kept: two first, three second, four third.
pub(crate) const PARTIALS: usize = 9;

impl Function {
    /// The planes of partial derivatives, `(9, lanes)`.
    fn planes<S>(self, partials: &[S], lanes: usize) -> [&[S]; PARTIALS] {
        core::array::from_fn(|k| &partials[(self.number * PARTIALS + k) * lanes..][..lanes])
    }

    pub fn forward<S: Scalar>(self, out: usize, sweep: &mut Forward<'_, S>) {
        let (lanes, layout) = (sweep.store.lanes, sweep.store.layout);
        let (before, planes) = sweep.store.split(out);
        let (a, b) = (before.plane(self.a, 0), before.plane(self.b, 0));
        let kept = &mut sweep.partials[self.number * PARTIALS * lanes..][..PARTIALS * lanes];
        for lane in 0..lanes {
            let (value, all) = partials(self.f, a[lane], b[lane]);
            planes[lane] = value;
            all.into_iter().enumerate().for_each(|(k, partial)| kept[k * lanes + lane] = partial);
        }
        let (fa, fb) = kept[..2 * lanes].split_at(lanes);
        let tangents = &mut planes[lanes..];
        tangents.fill(<S as Real>::zero());
        for (&direction, plane) in layout.directions(out).iter().zip(tangents.chunks_exact_mut(lanes)) {
            add_if(plane, fa, before.tangent(self.a, direction));
            add_if(plane, fb, before.tangent(self.b, direction));
        }
    }

    pub fn reverse<S: Scalar>(self, out: usize, sweep: &mut Reverse<'_, S>) {
        let (forward, lanes) = (sweep.kept.forward, sweep.adjoints.lanes);
        let [fa, fb, aa, ab, bb, ..] = self.planes(sweep.kept.partials, lanes);
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        add_product(before.plane_mut(self.a, 0), adjoint, fa);
        add_product(before.plane_mut(self.b, 0), adjoint, fb);
        if sweep.depth >= Depth::MassMatrix {
            sweep.second.add_square(self.a, forward, &weighted(adjoint, aa)[..lanes]);
            sweep.second.add_cross((self.a, self.b), forward, &weighted(adjoint, ab)[..lanes]);
            sweep.second.add_square(self.b, forward, &weighted(adjoint, bb)[..lanes]);
        }
    }

    pub fn mixed<S: Scalar>(self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let lanes = sweep.mixed.lanes;
        let [to, ca, cb] = [out, self.a, self.b].map(|value| sweep.kept.values[value].mixed(sweep.order));
        let [fa, fb, aa, ab, bb, ..] = self.planes(sweep.kept.partials, lanes);
        let (before, planes) = sweep.mixed.split(out);
        planes.fill(<S as Real>::zero());
        let of = |value: usize, channel: Option<usize>| channel.map(|channel| before.plane(value, channel));
        for (to, of_a, of_b) in [(to.s, ca.s, cb.s), (to.t, ca.t, cb.t), (to.st, ca.st, cb.st)] {
            if let Some(to) = to {
                let plane = &mut planes[to * lanes..][..lanes];
                add_if(plane, fa, of(self.a, of_a));
                add_if(plane, fb, of(self.b, of_b));
            }
        }
        let Some(st) = to.st else { return };
        let plane = &mut planes[st * lanes..][..lanes];
        let mut add = |d2: &[S], x: Option<&[S]>, y: Option<&[S]>| {
            if let (Some(x), Some(y)) = (x, y) {
                add_product3(plane, d2, x, y);
            }
        };
        let (s, t) = ((of(self.a, ca.s), of(self.b, cb.s)), (of(self.a, ca.t), of(self.b, cb.t)));
        add(aa, s.0, t.0);
        add(ab, s.0, t.1);
        add(ab, s.1, t.0);
        add(bb, s.1, t.1);
    }

    pub fn mixed_reverse<S: Scalar>(self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let [fa, fb, aa, ab, bb, aaa, aab, abb, bbb] = self.planes(sweep.kept.partials, sweep.adjoints.lanes);
        if sweep.wants(self.a) {
            add_to_operand((self.a, self.b), [fa, aa, ab, aaa, aab, abb], out, sweep);
        }
        if sweep.wants(self.b) {
            add_to_operand((self.b, self.a), [fb, bb, ab, bbb, abb, aab], out, sweep);
        }
    }
}

/// `w d` of every lane; 0 past their number.
fn weighted<S: Scalar>(w: &[S], d: &[S]) -> [S; STATES] {
    let mut product = [<S as Real>::zero(); STATES];
    update2(&mut product, w, d, |product, w, d| *product = w * d);
    product
}

/// Adjoints of the operand `x`, with the other operand `y`: partial derivatives `x`, `xx`, `xy`, `xxx`, `xxy`, `xyy`.
fn add_to_operand<S: Scalar>(
    (x, y): (usize, usize),
    [fx, xx, xy, xxx, xxy, xyy]: [&[S]; 6],
    out: usize,
    sweep: &mut MixedReverse<'_, S>,
) {
    let [own, cx, cy] = [out, x, y].map(|value| sweep.channels(value));
    let (mixed, lanes) = (sweep.mixed, sweep.adjoints.lanes);
    let plane_of = |value: usize, channel: Option<usize>| channel.map(|channel| mixed.plane(value, channel));
    let outer = sweep.value_adjoints.plane(out, 0);
    let (mut before, adjoints) = sweep.adjoints.reverse(out);
    let of_out = |channel: Option<usize>| channel.map(|channel| &adjoints[channel * lanes..][..lanes]);
    let [xs, xt, xst] = [cx.s, cx.t, cx.st].map(|channel| plane_of(x, channel));
    let [ys, yt, yst] = [cy.s, cy.t, cy.st].map(|channel| plane_of(y, channel));
    if let Some(value) = cx.value {
        let plane = before.plane_mut(x, value);
        add_if(plane, fx, of_out(own.value));
        for (adjoint, of_x, of_y) in [(of_out(own.s), xs, ys), (of_out(own.t), xt, yt), (Some(outer), xst, yst)] {
            if let Some(adjoint) = adjoint {
                add_if(plane, &weighted(adjoint, xx)[..lanes], of_x);
                add_if(plane, &weighted(adjoint, xy)[..lanes], of_y);
            }
        }
        for (d3, of_s, of_t) in [(xxx, xs, xt), (xxy, xs, yt), (xxy, ys, xt), (xyy, ys, yt)] {
            if let (Some(of_s), Some(of_t)) = (of_s, of_t) {
                add_product3(plane, &weighted(outer, d3)[..lanes], of_s, of_t);
            }
        }
    }
    for (own, of_x, other_x, other_y) in [(own.s, cx.s, xt, yt), (own.t, cx.t, xs, ys)] {
        if let Some(channel) = of_x {
            let plane = before.plane_mut(x, channel);
            add_if(plane, fx, of_out(own));
            add_if(plane, &weighted(outer, xx)[..lanes], other_x);
            add_if(plane, &weighted(outer, xy)[..lanes], other_y);
        }
    }
}

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

/// Adjoints of the factor `x` of `x y`.
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
