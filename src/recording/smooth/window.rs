//! Length of the window: as long as noise demands, as short as the motion allows.

use crate::recording::RecordedTrajectory;
use crate::recording::smooth::local_fit::{Estimate, LocalFit};
use serde::Serialize;

/// Places at which windows are tried.
const CENTRES: usize = 2048;
/// Longest window that is tried, in samples.
const LONGEST: usize = 2001;

/// Errors of one coordinate's derivatives, on average over the recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quality {
    /// Length of the window in samples, odd.
    pub window: usize,
    /// Standard errors of position, velocity and acceleration: what noise does to them.
    pub error: [f64; 3],
    /// Their bias, root mean square: what the polynomial cannot follow. Estimated by two more degrees, which miss part of
    /// short bursts themselves: there it is too small, for a chaotic double pendulum by a third.
    pub bias: [f64; 3],
    /// Root mean square of velocity, error taken out.
    pub velocity: f64,
    /// The same about its mean: of a drift with oscillations the velocity of these.
    pub velocity_deviation: f64,
    /// Root mean square of acceleration, error taken out.
    pub acceleration: f64,
}

impl Quality {
    /// Root mean square error of position, velocity (1) or acceleration (2): noise and bias together.
    pub fn total(&self, derivative: usize) -> f64 {
        self.error[derivative].hypot(self.bias[derivative])
    }

    /// Error of the acceleration over its size; 0 if nothing accelerates.
    pub fn relative(&self) -> f64 {
        let total = self.total(2);
        if total == 0.0 { 0.0 } else { total / self.acceleration }
    }
}

/// One coordinate of the trajectories with its noise.
#[derive(Clone, Copy)]
pub struct Signal<'a> {
    /// The trajectories.
    pub tracks: &'a [RecordedTrajectory],
    /// `true` for each whose steps are equal.
    pub regular: &'a [bool],
    /// Number of coordinates.
    pub n: usize,
    /// Which one.
    pub i: usize,
    /// Noise of its positions.
    pub sigma: f64,
    /// Noise of positions over noise of velocities, in s, if velocities take part.
    pub ratio: Option<f64>,
    /// Degree of the polynomials.
    pub degree: usize,
}

impl Signal<'_> {
    /// Recomputes the rows for `window` samples of a track from `first` on, evaluated at sample `at`.
    pub fn fit(&self, fit: &mut LocalFit, track: &RecordedTrajectory, first: usize, window: usize, at: usize) {
        fit.compute(&track.times[first..first + window], track.times[at], self.degree, self.ratio);
    }

    /// Position, velocity and acceleration at sample `at` by the rows of the window from `first` on.
    pub fn estimate(
        &self,
        fit: &LocalFit,
        track: &RecordedTrajectory,
        first: usize,
        window: usize,
        at: usize,
    ) -> Estimate {
        let part = first * self.n..(first + window) * self.n;
        let ratio = self.ratio.unwrap_or(0.0);
        let v = if self.ratio.is_some() { &track.v[part.clone()] } else { &[] };
        let q = track.q[part].iter().skip(self.i).step_by(self.n).copied();
        fit.apply(track.q[at * self.n + self.i], q, v.iter().skip(self.i).step_by(self.n).map(|v| ratio * v))
    }

    /// Calls `visit` with the estimate of a window and its rows at places spread evenly over all trajectories; windows
    /// that would reach over an end are moved inwards. Gives the share of the places on trajectories long enough.
    pub fn visit(&self, window: usize, mut visit: impl FnMut(&Estimate, &LocalFit, &RecordedTrajectory, usize)) -> f64 {
        let total: usize = self.tracks.iter().map(RecordedTrajectory::len).sum();
        let centres = CENTRES.min(total);
        let (mut fit, mut fitted) = (LocalFit::default(), None);
        let (mut number, mut start, mut visited) = (0, 0, 0);
        for c in 0..centres {
            let place = (2 * c + 1) * total / (2 * centres);
            while place >= start + self.tracks[number].len() {
                start += self.tracks[number].len();
                number += 1;
            }
            let track = &self.tracks[number];
            if track.len() < window {
                continue;
            }
            let first = (place - start).saturating_sub(window / 2).min(track.len() - window);
            let at = first + window / 2;
            if !(self.regular[number] && fitted == Some(number)) {
                self.fit(&mut fit, track, first, window, at);
                fitted = Some(number);
            }
            visit(&self.estimate(&fit, track, first, window, at), &fit, track, at);
            visited += 1;
        }
        visited as f64 / centres.max(1) as f64
    }

    /// Errors by a window: variance from the noise; squared bias from the change by two more degrees, whose own
    /// variance is taken out. None if fewer than half the samples are on trajectories long enough.
    pub fn quality(&self, window: usize) -> Option<Quality> {
        let noise = self.sigma * self.sigma;
        let (mut variance, mut bias) = ([0.0; 3], [0.0; 3]);
        let (mut mean_v, mut square_v, mut square_a, mut count) = (0.0, 0.0, 0.0, 0.0);
        let share = self.visit(window, |estimate, fit, _, _| {
            for k in 0..3 {
                variance[k] += noise * fit.variance[k];
                bias[k] += estimate.changes[k] * estimate.changes[k] - noise * fit.change_variance[k];
            }
            let [_, v, a] = estimate.values;
            (mean_v, square_v, square_a, count) = (mean_v + v, square_v + v * v, square_a + a * a, count + 1.0);
        });
        if share < 0.5 {
            return None;
        }
        let root = |sum: f64| (sum / count).max(0.0).sqrt();
        Some(Quality {
            window,
            error: variance.map(root),
            bias: bias.map(root),
            velocity: root(square_v - variance[1]),
            velocity_deviation: root(square_v - mean_v * mean_v / count - variance[1]),
            acceleration: root(square_a - variance[2]),
        })
    }

    /// The window whose accelerations have the least squared bias and variance together (Fan and Gijbels, Local
    /// Polynomial Modelling, 1996, section 4.2: residual squares by a pilot of higher degree), lengths tried in steps
    /// of about a tenth.
    pub fn best(&self) -> Option<Quality> {
        let longest = self.tracks.iter().map(RecordedTrajectory::len).max().unwrap_or(0);
        let least = (self.degree + 3) | 1;
        let (mut window, mut best) = (least, None::<Quality>);
        while window <= LONGEST && (window <= longest / 2 || window == least) {
            let Some(quality) = self.quality(window) else { break };
            match best {
                // Past the first minimum: over several periods either degree misses everything, and their change says
                // nothing.
                Some(known) if quality.total(2) > 2.0 * known.total(2) => break,
                Some(known) if known.total(2) <= quality.total(2) => {}
                _ => best = Some(quality),
            }
            window = (window + 2).max((window + window / 10) | 1);
        }
        best
    }
}
