//! Best affine fit of one function to another: a learned Lagrangian is determined only up to `a L + b`.

use serde::{Deserialize, Serialize};

/// `target = a source + b` by least squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AffineFit {
    /// Factor.
    pub a: f64,
    /// Summand.
    pub b: f64,
    /// Share of the variance of the target that is explained, `1 - residual / variance`; at most 1. `NaN` for a constant
    /// target that is not met exactly.
    pub r2: f64,
    /// Root mean square of `target - (a source + b)`, in the unit of the target.
    pub rms: f64,
    /// Pairs used.
    pub count: usize,
}

impl AffineFit {
    /// `a x + b`.
    pub fn apply(&self, x: f64) -> f64 {
        self.a * x + self.b
    }
}

/// Fits `target[k] = a source[k] + b` over the pairs in which both are finite; `None` if there are fewer than two.
///
/// A constant source is fitted by `a = 0` and the mean of the target. Sums are taken about the means, so that a large
/// common offset costs no digits. The remaining freedom of a Lagrangian, a total derivative `dF(q)/dt`, is odd in the
/// velocity for the usual systems: compare on grids at rest or over coordinates to be free of it.
pub fn affine_fit(source: &[f64], target: &[f64]) -> Option<AffineFit> {
    fit(source, target, true)
}

/// As [`affine_fit`] with `b = 0`: `det M` of a learned Lagrangian is known up to a factor alone. `r2` is then the share
/// of the mean square of the target.
pub fn factor_fit(source: &[f64], target: &[f64]) -> Option<AffineFit> {
    fit(source, target, false)
}

fn fit(source: &[f64], target: &[f64], summand: bool) -> Option<AffineFit> {
    let pairs = || source.iter().zip(target).map(|(&x, &y)| (x, y)).filter(|(x, y)| x.is_finite() && y.is_finite());
    let count = pairs().count();
    if count < 2 {
        return None;
    }
    let per = 1.0 / count as f64;
    let means = pairs().fold((0.0, 0.0), |(a, b), (x, y)| (a + x * per, b + y * per));
    let (mean_x, mean_y) = if summand { means } else { (0.0, 0.0) };
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs() {
        let (x, y) = (x - mean_x, y - mean_y);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let a = if xx > 0.0 { xy / xx } else { 0.0 };
    let b = mean_y - a * mean_x;
    let residual: f64 = pairs().map(|(x, y)| ((y - mean_y) - a * (x - mean_x)).powi(2)).sum();
    let r2 = if yy > 0.0 {
        1.0 - residual / yy
    } else if residual == 0.0 {
        1.0
    } else {
        f64::NAN
    };
    Some(AffineFit { a, b, r2, rms: (residual * per).sqrt(), count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_a_and_b() {
        let source: Vec<f64> = (0..100).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let mut target: Vec<f64> = source.iter().map(|x| -2.5 * x + 1e3).collect();
        let fit = affine_fit(&source, &target).unwrap();
        assert!((fit.a + 2.5).abs() < 1e-12 && (fit.b - 1e3).abs() < 1e-12);
        assert!((fit.r2 - 1.0).abs() < 1e-14 && fit.rms < 1e-12 && fit.count == 100);
        assert!((fit.apply(2.0) - 995.0).abs() < 1e-11);

        target[3] = f64::NAN;
        target[7] = f64::INFINITY;
        let fit = affine_fit(&source, &target).unwrap();
        assert!((fit.a + 2.5).abs() < 1e-12 && fit.count == 98);
    }

    #[test]
    fn poor_and_degenerate_fits_say_so() {
        let fit = affine_fit(&[1.0, -1.0, 1.0, -1.0], &[1.0, 1.0, -1.0, -1.0]).unwrap();
        assert_eq!((fit.a, fit.b, fit.r2, fit.rms), (0.0, 0.0, 0.0, 1.0));
        let fit = affine_fit(&[2.0, 2.0], &[1.0, 3.0]).unwrap();
        assert_eq!((fit.a, fit.b), (0.0, 2.0));
        assert_eq!(affine_fit(&[0.0, 1.0], &[5.0, 5.0]).unwrap().r2, 1.0);
        assert!(affine_fit(&[1.0], &[1.0]).is_none());
    }

    #[test]
    fn a_factor_alone_has_no_summand() {
        // A constant target says nothing of a slope, but a factor it has.
        let fit = factor_fit(&[2.0, 2.0, 4.0], &[-1.0, -1.0, -2.0]).unwrap();
        assert_eq!((fit.a, fit.b, fit.r2, fit.rms), (-0.5, 0.0, 1.0, 0.0));
        let fit = factor_fit(&[1.0, 3.0], &[2.0, 2.0]).unwrap();
        assert!((fit.a - 0.8).abs() < 1e-15 && fit.b == 0.0 && (fit.r2 - 0.8).abs() < 1e-14);
    }
}
