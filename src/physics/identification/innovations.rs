//! A Kalman filter along each segment, which whitens the residuals.
//!
//! An error of a known force changes all later motion, so that the residuals of positions are correlated along the whole segment. In terms of the
//! initial state of the segment the filter is simple: with `P = d(q, v)/d(start)` at a sample, an error `e` of the force over an interval `h` acts
//! like the change `P^-1 (0, M^-1 e h)` of the initial state. The deviation of the initial state is thus a random walk, which every position
//! measures through its row of `P`. The filter passes the residuals and all their derivatives through the same linear map, which whitens them, so
//! that least squares on its output are generalized least squares (Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, 1989,
//! sections 3.4 and 7.3).

use super::covariance::Root;
use super::driven::Segment;
use super::linear::{inverses, part};
use super::solve::{Linear, Problem};
use super::thresholds::{
    FORCE_NOISE_FACTORS, FORCE_NOISE_GAIN, LANES, MOST_FORCE_NOISE, MOST_INNOVATION_VARIANCE, UNKNOWN_START,
};
use crate::linalg::dot;
use crate::recording::smooth::noise;

/// Random disturbances of the motion that the equations do not contain.
#[derive(Clone, Debug, Default)]
pub(crate) struct Disturbances {
    /// Standard deviation of the noise of every known force; empty if the forces are exact.
    pub force: Vec<f64>,
    /// Set if the filter treats the initial states as unknown: innovations of a right model are then independent, and those that mainly depend on
    /// the initial state are `NaN`. The value is the number of standard deviations from which an innovation is an outlier, which is `NaN`, too, and
    /// does not update the filter.
    pub unknown_start: Option<f64>,
    /// Variances of unknown initial states by lane, `(2n, 2n)`; empty if positions were measured, which determine them.
    pub start_variances: Vec<Vec<f64>>,
}

/// The filter of one segment.
pub(super) struct Filter {
    unknown_start: Option<f64>,
    /// Covariance of the initial state, `(starts, starts)`.
    variance: Vec<f64>,
    /// Expected deviation of the initial state, from the residuals and from each of their derivatives: `(1 + width, starts)`.
    expected: Vec<Vec<f64>>,
    /// Sum of the logarithms of the variances of innovations over those of the noise.
    pub log_variance: f64,
}

impl Filter {
    /// Filters a residual and its derivatives, the first `starts` of them by the initial state; returns the innovation.
    pub fn pass(&mut self, residual: f64, row: &mut [f64]) -> f64 {
        let size = self.expected[0].len();
        let slopes = row[..size].to_vec();
        let gain: Vec<f64> = self.variance.chunks_exact(size).map(|line| dot(line, &slopes)).collect();
        let variance = 1.0 + dot(&gain, &slopes);
        let root = variance.sqrt();
        let innovation = (residual - dot(&slopes, &self.expected[0])) / root;
        if self.unknown_start.is_some_and(|limit| innovation.abs() > limit) && variance < MOST_INNOVATION_VARIANCE {
            return f64::NAN;
        }
        self.log_variance += variance.ln();
        for (value, expected) in row.iter_mut().zip(&mut self.expected[1..]) {
            let own = (*value - dot(&slopes, expected)) / root;
            expected.iter_mut().zip(&gain).for_each(|(e, g)| *e += g * own / root);
            *value = own;
        }
        self.expected[0].iter_mut().zip(&gain).for_each(|(e, g)| *e += g * innovation / root);
        for (line, g) in self.variance.chunks_exact_mut(size).zip(&gain) {
            line.iter_mut().zip(&gain).for_each(|(x, other)| *x -= g * other / variance);
        }
        if self.unknown_start.is_some() && variance > MOST_INNOVATION_VARIANCE { f64::NAN } else { innovation }
    }

    /// Adds the variance that force errors cause in the initial state, each by one row of `(n, starts)`.
    pub fn disturb(&mut self, impulses: &[f64]) {
        let size = self.expected[0].len();
        for impulse in impulses.chunks_exact(size) {
            for (line, a) in self.variance.chunks_exact_mut(size).zip(impulse) {
                line.iter_mut().zip(impulse).for_each(|(x, b)| *x += a * b);
            }
        }
    }
}

impl Problem<'_> {
    /// Estimates the noise of the known forces by maximum likelihood of the innovations, bounded by the noise that neighbouring samples show;
    /// `true` if the estimate changes.
    ///
    /// The noise of the positions is a nuisance parameter, profiled out of the likelihood: its variance is the mean square innovation. Initial
    /// states count as unknown, because fitted ones absorb much of the effect of the forces (Patterson and Thompson, Biometrika 58 (1971) 545).
    pub(super) fn estimate_force_noise(&mut self, x: &[f64], segments: &[Segment]) -> bool {
        let recording = self.driven.recording;
        let forced = recording.tracks.iter().filter(|track| !track.force.is_empty());
        let signals = forced.map(|track| (track.times.as_slice(), track.force.as_slice()));
        let shown: Vec<f64> =
            (0..self.driven.equations.n).map(|i| noise(signals.clone(), self.sigma.len(), i).sigma).collect();
        let stride = segments.len().div_ceil(LANES).max(1);
        let mut probes: Vec<&Segment> = segments.iter().step_by(stride).collect();
        probes.sort_by_key(|segment| std::cmp::Reverse(segment.samples));
        let mut tried = self.clone();
        tried.disturbances.unknown_start = Some(f64::INFINITY);
        let mut cost = |factor: f64| {
            tried.disturbances.force =
                if factor > 0.0 { shown.iter().map(|s| factor * s).collect() } else { Vec::new() };
            let (mut square, mut count) = (0.0, 0.0);
            let logarithms = tried.residuals(x, &probes, false, |_, _, _, r, _| {
                // Innovations that depend on the initial state are missing.
                if !r.is_nan() {
                    square += r * r;
                    count += 1.0;
                }
            });
            let mean = square / f64::max(count, 1.0);
            let cost = count * f64::ln(mean) + logarithms;
            (if cost.is_finite() { cost } else { f64::INFINITY }, mean.sqrt())
        };
        let exact = cost(0.0).0;
        let mut best = (exact, 0.0, 1.0);
        let mut attempt = |best: &mut (f64, f64, f64), factor: f64| {
            let (cost, size) = cost(factor);
            if cost < best.0 && factor * size <= MOST_FORCE_NOISE {
                *best = (cost, factor, size);
            }
        };
        (0..FORCE_NOISE_FACTORS).for_each(|k| attempt(&mut best, 0.25_f64.powi(k)));
        for step in [2.0, 2.0_f64.sqrt(), 2.0_f64.powf(0.25)] {
            let middle = best.1;
            [middle * step, middle / step]
                .into_iter()
                .filter(|factor| *factor > 0.0)
                .for_each(|factor| attempt(&mut best, factor));
        }
        let before = std::mem::take(&mut self.disturbances.force);
        if best.0 < exact - FORCE_NOISE_GAIN {
            self.disturbances.force = shown.iter().map(|s| best.1 * best.2 * s).collect();
        }
        tracing::debug!(force = ?self.disturbances.force, "noise of forces");
        before != self.disturbances.force
    }

    /// Filters for the segments of all lanes, with rows of `width` derivatives; none if residuals are independent.
    pub(super) fn filters(&self, lanes: usize, width: usize) -> Vec<Filter> {
        let n = self.driven.equations.n;
        let Disturbances { force, unknown_start, start_variances } = &self.disturbances;
        if force.is_empty() && unknown_start.is_none() {
            return Vec::new();
        }
        let (starts, closed) = (self.driven.starts(), self.driven.equations.rows.as_ref());
        // Changes of positions come first.
        let positions = closed.map_or(n, |rows| n - rows.holonomic());
        let most = self.sigma.iter().copied().fold(0.0, f64::max);
        let mut variance = vec![0.0; starts * starts];
        for k in (0..starts).filter(|_| unknown_start.is_some() && start_variances.is_empty()) {
            let time = if k < positions { 1.0 } else { self.driven.step };
            let sigma = if closed.is_some() { most } else { self.sigma[k % n] };
            variance[k * (starts + 1)] = (UNKNOWN_START * sigma / time).powi(2);
        }
        let expected = vec![vec![0.0; starts]; 1 + width];
        let filter = |lane: usize| Filter {
            unknown_start: *unknown_start,
            variance: start_variances.get(lane).unwrap_or(&variance).clone(),
            expected: expected.clone(),
            log_variance: 0.0,
        };
        (0..lanes).map(filter).collect()
    }

    /// Covariances of unknown initial states of segments whose readings are not positions: the covariance that the readings of the segment give,
    /// scaled up to that of a single reading and by [`UNKNOWN_START`].
    pub(super) fn start_variances(&self, x: &[f64], segments: &[&Segment]) -> Vec<Vec<f64>> {
        let (size, width) = (2 * self.n(), 2 * self.n() + self.unknowns());
        let of = |(linear, segment): (Option<Linear>, &&Segment)| {
            let mut variance = vec![0.0; size * size];
            let Some(linear) = linear else { return variance };
            let own: Vec<usize> = (0..size).collect();
            let factor = UNKNOWN_START * UNKNOWN_START * self.readings(std::slice::from_ref(*segment)) / size as f64;
            for row in Root::of(size, &part(width, &linear.matrix, &own)).back {
                for (line, a) in variance.chunks_exact_mut(size).zip(&row) {
                    line.iter_mut().zip(&row).for_each(|(sum, b)| *sum += factor * a * b);
                }
            }
            variance
        };
        self.batch(x, segments).into_iter().zip(segments).map(of).collect()
    }

    /// Changes of the initial states that force errors over one interval are equivalent to, `(lanes, n, starts)`. `slopes` are the derivatives of
    /// states by initial states, `(lanes, 2n, starts)`, `mobility` the accelerations by unit forces, `(lanes, n, n)`.
    pub(super) fn impulses(&self, slopes: &[f64], mobility: &[f64], step: f64) -> Vec<f64> {
        let (n, force, starts) = (self.driven.equations.n, &self.disturbances.force, self.driven.starts());
        // Lanes that fail are NaN, and their segments fail.
        let back = if starts == 2 * n { inverses(starts, slopes) } else { left_inverses(starts, slopes, 2 * n) };
        let mut impulses = vec![0.0; slopes.len() / 2];
        for ((into, back), mobility) in impulses
            .chunks_exact_mut(n * starts)
            .zip(back.chunks_exact(starts * 2 * n))
            .zip(mobility.chunks_exact(n * n))
        {
            for (j, into) in into.chunks_exact_mut(starts).enumerate() {
                let kick = &mobility[j * n..(j + 1) * n];
                into.iter_mut()
                    .zip(back.chunks_exact(2 * n))
                    .for_each(|(x, line)| *x = force[j] * step * dot(&line[n..], kick));
            }
        }
        impulses
    }
}

/// Left inverses `(S' S)^-1 S'` of matrices `S`, `(batch, rows, columns)`, which map changes of states within the constraints to changes of the
/// initial state.
fn left_inverses(columns: usize, matrices: &[f64], rows: usize) -> Vec<f64> {
    let size = rows * columns;
    let gram = |matrix: &[f64]| -> Vec<f64> {
        let column = |k: usize| matrix.iter().skip(k).step_by(columns).copied().collect::<Vec<f64>>();
        let all: Vec<Vec<f64>> = (0..columns).map(column).collect();
        all.iter().flat_map(|a| all.iter().map(|b| dot(a, b))).collect()
    };
    let grams: Vec<f64> = matrices.chunks_exact(size).flat_map(gram).collect();
    let inverses = inverses(columns, &grams);
    let lanes = matrices.chunks_exact(size).zip(inverses.chunks_exact(columns * columns));
    let of = |(matrix, inverse): (&[f64], &[f64])| -> Vec<f64> {
        inverse.chunks_exact(columns).flat_map(|line| matrix.chunks_exact(columns).map(|row| dot(line, row))).collect()
    };
    lanes.flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn innovations_of_disturbed_motion_are_independent() {
        const STEPS: usize = 6;
        let slopes = |t: usize| [1.0, 0.4 * t as f64];
        let impulse = |t: usize| [0.3 - 0.1 * t as f64, 0.5];
        // Variance of a measurement: noise, and the changes of the initial state up to the earlier of two samples.
        let of = |t: usize, s: usize| {
            let both = (0..t.min(s)).map(|k| dot(&slopes(t), &impulse(k)) * dot(&slopes(s), &impulse(k)));
            f64::from(u8::from(t == s)) + both.sum::<f64>()
        };
        let mut filter = Filter {
            unknown_start: None,
            variance: vec![0.0; 4],
            expected: vec![vec![0.0; 2]; 3 + STEPS],
            log_variance: 0.0,
        };
        // The filtered residual of each single sample, in columns after the slopes.
        let map: Vec<Vec<f64>> = (0..STEPS)
            .map(|t| {
                let mut row = slopes(t).to_vec();
                row.extend((0..STEPS).map(|k| f64::from(u8::from(k == t))));
                filter.pass(0.0, &mut row);
                filter.disturb(&impulse(t));
                row[2..].to_vec()
            })
            .collect();
        for (t, a) in map.iter().enumerate() {
            for (s, b) in map.iter().enumerate() {
                let pairs = (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j)));
                let variance: f64 = pairs.map(|(i, j)| a[i] * of(i, j) * b[j]).sum();
                assert!((variance - f64::from(u8::from(t == s))).abs() < 1e-12, "{t} {s} {variance}");
            }
        }
    }
}
