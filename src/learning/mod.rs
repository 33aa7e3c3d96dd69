//! From motion to a network.
//!
//! | module | contents |
//! |---|---|
//! | [`recording`] | recorded motion: read, survey, smooth, split |
//! | [`state`] | the state of a computation in bytes, for checkpoints |
//! | [`optimizers`] | update rules, schedules of the learning rate |
//! | [`configuration`] | every choice of a training, its ranges, its penalty |
//! | [`data`] | states with their accelerations, sampled from known systems or taken from recorded motion |
//! | [`training`] | losses, the solvers hosted by argmin, checkpoints |
//! | [`shooting`] | multiple shooting: learning through the motion |
//! | [`presets`] | configurations that ship with the crate, trainings on arrays |

#[cfg(feature = "training")]
pub mod configuration;
#[cfg(feature = "training")]
pub mod data;
#[cfg(feature = "training")]
pub mod optimizers;
#[cfg(feature = "training")]
pub mod presets;
#[cfg(feature = "data")]
pub mod recording;
#[cfg(feature = "training")]
pub mod shooting;
#[cfg(feature = "training")]
pub mod state;
#[cfg(feature = "training")]
pub mod training;
