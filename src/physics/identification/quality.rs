//! Tests of the residuals: whether they are consistent with the noise, and which samples are outliers.

use super::driven::Segment;
use super::found::{Outlier, Residual};
use super::innovations::Disturbances;
use super::solve::{Problem, batches};
use super::thresholds::{
    COARSE_INTEGRATION, COARSE_OVER_NOISE, MOST_LISTED_OUTLIERS, MOST_NOISE_SHARE, MOST_OUTLIERS, MOST_OVER_NOISE,
    OUTLIER, SEGMENT_SIGNIFICANCE, SIGNIFICANCE, UNCORRELATED, WHITENESS_LAGS,
};
use super::verdict::Verdict;
use crate::recording::{Recording, robust_deviation};
use crate::scalar::Real;

/// Upper tail of the F distribution with the given degrees of freedom: Paulson's normal approximation of its cube root
/// (Annals of Mathematical Statistics 13 (1942) 233), which becomes Wilson and Hilferty's of chi squared for a large second number.
pub(super) fn tail(ratio: f64, first: f64, second: f64) -> f64 {
    let [a, b] = [first, second].map(|freedom| 2.0 / (9.0 * freedom));
    let root = ratio.max(0.0).cbrt();
    let z = ((1.0 - b) * root - (1.0 - a)) / (b * root * root + a).sqrt();
    Real::erfc(z / std::f64::consts::SQRT_2) / 2.0
}

/// Autocorrelation of the residuals of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correlation {
    /// Autocorrelation at lag 1.
    pub at_lag_one: f64,
    /// Probability that independent residuals are at least as correlated (Ljung and Box, Biometrika 65 (1978) 297).
    pub probability: f64,
    /// Number of lags over which residuals are significantly correlated.
    pub length: usize,
}

/// Autocorrelation of the numbers in several runs; missing numbers are `NaN`.
pub(super) fn correlation(runs: &[Vec<f64>]) -> Correlation {
    let (squares, count) = runs
        .iter()
        .flatten()
        .filter(|x| x.is_finite())
        .fold((0.0, 0.0), |(sum, count): (f64, f64), x| (sum + x * x, count + 1.0));
    let longest = runs.iter().map(Vec::len).max().unwrap_or(0);
    let square = squares / count.max(1.0);
    // The correlation at a lag in units of its standard deviation, and the number of pairs.
    let at = |lag: usize| {
        let pairs = runs.iter().flat_map(|run| run.iter().zip(run.iter().skip(lag)));
        let (sum, pairs) = pairs
            .map(|(a, b)| a * b)
            .filter(|x| x.is_finite())
            .fold((0.0, 0.0), |(sum, pairs): (f64, f64), x| (sum + x, pairs + 1.0));
        if square > 0.0 && pairs > 0.0 { (sum / square / f64::sqrt(pairs), pairs) } else { (0.0, 0.0) }
    };
    let (first, pairs) = at(1);
    let lags = WHITENESS_LAGS.min(longest / 4).max(1);
    let statistic: f64 = (1..=lags).map(|lag| at(lag).0.powi(2)).sum();
    let length = (1..longest / 2).find(|&lag| at(lag).0 < UNCORRELATED).unwrap_or(longest / 2);
    Correlation {
        at_lag_one: first / f64::sqrt(pairs.max(1.0)),
        probability: tail(statistic / lags as f64, lags as f64, 1e9),
        length,
    }
}

/// Innovations of every reading along segments with unknown initial states. For a right model they are independent, with variance 1.
pub(super) fn innovations(problem: &Problem<'_>, x: &[f64], segments: &[Segment]) -> Vec<Vec<Vec<f64>>> {
    let n = problem.sigma.len();
    let mut open = problem.clone();
    open.disturbances = Disturbances { unknown_start: Some(OUTLIER), ..problem.disturbances.clone() };
    let runs = || segments.iter().map(|segment| vec![f64::NAN; segment.samples]).collect::<Vec<_>>();
    let mut found: Vec<Vec<Vec<f64>>> = (0..n).map(|_| runs()).collect();
    for (batch, lanes) in batches(segments) {
        if problem.measured.is_some() {
            open.disturbances.start_variances = problem.start_variances(x, &lanes);
        }
        open.residuals(x, &lanes, true, |lane, sample, i, r, _| found[i][batch[lane]][sample] = r);
    }
    found
}

/// Standard deviation of the residuals of a coordinate, from the median of their sizes, which is robust against outliers.
pub(super) fn typical_size(residuals: &[Vec<f64>], n: usize, coordinate: usize) -> f64 {
    let own = residuals.iter().flat_map(|segment| segment.iter().skip(coordinate).step_by(n));
    let mut sizes: Vec<f64> = own.copied().filter(|r| r.is_finite()).collect();
    if sizes.is_empty() { 0.0 } else { robust_deviation(&mut sizes) }
}

/// Outliers, the largest first, and their number; `place` gives the trajectory and the sample.
pub(super) fn outliers(
    recording: &Recording,
    (segments, residuals): (&[Segment], &[Vec<f64>]),
    place: impl Fn(usize, usize) -> (usize, usize),
) -> (Vec<Outlier>, usize) {
    let (n, mut found) = (recording.n(), Vec::new());
    for i in 0..n {
        let of = |segment: &Vec<f64>| segment.iter().skip(i).step_by(n).copied().collect::<Vec<_>>();
        let typical = typical_size(residuals, n, i);
        for (segment, residuals) in segments.iter().zip(residuals) {
            for (sample, r) in of(residuals).into_iter().enumerate().filter(|(_, r)| r.abs() > OUTLIER * typical) {
                found.push((segment.track, segment.first + sample, i, r / typical.max(f64::MIN_POSITIVE)));
            }
        }
    }
    found.sort_by(|a, b| b.3.abs().total_cmp(&a.3.abs()));
    let count = found.len();
    let describe = |(track, sample, i, size): (usize, usize, usize, f64)| {
        let (track, sample) = place(track, sample);
        let (time, coordinate) = (recording.tracks[track].times[sample], recording.coordinates[i].clone());
        Outlier { track, sample, trajectory: String::new(), row: 0, time, coordinate, size }
    };
    (found.into_iter().take(MOST_LISTED_OUTLIERS).map(describe).collect(), count)
}

/// Root mean square of the residuals over the noise, all coordinates together.
pub(super) fn over_noise(residuals: &[Residual]) -> f64 {
    (residuals.iter().map(|r| (r.rms / r.noise).powi(2)).sum::<f64>() / residuals.len().max(1) as f64).sqrt()
}

/// Mean eigenvalue of a symmetric matrix `(n, n)`.
pub(super) fn mean_eigenvalue(matrix: &[f64], n: usize) -> f64 {
    (0..n).map(|k| matrix[k * n + k]).sum::<f64>() / n.max(1) as f64
}

/// Evidence for and against a model.
pub(super) struct Evidence<'a> {
    pub converged: bool,
    /// Residuals by coordinate; a spread of 0 means that there is no scale to compare with.
    pub residuals: &'a [Residual],
    /// Robust size of the residuals of every coordinate.
    pub sizes: Vec<f64>,
    /// The size that integration and rounding alone cause.
    pub exact: Vec<f64>,
    /// p-value of the test of independence for each coordinate, corrected for the number of coordinates.
    pub probabilities: Vec<f64>,
    /// Share of outliers.
    pub outliers: f64,
    /// p-value of the test that segments share their constants.
    pub agreement: f64,
    /// p-value of the test that segments continue each other, and their typical length in s.
    pub continuation: (f64, f64),
}

impl Evidence<'_> {
    /// The verdict on the model: residuals as small as integration and rounding allow are accepted whatever their correlation.
    pub fn verdict(&self) -> Verdict {
        let all = |times: f64| self.sizes.iter().zip(&self.exact).all(|(size, exact)| *size <= times * exact);
        let small = |(size, residual): (&f64, &Residual)| *size <= COARSE_OVER_NOISE * residual.noise;
        let objection = self.objection();
        let exact = all(1.0)
            || objection.is_some() && all(COARSE_INTEGRATION) && self.sizes.iter().zip(self.residuals).all(small);
        match objection {
            Some(objection) if !self.converged => objection,
            _ if exact => Verdict::Exact,
            objection => objection.unwrap_or(Verdict::Explained),
        }
    }

    /// The first condition that the model violates.
    fn objection(&self) -> Option<Verdict> {
        let share = |i: usize| {
            let spread = self.residuals[i].spread;
            if spread > 0.0 { self.sizes[i] / spread } else { 0.0 }
        };
        let name = |i: usize| self.residuals[i].coordinate.clone();
        let all = || 0..self.sizes.len();
        let over = |i: &usize| self.sizes[*i] / self.residuals[*i].noise;
        let worst = all().max_by(|a, b| over(a).total_cmp(&over(b))).unwrap_or(0);
        let least = all().min_by(|&a, &b| self.probabilities[a].total_cmp(&self.probabilities[b])).unwrap_or(0);
        if !self.converged {
            return Some(Verdict::NotConverged);
        }
        if let Some(i) = all().find(|&i| share(i) > MOST_NOISE_SHARE && over(&i) <= MOST_OVER_NOISE) {
            return Some(Verdict::Uninformative { coordinate: name(i), share: share(i) });
        }
        if over(&worst) > MOST_OVER_NOISE {
            return Some(Verdict::Large { coordinate: name(worst), over_noise: over(&worst), share: share(worst) });
        }
        if self.outliers > MOST_OUTLIERS {
            return Some(Verdict::Outliers { share: self.outliers });
        }
        if self.probabilities[least] < SIGNIFICANCE {
            let probability = self.probabilities[least];
            return Some(Verdict::Correlated { coordinate: name(least), probability, share: share(least) });
        }
        if self.agreement < SEGMENT_SIGNIFICANCE {
            return Some(Verdict::Disagreement { probability: self.agreement });
        }
        let (probability, seconds) = self.continuation;
        if probability < SEGMENT_SIGNIFICANCE {
            return Some(Verdict::Discontinuous { probability, seconds });
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RngStream;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn tails_are_those_of_tables() {
        // F(5, 10) exceeds 3.3258 in 5 of 100 cases, F(1, 30) exceeds 7.5625 in 1, and chi squared with 20 degrees of freedom exceeds 37.5662 in 1.
        for (ratio, first, second, exact) in
            [(3.3258, 5.0, 10.0, 0.05), (7.5625, 1.0, 30.0, 0.01), (37.5662 / 20.0, 20.0, 1e9, 0.01)]
        {
            let found = tail(ratio, first, second);
            assert!((found / exact - 1.0).abs() < 0.12, "{found} {exact}");
        }
        assert!(tail(1e3, 10.0, 1e3) < 1e-30 && tail(0.0, 3.0, 9.0) > 0.99);
    }

    #[test]
    fn independent_numbers_pass_and_correlated_ones_do_not() {
        let mut rng = RngStream::Region.generator(1);
        let mut series = |memory: f64| {
            let mut last = 0.0;
            let mut next = || {
                let draw: f64 = StandardNormal.sample(&mut rng);
                last = memory * last + draw;
                last
            };
            correlation(&[(0..600).map(|_| next()).collect::<Vec<f64>>(), (0..400).map(|_| next()).collect()])
        };
        let refused = (0..200).filter(|_| series(0.0).probability < SIGNIFICANCE).count();
        assert!(refused <= 8, "{refused}");
        let coloured = series(0.9);
        assert!(coloured.probability < 1e-30 && (coloured.at_lag_one - 0.9).abs() < 0.05, "{coloured:?}");
        assert!((10..80).contains(&coloured.length), "{coloured:?}");
        assert!(series(0.15).probability < SIGNIFICANCE);
    }
}
