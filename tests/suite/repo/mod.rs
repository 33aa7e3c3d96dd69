//! The repository itself: order of modules, examples, use by other programs, seeds of the fuzz targets, pages,
//! the reader of model files in Python.

mod docs;
mod embedding;
mod examples;
mod floors;
mod fuzz_seeds;
mod model_format;
mod properties;
mod python;
mod ratchets;
