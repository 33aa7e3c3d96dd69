#![doc = include_str!("../README.md")]
//!
//! The modules have the names that they have in `lnn`, which re-exports them:
//!
//! | module | contents |
//! |---|---|
//! | [`lagrangian`] | Lagrangians written down, as a formula or from the catalogue; `L`, `p`, `M`, `a`, `E` of a batch; accelerations, torques and linearizations of one state |
//! | [`rollout`] | integrators with error control and symplectic ones, events, forces, derivatives of the end of a motion (feature `rollout`) |
//! | [`network`] | Lagrangians by a network; model files (feature `model-files`) |
//! | [`tape`] | reverse mode, recorded functions and their second derivatives |
//! | [`linalg`] | small symmetric systems in batches |
//! | [`scalar`], [`random`] | number types up to double-double; random streams that a seed repeats |
//! | [`cancellation`], [`findings`] | the end of a long search; what a result says, in sentences and tables |
//!
//! Shapes, units and numbers are those of `lnn`: batches are row-major `(batch, n)`, units SI, results do not depend on the number of
//! threads. Items hidden from these pages are shared by the packages of the repository and may change in every version.
// Code for some features is dead without them; the build with all features finds code that is always dead.
#![cfg_attr(not(all(feature = "faer", feature = "model-files", feature = "rollout")), allow(dead_code, unused_imports))]
#![cfg_attr(not(feature = "std"), no_std)]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[macro_use]
extern crate alloc;

mod mechanics;
mod numerics;
#[cfg(test)]
mod properties;
mod support;

#[cfg(feature = "rollout")]
pub use mechanics::rollout;
pub use mechanics::{lagrangian, network};
pub(crate) use numerics::platform;
pub use numerics::{linalg, random, scalar, tape};
#[cfg(feature = "std")]
pub use support::cancellation;
pub use support::findings;
// For the packages of this repository.
#[cfg(feature = "std")]
#[doc(hidden)]
pub use support::storage;
#[doc(hidden)]
pub use {
    numerics::{forward, ops},
    support::names,
};
