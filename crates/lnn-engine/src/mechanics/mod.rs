//! Lagrangian mechanics of hand-written, described and learned systems: terms and motion.
//!
//! | module | contents |
//! |---|---|
//! | [`lagrangian`] | the trait, Euler-Lagrange terms, forces, the catalogue of systems, system files |
//! | [`rollout`] | integrators, trajectories |
//! | [`network`] | network Lagrangians, their structures, model files |

pub mod lagrangian;
pub mod network;
#[cfg(feature = "rollout")]
pub mod rollout;
