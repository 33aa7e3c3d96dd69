//! The result of a fit to motion: residuals, verdict and standard errors.

use super::covariance::{Root, Weighting, agreement, continuation, long_run, scores};
use super::driven::Segment;
use super::fitted::Fitted;
use super::found::{Identified, Residual, ResidualPath};
use super::quality::{
    Correlation, Evidence, correlation, innovations, mean_eigenvalue, outliers, over_noise, typical_size,
};
use super::segments::typical_samples;
use super::smoothed::Quantity;
use super::solve::{Normal, Problem};
use super::thresholds::{EXACT_RESIDUAL, LEAST_FREEDOM, SIGNIFICANCE};
use super::unknowns::unknowns;
use super::verdict::Verdict;
use crate::lagrangian::SystemInstance;
use crate::recording::rms;

/// The result of a fit that began at the constants `start`. `noise` is that of every coordinate before the fit; with `known` noise, residuals count
/// as at least that large.
pub(super) fn result(
    instance: &SystemInstance<f64>,
    problem: &Problem<'_>,
    fitted: &Fitted,
    (start, noise): (&[f64], &[f64]),
    known: bool,
) -> Identified {
    let recording = problem.driven.recording;
    let normal_at = |x: &[f64]| Some(problem.normal_at(x, &fitted.segments));
    let fit = FitResiduals::of(problem, fitted);
    let by_coordinate = fit.by_coordinate(problem, noise);
    let place = |track: usize, sample: usize| (track, sample);
    let (outliers, outlier_count) = outliers(recording, (&fitted.segments, &fit.residuals), place);
    let verdict = fit.verdict(problem, fitted, (&by_coordinate, outlier_count));
    let (normal, inflation) = with_covariance(problem, fitted, (fit.weighting, fit.lags(&fitted.segments)), known);
    let forced = instance.has_inputs() || recording.tracks.iter().any(|track| !track.force.is_empty());
    // A constant at its bound counts as given.
    let at_bounds = Fitted { normal: normal.with_held(), ..fitted.clone() };
    Identified {
        converged: fitted.normal.converged,
        decrement: fitted.normal.decrement,
        explained: verdict.explains(),
        verdict,
        over_noise: over_noise(&by_coordinate),
        residuals: by_coordinate,
        outliers,
        outlier_count,
        paths: paths(problem, &fitted.segments, &fit.residuals),
        inflation,
        force_noise: problem.disturbances.force.clone(),
        samples: fitted.segments.iter().map(|segment| segment.samples).sum(),
        segments: fitted.segments.len(),
        segment_seconds: typical_seconds(problem, &fitted.segments),
        substeps: fitted.substeps,
        between: forced.then_some(problem.driven.between),
        ..unknowns(instance, problem, &at_bounds, (start, 1.0), (Quantity::Accelerations, &normal_at))
    }
}

/// Length of a typical segment in s.
fn typical_seconds(problem: &Problem<'_>, segments: &[Segment]) -> f64 {
    typical_samples(segments) as f64 * problem.driven.step
}

/// Residuals of a fit and their statistics.
struct FitResiduals {
    /// Residuals by segment, in units of the noise.
    residuals: Vec<Vec<f64>>,
    /// Number of residuals, missing ones left out.
    count: f64,
    /// Share of the degrees of freedom that initial states and constants leave.
    freedom: f64,
    weighting: Weighting,
    /// Autocorrelation of the innovations of every coordinate.
    correlations: Vec<Correlation>,
}

impl FitResiduals {
    fn of(problem: &Problem<'_>, fitted: &Fitted) -> Self {
        let residuals = problem.all_residuals(&fitted.x, &fitted.segments);
        let count = problem.readings(&fitted.segments);
        let freedom = (fitted.normal.count - fitted.x.len() as f64).max(1.0) / count;
        let weighting = Weighting::of(&residuals, problem.robust, freedom);
        let innovations = innovations(problem, &fitted.x, &fitted.segments);
        let correlations = innovations.iter().map(|runs| correlation(runs)).collect();
        Self { residuals, count, freedom, weighting, correlations }
    }

    /// `true` if the innovations of a coordinate are independent.
    fn is_white(&self, of: &Correlation) -> bool {
        of.probability * self.correlations.len() as f64 >= SIGNIFICANCE
    }

    /// The residual of every coordinate.
    fn by_coordinate(&self, problem: &Problem<'_>, noise: &[f64]) -> Vec<Residual> {
        let n = problem.sigma.len();
        let of = |i: usize| {
            let own = self.residuals.iter().flat_map(|segment| segment.iter().skip(i).step_by(n).copied());
            let rms = rms(own.filter(|r| r.is_finite())) / self.freedom.sqrt() * problem.sigma[i];
            let (coordinate, spread) = (problem.driven.recording.coordinates[i].clone(), problem.spread[i]);
            let (autocorrelation, white) = (self.correlations[i].at_lag_one, self.is_white(&self.correlations[i]));
            Residual { coordinate, rms, noise: noise[i], spread, autocorrelation, white }
        };
        (0..n).map(of).collect()
    }

    /// Number of lags over which residuals are correlated; `None` if they are independent.
    fn lags(&self, segments: &[Segment]) -> Option<usize> {
        // A correlation that lasts as long as a segment continues in the next one.
        let longest = segments.iter().map(|segment| segment.samples).max().unwrap_or(0);
        let window = |of: &Correlation| if 4 * of.length >= longest { 4 * longest } else { 2 * of.length };
        self.correlations.iter().filter(|of| !self.is_white(of)).map(window).max()
    }

    /// The verdict on the model.
    fn verdict(
        &self,
        problem: &Problem<'_>,
        fitted: &Fitted,
        (by_coordinate, outliers): (&[Residual], usize),
    ) -> Verdict {
        let n = problem.sigma.len();
        // Robust, so that outliers do not excuse the other samples.
        let size = |i: usize| typical_size(&self.residuals, n, i) * problem.sigma[i] / self.freedom.sqrt();
        Evidence {
            converged: fitted.normal.converged,
            sizes: (0..n).map(size).collect(),
            exact: (0..n).map(|i| EXACT_RESIDUAL * problem.spread[i]).collect(),
            residuals: by_coordinate,
            probabilities: self.correlations.iter().map(|of| (of.probability * n as f64).min(1.0)).collect(),
            outliers: outliers as f64 / self.count,
            agreement: agreement(problem, &fitted.x, &fitted.segments, self.weighting),
            continuation: (continuation(problem, fitted, self.weighting), typical_seconds(problem, &fitted.segments)),
        }
        .verdict()
    }
}

/// Positions of the segments and their residuals, in SI units; `residuals` are in units of the noise.
fn paths(problem: &Problem<'_>, segments: &[Segment], residuals: &[Vec<f64>]) -> Vec<ResidualPath> {
    let of = |(segment, residuals): (&Segment, &Vec<f64>)| {
        let noise = |sample: usize, i: usize| problem.sigma_at(segment.track, sample, i);
        ResidualPath::of(problem.driven.recording, segment, residuals, noise)
    };
    segments.iter().zip(residuals).map(of).collect()
}

/// Normal equations with the covariance of the residuals, and the factor by which correlated residuals increase variances. `lags` is the length of
/// the correlation; with `known` noise, residuals count as at least that large.
fn with_covariance(
    problem: &Problem<'_>,
    fitted: &Fitted,
    (weighting, lags): (Weighting, Option<usize>),
    known: bool,
) -> (Normal, f64) {
    let m = fitted.x.len();
    let root = Root::of(m, &fitted.normal.matrix);
    let factor = weighting.weight_over_slope * weighting.weight_over_slope;
    let plain = weighting.square * factor;
    let least = if known { plain.max(1.0) } else { plain.max(f64::MIN_POSITIVE) };
    let Some(lags) = lags else {
        let unit = vec![0.0; root.forward.len().pow(2)];
        return (root.with_covariance(&fitted.normal, &unit, least), 1.0);
    };
    let scores = scores(problem, &fitted.x, &fitted.segments);
    let [wide, narrow] = [lags, lags / 2].map(|lags| long_run(&scores, &fitted.segments, m, lags));
    // A flat-top kernel: 1 over the first half of the lags, so that correlated noise gets its full weight (Politis and Romano, J. Time Series
    // Analysis 16 (1995) 67).
    let flat: Vec<f64> = wide.iter().zip(&narrow).map(|(wide, narrow)| 2.0 * wide - narrow).collect();
    let mut projected = root.projected(m, &flat);
    projected.iter_mut().for_each(|x| *x *= factor);
    let mean = mean_eigenvalue(&projected, root.forward.len());
    let inflation = (mean / plain).max(1.0);
    // Initial states and constants use up as many degrees of freedom of correlated residuals, which have fewer: these fall below the noise by
    // more than independent ones.
    let count = problem.readings(&fitted.segments);
    let used = (count - fitted.normal.count + m as f64) / count;
    let lost = (1.0 - used) / (1.0 - used * inflation).max(LEAST_FREEDOM);
    projected.iter_mut().for_each(|x| *x *= lost);
    (root.with_covariance(&fitted.normal, &projected, least), inflation * lost)
}
