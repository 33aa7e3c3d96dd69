//! Rules of operations that are linear in their operands: every channel is a sum of shares of the operands' channels.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::{Real, Scalar};
use crate::tape::engine::kernel::add_scaled;
use crate::tape::engine::value::{Mixed, View};

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
        let channels = std::iter::once(None).chain(layout.directions(out).iter().map(Some));
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
