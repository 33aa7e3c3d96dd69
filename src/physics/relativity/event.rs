//! Events along a motion: where a number that depends on the state passes through zero.

use crate::lagrangian::EulerLagrange;
use crate::rollout::{Method, Options, RolloutError, rollout, rollout_in_pieces};
use std::ops::ControlFlow;

/// Local error of the motions that are followed.
const TOLERANCE: f64 = 1e-11;
/// Steps of a motion, at most: many times what an orbit takes.
const STEPS: usize = 50_000;
/// Steps of the search between two samples, at most.
const REFINEMENTS: usize = 60;

/// State of a motion at a time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct State {
    pub t: f64,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
}

/// Options of the motions that are followed.
pub(super) fn options(t_end: f64, dt: f64) -> Options<f64> {
    Options {
        method: Method::Dop853,
        rtol: TOLERANCE,
        atol: TOLERANCE,
        max_steps: STEPS,
        energy: false,
        ..Options::new(t_end, dt)
    }
}

/// The first sample at which `next` says so, with the one before it.
///
/// `None` if the motion ends before, at `t_end` or where the model fails.
pub(super) fn passing(
    model: &dyn EulerLagrange<f64>,
    start: (&[f64], &[f64]),
    (t_end, dt): (f64, f64),
    mut next: impl FnMut(&State) -> bool,
) -> Option<[State; 2]> {
    let (mut before, mut found): (Option<State>, Option<[State; 2]>) = (None, None);
    rollout_in_pieces(model, start.0, start.1, &options(t_end, dt), &mut |piece| {
        for k in 0..piece.len() {
            let (q, v) = piece.state(k);
            let state = State { t: piece.t[k], q: q.to_vec(), v: v.to_vec() };
            if next(&state) {
                found = before.take().map(|before| [before, state]);
                return ControlFlow::Break(());
            }
            before = Some(state);
        }
        ControlFlow::Continue(())
    });
    found
}

/// The state at which `of` vanishes between two samples of a motion at which its signs differ, by the rule of false position, each trial
/// integrated from the first sample.
///
/// # Errors
/// Where the motion between the samples fails.
pub(super) fn zero(
    model: &dyn EulerLagrange<f64>,
    [from, to]: &[State; 2],
    of: impl Fn(&State) -> f64,
) -> Result<State, RolloutError> {
    let (mut low, mut high) = ((0.0, of(from)), (to.t - from.t, of(to)));
    let mut best = to.clone();
    let mut kept = 0_i32;
    for _ in 0..REFINEMENTS {
        let step = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
        let span = high.0 - low.0;
        if !(step > low.0 && step < high.0 && span > f64::EPSILON * to.t.abs()) {
            break;
        }
        let motion = rollout(model, &from.q, &from.v, &options(step, step)).complete()?;
        let (q, v) = motion.state(motion.len() - 1);
        best = State { t: from.t + step, q: q.to_vec(), v: v.to_vec() };
        let value = of(&best);
        if value == 0.0 {
            break;
        }
        // The end that stays twice counts half: the Illinois variant.
        if (value > 0.0) == (low.1 > 0.0) {
            low = (step, value);
            if kept > 0 {
                high.1 *= 0.5;
            }
            kept = 1;
        } else {
            high = (step, value);
            if kept < 0 {
                low.1 *= 0.5;
            }
            kept = -1;
        }
        if (high.0 - low.0) < TOLERANCE * to.t.abs() || value.abs() < TOLERANCE * (low.1.abs() + high.1.abs()) * 1e-3 {
            break;
        }
    }
    Ok(best)
}
