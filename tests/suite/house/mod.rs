//! The repository itself: order of rooms, examples, use by other programs, seeds of the fuzz targets.

mod docs;
mod embedding;
mod examples;
mod fuzz_seeds;
mod rooms;
mod wording;
