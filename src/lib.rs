//! Stabilized Lagrangian neural networks: learn `L(q, dq/dt)` from motion, predict motion that keeps its energy, read
//! physics off the learned function.
//!
//! Rooms, each importing only from those above it: [`names`], [`storage`], [`scalar`], [`ops`], [`forward`], [`linalg`], [`tape`],
//! [`recording`], [`lagrangian`], [`network`], [`training`], [`rollout`], [`analysis`], [`experiments`], `report`, `cli`.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod names;

pub mod storage;

pub mod scalar;

pub mod ops;

pub mod forward;

pub mod linalg;

pub mod tape;

pub mod recording;

pub mod lagrangian;

pub mod network;

pub mod training;

pub mod rollout;

pub mod analysis;

pub mod experiments;

#[cfg(feature = "plot")]
pub mod report;

#[cfg(feature = "cli")]
pub mod cli;

/// The README's code runs as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
