//! States of recorded motion with their noise.

use crate::cancellation::Cancellation;
use crate::recording::Recording;
use crate::recording::smooth::{SmoothError, SmoothOptions, Smoothing};

/// Most samples that are looked at, evenly spaced.
const MOST_SAMPLES: usize = 60_000;

/// Positions and velocities of trajectories, with standard deviations of their noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionSamples {
    names: Vec<String>,
    periodic: Vec<bool>,
    /// `(samples, 2 n)`.
    states: Vec<f64>,
    /// Of the positions, `(n)`, and of the velocities, `(samples, n)`.
    position_noise: Vec<f64>,
    velocity_noise: Vec<f64>,
    /// First sample of each trajectory.
    starts: Vec<usize>,
    /// Samples whose velocities have errors of their own, as one to so many.
    shared: f64,
    /// Ends a search in them.
    pub(super) cancellation: Cancellation,
}

impl MotionSamples {
    /// Of a recording: positions as they were measured, velocities measured or by smoothing.
    ///
    /// # Errors
    /// [`SmoothError`] of trajectories that are too short to know their noise.
    pub fn of(recording: &Recording, options: &SmoothOptions) -> Result<Self, SmoothError> {
        let n = recording.n();
        let smoothing = Smoothing::choose(recording, options)?;
        let measured = recording.tracks.iter().all(|track| !track.v.is_empty());
        let position_noise = smoothing.coordinates.iter().map(|chosen| chosen.noise.sigma).collect();
        let of_velocities: Vec<f64> =
            smoothing.coordinates.iter().map(|chosen| chosen.velocity_noise.map_or(0.0, |noise| noise.sigma)).collect();
        let mut samples = Self {
            names: recording.coordinates.clone(),
            periodic: recording.periodic.clone(),
            position_noise,
            shared: if measured { 1.0 } else { smoothing.window() as f64 },
            ..Self::default()
        };
        let stride = recording.samples().div_ceil(MOST_SAMPLES).max(1);
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

    /// Of a recording of exact states, positions and velocities, whose trajectories may be of any length.
    ///
    /// # Errors
    /// [`SmoothError::Shape`] of a trajectory without velocities.
    #[doc(hidden)]
    pub fn exact(recording: &Recording) -> Result<Self, SmoothError> {
        let n = recording.n();
        let mut samples = Self {
            names: recording.coordinates.clone(),
            periodic: recording.periodic.clone(),
            position_noise: vec![0.0; n],
            shared: 1.0,
            ..Self::default()
        };
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

    /// The same, a search in which is ended by `cancellation` and reports to it.
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
    /// Samples that count as one where errors are shared.
    pub(super) fn shared(&self) -> f64 {
        self.shared
    }
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }
    pub(super) fn periodic(&self) -> &[bool] {
        &self.periodic
    }
    /// Coordinates, then velocities.
    pub(super) fn state(&self, at: usize) -> &[f64] {
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
    /// So many samples, evenly spaced.
    pub(super) fn places(&self, most: usize) -> Vec<usize> {
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
