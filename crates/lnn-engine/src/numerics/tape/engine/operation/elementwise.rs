//! Functions of one number on every unit of a value: activations, sines, roots.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::ops::Unary;
use crate::scalar::{Real, Scalar, update2, update3, vectorized};
use crate::tape::engine::Depth;
use crate::tape::engine::kernel::jets;
use crate::tape::engine::value::{Dependence, Mixed};
use alloc::vec::Vec;

/// `f(x)`, unit by unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Elementwise {
    pub f: Unary,
    pub x: usize,
    pub units: usize,
    /// Offsets of the derivatives of `f`, in numbers per state.
    pub slope: usize,
}

/// Planes of mixed channels, empty where they are not carried.
fn planes<S>(all: &[S], channels: Mixed, size: usize) -> [&[S]; 4] {
    let Mixed { value, s, t, st, .. } = channels;
    [value, s, t, st].map(|channel| channel.map_or(&[] as &[S], |channel| &all[channel * size..(channel + 1) * size]))
}

/// The planes, for writing.
fn planes_mut<S>(all: &mut [S], channels: Mixed, size: usize) -> [&mut [S]; 4] {
    let Mixed { value, s, t, st, .. } = channels;
    let mut rest = all;
    [value, s, t, st].map(|channel| match channel {
        None => &mut [] as &mut [S],
        Some(_) => {
            let (plane, after) = core::mem::take(&mut rest).split_at_mut(size);
            rest = after;
            plane
        }
    })
}

impl Elementwise {
    fn slopes<'a, S>(&self, slopes: &'a [Vec<S>; 3], lanes: usize) -> [&'a [S]; 3] {
        let range = self.slope * lanes..(self.slope + self.units) * lanes;
        [&slopes[0], &slopes[1], &slopes[2]].map(|d| d.get(range.clone()).unwrap_or(&[]))
    }

    pub fn forward<S: Scalar>(self, out: usize, sweep: &mut Forward<'_, S>) {
        let (lanes, moves) = (sweep.store.lanes, sweep.values[self.x].kind == Dependence::Velocity);
        let size = self.units * lanes;
        let order = match sweep.depth {
            Depth::Value => 0,
            Depth::Training => 3,
            Depth::MassMatrix | Depth::Motion if moves => 2,
            _ => 1,
        };
        let (before, own) = sweep.store.split(out);
        let (value, tangents) = own.split_at_mut(size);
        let range = self.slope * lanes..self.slope * lanes + size;
        let mut k = 0;
        let kept = sweep.slopes.each_mut().map(|d| {
            k += 1;
            if k <= order { &mut d[range.clone()] } else { &mut [] as &mut [S] }
        });
        jets(self.f, order, before.plane(self.x, 0), value, kept);
        let d1 = &sweep.slopes[0][range];
        vectorized(
            #[inline(always)]
            || {
                for channel in 0..tangents.len() / size {
                    let (y, x) = (&mut tangents[channel * size..][..size], before.plane(self.x, channel + 1));
                    update2(y, x, d1, |y, x, d1| *y = d1 * x);
                }
            },
        );
    }

    pub fn reverse<S: Scalar>(self, out: usize, sweep: &mut Reverse<'_, S>) {
        let [d1, d2, _] = self.slopes(sweep.kept.slopes, sweep.adjoints.lanes);
        let in_place = sweep.kept.values[self.x].in_place;
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        let target = before.plane_mut(self.x, 0);
        vectorized(
            #[inline(always)]
            || update2(target, adjoint, d1, |sum, a, d1| *sum = if in_place { a * d1 } else { *sum + a * d1 }),
        );
        if sweep.depth < Depth::MassMatrix || sweep.kept.values[self.x].kind != Dependence::Velocity {
            return;
        }
        if self.units == 1 {
            let lanes = adjoint.len();
            let mut curvature = [<S as Real>::zero(); crate::tape::engine::STATES];
            update2(&mut curvature, adjoint, d2, |c, a, d2| *c = a * d2);
            sweep.second.add_square(self.x, sweep.kept.forward, &curvature[..lanes]);
        } else {
            sweep.second.add_block((self.x, self.units), sweep.kept.forward, adjoint, d2);
        }
    }

    pub fn mixed<S: Scalar>(self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let lanes = sweep.mixed.lanes;
        let size = self.units * lanes;
        let [d1, d2, _] = self.slopes(sweep.kept.slopes, lanes);
        let [own, from] = [out, self.x].map(|value| sweep.kept.values[value].mixed(sweep.order));
        let (before, all) = sweep.mixed.split(out);
        let [_, ys, yt, yst] = planes_mut(all, own, size);
        let [_, xs, xt, xst] = planes(before.all(self.x), from, size);
        vectorized(
            #[inline(always)]
            || {
                for (y, x) in [(ys, xs), (yt, xt)] {
                    update2(y, x, d1, |y, x, d1| *y = d1 * x);
                }
                update2(yst, xst, d1, |y, x, d1| *y = d1 * x);
                update3(yst, xs, xt, d2, |y, xs, xt, d2| *y += d2 * (xs * xt));
            },
        );
    }

    pub fn mixed_reverse<S: Scalar>(self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        if !sweep.wants(self.x) {
            return;
        }
        let lanes = sweep.adjoints.lanes;
        let size = self.units * lanes;
        let [d1, d2, d3] = self.slopes(sweep.kept.slopes, lanes);
        let [own, from] = [out, self.x].map(|value| sweep.channels(value));
        let in_place = sweep.kept.values[self.x].in_place;
        let outer = sweep.value_adjoints.plane(out, 0);
        let [_, xs, xt, xst] = planes(sweep.mixed.all(self.x), from, size);
        let (mut before, adjoints) = sweep.adjoints.reverse(out);
        // If the value is an output, only its mixed channel has an adjoint.
        let [y0, ys, yt, _] = planes(adjoints, own, size);
        let targets = before.all_mut(self.x);
        if !in_place {
            let [b0, bs, bt, _] = planes_mut(targets, from, size);
            for (b, y) in [(&mut *b0, y0), (bs, ys), (bt, yt)] {
                crate::tape::engine::kernel::add_product(b, d1, y);
            }
            let [_, bs, bt, _] = planes_mut(targets, from, size);
            for (b, x) in [(bs, xt), (bt, xs)] {
                crate::tape::engine::kernel::add_product3(b, d2, outer, x);
            }
            let [b0, ..] = planes_mut(targets, from, size);
            for (x, y) in [(xs, ys), (xt, yt), (xst, outer)] {
                crate::tape::engine::kernel::add_product3(b0, d2, x, y);
            }
            if !xs.is_empty() && !xt.is_empty() {
                vectorized(
                    #[inline(always)]
                    || {
                        for k in 0..size {
                            b0[k] += d3[k] * outer[k] * (xs[k] * xt[k]);
                        }
                    },
                );
            }
            return;
        }
        let [b0, bs, bt, _] = planes_mut(targets, from, size);
        let has = |plane: &[S]| plane.len() == size;
        let both = has(xs) && has(xt);
        vectorized(
            #[inline(always)]
            || match (both, has(ys)) {
                (true, true) => {
                    let (b0, bs, bt) = (&mut b0[..size], &mut bs[..size], &mut bt[..size]);
                    let (xs, xt, xst) = (&xs[..size], &xt[..size], &xst[..size]);
                    let (y0, ys, yt) = (&y0[..size], &ys[..size], &yt[..size]);
                    let (d1, d2, d3, outer) = (&d1[..size], &d2[..size], &d3[..size], &outer[..size]);
                    for u in 0..size {
                        let curved = d2[u] * outer[u];
                        bs[u] = d1[u] * ys[u] + curved * xt[u];
                        bt[u] = d1[u] * yt[u] + curved * xs[u];
                        let first = d1[u] * y0[u] + d2[u] * (xs[u] * ys[u] + xt[u] * yt[u]);
                        b0[u] = first + curved * xst[u] + d3[u] * outer[u] * (xs[u] * xt[u]);
                    }
                }
                (true, false) => {
                    let (b0, bs, bt) = (&mut b0[..size], &mut bs[..size], &mut bt[..size]);
                    let (xs, xt, xst) = (&xs[..size], &xt[..size], &xst[..size]);
                    let (d2, d3, outer) = (&d2[..size], &d3[..size], &outer[..size]);
                    for u in 0..size {
                        let curved = d2[u] * outer[u];
                        bs[u] = curved * xt[u];
                        bt[u] = curved * xs[u];
                        b0[u] = curved * xst[u] + d3[u] * outer[u] * (xs[u] * xt[u]);
                    }
                }
                // With fewer than two directions, products with missing directions are omitted.
                (false, _) => {
                    for (u, b0) in b0.iter_mut().enumerate() {
                        let mut sum = if has(y0) { d1[u] * y0[u] } else { <S as Real>::zero() };
                        if has(xt) && has(yt) {
                            sum += d2[u] * xt[u] * yt[u];
                        }
                        if has(xst) {
                            sum += d2[u] * outer[u] * xst[u];
                        }
                        *b0 = sum;
                    }
                    for (u, bt) in bt.iter_mut().enumerate() {
                        *bt = if has(yt) { d1[u] * yt[u] } else { <S as Real>::zero() };
                    }
                }
            },
        );
    }
}
