//! The constants of a known Lagrangian from recorded motion.
//!
//! A least-squares fit to smoothed accelerations comes first. Then Levenberg and Marquardt's method fits the motion itself by multiple shooting:
//! the recording is divided into segments, each with an initial state of its own; the equations of motion are integrated along each segment, and
//! constants, initial states and sensor constants are adjusted until the measured positions are fitted best. Segments grow as long as that
//! reduces the standard errors. Only positions enter with noise, so that the noise causes no bias.
//!
//! For machines under known forces that are noisier than their motion, such as robots, the forces are fitted instead: those of a chain of links
//! are linear in its constants, however many there are.
//!
//! ```
//! use lnn::identification::{IdentifyOptions, identify};
//! use lnn::lagrangian::configure;
//! use lnn::prelude::*;
//! use lnn::recording::{RecordedTrajectory, Recording};
//!
//! // A pendulum of 0.7 m, from positions alone.
//! let truth = configure::<f64>("n-pendulum", &[("n".into(), "1".into()), ("l".into(), "0.7".into())])?.build()?;
//! let motion = truth.rollout(&[1.0], &[0.0], 6.0, 0.02)?;
//! let track = RecordedTrajectory { name: "swing".into(), times: motion.t, q: motion.q, v: vec![], a: vec![], force: vec![] };
//! let recording = Recording { coordinates: vec!["theta".into()], periodic: vec![true], tracks: vec![track] };
//! let form = configure::<f64>("n-pendulum", &[("n".into(), "1".into())])?;
//! let found = identify(&form, &recording, &IdentifyOptions { constants: vec!["l".into()], ..Default::default() })?;
//! assert!((found.constants[0].value - 0.7).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod averages;
mod bodies;
mod bootstrap;
mod by_forces;
mod by_trajectory;
mod choices;
mod closed;
#[cfg(test)]
mod closed_tests;
mod covariance;
mod cure;
mod descent;
mod determined;
mod error;
mod first_fit;
mod follow;
mod found;
mod initial_states;
mod innovations;
mod invariants;
pub(crate) mod linear;
mod measured;
mod moves;
mod per_trajectory;
mod pieces;
mod quality;
mod says;
#[cfg(test)]
mod search_tests;
mod smoothed;
mod solve;
mod stages;
#[cfg(test)]
mod tests;
mod thresholds;
mod unknowns;
mod verdict;
mod ways;

pub use by_trajectory::{ByTrajectory, OfTrajectory, Scatter};
pub use error::IdentifyError;
pub(crate) use follow::{Course, Segment};
pub use found::{
    Bodies, Combination, Constant, Correlations, Identified, Outlier, Residual, ResidualPath, SensorConstant,
    Undetermined,
};
pub(crate) use innovations::Disturbances;
pub(crate) use solve::{Linear, Problem};
pub use stages::identify;
pub(crate) use stages::{choose_steps, joined, spread_of, thinned};
pub use verdict::Verdict;

use crate::cancellation::Cancellation;
use crate::recording::Targets;
pub use crate::rollout::Between;
use serde::Deserialize;

/// Options of [`identify`].
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentifyOptions {
    /// Symbols of the unknown constants; if empty, those that the system marks to be learned, or all if it marks none.
    pub constants: Vec<String>,
    /// Coordinates whose sensor has an unknown offset.
    pub offsets: Vec<String>,
    /// Coordinates whose sensor has an unknown gain.
    pub gains: Vec<String>,
    /// Coordinates whose sensor has an unknown delay.
    pub delays: Vec<String>,
    /// Standard deviation of every coordinate's noise; estimated if not given.
    pub noise: Option<Vec<f64>>,
    /// Standard deviations of the positions of every trajectory, `(samples, n)` each, in the units of the coordinates; residuals are weighted by
    /// them. Empty if they are not known.
    #[serde(default)]
    pub errors: Vec<Vec<f64>>,
    /// Readings of positions that are missing, `true` in `(samples, n)` of every trajectory; numbers in their place only start the search. Empty
    /// if none is missing.
    #[serde(default)]
    pub missing: Vec<Vec<bool>>,
    /// Inputs of the forces of the system at the samples of every trajectory, `(samples, inputs)` each, in the order of their names.
    #[serde(default)]
    pub inputs: Vec<Vec<f64>>,
    /// What is fitted, [`Targets::Motion`] or [`Targets::Forces`]; by default the forces of a chain of links under known forces, otherwise the
    /// motion.
    pub targets: Option<Targets>,
    /// Interpolation of known forces and inputs between the samples; by default the one that fits the motion best.
    pub between: Option<Between>,
    /// Length of the segments in s; chosen by the data if not given.
    pub segment: Option<f64>,
    /// Residuals beyond three standard deviations count linearly, which limits the influence of outliers.
    pub robust: bool,
    /// Every trajectory is identified alone, too, and the constants are compared; 64 trajectories at most.
    #[serde(default)]
    pub by_trajectory: bool,
    /// Threads; 0 for one. The result does not depend on their number.
    pub threads: usize,
    /// Cancels the search, and receives reports of its progress.
    #[serde(skip)]
    pub cancellation: Cancellation,
}
