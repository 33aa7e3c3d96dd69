//! Chooses the length of the window: long windows reduce noise, short ones reduce bias.

use super::thresholds::{
    BIAS_SIGNIFICANCE, HOPELESS_SQUARED_ERROR, KEPT_SQUARED_ERROR, LEAST_COVERED, LONGEST_WINDOW, RISEN_SQUARED_ERROR,
};
use crate::recording::RecordedTrajectory;
use crate::recording::smooth::signal::Signal;
use serde::Serialize;

/// The significant part of an estimated squared bias; 0 if it is consistent with noise. `square` is the mean of the squared change minus
/// its noise variance, over `independent` samples.
fn significant(square: f64, variance: f64, independent: f64) -> f64 {
    (square - BIAS_SIGNIFICANCE * variance * (2.0 / independent.max(1.0)).sqrt()).max(0.0)
}

/// Errors of one coordinate's derivatives, on average over the recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quality {
    /// Length of the window in samples, odd.
    pub window: usize,
    /// Standard errors of position, velocity and acceleration due to noise.
    pub error: [f64; 3],
    /// Their root mean square bias, from motion that the polynomial cannot follow. It is estimated with two more degrees, which also miss
    /// part of short bursts and make it too small there, for a chaotic double pendulum by a third.
    pub bias: [f64; 3],
    /// Root mean square velocity, corrected for its error.
    pub velocity: f64,
    /// Root mean square velocity about its mean: for a drift with oscillations, the velocity of the oscillations.
    pub velocity_deviation: f64,
    /// Root mean square acceleration, corrected for its error.
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

/// Lower bound of the squared bias of longer windows: the largest significant one of a shorter window.
///
/// The bias of a window is estimated by the change that two more degrees make. Over several periods of the motion polynomials of either
/// degree miss everything, and their change says nothing; but a window misses no less than a shorter one within it. Until then bias grows
/// from window to window. An apparent bias that decreases together with the error, before the error has clearly risen, was correlated
/// noise, such as an encoder's marks.
#[derive(Clone, Copy, Debug)]
pub struct BiasBound {
    square: f64,
    least: f64,
    risen: bool,
}

impl Default for BiasBound {
    fn default() -> Self {
        Self { square: 0.0, least: f64::INFINITY, risen: false }
    }
}

impl BiasBound {
    /// Squared bias of the next longer window. `error` contains its variance and the squared bias that the change indicates; see
    /// [`significant`].
    pub fn bias(&mut self, error: [f64; 2], variance: f64, independent: f64) -> f64 {
        let [own, square] = error;
        self.risen |= own + square > RISEN_SQUARED_ERROR * self.least;
        if self.falls(own + square) {
            *self = Self { square: 0.0, least: own + square, risen: false };
        }
        self.raise(significant(square, variance, independent));
        square.max(self.square)
    }

    /// `true` if this squared error shows that the earlier bias was only noise.
    fn falls(&self, error: f64) -> bool {
        !self.risen && error <= self.least
    }

    /// Raises the lower bound of the squared bias for this window and all longer ones.
    fn raise(&mut self, square: f64) {
        self.square = self.square.max(square);
    }
}

/// Accelerations of one trajectory for one window.
#[derive(Clone, Debug, Default)]
struct Accelerations {
    /// Samples, ascending, and the accelerations there.
    values: Vec<(usize, f64)>,
    /// Mean variance due to noise.
    variance: f64,
    /// Number of independent errors.
    independent: f64,
}

impl Accelerations {
    /// Significant additional squared bias of a longer window compared with this one: the mean square of their difference at the same
    /// samples. Its variance is the difference of the two, because the longer window has the least variance of all that its samples allow
    /// (Hausman, Econometrica 46 (1978) 1251). Over several periods of the motion, where changes of degree say nothing, the difference is
    /// the whole bias (a comparison like that of Lepski, Theory of Probability and its Applications 35 (1991) 454).
    fn missed_by(&self, longer: &Self) -> f64 {
        let same = longer.values.iter().filter_map(|(at, a)| {
            let k = self.values.binary_search_by_key(at, |(at, _)| *at).ok()?;
            Some((a - self.values[k].1).powi(2))
        });
        let (sum, count) = same.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
        if count == 0.0 {
            return 0.0;
        }
        let variance = (self.variance - longer.variance).max(0.0);
        significant(sum / count - variance, variance, self.independent * count / self.values.len() as f64)
    }
}

/// Errors of the accelerations of one trajectory, by window.
#[derive(Clone, Debug, Default)]
struct WindowErrors {
    /// Squared errors, bias and variance together, of the windows in order, up to the longest that fits the trajectory.
    squares: Vec<f64>,
    /// The significant squared bias of each window.
    significant: Vec<f64>,
    /// Index of the window with the smallest error, before the error clearly rises again.
    best: usize,
    /// The accelerations for that window.
    finest: Accelerations,
    past: bool,
    bound: BiasBound,
}

impl WindowErrors {
    /// Adds the accelerations by the next longer window, their squared bias estimated by the change of degree, and the variance of that change.
    fn push(&mut self, found: Accelerations, square: f64, change: f64) {
        let Accelerations { variance, independent, .. } = found;
        let additional = self.finest.missed_by(&found);
        if !self.bound.falls(variance + square) {
            self.bound.raise(additional);
        }
        self.squares.push(variance + self.bound.bias([variance, square], change, independent));
        self.significant.push(variance + self.bound.square);
        let (last, least) = (self.squares[self.squares.len() - 1], self.squares[self.best]);
        self.past |= last > HOPELESS_SQUARED_ERROR * least;
        if !self.past && last <= least {
            (self.best, self.finest) = (self.squares.len() - 1, found);
        }
    }

    /// Squared error of window number `k`; if that is too long for the trajectory, the error of the longest one.
    fn at(&self, k: usize) -> Option<f64> {
        self.squares.get(k).or(self.squares.last()).copied()
    }

    /// Index of the trajectory's own window, given the typical one.
    fn own(&self, usual: usize) -> usize {
        match (self.squares.get(self.best), self.significant.get(usual).or(self.significant.last())) {
            (Some(least), Some(kept)) if *kept > KEPT_SQUARED_ERROR * least => self.best,
            _ => usual,
        }
    }
}

/// Sums over the places of one trajectory.
#[derive(Clone, Debug, Default)]
struct Sums {
    values: Vec<(usize, f64)>,
    count: f64,
    variance: f64,
    square: f64,
    change_variance: f64,
}

/// Lengths of windows that are tried, in steps of about a tenth.
fn lengths(least: usize, longest: usize) -> impl Iterator<Item = usize> {
    let next = |window: usize| (window + 2).max((window + window / 10) | 1);
    let most = LONGEST_WINDOW.min(longest / 2).max(least);
    std::iter::successors(Some(least), move |window| Some(next(*window))).take_while(move |window| *window <= most)
}

impl Signal<'_> {
    /// Errors by windows, the same in all trajectories or one for each: variance from the noise; squared bias from the change with two more
    /// degrees, less its own variance. None if fewer than half the samples are on trajectories that are long enough.
    pub fn quality(&self, window: usize, own: &[usize]) -> Option<Quality> {
        let noise = self.sigma * self.sigma;
        let (mut variance, mut bias) = ([0.0; 3], [0.0; 3]);
        let (mut mean_v, mut square_v, mut square_a, mut count) = (0.0, 0.0, 0.0, 0.0);
        let length = |track: usize| own.get(track).copied().unwrap_or(window);
        let share = self.visit(length, |estimate, fit, _, _| {
            for k in 0..3 {
                variance[k] += noise * fit.variance[k];
                bias[k] += estimate.changes[k] * estimate.changes[k] - noise * fit.change_variance[k];
            }
            let [_, v, a] = estimate.values;
            (mean_v, square_v, square_a, count) = (mean_v + v, square_v + v * v, square_a + a * a, count + 1.0);
        });
        if share < LEAST_COVERED {
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
}

/// The search for the windows of one signal.
struct Search<'a> {
    signal: &'a Signal<'a>,
    /// Errors of the trajectories.
    tracks_errors: Vec<WindowErrors>,
    /// Index of the best typical window so far, and its mean.
    best: Option<(usize, f64)>,
    past: bool,
}

impl<'a> Search<'a> {
    fn new(signal: &'a Signal<'a>) -> Self {
        let tracks_errors = vec![WindowErrors::default(); signal.tracks.len()];
        Self { signal, tracks_errors, best: None, past: false }
    }

    /// Adds the errors of a window on the trajectories that are long enough, for signals with the same ratio of noises; `false` if these
    /// trajectories have fewer than half the samples.
    fn try_window(window: usize, alike: &mut [&mut Self]) -> bool {
        let Some(signal) = alike.first().map(|search| search.signal) else { return true };
        let mut sums: Vec<_> =
            alike.iter().map(|search| (search.signal, vec![Sums::default(); signal.tracks.len()])).collect();
        let share = signal.visit_places(
            |_| window,
            |fit, range, track, at| {
                for (signal, sums) in &mut sums {
                    let (noise, sums) = (signal.sigma * signal.sigma, &mut sums[track]);
                    let estimate = signal.estimate(fit, track, range.clone(), at);
                    // Windows that would extend beyond an end are replaced by the last one inside.
                    if sums.values.last().is_none_or(|(last, _)| *last != at) {
                        sums.values.push((at, estimate.values[2]));
                    }
                    sums.count += 1.0;
                    sums.variance += noise * fit.variance[2];
                    sums.square += estimate.changes[2] * estimate.changes[2];
                    sums.change_variance += noise * fit.change_variance[2];
                }
            },
        );
        if share < LEAST_COVERED {
            return false;
        }
        for (search, (signal, sums)) in alike.iter_mut().zip(sums) {
            let tracks = sums.into_iter().zip(&mut search.tracks_errors).zip(signal.tracks);
            for ((sums, errors), track) in tracks.filter(|((s, _), _)| s.count > 0.0) {
                let [variance, square, change] =
                    [sums.variance, sums.square, sums.change_variance].map(|x| x / sums.count);
                // Samples within half a window share their errors.
                let independent = sums.count.min(2.0 * track.len() as f64 / window as f64);
                errors.push(Accelerations { values: sums.values, variance, independent }, square - change, change);
            }
        }
        true
    }

    /// Mean over the samples of the logarithm of the squared error by window number `k`.
    fn mean(&self, k: usize) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (errors, track) in self.tracks_errors.iter().zip(self.signal.tracks) {
            if let Some(square) = errors.at(k) {
                (sum, count) = (sum + track.len() as f64 * square.ln(), count + track.len() as f64);
            }
        }
        sum / count
    }

    /// Compares window number `k`, the last one tried, with those before.
    fn compare(&mut self, k: usize) {
        let mean = self.mean(k);
        self.past |= self.best.is_some_and(|(_, least)| mean > least + HOPELESS_SQUARED_ERROR.ln());
        if !self.past && self.best.is_none_or(|(_, least)| mean < least) {
            self.best = Some((k, mean));
        }
    }

    /// `true` if no window beyond this number is useful.
    fn has_ended(&self, windows: usize) -> bool {
        self.past && self.tracks_errors.iter().all(|errors| errors.past || errors.squares.len() < windows)
    }
}

/// The typical window of every signal and the window of each of its trajectories. The signals have the same trajectories.
///
/// On a trajectory the best window is the one whose accelerations have the least squared bias and variance together (Fan and Gijbels, Local
/// Polynomial Modelling, 1996, section 4.2: residual squares by a pilot of higher degree). The typical window minimises the mean of the
/// logarithm of that error over the samples; with the error itself, a single fast trajectory would decide for all. Trajectories on which
/// the typical window is nearly as good as their best keep it. None if fewer than half the samples are on trajectories that are long
/// enough.
pub fn best(signals: &[Signal<'_>]) -> Option<Vec<(usize, Vec<usize>)>> {
    let Signal { tracks, degree, .. } = signals.first()?;
    let longest = tracks.iter().map(RecordedTrajectory::len).max().unwrap_or(0);
    let mut searches: Vec<Search<'_>> = signals.iter().map(Search::new).collect();
    let mut tried = Vec::new();
    for window in lengths((degree + 3) | 1, longest) {
        let mut open: Vec<&mut Search<'_>> =
            searches.iter_mut().filter(|search| !search.has_ended(tried.len())).collect();
        let mut alike = open.chunk_by_mut(|a, b| a.signal.ratio == b.signal.ratio);
        if !alike.all(|alike| Search::try_window(window, alike)) {
            break;
        }
        open.into_iter().for_each(|search| search.compare(tried.len()));
        tried.push(window);
    }
    let windows = |search: &Search<'_>| {
        let (usual, _) = search.best?;
        Some((tried[usual], search.tracks_errors.iter().map(|errors| tried[errors.own(usual)]).collect()))
    };
    searches.iter().map(windows).collect()
}
