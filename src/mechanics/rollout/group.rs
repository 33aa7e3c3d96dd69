//! Motions that wait for each other, so that the states they all ask for are evaluated as one batch.
//!
//! Every motion keeps its own steps and error control. Each runs until it needs its model, and waits there for the others;
//! the last to arrive evaluates all states at once, in the order of the motions. A wide network then reads its weights once
//! per round instead of once per motion.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::scalar::Scalar;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The model of a group and its current round.
pub(super) struct Group<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    round: Mutex<Round<S>>,
    evaluated: Condvar,
}

/// Requests of the members, until the last one has asked, and the answer.
struct Round<S> {
    /// Rounds evaluated so far.
    number: u64,
    active: usize,
    /// State that each member waits for; none waits any more once it is evaluated.
    asked: Vec<Option<Asked<S>>>,
    /// Rows of each member in the last batch.
    rows: Vec<Range<usize>>,
    q: Vec<S>,
    v: Vec<S>,
    terms: Terms<S>,
    /// All that was asked for.
    request: Request,
    /// `true` unless the round failed for a reason that is not that of single states.
    has_row_failures: bool,
}

struct Asked<S> {
    q: Vec<S>,
    v: Vec<S>,
    request: Request,
}

impl<'a, S: Scalar> Group<'a, S> {
    pub(super) fn new(model: &'a dyn EulerLagrange<S>, members: usize) -> Self {
        let round = Round {
            number: 0,
            active: members,
            asked: (0..members).map(|_| None).collect(),
            rows: vec![0..0; members],
            q: Vec::new(),
            v: Vec::new(),
            terms: Terms::default(),
            request: Request::default(),
            has_row_failures: true,
        };
        Self { model, round: Mutex::new(round), evaluated: Condvar::new() }
    }

    /// Member `index`, who belongs to the group until dropped.
    pub(super) fn member(&self, index: usize) -> Member<'_, 'a, S> {
        Member { group: self, index }
    }

    fn lock(&self) -> MutexGuard<'_, Round<S>> {
        self.round.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Evaluates the states of all who asked, in the order of the members.
    fn evaluate(&self, round: &mut Round<S>) {
        let n = self.model.coordinates();
        let mut request = Request::default();
        round.q.clear();
        round.v.clear();
        for (asked, rows) in round.asked.iter_mut().zip(&mut round.rows) {
            let Some(asked) = asked.take() else { continue };
            let first = round.q.len() / n;
            round.q.extend_from_slice(&asked.q);
            round.v.extend_from_slice(&asked.v);
            *rows = first..round.q.len() / n;
            request = request | asked.request;
        }
        let outcome = self.model.terms(&round.q, &round.v, request, &mut round.terms);
        round.has_row_failures = round.terms.record_failures(&outcome);
        round.request = request;
        round.number += 1;
        self.evaluated.notify_all();
    }
}

/// One motion's view of the model: asks, waits for the others, and takes its rows.
pub(super) struct Member<'g, 'a, S: Scalar> {
    group: &'g Group<'a, S>,
    index: usize,
}

impl<S: Scalar> Drop for Member<'_, '_, S> {
    /// The others no longer wait for this motion.
    fn drop(&mut self) {
        let mut round = self.group.lock();
        round.active -= 1;
        round.asked[self.index] = None;
        self.group.evaluated.notify_all();
    }
}

impl<S: Scalar> EulerLagrange<S> for Member<'_, '_, S> {
    fn coordinates(&self) -> usize {
        self.group.model.coordinates()
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(self.group.model)
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        let mut round = self.group.lock();
        round.asked[self.index] = Some(Asked { q: q.to_vec(), v: v.to_vec(), request });
        let number = round.number;
        while round.number == number {
            if round.asked.iter().flatten().count() == round.active {
                self.group.evaluate(&mut round);
            } else {
                round = self.group.evaluated.wait(round).unwrap_or_else(PoisonError::into_inner);
            }
        }
        if round.has_row_failures {
            let rows = round.rows[self.index].clone();
            terms.copy_rows(&round.terms, self.coordinates(), rows, request);
            if terms.failures.is_empty() || request == round.request {
                return terms.outcome();
            }
        }
        drop(round);
        // What failed may be what only the others had asked for.
        self.group.model.terms(q, v, request, terms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::configure;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A model that counts how often it is asked.
    struct Counted {
        model: Box<dyn EulerLagrange<f64>>,
        calls: AtomicUsize,
    }

    impl EulerLagrange<f64> for Counted {
        fn coordinates(&self) -> usize {
            self.model.coordinates()
        }

        fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
            self.calls.fetch_add(1, Ordering::Relaxed);
            self.model.terms(q, v, request, terms)
        }
    }

    /// Outcomes of two members who ask at once, and the evaluations that took.
    fn ask(requests: [Request; 2]) -> ([Result<(), MechanicsError>; 2], usize) {
        let model = configure::<f64>("spring-pendulum", &[]).unwrap().build().unwrap();
        let model = Counted { model, calls: AtomicUsize::new(0) };
        let group = Group::new(&model, 2);
        // The mass matrix is singular at r = 0.
        let states = [[1.0, 0.3], [0.0, 0.3]];
        let outcomes = std::thread::scope(|scope| {
            let members = [0, 1].map(|k| {
                let member = group.member(k);
                scope.spawn(move || {
                    let mut terms = Terms::default();
                    let outcome = member.terms(&states[k], &[0.1, 0.2], requests[k], &mut terms);
                    assert_eq!(terms.outcome(), outcome);
                    outcome
                })
            });
            members.map(|member| member.join().unwrap())
        });
        (outcomes, model.calls.into_inner())
    }

    #[test]
    fn a_failure_is_told_to_whom_it_concerns_without_asking_again() {
        let (outcomes, calls) = ask([Request::ACCELERATION; 2]);
        assert!(matches!(outcomes, [Ok(()), Err(MechanicsError::Singular { row: 0, .. })]), "{outcomes:?}");
        assert_eq!(calls, 1);
        // What only the other had asked for does not fail a member.
        let (outcomes, calls) = ask([Request::ACCELERATION, Request::ENERGY]);
        assert_eq!((outcomes, calls), ([Ok(()), Ok(())], 2));
    }
}
