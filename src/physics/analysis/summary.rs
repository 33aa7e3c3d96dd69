//! Statistics of a series of errors.

use serde::{Deserialize, Serialize};

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
    /// States left out because a model gives nothing finite there.
    pub failed: usize,
}

impl ErrorDistribution {
    /// Of the absolute errors of the states that were compared, and the number of those that were not.
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
}
