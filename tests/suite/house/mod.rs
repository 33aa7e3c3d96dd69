//! The repository itself: order of rooms, examples, use by other programs, seeds of the fuzz targets.

mod circles;
mod docs;
mod embedding;
mod examples;
mod fuzz_seeds;
#[cfg(feature = "cli")]
mod model_format;
mod rooms;
mod wording;
