//! Recorded motion: what somebody measured, as it was measured.

mod track;

pub use track::{Recording, Track, TrackError};
