//! Velocities and accelerations of recorded motion by local polynomial regression, with their errors.

mod local_fit;
mod noise;
mod pace;
mod signal;
mod thresholds;
mod window;

pub use noise::Noise;
pub(crate) use noise::{contrast_weights, noise};
use thresholds::{LARGEST_DEGREE, MOST_GAP_STRETCH, MOST_GAP_VARIANCE, NOISE_RATIOS};
pub use window::Quality;

use crate::names::pluralize;
use crate::recording::clock::Clock;
use crate::recording::statistics::median;
use crate::recording::{RecordedTrajectory, Recording};
use local_fit::Estimate;
use noise::along;
use pace::Typical;
use signal::{Fits, Signal};
use thiserror::Error;
use window::best;

/// Settings of smoothing; settings that are not given are chosen from the data.
#[derive(Clone, Debug, PartialEq)]
pub struct SmoothOptions {
    /// Degree of the polynomials, 2 to 8.
    pub degree: usize,
    /// Length of the windows in samples, odd and at least `degree + 3`, the same everywhere; if not given, a typical length is chosen per
    /// coordinate, and windows adapt to speed and noise along every trajectory.
    pub window: Option<usize>,
    /// Standard deviations of the positions' noise, one per coordinate; estimated if not given.
    pub noise: Option<Vec<f64>>,
    /// `true` to use measured velocities if there are any.
    pub velocities: bool,
}

impl Default for SmoothOptions {
    fn default() -> Self {
        Self { degree: 4, window: None, noise: None, velocities: true }
    }
}

/// Why derivatives cannot be estimated.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SmoothError {
    /// An option is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Option {
        /// Name of the option.
        what: &'static str,
        /// Its range.
        expected: String,
        /// Value that was given.
        found: String,
    },
    /// A trajectory is too short for the window.
    #[error("{track}: {} fewer than the {needed} that a fit of this degree needs", pluralize(*samples, "sample is", "samples are"))]
    Short {
        /// The trajectory; empty for all of them.
        track: String,
        /// Its samples.
        samples: usize,
        /// Smallest number of samples.
        needed: usize,
    },
    /// A trajectory has another number of coordinates, or lacks the velocities that the others have.
    #[error("{track}: expected positions and velocities of {n} coordinates")]
    Shape {
        /// The trajectory.
        track: String,
        /// Number of coordinates.
        n: usize,
    },
}

/// Noise, windows and quality of one coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Noise of its positions.
    pub noise: Noise,
    /// Noise of its velocities, if they are used.
    pub velocity_noise: Option<Noise>,
    /// The window and the quality of its derivatives.
    pub quality: Quality,
    /// Length of the window in s.
    pub seconds: f64,
}

/// Smoothing of a recording: a typical window per coordinate, the same in seconds for all trajectories.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothing {
    /// Degree of the polynomials.
    pub degree: usize,
    /// Every coordinate.
    #[doc(hidden)]
    pub coordinates: Vec<Chosen>,
    /// Windows in samples of every coordinate on every trajectory of the recording, `(coordinates)(trajectories)`: the typical one
    /// except where another is clearly better. Qualities are means over these.
    pub own: Vec<Vec<usize>>,
    /// Median step in s.
    pub step: f64,
    /// `true` if windows are shorter than usual where the motion is fast, and longer where it is slow; `false` if their length
    /// was given.
    pub varying: bool,
    /// Degrees added to `degree`, for which the windows were chosen.
    pub more: usize,
}

/// A trajectory with derivatives; all arrays are `(samples, n)`.
///
/// The errors are of two kinds: standard errors come from noise, biases from motion that the polynomial cannot follow. Their root sum of
/// squares is the expected error.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Smoothed {
    /// Times in s, `(samples)`.
    pub times: Vec<f64>,
    /// Positions.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// Accelerations.
    pub a: Vec<f64>,
    /// Standard errors of the positions.
    pub q_error: Vec<f64>,
    /// Standard errors of the velocities.
    pub v_error: Vec<f64>,
    /// Standard errors of the accelerations.
    pub a_error: Vec<f64>,
    /// Estimated bias of the positions, root mean square over the neighbourhood.
    pub q_bias: Vec<f64>,
    /// Estimated bias of the velocities.
    pub v_bias: Vec<f64>,
    /// Estimated bias of the accelerations.
    pub a_bias: Vec<f64>,
    /// Last sample that each state is estimated from, `(samples)`.
    pub reach: Vec<usize>,
    /// Numbers of samples at the left and right end without a full window: their errors are several times larger.
    pub margins: [usize; 2],
    /// Samples between the margins with too few others around them because of a gap, ascending.
    pub lacking: Vec<usize>,
}

impl Smoothed {
    /// The columns of some of `n` coordinates, in this order.
    #[cfg(feature = "training")]
    pub(crate) fn columns(&self, n: usize, columns: &[usize]) -> Self {
        let of = |values: &Vec<f64>| -> Vec<f64> {
            values.chunks_exact(n).flat_map(|row| columns.iter().map(|i| row[*i])).collect()
        };
        Self {
            q: of(&self.q),
            v: of(&self.v),
            a: of(&self.a),
            q_error: of(&self.q_error),
            v_error: of(&self.v_error),
            a_error: of(&self.a_error),
            q_bias: of(&self.q_bias),
            v_bias: of(&self.v_bias),
            a_bias: of(&self.a_bias),
            ..self.clone()
        }
    }

    /// Samples with full windows.
    pub fn interior(&self) -> std::ops::Range<usize> {
        let [before, after] = self.margins;
        let end = self.times.len().saturating_sub(after);
        before.min(end)..end
    }

    /// `true` if the window of the sample is complete and has no long gap.
    pub fn is_full(&self, sample: usize) -> bool {
        self.interior().contains(&sample) && self.lacking.binary_search(&sample).is_err()
    }
}

impl Smoothing {
    /// Estimates noise and chooses windows. Long recordings are sampled: the time taken does not grow with their length.
    ///
    /// # Errors
    /// [`SmoothError`] for an option out of range, a trajectory of another shape, or trajectories too short.
    pub fn choose(recording: &Recording, options: &SmoothOptions) -> Result<Self, SmoothError> {
        let (n, tracks) = (recording.n(), recording.tracks.as_slice());
        check(options, n)?;
        let velocities = options.velocities && tracks.iter().all(|t| !t.v.is_empty());
        for track in tracks {
            if track.q.len() != track.len() * n || (velocities && track.v.len() != track.q.len()) {
                return Err(SmoothError::Shape { track: track.name.clone(), n });
            }
        }
        let clocks: Vec<Clock> = tracks.iter().map(|track| Clock::of(&track.times)).collect();
        let mut usual: Vec<f64> = clocks.iter().zip(tracks).filter(|(_, t)| t.len() > 1).map(|(c, _)| c.step).collect();
        let step = median(&mut usual);
        let longest = tracks.iter().map(RecordedTrajectory::len).max().unwrap_or(0);
        let short = |needed| SmoothError::Short { track: "the longest trajectory".into(), samples: longest, needed };
        let noises = (0..n).map(|i| {
            let position = match &options.noise {
                Some(given) => Noise { sigma: given[i], order: 0, resolved: true },
                None => noise(tracks.iter().map(|t| (t.times.as_slice(), t.q.as_slice())), n, i),
            };
            let velocity = velocities.then(|| noise(tracks.iter().map(|t| (t.times.as_slice(), t.v.as_slice())), n, i));
            (position, velocity)
        });
        let noises: Vec<_> = noises.collect();
        let signals = noises.iter().enumerate().map(|(i, &(position, velocity))| {
            let ratio = velocity.and_then(|velocity| ratio(position, velocity, step));
            Signal { tracks, clocks: &clocks, n, i, sigma: position.sigma, ratio, degree: options.degree }
        });
        let signals: Vec<_> = signals.collect();
        let windows = match options.window {
            Some(window) => vec![(window, vec![window; tracks.len()]); n],
            None => best(&signals).ok_or_else(|| short(options.degree + 3))?,
        };
        let chosen =
            signals.iter().zip(noises).zip(&windows).map(|((signal, (noise, velocity_noise)), (window, own))| {
                let quality = signal.quality(*window, own).ok_or_else(|| short(*window))?;
                Ok(Chosen { noise, velocity_noise, quality, seconds: (window - 1) as f64 * step })
            });
        let coordinates = chosen.collect::<Result<_, _>>()?;
        let own = windows.into_iter().map(|(_, own)| own).collect();
        Ok(Self { degree: options.degree, coordinates, own, step, varying: options.window.is_none(), more: 0 })
    }

    /// Copies the smoothing with polynomials of two more degrees: more noise and hardly any bias, for results that are averaged later.
    pub(crate) fn sharper(&self) -> Self {
        Self { more: self.more + 2, ..self.clone() }
    }

    /// The signal of coordinate `i` on trajectories with their clocks.
    fn signal<'a>(&self, tracks: &'a [RecordedTrajectory], clocks: &'a [Clock], i: usize) -> Signal<'a> {
        let Chosen { noise, velocity_noise, .. } = self.coordinates[i];
        let ratio = velocity_noise.and_then(|velocity| ratio(noise, velocity, self.step));
        Signal { tracks, clocks, n: self.coordinates.len(), i, sigma: noise.sigma, ratio, degree: self.degree }
    }

    /// Calls `visit` with position, velocity and acceleration of coordinate `i` at places spread evenly over the
    /// trajectories of the recording that windows were chosen on, and where they are: trajectory and sample.
    pub(crate) fn visit(
        &self,
        recording: &Recording,
        i: usize,
        mut visit: impl FnMut([f64; 3], &RecordedTrajectory, usize),
    ) {
        let clocks: Vec<Clock> = recording.tracks.iter().map(|track| Clock::of(&track.times)).collect();
        let signal = self.signal(&recording.tracks, &clocks, i);
        let Self { coordinates, own, .. } = self;
        let window = |track: usize| own[i].get(track).copied().unwrap_or(coordinates[i].quality.window);
        signal.visit(window, |found, _, track, at| visit(found.values, &recording.tracks[track], at));
    }

    /// Ratio of the expected error of the accelerations to their size, for the worst coordinate.
    pub(crate) fn acceleration_error(&self) -> f64 {
        self.coordinates.iter().map(|chosen| chosen.quality.relative()).fold(0.0, f64::max)
    }

    /// Longest window in samples of a trajectory with typical steps.
    pub(crate) fn window(&self) -> usize {
        self.coordinates.iter().map(|chosen| chosen.quality.window).max().unwrap_or(0)
    }

    /// Gap in samples between two parts of a trajectory such that no window overlaps both, and the number of samples that each part needs:
    /// a full window and one more, or enough for a polynomial if nothing is differentiated.
    pub(crate) fn apart(&self, recording: &Recording) -> (usize, usize) {
        let window = self.window();
        let derived = !(recording.has_velocities() && recording.has_accelerations());
        (window, if derived { window + 1 } else { (self.degree + 3) | 1 })
    }

    /// Window of coordinate `i` in samples of a trajectory: the chosen number of seconds, at most the whole trajectory.
    fn samples(&self, i: usize, track: &RecordedTrajectory, clock: &Clock) -> usize {
        let least = (self.degree + self.more + 3) | 1;
        let samples = (self.coordinates[i].seconds / clock.step).round() as usize;
        let most = track.len() - (track.len() + 1) % 2;
        (samples | 1).clamp(least, most.max(least))
    }

    /// Estimates the derivatives of a trajectory. Near its ends windows are one-sided.
    ///
    /// # Errors
    /// [`SmoothError`] for a trajectory of fewer samples than coefficients, or of another shape than the recording's.
    pub fn apply(&self, track: &RecordedTrajectory) -> Result<Smoothed, SmoothError> {
        let (n, length) = (self.coordinates.len(), track.len());
        let needed = (self.degree + self.more + 3) | 1;
        if length < needed {
            return Err(SmoothError::Short { track: track.name.clone(), samples: length, needed });
        }
        let velocities = self.coordinates.iter().any(|chosen| chosen.velocity_noise.is_some());
        if track.q.len() != length * n || (velocities && track.v.len() != length * n) {
            return Err(SmoothError::Shape { track: track.name.clone(), n });
        }
        let mut smoothed = Smoothed { times: track.times.clone(), reach: vec![0; length], ..Smoothed::default() };
        for values in smoothed.arrays().into_iter().flatten() {
            values.resize(length * n, 0.0);
        }
        let clock = Clock::of(&track.times);
        let tracks = std::slice::from_ref(track);
        let usual: Vec<Typical<'_>> = (0..n)
            .map(|i| Typical {
                signal: self.signal(tracks, std::slice::from_ref(&clock), i),
                sigmas: along((&track.times, &track.q), clock.even, (n, i), self.coordinates[i].noise),
                window: self.samples(i, track, &clock),
                error: self.coordinates[i].quality.total(2),
            })
            .collect();
        let windows =
            if self.varying { pace::windows(&usual) } else { usual.iter().map(|u| vec![u.window; length]).collect() };
        for (mut usual, mut windows) in usual.into_iter().zip(windows) {
            usual.signal.degree += self.more;
            windows.iter_mut().for_each(|window| *window = (*window).max(needed));
            let surrounded = |at: usize| clock.surrounds(&track.times, at, windows[at]);
            let before = (0..length).find(|&at| surrounded(at)[0]).unwrap_or(length);
            let after = (0..length).find(|&left| surrounded(length - 1 - left)[1]).unwrap_or(length);
            smoothed.margins = [smoothed.margins[0].max(before), smoothed.margins[1].max(after)];
            smooth(&usual, &windows, &mut smoothed);
        }
        let inside = smoothed.interior();
        smoothed.lacking.sort_unstable();
        smoothed.lacking.dedup();
        smoothed.lacking.retain(|at| inside.contains(at));
        Ok(smoothed)
    }
}

/// Noise of positions over noise of velocities in s, within the range that the time step can resolve.
fn ratio(position: Noise, velocity: Noise, step: f64) -> Option<f64> {
    let [least, most] = NOISE_RATIOS.map(|steps| steps * step);
    let ratio = (position.sigma / velocity.sigma).clamp(least, most);
    ratio.is_finite().then_some(ratio)
}

/// Fills column `signal.i` of all arrays; every sample has its own window.
fn smooth(Typical { signal, sigmas, .. }: &Typical<'_>, windows: &[usize], smoothed: &mut Smoothed) {
    let (times, clock, n, i) = (&signal.tracks[0].times, &signal.clocks[0], signal.n, signal.i);
    let length = times.len();
    let mut fits = Fits::default();
    // Squared change by two more degrees, minus the variance of its noise, in units of the noise.
    let mut excess: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; length]);
    let full: Vec<bool> = (0..length).map(|at| clock.surrounds(times, at, windows[at]) == [true; 2]).collect();
    for (at, &window) in windows.iter().enumerate() {
        let range = signal.window(0, at, window);
        smoothed.reach[at] = smoothed.reach[at].max(range.end - 1);
        let usual = (full[at] && !clock.even).then(|| signal.even_variance(&mut fits, 0, window));
        let fit = signal.fit(&mut fits, 0, range.clone(), (at, window));
        if let Some(usual) = usual {
            let stretched =
                times[range.end - 1] - times[range.start] > MOST_GAP_STRETCH * (window - 1) as f64 * clock.step;
            if stretched || fit.variance[2] > MOST_GAP_VARIANCE * usual {
                smoothed.lacking.push(at);
            }
        }
        let Estimate { values, changes } = signal.estimate(fit, 0, range, at);
        for (k, [value, error, _]) in smoothed.arrays().into_iter().enumerate() {
            value[at * n + i] = values[k];
            error[at * n + i] = sigmas[at] * fit.variance[k].sqrt();
            excess[k][at] =
                (changes[k] / sigmas[at]).powi(2) / fit.variance[k] - fit.change_variance[k] / fit.variance[k];
        }
    }
    // A single change is a rough estimate of the bias, so its square is averaged over a window on either side. One-sided windows are
    // averaged separately from full ones.
    for (excess, [_, error, bias]) in excess.iter().zip(smoothed.arrays()) {
        let counted = |at: &usize| full[*at];
        for (at, window) in windows.iter().enumerate() {
            let near = at.saturating_sub(*window)..(at + window + 1).min(length);
            let (sum, count) = if full[at] {
                near.filter(counted).fold((0.0, 0), |(sum, count), k| (sum + excess[k], count + 1))
            } else {
                (excess[near.clone()].iter().sum(), near.len())
            };
            bias[at * n + i] = error[at * n + i] * (sum / count as f64).max(0.0).sqrt();
        }
    }
}

impl Smoothed {
    /// Value, standard error and bias of position, velocity and acceleration.
    fn arrays(&mut self) -> [[&mut Vec<f64>; 3]; 3] {
        [
            [&mut self.q, &mut self.q_error, &mut self.q_bias],
            [&mut self.v, &mut self.v_error, &mut self.v_bias],
            [&mut self.a, &mut self.a_error, &mut self.a_bias],
        ]
    }
}

/// Checks options for `n` coordinates.
fn check(options: &SmoothOptions, n: usize) -> Result<(), SmoothError> {
    let wrong = |what, expected: String, found: String| Err(SmoothError::Option { what, expected, found });
    let most = LARGEST_DEGREE - 2;
    if !(2..=most).contains(&options.degree) {
        return wrong("degree", format!("2 to {most}"), options.degree.to_string());
    }
    let least = (options.degree + 3) | 1;
    if let Some(window) = options.window
        && (window < least || window % 2 == 0)
    {
        return wrong("window", format!("an odd number of samples from {least} on"), window.to_string());
    }
    if let Some(noise) = &options.noise {
        if noise.len() != n {
            return wrong(
                "noise",
                format!("{}, one per coordinate", pluralize(n, "number", "numbers")),
                noise.len().to_string(),
            );
        }
        if let Some(sigma) = noise.iter().find(|sigma| !(sigma.is_finite() && **sigma > 0.0)) {
            return wrong("noise", "finite numbers above 0".to_string(), sigma.to_string());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
