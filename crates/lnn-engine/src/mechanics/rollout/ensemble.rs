//! Integrates many motions, individually or in groups whose states are evaluated together.
//!
//! The motions of a group wait for each other, so that all requested states are evaluated as one batch. Every motion has separate steps and
//! error control. Each thread runs until it needs the model; the last one to arrive evaluates all states at once, in the order of the
//! motions. A wide network then reads its weights once per round instead of once per motion.

use super::run::adaptive_or_fixed;
use super::thresholds::MOTIONS_TOGETHER;
use super::{Force, Integrable, Rollout, RolloutOptions};
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::scalar::Scalar;
use crate::storage::{MOST_THREADS, in_order};
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The initial state of a motion, and the external force that acts on it, if any.
#[derive(Clone, Copy)]
pub struct Start<'a, S: Scalar> {
    /// Coordinates, `(n)`.
    pub q: &'a [S],
    /// Velocities, `(n)`.
    pub v: &'a [S],
    /// External force.
    pub force: Option<&'a dyn Force<S>>,
}

/// Returns initial states without forces.
fn free<S: Scalar>(starts: &[(Vec<S>, Vec<S>)]) -> Vec<Start<'_, S>> {
    starts.iter().map(|(q, v)| Start { q, v, force: None }).collect()
}

/// Integrates a motion from every initial state `(q, v)`. The results have the order of the initial states and do not depend on `threads`.
///
/// Large ensembles of a model that [`EulerLagrange::prefers_batches`] are integrated as in [`rollout_together`].
pub fn rollout_many<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[(Vec<S>, Vec<S>)],
    options: &RolloutOptions<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    rollout_each(model, &free(starts), options, threads)
}

/// Does the same as [`rollout_many`] with a separate force for every motion.
pub fn rollout_each<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[Start<'_, S>],
    options: &RolloutOptions<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    if model.prefers_batches() && starts.len() > MOTIONS_TOGETHER {
        return together(model, starts, options, threads);
    }
    in_order(starts, threads, |start| adaptive_or_fixed(model, start.force, start.q, start.v, options))
}

/// Integrates a motion from every initial state `(q, v)` as [`rollout_many`](super::rollout_many) does, but evaluates groups of motions as
/// one batch.
///
/// The results have the order of the initial states and do not depend on `threads`, the number of simultaneous groups. They agree with
/// single motions up to rounding. This is faster for models for which [`EulerLagrange::prefers_batches`] returns `true`.
pub fn rollout_together<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[(Vec<S>, Vec<S>)],
    options: &RolloutOptions<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    together(model, &free(starts), options, threads)
}

fn together<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[Start<'_, S>],
    options: &RolloutOptions<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    let groups: Vec<_> = starts.chunks(MOTIONS_TOGETHER).collect();
    // Every motion of a group has its own thread.
    let abreast = threads.min(MOST_THREADS / MOTIONS_TOGETHER);
    in_order(&groups, abreast, |group| roll_group(model, group, options)).into_iter().flatten().collect()
}

fn roll_group<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[Start<'_, S>],
    options: &RolloutOptions<S>,
) -> Vec<Rollout<S>> {
    let group = Group::new(model, starts.len());
    // All members must exist before the first one starts; otherwise it would assume that it is alone.
    let members: Vec<_> = (0..starts.len()).map(|index| group.member(index)).collect();
    std::thread::scope(|scope| {
        let running: Vec<_> = members
            .into_iter()
            .zip(starts)
            .map(|(member, start)| {
                // If no thread can be started, the closure is dropped with its member, and the others do not wait for it.
                let work = move || adaptive_or_fixed(&member, start.force, start.q, start.v, options);
                std::thread::Builder::new().spawn_scoped(scope, work)
            })
            .collect();
        let ended = running.into_iter().zip(starts).map(|(thread, start)| match thread {
            Ok(thread) => thread.join().unwrap_or_else(|p| std::panic::resume_unwind(p)),
            Err(_) => adaptive_or_fixed(model, start.force, start.q, start.v, options),
        });
        ended.collect()
    })
}

/// The model of a group and its current round.
pub(super) struct Group<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    round: Mutex<Round<S>>,
    evaluated: Condvar,
}

/// The requests of the members until the last one has arrived, and the result.
struct Round<S> {
    /// Number of evaluated rounds.
    number: u64,
    active: usize,
    /// The state for which each member waits; `None` once it is evaluated.
    asked: Vec<Option<Asked<S>>>,
    /// Rows of each member in the last batch.
    rows: Vec<Range<usize>>,
    q: Vec<S>,
    v: Vec<S>,
    terms: Terms<S>,
    /// The union of all requests.
    request: Request,
    /// `true` unless the round failed for a reason that does not concern single states.
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

    /// Returns member `index`, which belongs to the group until it is dropped.
    fn member(&self, index: usize) -> Member<'_, 'a, S> {
        Member { group: self, index }
    }

    fn lock(&self) -> MutexGuard<'_, Round<S>> {
        self.round.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Evaluates the states of all requests, in the order of the members.
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

/// A motion's view of the model: it submits requests, waits for the others, and takes its rows of the result.
struct Member<'g, 'a, S: Scalar> {
    group: &'g Group<'a, S>,
    index: usize,
}

impl<S: Scalar> Drop for Member<'_, '_, S> {
    /// Removes this motion, so that the others no longer wait for it.
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
        // A failure may concern only terms that the others requested.
        self.group.model.terms(q, v, request, terms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;
    use crate::rollout::{Integrator, rollout_many};
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn starts(count: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
        (0..count).map(|k| (vec![0.3 * k as f64, 0.2], vec![0.1, -0.1 * k as f64])).collect()
    }

    /// Motions in a group agree with single motions for every kind of method up to the growth of rounding errors, and are bitwise equal for
    /// any number of threads.
    #[test]
    fn motions_together_are_the_motions_alone() {
        let system = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
        for method in [Integrator::Dopri5, Integrator::Dop853, Integrator::Gauss4, Integrator::Variational] {
            let options = RolloutOptions { method, step: Some(0.01), ..RolloutOptions::new(2.0, 0.1) };
            let alone = rollout_many(&*system, &starts(11), &options, 2);
            let together = rollout_together(&*system, &starts(11), &options, 1);
            assert_eq!(rollout_together(&*system, &starts(11), &options, 3), together);
            for (a, b) in together.iter().zip(&alone) {
                assert!(a.is_complete() && a.trajectory.t == b.trajectory.t);
                let states =
                    a.trajectory.q.iter().zip(&b.trajectory.q).chain(a.trajectory.v.iter().zip(&b.trajectory.v));
                for (x, y) in states {
                    assert!((x - y).abs() < 1e-10, "{method:?}: {x} and {y}");
                }
            }
        }
        assert!(rollout_together(&*system, &[], &RolloutOptions::new(1.0, 0.1), 2).is_empty());
    }

    /// A motion that fails or ends early neither stops the others nor passes its error to them.
    #[test]
    fn one_that_fails_leaves_the_others_alone() {
        let system = SystemInstance::<f64>::named("spring-pendulum", &[]).unwrap().build().unwrap();
        let mut starts = vec![(vec![1.0, 0.3], vec![0.1, 0.2]); 3];
        // r = 0 is singular; the last initial state is rejected before the integration.
        starts[1].0[0] = 0.0;
        starts.push((vec![f64::NAN, 0.0], vec![0.0, 0.0]));
        let options = RolloutOptions::new(3.0, 0.1);
        let (together, alone) =
            (rollout_together(&*system, &starts, &options, 2), rollout_many(&*system, &starts, &options, 1));
        let done: Vec<bool> = together.iter().map(Rollout::is_complete).collect();
        assert_eq!(done, [true, false, true, false]);
        for (a, b) in together.iter().zip(&alone) {
            assert_eq!((&a.trajectory.t, a.statistics), (&b.trajectory.t, b.statistics));
        }
    }

    /// A model that counts its evaluations.
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

    /// Returns the outcomes of two members with simultaneous requests, and the number of evaluations.
    fn ask(requests: [Request; 2]) -> ([Result<(), MechanicsError>; 2], usize) {
        let model = SystemInstance::<f64>::named("spring-pendulum", &[]).unwrap().build().unwrap();
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
        // A term that only the other member requested does not cause a failure.
        let (outcomes, calls) = ask([Request::ACCELERATION, Request::ENERGY]);
        assert_eq!((outcomes, calls), ([Ok(()), Ok(())], 2));
    }
}
