//! Statistics of a series of errors, and the training instability: how much a loss oscillates about its trend
//! (Hamzaogullari and Ozakin, appendix B).

use super::thresholds::{LEAST_LOSSES, LOSS_WINDOW};
use crate::configuration::Config;
use crate::optimizers::Schedule;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Mean, maximum and last value of a series of errors, and how many of its values were finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Mean of the finite values; `NaN` if there are none.
    pub mean: f64,
    /// Largest finite value; `NaN` if there are none.
    pub max: f64,
    /// Last finite value; `NaN` if there are none.
    pub last: f64,
    /// Number of finite values.
    pub count: usize,
}

/// Statistics of the finite values of a series.
pub fn statistics(series: impl IntoIterator<Item = f64>) -> Statistics {
    let mut result = Statistics { mean: f64::NAN, max: f64::NAN, last: f64::NAN, count: 0 };
    let mut sum = 0.0;
    for x in series.into_iter().filter(|x| x.is_finite()) {
        result.count += 1;
        sum += x;
        result.last = x;
        result.max = if result.max >= x { result.max } else { x };
    }
    if result.count > 0 {
        result.mean = sum / result.count as f64;
    }
    result
}

/// Distribution of errors over states.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorDistribution {
    /// Mean absolute error.
    pub mean: f64,
    /// Root of the mean squared error.
    pub rms: f64,
    /// Median absolute error.
    pub median: f64,
    /// 95 % of the states are better.
    pub p95: f64,
    /// 99 % of the states are better.
    pub p99: f64,
    /// Largest absolute error.
    pub max: f64,
    /// States compared.
    pub count: usize,
    /// States left out because a model is not finite there.
    pub failed: usize,
}

impl ErrorDistribution {
    /// Statistics of the absolute errors of the states that were compared, and the number of the others.
    pub(super) fn of(mut errors: Vec<f64>, failed: usize) -> Self {
        errors.sort_by(f64::total_cmp);
        let count = errors.len();
        let mean = |map: fn(f64) -> f64| errors.iter().map(|&e| map(e)).sum::<f64>() / count as f64;
        Self {
            mean: mean(|e| e),
            rms: mean(|e| e * e).sqrt(),
            median: quantile(&errors, 0.5),
            p95: quantile(&errors, 0.95),
            p99: quantile(&errors, 0.99),
            max: quantile(&errors, 1.0),
            count,
            failed,
        }
    }
}

/// Value below which the fraction `p` of a sorted series lies, interpolated linearly; `NaN` for an empty one.
pub(super) fn quantile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = p.clamp(0.0, 1.0) * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    // Infinities have no differences.
    if place == below as f64 || sorted[below] == sorted[above] {
        return sorted[below];
    }
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

/// Savitzky-Golay filter of order 2: at every point the value of the parabola fitted to the `window` points around it,
/// at the ends to the first or last `window` points.
///
/// `window` is odd; a shorter series narrows it to its own length (made odd), and fewer than three points are returned unchanged.
pub fn savitzky_golay(series: &[f64], window: usize) -> Vec<f64> {
    let longest = series.len() - usize::from(series.len().is_multiple_of(2) && !series.is_empty());
    let window = window.min(longest);
    if window < 3 {
        return series.to_vec();
    }
    let half = window / 2;
    let x = |k: usize| k as f64 - half as f64;
    // Polynomials orthogonal on -half ..= half: 1, x, x^2 - mean of x^2.
    let mean_square = (half * (half + 1)) as f64 / 3.0;
    let curved = |k: usize| x(k) * x(k) - mean_square;
    let norms = (0..window).fold([0.0; 2], |[a, b], k| [a + x(k) * x(k), b + curved(k) * curved(k)]);
    (0..series.len())
        .map(|i| {
            let start = i.saturating_sub(half).min(series.len() - window);
            let points = series[start..start + window].iter().enumerate();
            let [sum, slope, curve] =
                points.fold([0.0; 3], |[a, b, c], (k, y)| [a + y, b + y * x(k), c + y * curved(k)]);
            let at = i - start;
            sum / window as f64 + slope / norms[0] * x(at) + curve / norms[1] * curved(at)
        })
        .collect()
}

/// Epochs in which the learning rate falls, and those in which it rises, in order, for every phase of a configuration.
///
/// Cosine annealing gives stretches of `t_max` epochs; the other schedules one stretch per phase.
pub fn stretches(config: &Config) -> Vec<Range<usize>> {
    let mut all = Vec::new();
    let mut begin = 0;
    for phase in &config.phases {
        let end = begin + phase.epochs;
        let length = match phase.schedule {
            Schedule::CosineAnnealing => (phase.t_max.round() as usize).clamp(1, phase.epochs.max(1)),
            Schedule::Constant | Schedule::Cosine => phase.epochs.max(1),
        };
        all.extend((begin..end).step_by(length).map(|start| start..(start + length).min(end)));
        begin = end;
    }
    all
}

/// Mean over the stretches of the standard deviation of `loss - trend` within each, where the trend is the Savitzky-Golay filter of order 2
/// and window 15 over the whole series of losses, one per epoch; in the loss's unit.
///
/// Stretches beyond the end of the series are cut or passed over. `None` for fewer than five losses, too few for a parabola, without a
/// stretch of two epochs, or if a loss is not finite.
pub fn training_instability(losses: &[f64], stretches: &[Range<usize>]) -> Option<f64> {
    if losses.len() < LEAST_LOSSES || losses.iter().any(|loss| !loss.is_finite()) {
        return None;
    }
    let trend = savitzky_golay(losses, LOSS_WINDOW);
    let oscillation: Vec<f64> = losses.iter().zip(&trend).map(|(loss, trend)| loss - trend).collect();
    let deviations: Vec<f64> = stretches
        .iter()
        .filter_map(|range| oscillation.get(range.start..range.end.min(oscillation.len())))
        .filter(|part| part.len() >= 2)
        .map(|part| {
            let mean = part.iter().sum::<f64>() / part.len() as f64;
            (part.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / part.len() as f64).sqrt()
        })
        .collect();
    (!deviations.is_empty()).then(|| deviations.iter().sum::<f64>() / deviations.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finite_values_count() {
        let found = statistics([1.0, f64::NAN, 3.0, f64::INFINITY, 2.0]);
        assert_eq!(found, Statistics { mean: 2.0, max: 3.0, last: 2.0, count: 3 });
        assert!(statistics([]).mean.is_nan());
    }

    #[test]
    fn quantiles_interpolate() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 1.0), 4.0);
        assert_eq!(quantile(&[1.0, f64::INFINITY, f64::INFINITY], 0.75), f64::INFINITY);
        assert_eq!(quantile(&[1.0, 2.0, f64::INFINITY], 0.5), 2.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn parabolas_pass_unchanged_and_the_middle_has_the_known_weights() {
        let parabola: Vec<f64> = (0..40).map(|k| 3.0 - 0.5 * f64::from(k) + 0.25 * f64::from(k * k)).collect();
        for (a, b) in savitzky_golay(&parabola, 15).iter().zip(&parabola) {
            assert!((a - b).abs() <= 30.0 * f64::EPSILON * 400.0, "{a} {b}");
        }
        // Savitzky and Golay 1964, table I: window 5, (-3, 12, 17, 12, -3) / 35.
        for (at, weight) in [(-2, -3.0), (-1, 12.0), (0, 17.0), (1, 12.0), (2, -3.0)] {
            let mut pulse = vec![0.0; 21];
            pulse[(10 + at) as usize] = 35.0;
            assert!((savitzky_golay(&pulse, 5)[10] - weight).abs() < 1e-13);
        }
        assert_eq!(savitzky_golay(&[1.0, 7.0], 15), [1.0, 7.0]);
        assert!(savitzky_golay(&[], 15).is_empty());
        // Three points lie on their parabola.
        for (a, b) in savitzky_golay(&[1.0, 5.0, 2.0], 15).iter().zip([1.0, 5.0, 2.0]) {
            assert!((a - b).abs() < 1e-14);
        }
    }

    #[test]
    fn smooth_losses_are_stable_and_oscillations_count_by_stretch() {
        let smooth: Vec<f64> = (0..60).map(|k| 1.0 - 0.01 * f64::from(k)).collect();
        assert!(training_instability(&smooth, &[0..30, 30..60]).unwrap() < 1e-14);
        // An alternation of amplitude A in the second half only: half the mean over two stretches.
        let noisy = |amplitude: f64| -> Vec<f64> {
            let sign = |k: i32| if k % 2 == 0 { amplitude } else { -amplitude };
            (0..60).map(|k| 1.0 + if k >= 30 { sign(k) } else { 0.0 }).collect()
        };
        let found = training_instability(&noisy(0.1), &[0..30, 30..60]).unwrap();
        assert!((found / 0.05 - 1.0).abs() < 0.1, "{found}");
        let twice = training_instability(&noisy(0.2), &[0..30, 30..60]).unwrap();
        assert!((twice / found - 2.0).abs() < 1e-12);
        // A run that ended early, no stretch at all, and losses that are not finite.
        assert!(training_instability(&smooth[..35], &[0..30, 30..60, 60..90]).is_some());
        assert_eq!(training_instability(&smooth, &[]), None);
        assert_eq!(training_instability(&smooth[..4], &[0..2, 2..4]), None);
        assert_eq!(training_instability(&[1.0, f64::NAN, 1.0, 2.0, 1.0], &[0..3, 3..5]), None);
    }
}
