//! How far ahead held-out motion is predicted.

use crate::data::Split;
use crate::pipeline::thresholds::SAMPLES_AHEAD;
use crate::recording::Smoothed;
use std::f64::consts::TAU;

/// Range of possible horizons: from the shortest time step to the longest trajectory.
pub(crate) fn horizons(part: &Split) -> Option<(f64, f64)> {
    let times = || part.states.iter().map(|states| &states.times[states.interior()]);
    let spans = times().filter_map(|times| Some(times.last()? - times.first()?)).filter(|span| *span > 0.0);
    let steps = times().flat_map(|times| times.windows(2).map(|pair| pair[1] - pair[0]));
    Some((steps.reduce(f64::min)?, spans.reduce(f64::max)?))
}

/// Period of the fastest coordinate ([`HoldOut::fastest_period`](super::HoldOut::fastest_period)).
pub(super) fn fastest_period(part: &Split) -> Option<f64> {
    let n = part.recording.n();
    let longest = horizons(part)?.1;
    let of = |i: usize| {
        let column = |of: fn(&Smoothed) -> &[f64]| {
            part.states.iter().flat_map(move |states| states.interior().map(move |row| of(states)[row * n + i]))
        };
        let count = column(|states| &states.v).count() as f64;
        let square = |of: fn(&Smoothed) -> &[f64]| column(of).map(|x| x * x).sum::<f64>() / count;
        let mean = column(|states| &states.v).sum::<f64>() / count;
        let velocity = square(|states| &states.v) - mean * mean;
        let acceleration = square(|states| &states.a) - square(|states| &states.a_error);
        TAU * (velocity / acceleration).sqrt()
    };
    (0..n).map(of).filter(|period| *period <= longest).reduce(f64::min)
}

/// Default horizon: a quarter of the shortest long trajectory, but at most [`SAMPLES_AHEAD`] samples or one `period`. Trajectories count as
/// long from half the length above which half of the recorded time lies, so that pieces between gaps do not shorten the horizon of the
/// others.
pub(super) fn horizon(part: &Split, period: Option<f64>) -> f64 {
    let times = part.states.iter().map(|states| &states.times[states.interior()]);
    let mut spans: Vec<(f64, usize)> =
        times.filter_map(|times| Some((times.last()? - times.first()?, times.len() - 1))).collect();
    spans.sort_by(|a, b| b.0.total_cmp(&a.0));
    let half = 0.5 * spans.iter().map(|(span, _)| span).sum::<f64>();
    let mut sum = 0.0;
    let usual = spans.iter().find(|(span, _)| {
        sum += span;
        sum >= half
    });
    let long = usual.map_or(0.0, |(span, _)| 0.5 * span);
    let horizons = spans.iter().filter(|(span, _)| *span >= long);
    let period = period.unwrap_or(0.0);
    let horizons =
        horizons.map(|(span, steps)| (0.25 * span).min((SAMPLES_AHEAD * span / (*steps).max(1) as f64).max(period)));
    horizons.fold(f64::INFINITY, f64::min)
}
