//! Detects zero crossings of events along a motion, step by step.
//!
//! For every event, the watcher stores on which side of zero the motion is. The dense output of each step is sampled at equidistant points;
//! where the side changes, the crossing is refined. After an impact the motion stays on its side, so that the impact is not detected again.

use super::event::{Event, Occurrence};
use super::impact::Flights;
use super::thresholds::{EVENT_PARTS, EXTREME_TRISECTIONS, SLOPE_SHARE};
use super::{RolloutError, RolloutOptions, StepFailure};
use crate::lagrangian::{EulerLagrange, Terms};
use crate::scalar::{Real, Scalar};

/// Computes the state `(q, v)` at a fraction of a step, from 0 to 1.
pub(super) type Dense<'a, S> = dyn FnMut(S, &mut [S]) + 'a;
/// Computes the state at a fraction of a step with the integrator instead of interpolation.
type Exact<'a, S> = dyn FnMut(S, &mut [S]) -> Result<(), StepFailure> + 'a;

/// A crossing within a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found<S> {
    /// Index of the event.
    pub(super) event: usize,
    /// Fractions of the step that enclose it: before, and at or after the crossing.
    pub(super) between: (S, S),
    /// `true` if the value was positive before it.
    pub(super) above: bool,
}

/// Watches the events of one motion.
pub(super) struct Watcher<'a, S> {
    pub(super) model: &'a dyn EulerLagrange<S>,
    pub(super) events: &'a [Event<S>],
    backwards: bool,
    /// Sampling interval.
    pub(super) dt: S,
    /// Largest number of occurrences.
    pub(super) most: usize,
    /// For each event, `true` if the value is positive; `None` at the start.
    pub(super) sides: Vec<Option<bool>>,
    /// The sides at the end of a step.
    pub(super) next: Vec<Option<bool>>,
    /// The event that happened at the start of the step.
    pub(super) fired: Option<usize>,
    pub(super) counts: Vec<usize>,
    pub(super) flights: Vec<Flights<S>>,
    pub(super) happened: &'a mut Vec<Occurrence<S>>,
    /// `true` once an event has ended the motion.
    pub(super) over: bool,
    state: Vec<S>,
    pub(super) normal: Vec<S>,
    pub(super) terms: Terms<S>,
}

/// Returns the side of a number; `None` for zero.
pub(super) fn side<S: Scalar>(value: S) -> Option<bool> {
    let zero = <S as Real>::zero();
    if value > zero {
        Some(true)
    } else if value < zero {
        Some(false)
    } else {
        None
    }
}

/// Finds the point between `a` and `b` where `f`, nonnegative at `a`, becomes negative, by the method of Oliveira and Takahashi (2020). It
/// needs hardly more evaluations than bisection in the worst case and few if `f` is smooth. The remaining width is the tolerance, or one
/// rounding error.
fn refine<S: Scalar, E>(
    (mut a, mut b): (S, S),
    tolerance: S,
    f: &mut dyn FnMut(S) -> Result<S, E>,
) -> Result<(S, S), E> {
    let (half, zero) = (<S as Real>::half(), <S as Real>::zero());
    let (mut high, mut low) = (f(a)?, f(b)?);
    let (start, fifth) = (b - a, S::ratio(1, 5));
    let mut room = S::max(tolerance, S::epsilon() * start);
    while room < start {
        room = room + room;
    }
    while b - a > tolerance {
        let middle = a + (b - a) * half;
        if middle <= a || middle >= b {
            break;
        }
        let radius = room - (b - a) * half;
        room *= half;
        let straight = if high > zero { (b * high - a * low) / (high - low) } else { middle };
        let toward = if straight < middle { S::of_f64(1.0) } else { S::of_f64(-1.0) };
        let shift = fifth * (b - a) * (b - a) / start;
        let cut = if shift <= (middle - straight).abs() { straight + toward * shift } else { middle };
        let guess = if (cut - middle).abs() <= radius { cut } else { middle - toward * S::max(radius, zero) };
        let x = if guess > a && guess < b { guess } else { middle };
        let value = f(x)?;
        if value < zero { (b, low) = (x, value) } else { (a, high) = (x, value) }
    }
    Ok((a, b))
}

impl<'a, S: Scalar> Watcher<'a, S> {
    /// Returns a watcher for a motion that starts at `(q, v)`; `None` if the options contain no events.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] for impacts in a motion backwards in time.
    pub(super) fn new(
        model: &'a dyn EulerLagrange<S>,
        (q, v): (&[S], &[S]),
        options: &'a RolloutOptions<S>,
        happened: &'a mut Vec<Occurrence<S>>,
    ) -> Result<Option<Self>, RolloutError> {
        let events = &options.events[..];
        if events.is_empty() {
            return Ok(None);
        }
        let backwards = options.t_end < options.t0;
        if let Some(event) = events.iter().find(|event| backwards && event.restitution.is_some()) {
            let problem = format!("is before the start, and the impacts of event `{}` run forwards only", event.name);
            return Err(RolloutError::Invalid { what: "t_end", problem });
        }
        let sides = events.iter().map(|event| {
            let only = (event.restitution.is_some() && event.falling != event.rising).then_some(event.falling);
            side(event.when.value(options.t0, q, v)).or(only)
        });
        let sides: Vec<_> = sides.collect();
        Ok(Some(Self {
            model,
            events,
            backwards,
            dt: options.dt.abs(),
            most: options.max_steps,
            next: sides.clone(),
            sides,
            fired: None,
            counts: vec![0; events.len()],
            flights: vec![Flights::default(); events.len()],
            happened,
            over: false,
            state: vec![<S as Real>::zero(); 2 * q.len()],
            normal: vec![<S as Real>::zero(); q.len()],
            terms: Terms::default(),
        }))
    }

    /// Returns `true` if the event counts crossings from this side of zero.
    pub(super) fn catches(&self, event: usize, above: bool) -> bool {
        let Event { falling, rising, .. } = self.events[event];
        if above != self.backwards { falling } else { rising }
    }

    /// Returns the value of an event at a fraction of a step.
    fn value(&mut self, event: usize, share: S, time: &dyn Fn(S) -> S, dense: &mut Dense<'_, S>) -> S {
        dense(share, &mut self.state);
        let (q, v) = self.state.split_at(self.normal.len());
        self.events[event].when.value(time(share), q, v)
    }

    /// Finds the first crossing after a fraction of a step, and refines it with `dense`.
    pub(super) fn first(&mut self, from: S, time: &dyn Fn(S) -> S, dense: &mut Dense<'_, S>) -> Option<Found<S>> {
        let mut first: Option<Found<S>> = None;
        for event in 0..self.events.len() {
            if let Some(found) = self.first_of(event, from, time, dense)
                && first.is_none_or(|first| found.between.1 < first.between.1)
            {
                first = Some(found);
            }
        }
        if first.is_none() {
            self.sides.clone_from(&self.next);
            self.fired = None;
        }
        first
    }

    /// Finds the first crossing of one event.
    fn first_of(&mut self, event: usize, from: S, time: &dyn Fn(S) -> S, dense: &mut Dense<'_, S>) -> Option<Found<S>> {
        let one = <S as Real>::one();
        let place = |k: usize| from + (one - from) * S::of_f64(k as f64 / EVENT_PARTS as f64);
        let mut known = self.sides[event];
        let start = side(self.value(event, from, time, dense));
        if self.fired != Some(event) && start.is_some() && start != known {
            // Another event happened at the same time or slightly later.
            if let Some(above) = known.filter(|above| self.catches(event, *above)) {
                return Some(Found { event, between: (from, from), above });
            }
            known = start;
        }
        for k in 1..=EVENT_PARTS {
            let (a, b) = (place(k - 1), place(k));
            let now = side(self.value(event, b, time, dense));
            let mut turns = vec![(a, b)];
            if let Some(above) = known.filter(|_| now == known)
                && let Some(beyond) = self.beyond(event, above, (a, b), time, dense)
            {
                turns = vec![(a, beyond), (beyond, b)];
            } else if known.is_none() || now.is_none() || now == known {
                turns.clear();
            }
            for between in turns {
                if let Some(above) = known.filter(|above| self.catches(event, *above)) {
                    let between = self.refined(event, above, between, time, dense);
                    return Some(Found { event, between, above });
                }
                known = known.map(|above| !above);
            }
            known = now.or(known);
        }
        self.next[event] = known;
        None
    }

    /// Returns the value of an event at a fraction of a step, with the sign that makes the given side positive.
    fn oriented(
        &mut self,
        (event, above): (usize, bool),
        share: S,
        time: &dyn Fn(S) -> S,
        dense: &mut Dense<'_, S>,
    ) -> S {
        let value = self.value(event, share, time, dense);
        if above { value } else { -value }
    }

    /// Finds a point on the other side of zero between two points on the same side, if the slopes at both suggest one.
    fn beyond(
        &mut self,
        event: usize,
        above: bool,
        (a, b): (S, S),
        time: &dyn Fn(S) -> S,
        dense: &mut Dense<'_, S>,
    ) -> Option<S> {
        let (zero, small) = (<S as Real>::zero(), (b - a) * S::of_f64(SLOPE_SHARE));
        let mut f = |share: S| self.oriented((event, above), share, time, dense);
        let comes_back = f(a + small) < f(a) && f(b - small) < f(b);
        if !comes_back {
            return None;
        }
        let (mut low, mut high) = (a, b);
        for _ in 0..EXTREME_TRISECTIONS {
            let third = (high - low) / S::of_f64(3.0);
            let (left, right) = (low + third, high - third);
            let values = (f(left), f(right));
            if values.0 < zero || values.1 < zero {
                return Some(if values.0 < zero { left } else { right });
            }
            if values.0 < values.1 { high = right } else { low = left }
        }
        None
    }

    /// Refines a crossing to the rounding error of the time.
    fn refined(
        &mut self,
        event: usize,
        above: bool,
        between: (S, S),
        time: &dyn Fn(S) -> S,
        dense: &mut Dense<'_, S>,
    ) -> (S, S) {
        let tolerance = rounding(time);
        let mut f = |share: S| Ok::<S, StepFailure>(self.oriented((event, above), share, time, dense));
        refine(between, tolerance, &mut f).unwrap_or(between)
    }

    /// Refines a crossing with states from the integrator, given the fraction of the step, starting near the result of `dense`. Returns
    /// `None` if there is no crossing.
    ///
    /// # Errors
    /// Those of `exact`.
    pub(super) fn sharpened(
        &mut self,
        found: Found<S>,
        time: &dyn Fn(S) -> S,
        exact: &mut Exact<'_, S>,
    ) -> Result<Option<Found<S>>, StepFailure> {
        let (zero, one, n) = (<S as Real>::zero(), <S as Real>::one(), self.normal.len());
        let Found { event, between, above } = found;
        let when = self.events[event].when.clone();
        let state = &mut self.state;
        let mut f = |share: S| -> Result<S, StepFailure> {
            exact(share, state)?;
            let (q, v) = state.split_at(n);
            let value = when.value(time(share), q, v);
            Ok(if above { value } else { -value })
        };
        if between.0 == between.1 {
            return Ok(Some(found));
        }
        // Enlarge the interval until it contains the crossing.
        let part = S::ratio(1, EVENT_PARTS as i32);
        let mut reach = part.ldexp(-10);
        let (mut a, mut b) = between;
        while b < one && f(b)? >= zero {
            (a, b) = (b, S::min(b + reach, one));
            reach = reach.ldexp(3);
        }
        if b == one && f(b)? >= zero {
            return Ok(None);
        }
        let mut reach = part.ldexp(-10);
        while a > zero && f(a)? < zero {
            (a, b) = (S::max(a - reach, zero), a);
            reach = reach.ldexp(3);
        }
        let between = refine((a, b), rounding(time), &mut f)?;
        Ok(Some(Found { between, ..found }))
    }

    /// Returns the fraction of a step from which the motion continues after a crossing; for an impact this is still before zero.
    pub(super) fn share(&self, found: &Found<S>) -> S {
        if self.events[found.event].restitution.is_some() { found.between.0 } else { found.between.1 }
    }
}

/// Returns the rounding error of the time as a fraction of a step.
fn rounding<S: Scalar>(time: &dyn Fn(S) -> S) -> S {
    let (start, end) = (time(<S as Real>::zero()), time(<S as Real>::one()));
    S::epsilon() * S::max(start.abs(), end.abs()) / (end - start).abs()
}
