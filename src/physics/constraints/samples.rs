//! States of recorded motion with their noise.

use super::colour::Colour;
use super::thresholds::{LEAST_MOTION_RATIO, MOST_SAMPLES};
use crate::cancellation::Cancellation;
use crate::names::number;
use crate::recording::Recording;
use crate::recording::smooth::{SmoothError, SmoothOptions, Smoothing};
use std::collections::BTreeMap;

/// Positions and velocities of trajectories, with standard deviations of their noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionSamples {
    names: Vec<String>,
    periodic: Vec<bool>,
    /// `(samples, 2 n)`.
    states: Vec<f64>,
    /// Noise of the positions, `(n)`, and of the velocities, `(samples, n)`.
    position_noise: Vec<f64>,
    velocity_noise: Vec<f64>,
    /// First sample of each trajectory.
    starts: Vec<usize>,
    /// Number of samples that share the errors of their velocities.
    shared: f64,
    /// Cancels a search that uses these samples.
    pub(super) cancellation: Cancellation,
    /// Number of samples that share the errors of their positions, and how much larger the variance of their noise may be.
    shared_positions: f64,
    slack: f64,
    /// Columns that do not move, with the reason.
    still: Vec<(usize, String)>,
    /// Samples of the recording per sample used.
    stride: usize,
    /// `true` if velocities were measured, with known noise.
    measured: bool,
}

impl MotionSamples {
    /// Takes measured positions from a recording, with measured or smoothed velocities.
    ///
    /// # Errors
    /// [`SmoothError`] for trajectories that are too short to estimate their noise.
    pub fn of(recording: &Recording, options: &SmoothOptions) -> Result<Self, SmoothError> {
        let n = recording.n();
        let smoothing = Smoothing::choose(recording, options)?;
        let measured = recording.tracks.iter().all(|track| !track.v.is_empty());
        let white = smoothing.coordinates.iter().map(|chosen| chosen.noise).enumerate();
        let colours: Vec<Colour> = white.map(|(i, noise)| Colour::of(&recording.tracks, n, i, noise)).collect();
        let position_noise: Vec<f64> = colours.iter().map(|colour| colour.sigma).collect();
        let largest = |of: &dyn Fn(&Colour) -> f64| colours.iter().map(of).fold(1.0, f64::max);
        let of_velocities: Vec<f64> =
            smoothing.coordinates.iter().map(|chosen| chosen.velocity_noise.map_or(0.0, |noise| noise.sigma)).collect();
        let mut samples = Self {
            names: recording.coordinates.clone(),
            periodic: recording.periodic.clone(),
            position_noise,
            shared: if measured { 1.0 } else { smoothing.window() as f64 },
            shared_positions: largest(&|colour| colour.shared()),
            slack: largest(&|colour| colour.slack),
            measured,
            ..Self::default()
        };
        let moves = |i: usize| stillness(recording, i, smoothing.coordinates[i].noise.resolved, colours[i]);
        samples.still = (0..n).filter_map(|i| Some((i, moves(i)?))).collect();
        let stride = recording.samples().div_ceil(MOST_SAMPLES).max(1);
        samples.stride = stride;
        for track in &recording.tracks {
            let smoothed = if measured { None } else { smoothing.apply(track).ok() };
            samples.starts.push(samples.len());
            for k in (0..track.len()).step_by(stride) {
                let at = k * n..(k + 1) * n;
                let (v, noise): (&[f64], Vec<f64>) = match &smoothed {
                    None if measured => (&track.v[at.clone()], of_velocities.clone()),
                    Some(smoothed) if smoothed.is_full(k) => {
                        let errors = smoothed.v_error[at.clone()].iter().zip(&smoothed.v_bias[at.clone()]);
                        (&smoothed.v[at.clone()], errors.map(|(error, bias)| error.hypot(*bias)).collect())
                    }
                    _ => continue,
                };
                samples.states.extend_from_slice(&track.q[at]);
                samples.states.extend_from_slice(v);
                samples.velocity_noise.extend(noise);
            }
            if samples.starts.last() == Some(&samples.len()) {
                samples.starts.pop();
            }
        }
        Ok(samples)
    }

    /// Takes exact positions and velocities from a recording; trajectories may have any length.
    ///
    /// # Errors
    /// [`SmoothError::Shape`] for a trajectory without velocities.
    pub fn exact(recording: &Recording) -> Result<Self, SmoothError> {
        let n = recording.n();
        let mut samples = Self {
            names: recording.coordinates.clone(),
            periodic: recording.periodic.clone(),
            position_noise: vec![0.0; n],
            shared: 1.0,
            shared_positions: 1.0,
            slack: 1.0,
            stride: 1,
            measured: true,
            ..Self::default()
        };
        samples.still = (0..n).filter_map(|i| Some((i, stillness(recording, i, false, Colour::default())?))).collect();
        for track in recording.tracks.iter().filter(|track| !track.is_empty()) {
            if [track.q.len(), track.v.len()] != [track.len() * n; 2] {
                return Err(SmoothError::Shape { track: track.name.clone(), n });
            }
            samples.starts.push(samples.len());
            for (q, v) in track.q.chunks_exact(n).zip(track.v.chunks_exact(n)) {
                samples.states.extend(q.iter().chain(v));
                samples.velocity_noise.extend(vec![0.0; n]);
            }
        }
        Ok(samples)
    }

    /// These samples with a `cancellation` that cancels a search in them and receives its progress.
    #[must_use]
    pub fn watched(self, cancellation: &Cancellation) -> Self {
        Self { cancellation: cancellation.clone(), ..self }
    }

    /// Number of coordinates.
    pub(crate) fn n(&self) -> usize {
        self.names.len()
    }
    /// Number of samples.
    pub(crate) fn len(&self) -> usize {
        self.states.len() / (2 * self.n()).max(1)
    }
    /// Number of trajectories.
    pub(crate) fn trajectories(&self) -> usize {
        self.starts.len()
    }
    /// Number of samples that share one error.
    pub(super) fn shared(&self) -> f64 {
        self.shared
    }
    /// Approximate number of samples with independent noise.
    pub(super) fn independent(&self) -> f64 {
        self.len() as f64 / self.shared_positions.max(1.0)
    }
    /// Largest variance of the noise that the recording allows, over the estimated one.
    pub(super) fn slack(&self) -> f64 {
        self.slack
    }
    /// `true` if the noise of velocities is known as well as that of positions.
    pub(super) fn measured(&self) -> bool {
        self.measured
    }
    /// `true` for a column that moves.
    pub(super) fn moves(&self, i: usize) -> bool {
        self.still.iter().all(|(still, _)| *still != i)
    }
    /// Describes the columns that do not move.
    pub(super) fn still(&self) -> BTreeMap<String, String> {
        self.still.iter().map(|(i, how)| (self.names[*i].clone(), how.clone())).collect()
    }
    /// Samples of the recording per sample used.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }
    pub(super) fn periodic(&self) -> &[bool] {
        &self.periodic
    }
    /// Coordinates, then velocities.
    pub(crate) fn state(&self, at: usize) -> &[f64] {
        let n = self.n();
        &self.states[2 * n * at..2 * n * (at + 1)]
    }
    /// Standard deviation of component `i` of the state.
    pub(super) fn noise(&self, at: usize, i: usize) -> f64 {
        let n = self.n();
        if i < n { self.position_noise[i] } else { self.velocity_noise[at * n + i - n] }
    }
    /// Samples of each trajectory.
    pub(super) fn tracks(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let ends = self.starts.iter().skip(1).copied().chain([self.len()]);
        self.starts.iter().copied().zip(ends).map(|(start, end)| start..end)
    }
    /// At most `most` evenly spaced samples.
    pub(crate) fn places(&self, most: usize) -> Vec<usize> {
        (0..self.len()).step_by(self.len().div_ceil(most).max(1)).collect()
    }
    /// Noise of each coordinate over its root mean square.
    pub(super) fn relative_noise(&self) -> Vec<f64> {
        let n = self.n();
        (0..n)
            .map(|i| {
                let square: f64 = (0..self.len()).map(|at| self.state(at)[i].powi(2)).sum();
                let size = (square / self.len().max(1) as f64).sqrt();
                if size > 0.0 { self.position_noise[i] / size } else { 0.0 }
            })
            .collect()
    }
}

/// Why a column counts as still; `None` if it moves. A column that is constant along every trajectory, or pure noise, is no evidence of a
/// constraint: its sensor may be off.
fn stillness(recording: &Recording, i: usize, resolved: bool, noise: Colour) -> Option<String> {
    let (n, mut square, mut count, mut constant) = (recording.n(), 0.0, 0.0, true);
    for track in &recording.tracks {
        let values = || track.q.iter().skip(i).step_by(n);
        let samples = values().count() as f64;
        let mean = values().map(|x| x / samples).sum::<f64>();
        square += values().map(|x| (x - mean).powi(2)).sum::<f64>();
        count += samples;
        constant &= values().all(|x| Some(x) == values().next());
    }
    let first = recording.tracks.iter().find_map(|track| track.q.get(i))?;
    if constant {
        return Some(format!(
            "is constant ({} in the first sample): it does not move, or its sensor is off",
            number(*first)
        ));
    }
    // A mean absorbs part of correlated noise.
    let still =
        resolved && square <= LEAST_MOTION_RATIO * LEAST_MOTION_RATIO * noise.sigma.powi(2) * noise.slack * count;
    still.then(|| format!("moves by no more than twice its noise of {}", number(noise.sigma)))
}
