//! A Lagrangian, however made: its terms and its motion.
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
