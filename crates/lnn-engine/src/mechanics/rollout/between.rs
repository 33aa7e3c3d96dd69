//! Interpolation of forces between the samples at which they were recorded.

use super::thresholds::AT_SAMPLE;
use crate::scalar::{Real, Scalar};
use serde::{Deserialize, Serialize};

/// How to interpolate known forces between their samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Between {
    /// Each value is held until the next sample (zero-order hold), as a converter or a controller does.
    Held,
    /// Linear interpolation.
    #[default]
    Linear,
    /// Cubic interpolation through the four nearest samples, for smooth forces.
    Cubic,
    /// Band-limited interpolation, without frequencies above half the sampling rate: a windowed sum of `sin(x)/x`.
    BandLimited,
}

/// Number of samples on either side that a band-limited interpolation uses.
const REACH: isize = 8;

impl Between {
    /// All kinds of interpolation.
    pub const ALL: [Self; 4] = [Self::Held, Self::Linear, Self::Cubic, Self::BandLimited];

    /// Returns its name in options, results and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Linear => "linear",
            Self::Cubic => "cubic",
            Self::BandLimited => "band-limited",
        }
    }

    /// Describes it in a few words.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Held => "As they were at the sample before",
            Self::Linear => "On straight lines",
            Self::Cubic => "On curves of the third degree through the four nearest samples",
            Self::BandLimited => "Without frequencies above half the rate of the samples",
        }
    }

    /// Calls the function with each sample that contributes to the value at the fraction `x` of the interval that ends at `sample`, and
    /// with its weight; `times` are ascending. The first and the last sample are held beyond the ends.
    pub fn weigh<S: Scalar>(self, times: &[S], (sample, x): (usize, S), mut take: impl FnMut(usize, S)) {
        let (before, one) = (sample.saturating_sub(1), <S as Real>::one());
        let last = times.len() as isize - 1;
        match self {
            Self::Held => take(before, one),
            Self::Linear => {
                take(before, one - x);
                take(sample, x);
            }
            Self::Cubic => {
                let first = (before as isize - 1).clamp(0, (last - 3).max(0));
                // Samples with the same time count as one node.
                let is_new = |k: &isize| *k == first || times[*k as usize] > times[*k as usize - 1];
                let nodes = (first..=(first + 3).min(last)).filter(is_new);
                let now = times[before] + x * (times[sample] - times[before]);
                for k in nodes.clone() {
                    let own = times[k as usize];
                    let others = nodes.clone().filter(|&j| j != k).map(|j| times[j as usize]);
                    take(k as usize, others.fold(one, |weight, t| weight * (now - t) / (own - t)));
                }
            }
            Self::BandLimited => {
                let (pi, width) = (S::pi(), S::of_f64(REACH as f64));
                let weight = |k: isize| {
                    let t = x - S::of_f64(k as f64);
                    if t.abs() < S::of_f64(AT_SAMPLE) {
                        one
                    } else if t.abs() >= width {
                        <S as Real>::zero()
                    } else {
                        width * Real::sin(pi * t) * Real::sin(pi * t / width) / Real::sqr(pi * t)
                    }
                };
                let weights = || (1 - REACH..=REACH).map(|k| (k, weight(k)));
                let whole = weights().fold(<S as Real>::zero(), |sum, (_, w)| sum + w);
                weights().for_each(|(k, w)| take((before as isize + k).clamp(0, last) as usize, w / whole));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Interpolates samples of a function, half a second apart.
    fn value(between: Between, f: impl Fn(f64) -> f64, t: f64) -> f64 {
        let times: Vec<f64> = (0..40).map(|k| 0.5 * f64::from(k)).collect();
        let sample = times.partition_point(|known| *known <= t).clamp(1, 39);
        let mut sum = 0.0;
        between.weigh(&times, (sample, (t - times[sample - 1]) / 0.5), |k, weight| sum += weight * f(times[k]));
        sum
    }

    #[test]
    fn each_way_is_exact_for_what_it_says() {
        for t in [3.1, 7.4, 9.0, 0.2, 19.3] {
            let held = value(Between::Held, |t| t, t);
            assert_eq!(held, (t / 0.5).floor() * 0.5);
            assert!((value(Between::Linear, |t| 2.0 * t - 1.0, t) - 2.0 * t + 1.0).abs() < 1e-12);
            let cubic = |t: f64| 0.1 * t.powi(3) - t * t + 2.0;
            assert!((value(Between::Cubic, cubic, t) - cubic(t)).abs() < 1e-10 * cubic(t).abs().max(1.0));
        }
        // With five samples per period, linear interpolation is wrong by a quarter, and the band-limited curve is accurate.
        let wave = |t: f64| (std::f64::consts::TAU * t / 2.5).sin();
        let worst = |between| {
            (160..240)
                .map(|k| 0.05 * f64::from(k))
                .fold(0.0, |worst: f64, t| worst.max((value(between, wave, t) - wave(t)).abs()))
        };
        assert!(worst(Between::Linear) > 0.15 && worst(Between::BandLimited) < 0.01, "{}", worst(Between::BandLimited));
    }
}
