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

pub use between::hermite;
pub use columns::{Columns, ColumnsError};
pub use hold_out::{HeldOut, HoldOutError, hold_out};
pub use reading::{Cut, Dropped, Reading, Rows};
pub use targets::{LARGE_ERROR, Targets};
pub use track::{Recording, Track, TrackError};
pub use units::factor;
