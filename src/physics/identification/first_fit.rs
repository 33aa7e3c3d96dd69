//! The fit of the first segments. It starts from a fit to smoothed accelerations, or from a search of initial states if a coordinate was not
//! measured.

use super::driven::Segment;
use super::fitted::{Fitted, log, refit};
use super::initial_states::Search;
use super::pieces::Pieces;
use super::smoothed::States;
use super::solve::{Normal, Problem};
use super::steps::choose_steps;
use super::thresholds::{
    FIRST_SEGMENT, ITERATIONS, LEAST_SEGMENT, MOST_FIRST_SAMPLES, START_ROUNDS, USUAL_FIRST_SAMPLES,
};
use super::{IdentifyError, IdentifyOptions};
use crate::lagrangian::SystemInstance;
use crate::names::rounded;
use crate::recording::deviation;

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

/// Number of samples in a first segment: a few time scales of the fastest coordinate, or the requested number if that is smaller.
fn first_samples(
    (v, a): (&[f64], &[f64]),
    (n, step): (usize, f64),
    wanted: Option<f64>,
) -> Result<usize, IdentifyError> {
    let size = |values: &[f64], i: usize| deviation(values.iter().skip(i).step_by(n));
    let paces = (0..n).map(|i| size(v, i) / size(a, i)).filter(|pace| pace.is_finite() && *pace > 0.0);
    let pace = paces.fold(f64::INFINITY, f64::min);
    let samples = if pace.is_finite() { FIRST_SEGMENT * pace / step } else { USUAL_FIRST_SAMPLES };
    let samples = samples.clamp(LEAST_SEGMENT as f64, MOST_FIRST_SAMPLES) as usize;
    let Some(seconds) = wanted else { return Ok(samples) };
    let wanted = (seconds / step).round() as usize;
    if wanted < LEAST_SEGMENT {
        let expected = format!("at least {LEAST_SEGMENT} samples, {} s", rounded(LEAST_SEGMENT as f64 * step, 3));
        return Err(IdentifyError::Option { what: "segment", expected, found: format!("{seconds} s") });
    }
    Ok(samples.min(wanted))
}

/// The better fit of the first segments from two starting points. The second one is tried only if the fit from the first does not reach the noise.
/// Segments that cannot be integrated are left out.
fn fit_first_segments(
    problem: &mut Problem<'_>,
    starts: [Vec<f64>; 2],
    segments: Vec<Segment>,
) -> Result<Fitted, IdentifyError> {
    let mut best: Option<Fitted> = None;
    for x in starts {
        if best.as_ref().is_some_and(Fitted::is_sufficient) {
            break;
        }
        let tried = fit_from(problem, x, segments.clone());
        problem.cancellation.check()?;
        let Some(tried) = tried else { continue };
        if best.as_ref().is_none_or(|best| tried.normal.square < best.normal.square) {
            best = Some(tried);
        }
    }
    let best = best.ok_or(IdentifyError::Lost)?;
    problem.driven.substeps = best.substeps;
    log(&best, "first");
    Ok(best)
}

/// The fit of the first segments from one starting point; `None` if no segment can be integrated.
fn fit_from(problem: &mut Problem<'_>, x: Vec<f64>, mut segments: Vec<Segment>) -> Option<Fitted> {
    problem.driven.substeps = 1;
    problem.project_starts(&x, &mut segments);
    choose_steps(problem, &x, &segments);
    let integrated = problem.all(&x, &segments);
    let mut kept = integrated.iter().map(Option::is_some);
    segments.retain(|_| kept.next().unwrap_or(false));
    if segments.is_empty() {
        return None;
    }
    problem.fit_starts(&x, &mut segments, START_ROUNDS);
    let mut fitted = Fitted { x, segments, normal: Normal::default(), substeps: 1 };
    refit(problem, &mut fitted, ITERATIONS);
    if choose_steps(problem, &fitted.x, &fitted.segments) {
        refit(problem, &mut fitted, ITERATIONS);
    }
    Some(fitted)
}
