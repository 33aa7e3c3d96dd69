//! Identifies the constants of a known Lagrangian from recorded motion.
//!
//! A least-squares fit to smoothed accelerations comes first. Then the motion itself is fitted by multiple shooting with the method of Levenberg and
//! Marquardt: the recording is divided into segments, each with its own initial state. The equations of motion are integrated along each segment,
//! and constants, initial states and sensor constants are adjusted to minimize the residuals of the measured positions. Segments grow as long as
//! that reduces the standard errors. Only the positions are noisy, so that the noise causes no bias.
//!
//! For machines whose known forces are noisier than their motion, such as robots, the constants are fitted to the forces instead. The forces of a
//! chain of links are linear in its constants, so that many constants can be fitted at once.
//!
//! ```
//! use lnn::identification::{IdentifyOptions, identify};
//! use lnn::lagrangian::SystemInstance;
//! use lnn::prelude::*;
//! use lnn::recording::{RecordedTrajectory, Recording};
//!
//! // A pendulum of 0.7 m, from positions alone.
//! let truth = SystemInstance::<f64>::named("n-pendulum", &[("n".into(), "1".into()), ("l".into(), "0.7".into())])?.build()?;
//! let motion = truth.rollout(&[1.0], &[0.0], 6.0, 0.02)?;
//! let track = RecordedTrajectory { name: "swing".into(), times: motion.t, q: motion.q, v: vec![], a: vec![], force: vec![] };
//! let recording = Recording { coordinates: vec!["theta".into()], periodic: vec![true], tracks: vec![track] };
//! let form = SystemInstance::<f64>::named("n-pendulum", &[("n".into(), "1".into())])?;
//! let found = identify(&form, &recording, &IdentifyOptions::new().constants(["l"]))?;
//! assert!((found.constants[0].value - 0.7).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod advice;
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
mod descent;
mod determined;
mod driven;
mod error;
mod first_fit;
mod fitted;
mod follow;
#[cfg(test)]
mod forced_tests;
mod found;
mod initial_states;
mod innovations;
mod interpolations;
mod invariants;
mod lanes;
pub(crate) mod linear;
mod measured;
mod motion_result;
mod moves;
mod options;
mod per_trajectory;
mod pieces;
mod quality;
mod report;
mod residual_noise;
#[cfg(test)]
mod search_tests;
mod segments;
mod smoothed;
mod solve;
mod stages;
mod steps;
#[cfg(test)]
mod tests;
mod thresholds;
mod unknowns;
mod verdict;

pub use by_trajectory::{ByTrajectory, OfTrajectory, Scatter};
pub(crate) use driven::{DrivenEquations, Segment};
pub use error::IdentifyError;
pub use found::{
    Bodies, Combination, Constant, Correlations, Identified, Outlier, Residual, ResidualPath, SensorConstant,
    Undetermined,
};
pub(crate) use innovations::Disturbances;
pub use options::IdentifyOptions;
pub(crate) use segments::{joined, thinned};
pub(crate) use solve::{Linear, Problem};
pub use stages::identify;
pub(crate) use stages::spread_of;
pub(crate) use steps::choose_steps;
pub use verdict::Verdict;

pub use crate::rollout::Between;
