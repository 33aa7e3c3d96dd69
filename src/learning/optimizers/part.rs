//! Parameters beside their gradients and moments, and the rule that moves them.

use crate::optimizers::Update;
use crate::scalar::{Scalar, vectorized};

/// Keeps a step finite where a second moment vanishes.
const EPSILON: f64 = 1e-8;

/// Adam's rule at one step.
#[derive(Clone, Copy)]
pub(super) struct Rule<S> {
    /// Factors of both moments, and of the gradient and its square that are added to them.
    keep: [S; 2],
    take: [S; 2],
    /// Step length, and the factor of the second moment's root; no factor where RAdam does without the second moment.
    length: S,
    scale: Option<S>,
    epsilon: S,
}

impl<S: Scalar> Rule<S> {
    /// The rule at step `step`, counted from 1.
    pub fn new(update: &Update, step: u32) -> Self {
        let (length, scale) = update.step_size(step);
        let decay = update.method.traits().decay;
        Self {
            keep: decay.map(S::of_f64),
            take: decay.map(|b| S::of_f64(1.0 - b)),
            length: S::of_f64(length),
            scale: scale.map(S::of_f64),
            epsilon: S::of_f64(EPSILON),
        }
    }

    /// Moves both moments of a number on and returns its step.
    #[inline(always)]
    pub fn advance(&self, m: &mut S, v: &mut S, g: S) -> S {
        *m = self.keep[0] * *m + self.take[0] * g;
        *v = self.keep[1] * *v + self.take[1] * g * g;
        self.length
            * match self.scale {
                Some(scale) => *m / (v.sqrt() * scale + self.epsilon),
                None => *m,
            }
    }
}

/// Some of the parameters, from number `start` on, with their gradients and moments.
pub(super) struct Part<'a, S> {
    pub start: usize,
    pub weights: &'a mut [S],
    pub gradient: &'a mut [S],
    pub first: &'a mut [S],
    pub second: &'a mut [S],
}

impl<S: Scalar> Part<'_, S> {
    /// The parameters before number `at`, and those from there on.
    pub fn split(self, at: usize) -> (Self, Self) {
        let k = at - self.start;
        let (weights, gradient) = (self.weights.split_at_mut(k), self.gradient.split_at_mut(k));
        let (first, second) = (self.first.split_at_mut(k), self.second.split_at_mut(k));
        (
            Self { start: self.start, weights: weights.0, gradient: gradient.0, first: first.0, second: second.0 },
            Self { start: at, weights: weights.1, gradient: gradient.1, first: first.1, second: second.1 },
        )
    }

    /// Turns the gradient into the step, and moves both moments on.
    pub fn advance(&mut self, rule: &Rule<S>) {
        vectorized(
            #[inline(always)]
            || {
                let moments = self.first.iter_mut().zip(&mut *self.second);
                self.gradient.iter_mut().zip(moments).for_each(|(g, (m, v))| *g = rule.advance(m, v, *g));
            },
        );
    }

    /// Takes the step that the gradient was turned into.
    pub fn apply(self) {
        vectorized(
            #[inline(always)]
            || self.weights.iter_mut().zip(&*self.gradient).for_each(|(w, &step)| *w -= step),
        );
    }
}
