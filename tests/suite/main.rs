//! One program of all tests that may run side by side, a folder per subject; `tests/process` holds those that must own their
//! process. `cargo test --test suite training::` runs a subject, `cargo test --test suite stress -- --nocapture` prints tables.

#![allow(clippy::duplicate_mod, reason = "the fuzz targets bring their copy of the reference")]

mod autodiff;
mod common;
mod geometry;
mod linalg;
mod mechanics;
mod network;
mod program;
mod recording;
mod repo;
mod rollout;
mod running;
mod stress;
mod symmetry;
mod training;
