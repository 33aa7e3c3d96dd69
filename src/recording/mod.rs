//! Recorded motion: what somebody measured, as it was measured; its derivatives, and what it is good for.

mod between;
mod columns;
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

pub(crate) use between::hermite;
pub use columns::{Columns, ColumnsError};
pub use hold_out::{HeldOut, HoldOutError};
pub use reading::{Cut, Dropped, Reading, Rows};
pub(crate) use targets::LARGE_ERROR;
pub use targets::Targets;
pub use track::{Recording, Track, TrackError};
pub use units::factor;
