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
