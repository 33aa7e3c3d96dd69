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

/// Golden angle, and the ratio of the additive recurrence that goes with it: both fill evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
const RATIO: f64 = 0.754_877_666_246_692_8;

/// Distances, uniform in their logarithm, with the directions of a Fibonacci sphere.
pub(super) fn directions(points: usize, (low, high): (f64, f64)) -> impl Iterator<Item = (f64, [f64; 3])> {
    (0..points).map(move |k| {
        let (z, angle) = (1.0 - (2.0 * k as f64 + 1.0) / points as f64, GOLDEN_ANGLE * k as f64);
        let across = (1.0 - z * z).sqrt();
        (low * (high / low).powf((k as f64 * RATIO).fract()), [across * angle.cos(), across * angle.sin(), z])
    })
}

/// `a.b`.
pub(super) fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(&b).fold(0.0, |sum, (a, b)| sum + a * b)
}

/// `|a|`.
pub(super) fn norm<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}

/// `a + s b`.
pub(super) fn along<const N: usize>(a: [f64; N], s: f64, b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// `s a`.
pub(super) fn times<const N: usize>(s: f64, a: [f64; N]) -> [f64; N] {
    a.map(|a| s * a)
}

/// `g(a, b) = g_ij a^i b^j` of a metric `(4, 4)`.
pub(super) fn product(metric: &[f64], a: [f64; 4], b: [f64; 4]) -> f64 {
    dot(a, lower(metric, b))
}

/// `a_i = g_ij a^j` of a metric `(4, 4)`.
pub(super) fn lower(metric: &[f64], a: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| (0..4).fold(0.0, |sum, j| sum + metric[4 * i + j] * a[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_distances_fill_a_shell_evenly() {
        type Place = (f64, [f64; 3]);
        let all: Vec<Place> = directions(1000, (1.0, 100.0)).collect();
        let mean = |of: &dyn Fn(&Place) -> f64| all.iter().map(of).sum::<f64>() / 1000.0;
        assert!((mean(&|(r, _)| r.ln()) - 10.0_f64.ln()).abs() < 0.01);
        for i in 0..3 {
            assert!(mean(&|(_, d)| d[i]).abs() < 5e-3);
            assert!((mean(&|(_, d)| d[i] * d[i]) - 1.0 / 3.0).abs() < 5e-3);
        }
    }
}
