//! Times of a trajectory's samples: the typical step, gaps, windows around a sample.

use super::thresholds::{
    BRIDGED_STEPS, EVEN_ROUNDINGS, EXAMINED_STEPS, GAP_DEVIATIONS, GAP_QUANTILE, GAP_STEPS, TYPICAL_SPAN,
};
use crate::recording::statistics::{median, quantile, robust_deviation};
use std::ops::Range;

/// Steps of increasing times, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Typical step: the median if steps are equal; otherwise the mean of the steps that are not gaps.
    pub step: f64,
    /// Standard deviation of the steps that are not gaps; if steps are equal, a robust estimate, which measures rounding.
    pub spread: f64,
    /// Longest step that is not a gap.
    pub longest: f64,
    /// `true` if steps are equal to within the rounding of the times.
    pub even: bool,
}

impl Clock {
    /// Measures the steps of a trajectory.
    ///
    /// A gap is a step longer than one and a half typical ones. Where sampling is uneven, it is longer than the median plus six robust
    /// standard deviations, and than one and a half times the 90 % quantile.
    pub fn of(times: &[f64]) -> Self {
        let steps = || times.windows(2).map(|pair| pair[1] - pair[0]);
        let stride = (times.len() / EXAMINED_STEPS).max(1);
        let mut sampled: Vec<f64> = steps().step_by(stride).collect();
        let most = quantile(&mut sampled, GAP_QUANTILE);
        let middle = median(&mut sampled);
        for step in &mut sampled {
            *step -= middle;
        }
        let robust = robust_deviation(&mut sampled);
        let longest = (middle + ((GAP_STEPS - 1.0) * middle).max(GAP_DEVIATIONS * robust)).max(GAP_STEPS * most);
        if is_even(times) {
            return Self { step: middle, spread: robust, longest, even: true };
        }
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
        for step in steps().filter(|step| *step <= longest) {
            let off = step - middle;
            (sum, square, count) = (sum + off, square + off * off, count + 1.0);
        }
        let mean = sum / count;
        let spread = (square / count - mean * mean).max(0.0).sqrt();
        Self { step: middle + mean, spread, longest, even: false }
    }

    /// Standard deviation of the steps divided by the typical step; 0 if it is rounding.
    pub fn jitter(&self) -> f64 {
        if self.even { 0.0 } else { self.spread / self.step }
    }

    /// Number of rows missing within a step; 0 if it is not a gap.
    pub fn missing(&self, seconds: f64) -> usize {
        if seconds > self.longest { ((seconds / self.step).round() as usize).saturating_sub(1) } else { 0 }
    }

    /// `true` if a trajectory continues across a gap of this length.
    pub fn reaches_across(&self, seconds: f64) -> bool {
        seconds <= (BRIDGED_STEPS * self.step).max(self.longest)
    }

    /// `true` if all steps of these times equal the typical one.
    pub fn is_even_over(&self, times: &[f64]) -> bool {
        let seconds = times.len().saturating_sub(1) as f64 * self.step;
        let usual =
            || times.last().zip(times.first()).is_some_and(|(b, a)| (b - a - seconds).abs() < TYPICAL_SPAN * self.step);
        self.even || (usual() && is_even(times))
    }

    /// Sample nearest to `at` that has half a window, of `window` typical steps, on either side; `None` if the trajectory is too short.
    pub fn centre(&self, times: &[f64], at: usize, window: usize) -> Option<usize> {
        if self.even {
            let half = window / 2;
            return (times.len() >= window).then(|| at.saturating_sub(half).min(times.len() - window) + half);
        }
        let (&[first, ..], &[.., last]) = (times, times) else { return None };
        let half = (0.5 * window as f64 - 1.0) * self.step;
        let least = times.partition_point(|t| *t < first + half);
        let most = times.partition_point(|t| *t <= last - half).checked_sub(1)?;
        (least <= most).then(|| at.clamp(least, most))
    }

    /// Whether half a window lies before sample `at`, and whether after it.
    pub fn surrounds(&self, times: &[f64], at: usize, window: usize) -> [bool; 2] {
        if self.even {
            return [at >= window / 2, at + window / 2 < times.len()];
        }
        let half = (0.5 * window as f64 - 1.0) * self.step;
        [times[at] - times[0] >= half, times[times.len() - 1] - times[at] >= half]
    }

    /// Samples of a window of `window` typical steps around sample `at`, moved inwards at the ends; for uneven steps, those in the same
    /// number of seconds, and the `least` nearest where a gap leaves fewer.
    pub fn window(&self, times: &[f64], at: usize, window: usize, least: usize) -> Range<usize> {
        let length = times.len();
        if self.even {
            let first = at.saturating_sub(window / 2).min(length - window);
            return first..first + window;
        }
        let width = window as f64 * self.step;
        let (start, end) = (times[0] - 0.5 * self.step, times[length - 1] + 0.5 * self.step);
        let from = (times[at] - 0.5 * width).min(end - width).max(start);
        let mut first = times.partition_point(|t| *t < from).min(at);
        let mut end = times.partition_point(|t| *t <= from + width).max(at + 1);
        while end - first < least.min(length) {
            let nearer = || times[at] - times[first - 1] <= times[end] - times[at];
            if end == length || (first > 0 && nearer()) { first -= 1 } else { end += 1 }
        }
        first..end
    }
}

/// `true` if steps are equal to within the rounding of the times.
fn is_even(times: &[f64]) -> bool {
    let [first, .., last] = times else { return true };
    let step = (last - first) / (times.len() - 1) as f64;
    let tolerance = EVEN_ROUNDINGS * f64::EPSILON * first.abs().max(last.abs());
    times.iter().enumerate().all(|(k, t)| (t - (first + k as f64 * step)).abs() <= tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times `k / 100` of the frames that `kept` accepts.
    fn frames(count: usize, kept: impl Fn(usize) -> bool) -> Vec<f64> {
        (0..count).filter(|k| kept(*k)).map(|k| 0.01 * k as f64).collect()
    }

    #[test]
    fn gaps_are_told_from_uneven_steps() {
        let even = frames(300, |_| true);
        let dropped = frames(300, |k| k % 40 != 7 && !(100..104).contains(&k));
        let clock = Clock::of(&even);
        assert!(clock.even && (clock.step - 0.01).abs() < 1e-12 && clock.spread < 1e-12);
        let clock = Clock::of(&dropped);
        assert!(!clock.even && (clock.step - 0.01).abs() < 1e-12 && clock.spread < 1e-8, "{clock:?}");
        let missing: usize = dropped.windows(2).map(|pair| clock.missing(pair[1] - pair[0])).sum();
        assert_eq!(missing, 300 - dropped.len());
        assert!(clock.reaches_across(0.1) && !clock.reaches_across(0.11));
        // Steps of one, two and three frames in turn are not gaps.
        let uneven = frames(600, |k| [0, 1, 3].contains(&(k % 6)));
        let clock = Clock::of(&uneven);
        assert!((clock.step - 0.02).abs() < 1e-4 && (clock.spread / 0.00816 - 1.0).abs() < 0.02, "{clock:?}");
        assert!(uneven.windows(2).all(|pair| clock.missing(pair[1] - pair[0]) == 0));
    }

    #[test]
    fn windows_count_time() {
        let times = frames(100, |k| k != 50 && k != 52);
        let clock = Clock::of(&times);
        // Sample 49 lies at frame 49, sample 50 at 51, sample 51 at 53.
        assert_eq!(clock.window(&times, 30, 9, 7), 26..35);
        assert_eq!(clock.window(&times, 50, 9, 7), 47..54);
        assert_eq!(clock.window(&times, 50, 7, 7), 47..54);
        assert_eq!(clock.window(&times, 0, 9, 7), 0..9);
        assert_eq!(clock.window(&times, 97, 9, 7), 89..98);
        assert_eq!((clock.surrounds(&times, 4, 9), clock.surrounds(&times, 3, 9)), ([true; 2], [false, true]));
        assert_eq!((clock.centre(&times, 0, 9), clock.centre(&times, 97, 9)), (Some(4), Some(93)));
        assert_eq!((clock.centre(&times, 60, 9), clock.centre(&times, 60, 201)), (Some(60), None));
        // The same for equal steps, where windows are counted in samples.
        let times = frames(100, |_| true);
        let clock = Clock::of(&times);
        assert_eq!((clock.window(&times, 50, 9, 7), clock.window(&times, 1, 9, 7)), (46..55, 0..9));
        assert_eq!((clock.centre(&times, 98, 9), clock.centre(&times, 98, 101)), (Some(95), None));
    }
}
