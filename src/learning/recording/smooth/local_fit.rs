//! Local polynomial regression: the polynomial of least squares through the samples around one time.
//!
//! Savitzky and Golay, Anal. Chem. 36 (1964) 1627, for any times: position, velocity and acceleration at the centre are
//! linear in the measurements, so a fit is three rows of weights. Measured velocities join as further equations (the
//! derivative of the same polynomial), weighted by the ratio of the noises. The least-squares problem is solved by
//! orthogonalisation (Gram-Schmidt, twice), with times scaled to `[-1, 1]`.

use super::thresholds::LARGEST_DEGREE;
use crate::linalg::dot;

/// Weights of one window for one degree `d`, and their change with two more degrees.
#[derive(Clone, Debug, Default)]
pub struct LocalFit {
    /// Rows of position, velocity and acceleration, `(3, measurements)`: positions of the window, then, if they were
    /// measured, its velocities times `ratio`.
    weights: [Vec<f64>; 3],
    /// The row of degree `d + 2` minus the row of degree `d`: applied to data, an estimate of minus the bias.
    change: [Vec<f64>; 3],
    /// Variance of position, velocity and acceleration for noise of variance 1.
    pub variance: [f64; 3],
    /// Variance of the change for noise of variance 1.
    pub change_variance: [f64; 3],
    columns: Vec<f64>,
    triangle: Vec<f64>,
}

/// Position, velocity and acceleration at the centre, and by how much two more degrees change them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// `q`, `dq/dt`, `d2q/dt2`.
    pub values: [f64; 3],
    /// Changes of the three.
    pub changes: [f64; 3],
}

impl LocalFit {
    /// Computes the rows for samples at `times` (at least `degree + 3`, distinct), evaluated at time `centre`.
    ///
    /// `ratio` is the noise of positions over the noise of velocities, in s, if velocities are measured.
    pub fn compute(&mut self, times: &[f64], centre: f64, degree: usize, ratio: Option<f64>) {
        let (w, p) = (times.len(), degree + 3);
        let m = if ratio.is_some() { 2 * w } else { w };
        let scale = times.iter().fold(0.0, |s: f64, t| s.max((t - centre).abs()));
        self.columns.clear();
        self.columns.resize(p * m, 0.0);
        self.triangle.clear();
        self.triangle.resize(p * p, 0.0);
        for (j, t) in times.iter().enumerate() {
            let u = (t - centre) / scale;
            let mut power = 1.0;
            for k in 0..p {
                self.columns[k * m + j] = power;
                if let Some(ratio) = ratio
                    && k + 1 < p
                {
                    self.columns[(k + 1) * m + w + j] = ratio * (k + 1) as f64 * power / scale;
                }
                power *= u;
            }
        }
        self.orthogonalise(p, m);
        let mut factor = 1.0;
        for k in 0..3 {
            if k > 0 {
                factor *= k as f64 / scale;
            }
            self.row(k, factor, degree + 1, p, m);
        }
    }

    /// Columns become orthonormal; `triangle` holds the upper triangle `R`, row-major.
    fn orthogonalise(&mut self, p: usize, m: usize) {
        for j in 0..p {
            let (before, rest) = self.columns.split_at_mut(j * m);
            let column = &mut rest[..m];
            for _ in 0..2 {
                for (i, basis) in before.chunks_exact(m).enumerate() {
                    let r = dot(basis, column);
                    self.triangle[i * p + j] += r;
                    for (x, b) in column.iter_mut().zip(basis) {
                        *x -= r * b;
                    }
                }
            }
            let norm = dot(column, column).sqrt();
            self.triangle[j * p + j] = norm;
            for x in column.iter_mut() {
                *x /= norm;
            }
        }
    }

    /// The row of coefficient `k` times `factor`: `Q y` with `R^T y = factor e_k`, cut after `kept` columns and beyond.
    fn row(&mut self, k: usize, factor: f64, kept: usize, p: usize, m: usize) {
        let (weights, change) = (&mut self.weights[k], &mut self.change[k]);
        for row in [&mut *weights, &mut *change] {
            row.clear();
            row.resize(m, 0.0);
        }
        (self.variance[k], self.change_variance[k]) = (0.0, 0.0);
        // Solved downwards; entries before `k` are 0. `y` replaces the last used triangle column by column.
        let mut y = [0.0; LARGEST_DEGREE + 3];
        for i in k..p {
            let right = if i == k { factor } else { 0.0 };
            let known: f64 = (k..i).map(|j| self.triangle[j * p + i] * y[j]).sum();
            y[i] = (right - known) / self.triangle[i * p + i];
            let (row, variance) = if i < kept {
                (&mut *weights, &mut self.variance[k])
            } else {
                (&mut *change, &mut self.change_variance[k])
            };
            *variance += y[i] * y[i];
            for (x, q) in row.iter_mut().zip(&self.columns[i * m..(i + 1) * m]) {
                *x += y[i] * q;
            }
        }
    }

    /// Applies the rows to measured positions of the window, taken relative to `origin` against rounding, and to its
    /// velocities times the ratio.
    pub fn apply(&self, origin: f64, q: impl Iterator<Item = f64>, scaled_v: impl Iterator<Item = f64>) -> Estimate {
        let mut estimate = Estimate::default();
        for (j, x) in q.map(|q| q - origin).chain(scaled_v).enumerate() {
            for k in 0..3 {
                estimate.values[k] += self.weights[k][j] * x;
                estimate.changes[k] += self.change[k][j] * x;
            }
        }
        estimate.values[0] += origin;
        estimate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `1 + 2t - 3t^2 + t^3/2 + 0.7t^4` and its first two derivatives.
    fn quartic(t: f64) -> [f64; 3] {
        [
            1.0 + t * (2.0 + t * (-3.0 + t * (0.5 + t * 0.7))),
            2.0 + t * (-6.0 + t * (1.5 + t * 2.8)),
            -6.0 + t * (3.0 + t * 8.4),
        ]
    }

    #[test]
    fn polynomials_are_exact_at_any_times() {
        let mut fit = LocalFit::default();
        // Uneven steps, off-centre evaluation, with and without velocities.
        for (count, ratio) in [(7, None), (21, None), (7, Some(0.3)), (15, Some(1e-3))] {
            let times: Vec<f64> = (0..count).map(|k| 0.1 * k as f64 + 0.04 * (1.7 * k as f64).sin()).collect();
            for centre in [times[0], times[count / 2], times[count - 1]] {
                fit.compute(&times, centre, 4, ratio);
                let scaled = times.iter().filter_map(|t| ratio.map(|r| r * quartic(*t)[1]));
                let estimate = fit.apply(quartic(centre)[0], times.iter().map(|t| quartic(*t)[0]), scaled);
                let size = times.iter().flat_map(|t| quartic(*t)).fold(0.0, |s: f64, x| s.max(x.abs()));
                for k in 0..3 {
                    // Rounding of each measurement, carried by the row: sum |w| <= sqrt(count) |w|.
                    let tolerance = 64.0 * f64::EPSILON * size * ((2 * count) as f64 * fit.variance[k]).sqrt().max(1.0);
                    let error = (estimate.values[k] - quartic(centre)[k]).abs();
                    assert!(error <= tolerance, "{count} {ratio:?} {k}: {error:e} > {tolerance:e}");
                    let limit = tolerance * (1.0 + fit.change_variance[k] / fit.variance[k].max(1.0)).sqrt();
                    assert!(estimate.changes[k].abs() <= limit, "{count} {k}: {:e} > {limit:e}", estimate.changes[k]);
                }
            }
        }
    }

    #[test]
    fn rows_are_those_of_savitzky_and_golay() {
        // Their table for the quadratic on five points: smoothing (-3, 12, 17, 12, -3)/35, second derivative over 7.
        let mut fit = LocalFit::default();
        fit.compute(&[-2.0, -1.0, 0.0, 1.0, 2.0], 0.0, 2, None);
        for (weights, known) in [
            (&fit.weights[0], [-3.0, 12.0, 17.0, 12.0, -3.0].map(|x| x / 35.0)),
            (&fit.weights[1], [-0.2, -0.1, 0.0, 0.1, 0.2]),
            (&fit.weights[2], [2.0, -1.0, -2.0, -1.0, 2.0].map(|x| x / 7.0)),
        ] {
            assert!(weights.iter().zip(known).all(|(x, y)| (x - y).abs() < 8.0 * f64::EPSILON), "{weights:?}");
        }
        assert!((fit.variance[0] - 17.0 / 35.0).abs() < 8.0 * f64::EPSILON);
    }
}
