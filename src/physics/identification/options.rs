//! Options of an identification.

use super::Between;
use crate::cancellation::Cancellation;
use crate::recording::{LoadedRecording, Targets};
use serde::Deserialize;

/// Options of [`identify`](super::identify). The defaults suit most recordings:
///
/// ```
/// use lnn::identification::IdentifyOptions;
///
/// let options = IdentifyOptions::new().constants(["m", "l"]).offsets(["theta"]).robust(true);
/// assert_eq!(options.constants, ["m", "l"]);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
#[must_use]
pub struct IdentifyOptions {
    /// Symbols of the unknown constants. If empty, those that the system marks to be learned, or all if it marks none.
    pub constants: Vec<String>,
    /// Coordinates whose sensor has an unknown offset.
    pub offsets: Vec<String>,
    /// Coordinates whose sensor has an unknown gain.
    pub gains: Vec<String>,
    /// Coordinates whose sensor has an unknown delay.
    pub delays: Vec<String>,
    /// Standard deviation of every coordinate's noise; estimated from the recording if `None`.
    pub noise: Option<Vec<f64>>,
    /// Standard deviations of the positions of every trajectory, `(samples, n)` each, in the units of the coordinates, by which the residuals are
    /// weighted. Empty if they are not known.
    #[serde(default)]
    pub errors: Vec<Vec<f64>>,
    /// Marks of missing readings of positions, `(samples, n)` for every trajectory. The numbers in place of missing readings only serve to start the
    /// search. Empty if no reading is missing.
    #[serde(default)]
    pub missing: Vec<Vec<bool>>,
    /// Inputs of the system at the samples of every trajectory, `(samples, inputs)` each, in the order of their names.
    #[serde(default)]
    pub inputs: Vec<Vec<f64>>,
    /// The quantity that is fitted, [`Targets::Motion`] or [`Targets::Forces`]. If `None`, the forces for a chain of links under known forces,
    /// otherwise the motion.
    pub targets: Option<Targets>,
    /// Interpolation of known forces and inputs between the samples; if `None`, the one that fits the motion best.
    pub between: Option<Between>,
    /// Length of the segments in s; if `None`, the length with the smallest standard errors.
    pub segment: Option<f64>,
    /// `true` for a robust fit: residuals beyond three standard deviations count linearly, which limits the influence of outliers.
    pub robust: bool,
    /// `true` to identify the constants also from every trajectory alone, and to compare them; at most 64 trajectories.
    #[serde(default)]
    pub by_trajectory: bool,
    /// Number of threads; 0 counts as 1. The result does not depend on it.
    pub threads: usize,
    /// Cancels the search, and receives its progress.
    #[serde(skip)]
    pub cancellation: Cancellation,
}

fn names<S: Into<String>>(names: impl IntoIterator<Item = S>) -> Vec<String> {
    names.into_iter().map(Into::into).collect()
}

impl IdentifyOptions {
    /// The defaults.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the unknown constants by their symbols.
    pub fn constants<S: Into<String>>(self, symbols: impl IntoIterator<Item = S>) -> Self {
        Self { constants: names(symbols), ..self }
    }

    /// Sets the coordinates whose sensor has an unknown offset.
    pub fn offsets<S: Into<String>>(self, coordinates: impl IntoIterator<Item = S>) -> Self {
        Self { offsets: names(coordinates), ..self }
    }

    /// Sets the coordinates whose sensor has an unknown gain.
    pub fn gains<S: Into<String>>(self, coordinates: impl IntoIterator<Item = S>) -> Self {
        Self { gains: names(coordinates), ..self }
    }

    /// Sets the coordinates whose sensor has an unknown delay.
    pub fn delays<S: Into<String>>(self, coordinates: impl IntoIterator<Item = S>) -> Self {
        Self { delays: names(coordinates), ..self }
    }

    /// Sets the standard deviation of every coordinate's noise.
    pub fn noise(self, noise: impl Into<Option<Vec<f64>>>) -> Self {
        Self { noise: noise.into(), ..self }
    }

    /// Sets the standard deviations of the positions.
    pub fn errors(self, errors: Vec<Vec<f64>>) -> Self {
        Self { errors, ..self }
    }

    /// Takes what files hold beside the motion: the marks of missing readings, and standard deviations and inputs unless they are given.
    pub fn of_recording(mut self, loaded: &LoadedRecording) -> Self {
        self.missing.clone_from(&loaded.missing);
        if self.errors.is_empty() {
            self.errors.clone_from(&loaded.errors);
        }
        if self.inputs.is_empty() {
            self.inputs.clone_from(&loaded.inputs);
        }
        self
    }

    /// Sets the marks of missing readings.
    pub fn missing(self, missing: Vec<Vec<bool>>) -> Self {
        Self { missing, ..self }
    }

    /// Sets the inputs of the system.
    pub fn inputs(self, inputs: Vec<Vec<f64>>) -> Self {
        Self { inputs, ..self }
    }

    /// Sets the quantity that is fitted.
    pub fn targets(self, targets: impl Into<Option<Targets>>) -> Self {
        Self { targets: targets.into(), ..self }
    }

    /// Sets the interpolation of known forces and inputs.
    pub fn between(self, between: impl Into<Option<Between>>) -> Self {
        Self { between: between.into(), ..self }
    }

    /// Sets the length of the segments in s.
    pub fn segment(self, seconds: impl Into<Option<f64>>) -> Self {
        Self { segment: seconds.into(), ..self }
    }

    /// Sets whether the fit is robust.
    pub fn robust(self, robust: bool) -> Self {
        Self { robust, ..self }
    }

    /// Sets whether every trajectory is also identified alone.
    pub fn by_trajectory(self, by_trajectory: bool) -> Self {
        Self { by_trajectory, ..self }
    }

    /// Sets the number of threads.
    pub fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Sets what cancels the search and receives its progress.
    pub fn cancellation(self, cancellation: Cancellation) -> Self {
        Self { cancellation, ..self }
    }
}
