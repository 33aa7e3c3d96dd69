//! Estimates the noise of every coordinate from the residuals of a fit.

use super::fitted::Fitted;
use super::solve::Problem;
use super::thresholds::{
    EXACT_RESIDUAL, LEAST_NOISE, LEAST_NOISE_LEFT, LEAST_OWN_NOISE_SAMPLES, OWN_NOISE_ERRORS, OWN_NOISE_RATIO,
};
use crate::recording::rms;

/// Replaces the noise of every coordinate by the size of its residuals, for each trajectory separately if trajectories differ significantly.
pub(super) fn update_noise(problem: &mut Problem<'_>, fitted: &Fitted) {
    let (n, tracks) = (problem.sigma.len(), problem.driven.recording.tracks.len());
    let residuals = problem.all_residuals(&fitted.x, &fitted.segments);
    let freedom = fitted.normal.count / problem.readings(&fitted.segments);
    // Residuals in the units of the coordinates, `(tracks, n)`.
    let mut own = vec![Vec::new(); tracks * n];
    for (segment, residuals) in fitted.segments.iter().zip(&residuals) {
        for (k, r) in residuals.iter().enumerate().filter(|(_, r)| r.is_finite()) {
            own[segment.track * n + k % n].push(r * problem.sigma_at(segment.track, segment.first + k / n, k % n));
        }
    }
    let mut of = vec![vec![0.0; n]; tracks];
    let mut differ = false;
    for i in 0..n {
        let least = (LEAST_NOISE * problem.spread[i]).max(LEAST_NOISE_LEFT * problem.sigma[i]);
        let size = |values: Vec<f64>| (deviation_of(values, problem.robust) / freedom.sqrt()).max(least);
        let whole = size(own.iter().skip(i).step_by(n).flatten().copied().collect());
        // Integration errors of exact motion are not noise.
        let noisy = whole > EXACT_RESIDUAL * problem.spread[i];
        problem.sigma[i] = whole;
        for (track, of) in of.iter_mut().enumerate() {
            let values = &own[track * n + i];
            let count = independent_samples(values);
            of[i] = if values.len() < LEAST_OWN_NOISE_SAMPLES { whole } else { size(values.clone()) };
            // The standard error of the logarithm of a standard deviation is one over the square root of twice the count.
            differ |=
                noisy && (of[i] / whole).ln().abs() > OWN_NOISE_RATIO.max(OWN_NOISE_ERRORS / (2.0 * count).sqrt());
        }
    }
    problem.sigma_of = if differ { of } else { Vec::new() };
}

/// Effective number of independent samples in a mean square, from the autocorrelation at lag 1.
fn independent_samples(values: &[f64]) -> f64 {
    let square: f64 = values.iter().map(|x| x * x).sum();
    let product: f64 = values.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = (product / square).powi(2);
    let share = (1.0 - correlation) / (1.0 + correlation);
    if share.is_finite() { values.len() as f64 * share } else { 0.0 }
}

/// Root mean square, or a robust estimate from the median of the sizes, which is 0.6745 times the standard deviation of normal numbers.
fn deviation_of(mut values: Vec<f64>, robust: bool) -> f64 {
    if !robust {
        return rms(values);
    }
    values.iter_mut().for_each(|x| *x = x.abs());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0) / 0.6745
}
