//! A fit of constants and initial states, how well it determines them, and its repetition.

use super::driven::Segment;
use super::solve::{Normal, Problem};
use super::thresholds::{LEAST_ERROR_DECREASE, LEAST_SCATTERED_SEGMENTS, MOST_OVER_NOISE, SCATTER_ERRORS};

/// Fitted constants, sensor constants and initial states, with the normal equations at these values.
#[derive(Clone)]
pub(super) struct Fitted {
    pub x: Vec<f64>,
    pub segments: Vec<Segment>,
    pub normal: Normal,
    pub substeps: usize,
}

impl Fitted {
    /// Mean square of the residuals.
    pub fn mean_square(&self) -> f64 {
        self.normal.square / self.normal.count.max(1.0)
    }

    /// `true` for a fit that reached the noise with every constant inside its range: no better fit can be expected.
    pub fn is_sufficient(&self) -> bool {
        let inside = !self.normal.held.contains(&true);
        self.normal.converged && inside && self.mean_square() < MOST_OVER_NOISE * MOST_OVER_NOISE
    }

    /// Variance of the unknowns over that of independent noise of the given size: the mean square of the residuals, or the scatter of the
    /// segments' scores if residuals are correlated along a segment. The second number is the share of the latter.
    pub fn inflation(&self) -> (f64, f64) {
        let square = self.mean_square();
        let (m, count) = (self.x.len(), self.normal.rights.len());
        if count < LEAST_SCATTERED_SEGMENTS {
            return (square, 1.0);
        }
        let ratio = |k: usize| {
            let scatter: f64 = self.normal.rights.iter().map(|part| part[k] * part[k]).sum();
            scatter / self.normal.matrix[k * m + k]
        };
        let mut ratios: Vec<f64> = (0..m).map(ratio).filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        let scatter = ratios.get(ratios.len() / 2).copied().unwrap_or(square) / square;
        // The scatter that noise causes is itself only estimated.
        let independent = scatter <= 1.0 + SCATTER_ERRORS * (2.0 / count as f64).sqrt();
        if independent { (square, 1.0) } else { (square * scatter, scatter) }
    }

    /// Marks the unknowns with a visible effect.
    fn visible(&self) -> Vec<bool> {
        let m = self.x.len();
        let own = |k: usize| self.normal.matrix[k * m + k];
        (0..m).map(|k| own(k) > 0.0 && (self.x[k] == 0.0 || own(k) * self.x[k] * self.x[k] > 1.0)).collect()
    }

    /// Mean log standard error of the marked unknowns, each with the others held fixed.
    fn mean_log_error(&self, of: &[bool]) -> f64 {
        let m = self.x.len();
        let own = |k: usize| self.normal.matrix[k * m + k].max(f64::MIN_POSITIVE);
        let logarithms: Vec<f64> = (0..m).filter(|k| of[*k]).map(|k| own(k).ln()).collect();
        let mean = logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64;
        (self.inflation().0.ln() - mean) / 2.0
    }

    /// `true` if its standard errors are smaller than those of another fit. Unknowns without a visible effect in either fit do not count: their
    /// errors are rounding.
    pub fn determines_better_than(&self, other: &Self) -> bool {
        let either: Vec<bool> = self.visible().into_iter().zip(other.visible()).map(|(a, b)| a || b).collect();
        self.mean_log_error(&either) < other.mean_log_error(&either) - LEAST_ERROR_DECREASE
    }
}

/// Fits the constants and the initial states again.
pub(super) fn refit(problem: &Problem<'_>, fitted: &mut Fitted, iterations: usize) {
    fitted.substeps = problem.driven.substeps;
    fitted.normal = problem.fit(&mut fitted.x, &mut fitted.segments, iterations);
}

/// Logs a fit of the search.
pub(super) fn log(fitted: &Fitted, what: &str) {
    let (x, samples) = (&fitted.x, fitted.segments.first().map_or(0, |segment| segment.samples));
    let (square, spread) = (fitted.mean_square(), fitted.mean_log_error(&fitted.visible()));
    let (segments, substeps) = (fitted.segments.len(), fitted.substeps);
    tracing::debug!(?x, samples, segments, substeps, square, spread, failed = fitted.normal.failed, "{what}");
}
