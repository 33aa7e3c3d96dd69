//! Events as formulas of state, time and parameters, as a system file states them.

use super::expression::Formula;
use crate::forward::Dual;
use crate::scalar::{Real, Scalar};
use alloc::string::String;
use alloc::vec::Vec;

/// An event whose formulas have the time as a coordinate after those of the system.
#[derive(Clone, Debug)]
pub struct FormulaEvent {
    /// Its name in the file.
    pub name: String,
    /// `true` if zeros of this direction in time count.
    pub falling: bool,
    /// As [`FormulaEvent::falling`].
    pub rising: bool,
    /// Which of its zeros ends the motion, counted from 1.
    pub last: Option<usize>,
    pub(super) when: Formula,
    pub(super) restitution: Option<Formula>,
}

impl FormulaEvent {
    /// `true` if velocities change at its zeros.
    pub fn is_impact(&self) -> bool {
        self.restitution.is_some()
    }
}

/// An event of a system file, with values of its parameters.
#[derive(Clone, Debug)]
pub struct GivenEvent<S> {
    /// The event as described in the file.
    pub event: FormulaEvent,
    parameters: Vec<S>,
}

impl<S: Scalar> GivenEvent<S> {
    /// The event for these parameters.
    pub(super) fn new(event: FormulaEvent, parameters: Vec<S>) -> Self {
        Self { event, parameters }
    }

    fn evaluate(&self, formula: &Formula, t: S, (q, v): (&[S], &[S])) -> S {
        formula.evaluate(&self.parameters, &[q, &[t]].concat(), v)
    }

    /// The number that vanishes at the event.
    pub fn value(&self, t: S, state: (&[S], &[S])) -> S {
        self.evaluate(&self.event.when, t, state)
    }

    /// Writes its derivatives by the coordinates, `(n)`, and returns the one by the time.
    pub fn slopes(&self, t: S, (q, v): (&[S], &[S]), normal: &mut [S]) -> S {
        let (n, one) = (q.len(), <S as Real>::one());
        let mut inputs: Vec<Dual<S>> =
            q.iter().chain([&t]).chain(v).chain(&self.parameters).map(|x| Dual::lift(*x)).collect();
        let mut slope = |k: usize| {
            inputs[k].tangent = one;
            let value =
                self.event.when.evaluate(&inputs[2 * n + 1..], &inputs[..n + 1], &inputs[n + 1..2 * n + 1]).tangent;
            inputs[k].tangent = <S as Real>::zero();
            value
        };
        normal.iter_mut().enumerate().for_each(|(k, normal)| *normal = slope(k));
        slope(n)
    }

    /// The coefficient of restitution at a state, of an impact.
    pub fn restitution(&self, t: S, state: (&[S], &[S])) -> Option<S> {
        self.event.restitution.as_ref().map(|formula| self.evaluate(formula, t, state))
    }
}
