//! The fit of the first segments. It starts from a fit to smoothed accelerations, or from a search of initial states if a coordinate was not
//! measured.

use super::initial_states::Search;
use super::pieces::Pieces;
use super::smoothed::States;
use super::solve::Problem;
use super::stages::{Fitted, first_samples, fit_first_segments};
use super::{IdentifyError, IdentifyOptions};
use crate::lagrangian::SystemInstance;

/// A fit of the first segments, and the constants, by index, whose range was searched only in part.
type FirstFit = (Fitted, Vec<(usize, [f64; 2])>);

/// Fits the first segments, starting at the given constants; `on_pieces` is the problem of the long pieces alone.
pub(super) fn first_fit<'b>(
    problem: &mut Problem<'b>,
    (on_pieces, pieces): (&Problem<'_>, &Pieces<'b>),
    (instance, given): (&SystemInstance<f64>, &[f64]),
    options: &IdentifyOptions,
) -> Result<FirstFit, IdentifyError> {
    let states = match problem.measured {
        None => Some(States::new(on_pieces, &pieces.smoothed)),
        Some(measured) => measured.coordinates(&pieces.smoothed).map(|own| States::new(on_pieces, &own)),
    };
    if let Some(states) = states {
        on_pieces.require_constraints(given, (&states.q, &states.v))?;
        return from_smoothed(problem, (on_pieces, &states, pieces), given, options);
    }
    problem.cancellation.stage("initial states");
    let bounds = &instance.system.validation(instance.coordinates);
    let [v, a] = pieces.rates();
    let samples = first_samples((&v, &a), (problem.width(), pieces.step), options.segment)?;
    let layout = pieces.cut(samples.max(problem.least_segment()));
    Ok((Search { problem, pieces, bounds, layout }.first(given)?, Vec::new()))
}

/// Fits the first segments, starting at constants that are fitted to smoothed accelerations.
fn from_smoothed(
    problem: &mut Problem<'_>,
    (on_pieces, states, pieces): (&Problem<'_>, &States, &Pieces<'_>),
    given: &[f64],
    options: &IdentifyOptions,
) -> Result<FirstFit, IdentifyError> {
    let (n, mut x) = (problem.n(), given.to_vec());
    let cut = match states.len(n) {
        0 => Some(Vec::new()),
        _ => states.fit_phases(on_pieces, &mut x),
    };
    problem.cancellation.check()?;
    let cut = cut.ok_or(IdentifyError::Singular)?;
    tracing::debug!(?x, states = states.len(n), "smoothed accelerations");
    let samples = first_samples((&states.v, &states.a), (n, pieces.step), options.segment)?;
    problem.cancellation.stage("short segments");
    let mut segments = pieces.cut(samples);
    if let Some(measured) = problem.measured {
        segments.iter_mut().for_each(|segment| segment.start = measured.state(&segment.start, &[]));
    }
    Ok((fit_first_segments(problem, [x, given.to_vec()], segments)?, cut))
}
