//! Recorded motion: what somebody measured, as it was measured; its derivatives, and what it is good for.

mod columns;
mod hermite;
mod hold_out;
#[cfg(feature = "data")]
pub mod read;
mod reading;
pub mod smooth;
mod statistics;
pub mod survey;
mod targets;
mod track;
mod units;

pub use columns::{Columns, ColumnsError};
pub(crate) use hermite::hermite;
pub(crate) use hold_out::HeldOut;
pub use hold_out::HoldOutError;
pub use reading::{Cut, Dropped, LoadedRecording, Rows};
pub(crate) use targets::LARGE_ERROR;
pub use targets::Targets;
pub use track::{RecordedTrajectory, Recording, TrajectoryError};
pub(crate) use units::factor;
