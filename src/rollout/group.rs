//! Motions that wait for each other, so that the states they all ask for are evaluated as one batch.
//!
//! Every motion keeps its own steps and error control. Each runs until it needs its model, and waits there for the others;
//! the last to arrive evaluates all states at once, in the order of the motions. A wide network then reads its weights once
//! per round instead of once per motion.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::scalar::Scalar;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The model of a group and the round at hand.
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
    /// State that each member waits for; nobody waits any more once it is evaluated.
    asked: Vec<Option<Asked<S>>>,
    /// Rows of each member in the last batch.
    rows: Vec<Range<usize>>,
    q: Vec<S>,
    v: Vec<S>,
    terms: Terms<S>,
    /// `true` if every state of the round could be evaluated.
    complete: bool,
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
            complete: true,
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
        round.complete = self.model.terms(&round.q, &round.v, request, &mut round.terms).is_ok();
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

    fn conserves_energy(&self) -> bool {
        self.group.model.conserves_energy()
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
        if round.complete {
            let rows = round.rows[self.index].clone();
            terms.copy_rows(&round.terms, self.coordinates(), rows, request);
            return Ok(());
        }
        drop(round);
        // A state of the round failed: whose it was shows when each asks alone.
        self.group.model.terms(q, v, request, terms)
    }
}
