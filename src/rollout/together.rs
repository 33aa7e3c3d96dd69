//! Ensembles that advance together: the states that all motions of a group ask for are evaluated as one batch.
//!
//! Every motion keeps its own steps and error control. Each runs until it needs its model, and waits there for the others;
//! the last to arrive evaluates all states at once, in the order of the motions. A wide network then reads its weights once
//! per round instead of once per motion.

use super::{Integrable, Options, Rollout, rollout};
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::scalar::Scalar;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Motions of a group; more gain nothing, since products of eight states at a time are as quick per state as any.
pub(super) const GROUP: usize = 8;

/// Rolls out every start `(q, v)` like [`rollout_many`](super::rollout_many), groups of motions evaluated as one batch.
///
/// The results keep the order of the starts and do not depend on `threads`, the number of groups at work at a time. They
/// agree with single motions to rounding, not to the bit. Worth its threads for models that take long for one state and
/// less per state for several, as [`EulerLagrange::prefers_batches`] says.
pub fn rollout_together<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[(Vec<S>, Vec<S>)],
    options: &Options<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    let groups: Vec<_> = starts.chunks(GROUP).collect();
    super::run::in_order(&groups, threads, |group| roll_group(model, group, options)).into_iter().flatten().collect()
}

fn roll_group<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[(Vec<S>, Vec<S>)],
    options: &Options<S>,
) -> Vec<Rollout<S>> {
    let group = Group::new(model, starts.len());
    // Every member must exist before the first one may think that it is alone.
    let members: Vec<_> = (0..starts.len()).map(|index| Member { group: &group, index }).collect();
    std::thread::scope(|scope| {
        let running: Vec<_> = members
            .into_iter()
            .zip(starts)
            .map(|(member, (q, v))| scope.spawn(move || rollout(&member, q, v, options)))
            .collect();
        running.into_iter().map(|thread| thread.join().unwrap_or_else(|p| std::panic::resume_unwind(p))).collect()
    })
}

/// The model of a group and the round at hand.
struct Group<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    round: Mutex<Round<S>>,
    evaluated: Condvar,
}

/// What the members ask for, until the last one has asked, and the answer.
struct Round<S> {
    /// Rounds evaluated so far.
    number: u64,
    active: usize,
    asked: Vec<Option<Asked<S>>>,
    q: Vec<S>,
    v: Vec<S>,
    terms: Terms<S>,
    /// Whether every state of the round could be evaluated.
    complete: bool,
}

struct Asked<S> {
    q: Vec<S>,
    v: Vec<S>,
    request: Request,
    /// Rows of the batch, once evaluated.
    rows: Range<usize>,
}

impl<'a, S: Scalar> Group<'a, S> {
    fn new(model: &'a dyn EulerLagrange<S>, members: usize) -> Self {
        let round = Round {
            number: 0,
            active: members,
            asked: (0..members).map(|_| None).collect(),
            q: Vec::new(),
            v: Vec::new(),
            terms: Terms::default(),
            complete: true,
        };
        Self { model, round: Mutex::new(round), evaluated: Condvar::new() }
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
        for asked in round.asked.iter_mut().flatten() {
            let first = round.q.len() / n;
            round.q.extend_from_slice(&asked.q);
            round.v.extend_from_slice(&asked.v);
            asked.rows = first..round.q.len() / n;
            request = request | asked.request;
        }
        round.complete = self.model.terms(&round.q, &round.v, request, &mut round.terms).is_ok();
        round.number += 1;
        self.evaluated.notify_all();
    }
}

/// One motion's view of the model: asks, waits for the others, and takes its rows.
struct Member<'g, 'a, S: Scalar> {
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

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        let mut round = self.group.lock();
        round.asked[self.index] = Some(Asked { q: q.to_vec(), v: v.to_vec(), request, rows: 0..0 });
        let number = round.number;
        while round.number == number {
            if round.asked.iter().flatten().count() == round.active {
                self.group.evaluate(&mut round);
            } else {
                round = self.group.evaluated.wait(round).unwrap_or_else(PoisonError::into_inner);
            }
        }
        let rows = round.asked[self.index].take().map_or(0..0, |asked| asked.rows);
        if round.complete {
            terms.copy_rows(&round.terms, self.coordinates(), rows, request);
            return Ok(());
        }
        drop(round);
        // A state of the round failed: whose it was shows when each asks alone.
        self.group.model.terms(q, v, request, terms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::configure;
    use crate::rollout::{Method, rollout_many};

    fn starts(count: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
        (0..count).map(|k| (vec![0.3 * k as f64, 0.2], vec![0.1, -0.1 * k as f64])).collect()
    }

    /// Hand-written systems treat each state alone: together or not, the same bits, for every kind of method.
    #[test]
    fn motions_together_are_the_motions_alone() {
        let system = configure::<f64>("double-pendulum", &[]).unwrap().build().unwrap();
        for method in [Method::Dopri5, Method::Dop853, Method::Gauss4, Method::Variational] {
            let options = Options { method, step: Some(0.01), ..Options::new(2.0, 0.1) };
            let alone = rollout_many(&*system, &starts(11), &options, 2);
            for threads in [1, 3] {
                assert_eq!(rollout_together(&*system, &starts(11), &options, threads), alone);
            }
        }
        assert!(rollout_together(&*system, &[], &Options::new(1.0, 0.1), 2).is_empty());
    }

    /// A motion that fails or ends early neither stops the others nor lends them its error.
    #[test]
    fn one_that_fails_leaves_the_others_alone() {
        let system = configure::<f64>("spring-pendulum", &[]).unwrap().build().unwrap();
        let mut starts = vec![(vec![1.0, 0.3], vec![0.1, 0.2]); 3];
        // r = 0 is singular; the last start is refused before it begins.
        starts[1].0[0] = 0.0;
        starts.push((vec![f64::NAN, 0.0], vec![0.0, 0.0]));
        let options = Options::new(3.0, 0.1);
        let (together, alone) =
            (rollout_together(&*system, &starts, &options, 2), rollout_many(&*system, &starts, &options, 1));
        let done: Vec<bool> = together.iter().map(Rollout::is_complete).collect();
        assert_eq!(done, [true, false, true, false]);
        for (a, b) in together.iter().zip(&alone) {
            assert_eq!((&a.trajectory, a.statistics), (&b.trajectory, b.statistics));
        }
    }
}
