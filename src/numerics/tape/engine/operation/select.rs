//! Recorded branches: linear in the branch that is taken, nothing flows to the condition.

use super::linear::Linear;
use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::{Real, Scalar, update2};
use crate::tape::engine::value::View;

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
