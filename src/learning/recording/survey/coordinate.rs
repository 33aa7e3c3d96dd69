//! Survey of one coordinate.

use super::warnings::{Consistency, compare};
use crate::recording::Recording;
use crate::recording::smooth::{Chosen, Smoothing};
use serde::Serialize;
use std::f64::consts::TAU;

/// Range, noise and motion of one coordinate, and the errors after smoothing; in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoordinateSurvey {
    /// Its name.
    pub name: String,
    /// `true` for an angle; it is unwrapped.
    pub periodic: bool,
    /// Least value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Standard deviation of the noise, estimated from the data.
    pub noise: f64,
    /// The noise over the range.
    pub noise_relative: f64,
    /// `true` if motion and noise can be distinguished; if not, `noise` is an upper bound.
    pub noise_resolved: bool,
    /// Root mean square of the velocity.
    pub velocity: f64,
    /// Root mean square velocity about its mean.
    pub velocity_deviation: f64,
    /// Root mean square of the acceleration.
    pub acceleration: f64,
    /// Period in s of the fast part of the motion, `2 pi rms(v) / rms(a)`, with the velocity about its mean: the period of a sine, or the
    /// period at the root mean square frequency of the velocity's spectrum (Rice 1944).
    pub period: f64,
    /// Samples in such a period.
    pub samples_per_period: f64,
    /// Window that smoothing would use, in samples.
    pub window: usize,
    /// The window in s.
    pub window_seconds: f64,
    /// Error of velocities by smoothing, noise and bias together, root mean square.
    pub velocity_error: f64,
    /// Error of accelerations by smoothing.
    pub acceleration_error: f64,
    /// The error of the accelerations over their size.
    pub acceleration_error_relative: f64,
    /// Comparison of measured velocities with derivatives of positions.
    pub measured_velocity: Option<Consistency>,
    /// Comparison of measured accelerations with second derivatives of positions.
    pub measured_acceleration: Option<Consistency>,
    /// Steps of an angle by more than 2 rad, whose direction is ambiguous.
    pub ambiguous_turns: usize,
    /// Row and trajectory of the first such step.
    pub first_ambiguous: Option<(String, u64)>,
}

impl CoordinateSurvey {
    /// Surveys coordinate `i`. `alone` smooths positions only; `planned` is the smoothing that a fit would use.
    pub fn new(recording: &Recording, i: usize, alone: &Smoothing, planned: &Chosen) -> Self {
        let n = recording.n();
        let values = || recording.tracks.iter().flat_map(|track| track.q.iter().skip(i).step_by(n).copied());
        let (min, max) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let Chosen { noise, quality, seconds, .. } = *planned;
        let period = TAU * quality.velocity_deviation / quality.acceleration;
        let measured = |derivative: usize| {
            let is_measured = if derivative == 1 { recording.has_velocities() } else { recording.has_accelerations() };
            is_measured.then(|| compare(recording, i, derivative, alone))
        };
        Self {
            name: recording.coordinates[i].clone(),
            periodic: recording.periodic[i],
            min,
            max,
            noise: noise.sigma,
            noise_relative: noise.sigma / (max - min),
            noise_resolved: noise.resolved,
            velocity: quality.velocity,
            velocity_deviation: quality.velocity_deviation,
            acceleration: quality.acceleration,
            period,
            samples_per_period: period / alone.step,
            window: quality.window,
            window_seconds: seconds,
            velocity_error: quality.total(1),
            acceleration_error: quality.total(2),
            acceleration_error_relative: quality.relative(),
            measured_velocity: measured(1),
            measured_acceleration: measured(2),
            ambiguous_turns: 0,
            first_ambiguous: None,
        }
    }
}
