//! Events given as formulas of state, time and parameters in a system file.

use super::expression::Formula;
use crate::forward::Dual;
use crate::scalar::{Real, Scalar};
use alloc::string::String;
use alloc::vec::Vec;

/// An event; in its formulas the time is a coordinate after those of the system.
#[derive(Clone, Debug)]
pub struct FormulaEvent {
    /// Its name in the file.
    pub name: String,
    /// `true` if zeros where the value decreases with time count.
    pub falling: bool,
    /// `true` if zeros where the value increases with time count.
    pub rising: bool,
    /// Number of the zero that ends the motion, counted from 1.
    pub last: Option<usize>,
    pub(super) when: Formula,
    pub(super) restitution: Option<Formula>,
}

impl FormulaEvent {
    /// Returns `true` if the velocities jump at its zeros.
    pub fn is_impact(&self) -> bool {
        self.restitution.is_some()
    }
}

/// An event of a system file together with values of its parameters.
#[derive(Clone, Debug)]
pub struct GivenEvent<S> {
    /// The event as described in the file.
    pub event: FormulaEvent,
    parameters: Vec<S>,
}

impl<S: Scalar> GivenEvent<S> {
    /// Combines an event with values of its parameters.
    pub(super) fn new(event: FormulaEvent, parameters: Vec<S>) -> Self {
        Self { event, parameters }
    }

    fn evaluate(&self, formula: &Formula, t: S, (q, v): (&[S], &[S])) -> S {
        formula.evaluate(&self.parameters, &[q, &[t]].concat(), v)
    }

    /// Returns the number that vanishes at the event.
    pub fn value(&self, t: S, state: (&[S], &[S])) -> S {
        self.evaluate(&self.event.when, t, state)
    }

    /// Writes its derivatives by the coordinates, `(n)`, and returns its derivative by the time.
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

    /// Returns the coefficient of restitution of an impact at a state.
    pub fn restitution(&self, t: S, state: (&[S], &[S])) -> Option<S> {
        self.event.restitution.as_ref().map(|formula| self.evaluate(formula, t, state))
    }
}
