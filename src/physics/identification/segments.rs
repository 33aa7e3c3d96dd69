//! The lengths of segments: thins them out, and halves or joins them as long as that reduces the standard errors.

use super::driven::Segment;
use super::fitted::{Fitted, log, refit};
use super::solve::Problem;
use super::steps::choose_steps;
use super::thresholds::{
    FEW_START_ROUNDS, ITERATIONS, MOST_INCREASE, MOST_OVER_NOISE, MOST_SAMPLES, MOST_SUBSTEPS, NEAR_DECREMENT,
    SEGMENTS_OF_RUN, SHORT_OF_CHOSEN, START_ROUNDS,
};

/// Leaves out segments beyond the largest number of samples. Runs of consecutive segments are kept, so that these can be joined later.
pub(crate) fn thinned(segments: Vec<Segment>) -> Vec<Segment> {
    let all: usize = segments.iter().map(|segment| segment.samples).sum();
    if all <= MOST_SAMPLES {
        return segments;
    }
    let runs = segments.len().div_ceil(SEGMENTS_OF_RUN);
    let kept = (runs * MOST_SAMPLES / all).max(1);
    let keep = |at: usize| (at / SEGMENTS_OF_RUN + 1) * kept / runs > at / SEGMENTS_OF_RUN * kept / runs;
    segments.into_iter().enumerate().filter(|(at, _)| keep(*at)).map(|(_, segment)| segment).collect()
}

/// Joins pairs of adjacent segments.
pub(crate) fn joined(segments: &[Segment]) -> Vec<Segment> {
    let mut joined: Vec<(Segment, bool)> = Vec::new();
    for segment in segments {
        match joined.last_mut() {
            Some((last, double))
                if !*double && last.track == segment.track && last.first + last.samples == segment.first =>
            {
                last.samples += segment.samples;
                *double = true;
            }
            _ => joined.push((segment.clone(), false)),
        }
    }
    joined.into_iter().map(|(segment, _)| segment).collect()
}

/// Halves every segment that is long enough. Both halves start on the fitted motion.
fn halved(problem: &Problem<'_>, fitted: &Fitted) -> Vec<Segment> {
    let long = |segment: &&Segment| segment.samples >= 2 * problem.least_segment();
    let to_middle = |segment: &Segment| Segment { samples: segment.samples / 2 + 1, ..segment.clone() };
    let first: Vec<Segment> = fitted.segments.iter().filter(long).map(to_middle).collect();
    let mut middles = problem.ends(&fitted.x, &first.iter().collect::<Vec<_>>()).into_iter();
    let mut segments = Vec::new();
    for segment in &fitted.segments {
        let Some(start) = long(&segment).then(|| middles.next()).flatten() else {
            segments.push(segment.clone());
            continue;
        };
        let half = segment.samples / 2;
        let (first, samples) = (segment.first + half, segment.samples - half);
        segments.push(Segment { samples: half, ..segment.clone() });
        segments.push(Segment { track: segment.track, first, samples, start });
    }
    segments
}

/// Halves the segments of a model that does not fit, as long as that reduces the standard errors: the effect of a missing term accumulates along
/// a segment.
pub(super) fn shortened(problem: &Problem<'_>, mut fitted: Fitted) -> Fitted {
    while fitted.mean_square() > MOST_OVER_NOISE * MOST_OVER_NOISE && !problem.cancellation.is_cancelled() {
        let segments = halved(problem, &fitted);
        if segments.len() == fitted.segments.len() {
            break;
        }
        let mut shorter = Fitted { segments, ..fitted.clone() };
        problem.fit_starts(&shorter.x, &mut shorter.segments, FEW_START_ROUNDS);
        refit(problem, &mut shorter, ITERATIONS);
        log(&shorter, "shorter");
        if shorter.normal.failed > 0 || !shorter.determines_better_than(&fitted) {
            break;
        }
        fitted = shorter;
    }
    fitted
}

/// Joins adjacent segments as long as that reduces the standard errors, or up to the wanted length.
pub(super) fn lengthened(problem: &mut Problem<'_>, mut fitted: Fitted, wanted: Option<f64>) -> Fitted {
    let seconds = |segments: &[Segment]| typical_samples(segments) as f64 * problem.driven.step;
    let mut too_short = wanted.map(|wanted| seconds(&fitted.segments) * SHORT_OF_CHOSEN < wanted);
    while too_short != Some(false) && !problem.cancellation.is_cancelled() {
        let segments = joined(&fitted.segments);
        if segments.len() == fitted.segments.len() {
            break;
        }
        let mut longer = Fitted { segments, ..fitted.clone() };
        choose_steps(problem, &longer.x, &longer.segments);
        // The largest number of steps may not be enough to integrate longer segments accurately.
        if wanted.is_none() && problem.driven.substeps == MOST_SUBSTEPS && fitted.substeps < MOST_SUBSTEPS {
            problem.driven.substeps = fitted.substeps;
            break;
        }
        problem.fit_starts(&longer.x, &mut longer.segments, START_ROUNDS);
        refit(problem, &mut longer, ITERATIONS);
        log(&longer, "longer");
        // For chaotic motion the sum of squares is rough, and the search stalls.
        let has_arrived = longer.normal.decrement < NEAR_DECREMENT || !fitted.normal.converged;
        let acceptable =
            longer.normal.failed == 0 && longer.mean_square() < MOST_INCREASE * fitted.mean_square() && has_arrived;
        if wanted.is_none() && !(acceptable && longer.determines_better_than(&fitted)) {
            problem.driven.substeps = fitted.substeps;
            break;
        }
        fitted = longer;
        let seconds = typical_samples(&fitted.segments) as f64 * problem.driven.step;
        too_short = wanted.map(|wanted| seconds * SHORT_OF_CHOSEN < wanted);
    }
    fitted
}

/// Number of samples of a typical segment.
pub(super) fn typical_samples(segments: &[Segment]) -> usize {
    let mut samples: Vec<usize> = segments.iter().map(|segment| segment.samples).collect();
    samples.sort_unstable();
    samples.get(samples.len() / 2).copied().unwrap_or(0)
}
