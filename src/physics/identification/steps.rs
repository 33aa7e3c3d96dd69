//! Chooses the number of integration steps between samples.

use super::driven::Segment;
use super::fitted::{Fitted, log, refit};
use super::solve::Problem;
use super::thresholds::{INTEGRATION_ERROR, ITERATIONS, MOST_SUBSTEPS, STEP_PROBES};

/// Halves the integration steps until the search converges. Where a force changes abruptly, such as dry friction, the integration error is not a
/// smooth function of the constants, and neither is the sum of squares.
pub(super) fn refine_steps(problem: &mut Problem<'_>, fitted: &mut Fitted) {
    while !fitted.normal.converged && fitted.normal.failed == 0 && problem.driven.substeps < MOST_SUBSTEPS {
        if problem.cancellation.is_cancelled() {
            break;
        }
        let before = fitted.normal.decrement;
        problem.driven.substeps *= 2;
        refit(problem, fitted, ITERATIONS);
        log(fitted, "smaller steps");
        if fitted.normal.decrement > before / 2.0 {
            break;
        }
    }
}

/// Increases the number of integration steps between samples until the integration error is small compared with the noise; `true` if the number
/// changes.
pub(crate) fn choose_steps(problem: &mut Problem<'_>, x: &[f64], segments: &[Segment]) -> bool {
    let before = problem.driven.substeps;
    let stride = segments.len().div_ceil(STEP_PROBES).max(1);
    let mut probes: Vec<&Segment> = segments.iter().step_by(stride).collect();
    probes.sort_by_key(|segment| std::cmp::Reverse(segment.samples));
    let n = problem.width();
    let mut coarse = problem.last_readings(x, &probes);
    while problem.driven.substeps < MOST_SUBSTEPS && problem.cancellation.go_on() {
        let mut finer = problem.clone();
        finer.driven.substeps *= 2;
        let fine = finer.last_readings(x, &probes);
        let errors = coarse.iter().zip(&fine).flat_map(|(a, b)| {
            (0..n).map(|i| ((a[i] - b[i]) / problem.sigma[i]).abs()).filter(|e| e.is_finite()).collect::<Vec<_>>()
        });
        let mut errors: Vec<f64> = errors.collect();
        errors.sort_by(f64::total_cmp);
        if errors.get(errors.len() * 9 / 10).is_none_or(|worst| *worst < INTEGRATION_ERROR) {
            break;
        }
        (problem.driven.substeps, coarse) = (finer.driven.substeps, fine);
    }
    problem.driven.substeps != before
}
