//! Order statistics and robust scale.

/// Median magnitude of a standard normal variable, which converts a median magnitude to a standard deviation.
const NORMAL_MEDIAN: f64 = 0.674_489_750_196_081_7;

/// The quantile below which a fraction `f` of the values lies; `NaN` without values. Reorders the values.
pub fn quantile(values: &mut [f64], f: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let at = ((values.len() - 1) as f64 * f.clamp(0.0, 1.0)).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// Median; `NaN` without values. Reorders the values.
pub fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// Robust standard deviation of normal numbers with mean 0 and outliers: median magnitude divided by 0.6745. Reorders the values.
pub fn robust_deviation(values: &mut [f64]) -> f64 {
    for x in values.iter_mut() {
        *x = x.abs();
    }
    median(values) / NORMAL_MEDIAN
}

/// Root mean square; 0 without values.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0usize), |(sum, count), x| (sum + x * x, count + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}

/// Standard deviation about the mean; 0 without values.
pub fn deviation<'a>(values: impl Iterator<Item = &'a f64> + Clone) -> f64 {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    rms(values.map(|x| x - mean))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_quantiles_are_those_of_sorted_values() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(quantile(&mut [4.0, 3.0, 1.0, 2.0, 5.0], 1.0), 5.0);
        assert!(median(&mut []).is_nan());
        assert_eq!(rms([3.0, -4.0, 0.0, 0.0]), 2.5);
        assert_eq!((deviation([1.0, 3.0, 5.0, 7.0].iter()), deviation([].iter())), (5.0_f64.sqrt(), 0.0));
        // A quarter of outliers hardly changes the deviation: the median of |x| is among the others.
        assert!((robust_deviation(&mut [1.0, -1.0, 1.0, 1e9]) - 1.0 / NORMAL_MEDIAN).abs() < 1e-15);
    }
}
