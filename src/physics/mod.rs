//! Analyses of a Lagrangian, learned or given.
//!
//! | module | contents |
//! |---|---|
//! | [`geometry`] | metric, connection, curvature, surfaces where a metric changes its character |
//! | [`constraints`] | constraints found in recorded motion |
//! | [`symmetry`] | symmetries and conserved quantities, charges along motion, comparison of two Lagrangians |
//! | [`certificate`] | proofs of the signature of mass matrices over boxes |
//! | [`analysis`] | errors of accelerations, energy and trajectories, Lyapunov times, what data determine |
//! | [`relativity`] | black holes, light in a metric |
//! | [`formula`] | a Lagrangian as a formula, from motion or from a model |
//! | [`identification`] | the constants of a Lagrangian whose form is known, from motion |

#[cfg(feature = "training")]
pub mod analysis;
#[cfg(feature = "std")]
pub mod certificate;
#[cfg(feature = "data")]
pub mod constraints;
#[cfg(feature = "data")]
pub(crate) mod digits;
#[cfg(feature = "training")]
pub mod formula;
pub mod geometry;
#[cfg(feature = "training")]
pub mod identification;
#[cfg(feature = "rollout")]
pub mod relativity;
#[cfg(feature = "rollout")]
pub mod symmetry;
