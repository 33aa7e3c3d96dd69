//! Sums, differences, negations and constant factors.

use super::linear::Linear;
use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::Scalar;
use crate::tape::engine::kernel::add_scaled;
use crate::tape::engine::value::View;

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
