//! Effects of an event on a motion: it is recorded, ends the motion, or changes the velocities in an impact.

use super::crossing::{Dense, Found, Watcher, side};
use super::event::{Event, Impact, Occurrence, When};
use super::run::into_error;
use super::thresholds::QUICK_IMPACTS;
use super::{RolloutError, StepFailure};
use crate::lagrangian::{Manifold, MechanicsError, Request, dot, project};
use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar};

/// The previous impacts of an event.
#[derive(Clone, Debug, Default)]
pub(super) struct Flights<S> {
    /// Time of the last impact, and the time between the last two.
    last: Option<S>,
    between: Option<S>,
    /// Index of the first impact in a sequence that is faster than the resolution of time, and the number of these impacts.
    since: Option<usize>,
    quick: usize,
}

impl<S: Scalar> Watcher<'_, S> {
    /// Returns `true` if a crossing interrupts the motion: an impact, or an event that ends it.
    pub(super) fn interrupts(&self, found: &Found<S>) -> bool {
        let Event { restitution, last, .. } = &self.events[found.event];
        let ends = last.is_some_and(|last| self.counts[found.event] + 1 >= last);
        restitution.is_some() || ends || self.happened.len() >= self.most
    }

    /// Returns the first event within a step that interrupts the motion, and its fraction of the step. Earlier ones are recorded, with
    /// their states projected onto the constraints.
    pub(super) fn interruption(
        &mut self,
        manifold: Option<&dyn Manifold<S>>,
        time: &dyn Fn(S) -> S,
        dense: &mut Dense<'_, S>,
    ) -> Option<(Found<S>, S)> {
        let (n, mut from) = (self.normal.len(), <S as Real>::zero());
        while let Some(found) = self.first(from, time, dense) {
            from = self.share(&found);
            if self.interrupts(&found) {
                return Some((found, from));
            }
            let mut state = vec![<S as Real>::zero(); 2 * n];
            dense(from, &mut state);
            let mut shown = state.clone();
            let (q, v) = shown.split_at_mut(n);
            // The state is left unchanged if it is too far from the constraints.
            let _ = manifold.map(|manifold| project(manifold, q, v));
            self.mark(found, time(from), [&state, &shown]);
        }
        None
    }

    /// Records a crossing that does not interrupt the motion, with the state `shown`.
    pub(super) fn mark(&mut self, found: Found<S>, t: S, [state, shown]: [&[S]; 2]) {
        self.record(found.event, t, shown, None);
        self.follow(t, state);
        self.goes_on(found, !found.above);
    }

    /// Applies a crossing at a time and state `(q, v)`; an impact changes the velocities.
    ///
    /// # Errors
    /// [`RolloutError::Event`] if an impact is not determined or impacts accumulate; errors of the model.
    pub(super) fn strike(&mut self, found: Found<S>, t: S, state: &mut [S]) -> Result<(), RolloutError> {
        let Found { event, above, .. } = found;
        if self.happened.len() >= self.most {
            let problem = format!("it is one of more than {}, as many as steps are allowed", self.most);
            return Err(self.refused(event, t, state, problem));
        }
        let Some(restitution) = self.events[event].restitution.clone() else {
            self.mark(found, t, [state, state]);
            return Ok(());
        };
        self.impact((event, above), t, state, restitution.as_ref())?;
        self.follow(t, state);
        self.goes_on(found, above);
        Ok(())
    }

    /// Sets the side of zero on which the motion continues after an event.
    fn goes_on(&mut self, found: Found<S>, above: bool) {
        self.fired = Some(found.event);
        self.sides[found.event] = Some(above);
        self.next.clone_from(&self.sides);
    }

    /// Updates the sides for a state. An event that is not detected yet keeps its side, so that it is found at the start of the next step.
    pub(super) fn follow(&mut self, t: S, state: &[S]) {
        let (q, v) = state.split_at(self.normal.len());
        for event in 0..self.events.len() {
            let (now, before) = (side(self.events[event].when.value(t, q, v)), self.sides[event]);
            let crossed = before.is_some_and(|above| now == Some(!above) && self.catches(event, above));
            self.sides[event] = if crossed { before } else { now.or(before) };
        }
        self.fired = None;
        self.next.clone_from(&self.sides);
    }

    fn record(&mut self, event: usize, t: S, state: &[S], impact: Option<Impact<S>>) {
        let (q, v) = state.split_at(self.normal.len());
        let name = self.events[event].name.clone();
        self.happened.push(Occurrence { name, t, q: q.to_vec(), v: v.to_vec(), impact });
        self.counts[event] += 1;
        self.over |= self.events[event].last.is_some_and(|last| self.counts[event] >= last);
    }

    /// Returns the error for an event at a time and state.
    fn refused(&self, event: usize, t: S, state: &[S], problem: impl Into<String>) -> RolloutError {
        let (event, state) = (self.events[event].name.clone(), state.iter().map(|x| x.to_f64()).collect());
        RolloutError::Event { t: t.to_f64(), state, event, problem: problem.into() }
    }

    /// Changes the velocities in an impact and records it.
    fn impact(
        &mut self,
        (event, above): (usize, bool),
        t: S,
        state: &mut [S],
        restitution: &dyn When<S>,
    ) -> Result<(), RolloutError> {
        let (n, zero, one) = (self.normal.len(), <S as Real>::zero(), <S as Real>::one());
        let when = self.events[event].when.clone();
        let v_before = state[n..].to_vec();
        let (q, v) = state.split_at(n);
        let by_time = when.slopes(t, q, v, &mut self.normal);
        let (energy_before, direction) = self.answer(t, (q, v)).map_err(|error| failed(error, t, state))?;
        let inverse = dot(&self.normal, &direction);
        let speed = dot(&self.normal, v) + by_time;
        let e = restitution.value(t, q, v);
        if !(inverse.is_finite() && inverse > zero && speed.is_finite()) {
            let problem = "the gradient of its formula by the coordinates gives no direction for an impact";
            return Err(self.refused(event, t, state, problem));
        }
        if !(e >= zero && e <= one) {
            let problem = format!("expected a coefficient of restitution from 0 to 1, found {e}");
            return Err(self.refused(event, t, state, problem));
        }
        // Because of rounding, a crossing may be found after the velocity has already reversed.
        if (speed < zero) == above {
            let change = (one + e) * speed / inverse;
            state[n..].iter_mut().zip(&direction).for_each(|(v, direction)| *v -= change * *direction);
        }
        let (q, v) = state.split_at(n);
        if when.value(t, q, v) != when.value(t, q, &v_before) {
            let problem = "its formula depends on velocities, which an impact changes at once";
            return Err(self.refused(event, t, state, problem));
        }
        let after = self.model.terms_at(&[t], q, v, Request::ENERGY, &mut self.terms);
        after.map_err(|error| failed(error, t, state))?;
        let energy_after = self.terms.energy.first().copied().unwrap_or_else(S::nan);
        self.record(event, t, state, Some(Impact { v_before, energy_before, energy_after }));
        match self.accumulates(event, t) {
            None => Ok(()),
            Some(problem) => Err(self.refused(event, t, state, problem)),
        }
    }

    /// Computes the energy of a state, and the change of its velocities by a unit impulse along the normal within the constraints: `M^-1
    /// n`.
    fn answer(&mut self, t: S, (q, v): (&[S], &[S])) -> Result<(S, Vec<S>), MechanicsError> {
        let terms = &mut self.terms;
        self.model.terms_at(&[t], q, v, Request::ACCELERATION | Request::ENERGY, terms)?;
        let energy = terms.energy.first().copied().unwrap_or_else(S::nan);
        terms.acceleration.fill(<S as Real>::zero());
        terms.add_force(q.len(), v, &self.normal, &mut Workspace::new())?;
        Ok((energy, terms.acceleration.clone()))
    }

    /// Returns the error message if the impacts of an event accumulate; impacts that are not resolved in time are then removed.
    fn accumulates(&mut self, event: usize, t: S) -> Option<String> {
        let Flights { last, between, since, quick } = &mut self.flights[event];
        let now = t - last.replace(t)?;
        let ratio = between.replace(now).filter(|before| *before > now).map(|before| now / before);
        // Near a surface, distances are quadratic in time.
        if now > Real::sqrt(S::epsilon()) * S::max(t.abs(), self.dt) {
            (*since, *quick) = (None, 0);
            return None;
        }
        let since = *since.get_or_insert(self.happened.len().saturating_sub(1));
        *quick += 1;
        if *quick < QUICK_IMPACTS {
            return None;
        }
        let rest = ratio.map_or(<S as Real>::zero(), |ratio| now * ratio / (<S as Real>::one() - ratio));
        self.happened.truncate(since);
        let at = (t + rest).to_f64();
        Some(format!("its impacts accumulate at t = {at}, and a motion in contact does not follow from them"))
    }
}

/// Returns the error for a state at which the model fails.
fn failed<S: Scalar>(error: MechanicsError, t: S, state: &[S]) -> RolloutError {
    into_error(StepFailure::Model(error), t.to_f64(), state.iter().map(|x| x.to_f64()).collect(), 0.0)
}
