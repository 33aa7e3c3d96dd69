//! Problem and result of an integration with error control, and the functions that it calls.

use super::StepCounts;
use super::crossing::Dense;
use super::trajectory::Times;

/// Receives sample `k` with its state, and returns whether to continue.
pub(super) type Output<'a, S> = dyn FnMut(usize, &[S]) -> bool + 'a;

/// Receives elapsed time, weight and state at quadrature nodes within every step.
pub(super) type StepNodes<'a, S> = dyn FnMut(S, S, &[S]) + 'a;

/// Searches a step for events, given its elapsed time, size and dense output; returns the fraction of the step at which the first one
/// happens.
pub(super) type Scan<'a, S> = dyn FnMut(S, S, &mut Dense<'_, S>) -> Option<S> + 'a;

/// The receivers of the results of an integration.
pub(super) type Receivers<'a, 'f, S> =
    (&'a mut Output<'f, S>, Option<&'a mut StepNodes<'f, S>>, Option<&'a mut Scan<'f, S>>);

/// Projects the state at the end of a step of some length onto its manifold; returns the distance in units of the tolerance.
pub(super) type Project<'a, S, E> = dyn FnMut(S, &mut [S]) -> Result<S, E> + 'a;

/// The adaptive methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Adaptive {
    Dopri5,
    Dop853,
}

impl Adaptive {
    /// Returns the number of stages after the first one.
    pub(super) const fn stages(self) -> usize {
        match self {
            Self::Dopri5 => 6,
            Self::Dop853 => 11,
        }
    }

    /// Returns the number of calls per accepted step that are not stages of the attempt.
    pub(super) const fn closing_calls(self) -> usize {
        match self {
            Self::Dopri5 => 0,
            Self::Dop853 => 1,
        }
    }
}

/// An integration problem.
pub struct Integration<'a, S> {
    pub(super) method: Adaptive,
    pub(super) rtol: S,
    pub(super) atol: S,
    pub(super) max_steps: usize,
    /// Size of the first attempt; 0 lets the solver choose it.
    pub(super) first_step: S,
    /// `true` if the right-hand side depends on time.
    pub(super) timed: bool,
    /// State at elapsed time 0.
    pub(super) start: &'a [S],
    /// Elapsed times of the samples, ascending from 0; the last is the end.
    pub(super) samples: &'a dyn Times<S>,
}

/// The reason why an integration ended early.
#[derive(Debug)]
pub enum EarlyEnd<E> {
    /// The right-hand side fails beyond the last step, however short the next one.
    Failed(E),
    /// The error estimate requires steps that do not advance the time.
    Underflow,
    /// The allowed number of attempts is used up.
    TooManySteps,
    /// The receiver accepts no more samples.
    Stopped,
    /// An event interrupts the motion.
    Event,
}

/// Result of an integration.
pub struct Ran<S, E> {
    pub(super) statistics: StepCounts,
    /// Elapsed time and state at the end of the last accepted step or at the event within it, and the size of the step.
    pub(super) elapsed: S,
    pub(super) state: Vec<S>,
    pub(super) step: S,
    pub(super) ended: Option<EarlyEnd<E>>,
}
