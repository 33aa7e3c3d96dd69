//! Many motions: each by itself, or groups of them evaluated together.

use super::group::Group;
use super::run::adaptive_or_fixed;
use super::{Force, Integrable, Options, Rollout};
use crate::lagrangian::EulerLagrange;
use crate::scalar::Scalar;
use crate::storage::{MOST_THREADS, in_order};

/// Motions of a group; more gain nothing, since products of eight states at a time are as quick per state as any.
const GROUP: usize = 8;

/// Where a motion starts, and the force from outside that drives it, if there is one.
#[derive(Clone, Copy)]
pub struct Start<'a, S: Scalar> {
    /// Coordinates, `(n)`.
    pub q: &'a [S],
    /// Velocities, `(n)`.
    pub v: &'a [S],
    /// Force from outside.
    pub force: Option<&'a dyn Force<S>>,
}

/// The starts without forces.
fn free<S: Scalar>(starts: &[(Vec<S>, Vec<S>)]) -> Vec<Start<'_, S>> {
    starts.iter().map(|(q, v)| Start { q, v, force: None }).collect()
}

/// Rolls out every start `(q, v)`; the results keep the order of the starts and do not depend on `threads`.
///
/// Large ensembles of a model that [`EulerLagrange::prefers_batches`] advance as [`rollout_together`] does.
pub fn rollout_many<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[(Vec<S>, Vec<S>)],
    options: &Options<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    rollout_each(model, &free(starts), options, threads)
}

/// [`rollout_many`] with a force of its own for every start.
pub fn rollout_each<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[Start<'_, S>],
    options: &Options<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    if model.prefers_batches() && starts.len() > GROUP {
        return together(model, starts, options, threads);
    }
    in_order(starts, threads, |start| adaptive_or_fixed(model, start.force, start.q, start.v, options))
}

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
    together(model, &free(starts), options, threads)
}

fn together<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[Start<'_, S>],
    options: &Options<S>,
    threads: usize,
) -> Vec<Rollout<S>> {
    let groups: Vec<_> = starts.chunks(GROUP).collect();
    // Every motion of a group has a thread.
    let abreast = threads.min(MOST_THREADS / GROUP);
    in_order(&groups, abreast, |group| roll_group(model, group, options)).into_iter().flatten().collect()
}

fn roll_group<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    starts: &[Start<'_, S>],
    options: &Options<S>,
) -> Vec<Rollout<S>> {
    let group = Group::new(model, starts.len());
    // Every member must exist before the first one may think that it is alone.
    let members: Vec<_> = (0..starts.len()).map(|index| group.member(index)).collect();
    std::thread::scope(|scope| {
        let running: Vec<_> = members
            .into_iter()
            .zip(starts)
            .map(|(member, start)| {
                // Without a thread the member is gone with the closure, and the others do not wait for it.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::configure;
    use crate::rollout::{Method, rollout_many};

    fn starts(count: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
        (0..count).map(|k| (vec![0.3 * k as f64, 0.2], vec![0.1, -0.1 * k as f64])).collect()
    }

    /// The same motions for every kind of method, to what rounding grows to, and the same bits on any number of threads.
    #[test]
    fn motions_together_are_the_motions_alone() {
        let system = configure::<f64>("double-pendulum", &[]).unwrap().build().unwrap();
        for method in [Method::Dopri5, Method::Dop853, Method::Gauss4, Method::Variational] {
            let options = Options { method, step: Some(0.01), ..Options::new(2.0, 0.1) };
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
            assert_eq!((&a.trajectory.t, a.statistics), (&b.trajectory.t, b.statistics));
        }
    }
}
