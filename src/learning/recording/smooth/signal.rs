//! One coordinate of recorded trajectories, and its local polynomials.

use super::thresholds::TRIED_PLACES;
use crate::recording::RecordedTrajectory;
use crate::recording::clock::Clock;
use crate::recording::smooth::local_fit::{Estimate, LocalFit};
use std::collections::BTreeMap;
use std::ops::Range;

/// One coordinate of the trajectories with its noise.
#[derive(Clone, Copy)]
pub struct Signal<'a> {
    /// The trajectories.
    pub tracks: &'a [RecordedTrajectory],
    /// The clock of each.
    pub clocks: &'a [Clock],
    /// Number of coordinates.
    pub n: usize,
    /// Index of the coordinate.
    pub i: usize,
    /// Noise of its positions.
    pub sigma: f64,
    /// Noise of positions over noise of velocities, in s, if velocities are used.
    pub ratio: Option<f64>,
    /// Degree of the polynomials.
    pub degree: usize,
}

/// Fits of local polynomials on one trajectory. Full windows of equal steps have the same fit everywhere, which is computed once.
#[derive(Default)]
pub struct Fits {
    centred: BTreeMap<usize, LocalFit>,
    elsewhere: LocalFit,
}

impl Signal<'_> {
    /// Samples of a window of `window` typical steps around sample `at` of a trajectory, see [`Clock::window`].
    pub fn window(&self, track: usize, at: usize, window: usize) -> Range<usize> {
        // The window needs enough samples for two more degrees.
        self.clocks[track].window(&self.tracks[track].times, at, window, self.degree + 3)
    }

    /// The rows of the samples `range`, a window of `window` usual steps, evaluated at sample `at`.
    pub fn fit<'r>(
        &self,
        fits: &'r mut Fits,
        track: usize,
        range: Range<usize>,
        (at, window): (usize, usize),
    ) -> &'r LocalFit {
        let (times, clock) = (&self.tracks[track].times, &self.clocks[track]);
        let centred = range.len() == window && at == range.start + window / 2;
        let compute = |fit: &mut LocalFit, times: &[f64], at: f64| fit.compute(times, at, self.degree, self.ratio);
        if centred && clock.is_even_over(&times[range.clone()]) {
            return fits.centred.entry(window).or_insert_with(|| {
                let mut fit = LocalFit::default();
                compute(&mut fit, &times[range], times[at]);
                fit
            });
        }
        compute(&mut fits.elsewhere, &times[range], times[at]);
        &fits.elsewhere
    }

    /// Variance of the acceleration for noise of variance 1 in a full window of equal steps.
    pub fn even_variance(&self, fits: &mut Fits, track: usize, window: usize) -> f64 {
        let fit = fits.centred.entry(window).or_insert_with(|| {
            let times: Vec<f64> = (0..window).map(|k| k as f64 * self.clocks[track].step).collect();
            let mut fit = LocalFit::default();
            fit.compute(&times, times[window / 2], self.degree, self.ratio);
            fit
        });
        fit.variance[2]
    }

    /// Position, velocity and acceleration at sample `at`, from the rows of the samples `range`.
    pub fn estimate(&self, fit: &LocalFit, track: usize, range: Range<usize>, at: usize) -> Estimate {
        let track = &self.tracks[track];
        let part = range.start * self.n..range.end * self.n;
        let ratio = self.ratio.unwrap_or(0.0);
        let v = if self.ratio.is_some() { &track.v[part.clone()] } else { &[] };
        let q = track.q[part].iter().skip(self.i).step_by(self.n).copied();
        fit.apply(track.q[at * self.n + self.i], q, v.iter().skip(self.i).step_by(self.n).map(|v| ratio * v))
    }

    /// Calls `visit` with the estimate of a window and its rows at evenly spaced samples of all trajectories, with the number of the
    /// trajectory and the sample; windows that would cross an end are moved inwards. `length` is the window of a trajectory. Returns the
    /// share of the samples on trajectories that are long enough.
    pub fn visit(
        &self,
        length: impl Fn(usize) -> usize,
        mut visit: impl FnMut(&Estimate, &LocalFit, usize, usize),
    ) -> f64 {
        self.visit_places(length, |fit, range, track, at| visit(&self.estimate(fit, track, range, at), fit, track, at))
    }

    /// Calls `visit` with the rows at the samples of [`visit`](Self::visit), the samples of their window, the trajectory and the sample:
    /// the rows are shared by all coordinates with the same ratio of noises.
    pub fn visit_places(
        &self,
        length: impl Fn(usize) -> usize,
        mut visit: impl FnMut(&LocalFit, Range<usize>, usize, usize),
    ) -> f64 {
        let total: usize = self.tracks.iter().map(RecordedTrajectory::len).sum();
        let centres = TRIED_PLACES.min(total);
        let mut fits = Fits::default();
        let (mut number, mut start, mut visited) = (0, 0, 0);
        for c in 0..centres {
            let place = (2 * c + 1) * total / (2 * centres);
            while place >= start + self.tracks[number].len() {
                start += self.tracks[number].len();
                number += 1;
                fits = Fits::default();
            }
            let (track, window) = (&self.tracks[number], length(number));
            if track.len() < self.degree + 3 {
                continue;
            }
            let Some(at) = self.clocks[number].centre(&track.times, place - start, window) else { continue };
            let range = self.window(number, at, window);
            let fit = self.fit(&mut fits, number, range.clone(), (at, window));
            visit(fit, range, number, at);
            visited += 1;
        }
        visited as f64 / centres.max(1) as f64
    }
}
