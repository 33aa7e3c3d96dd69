//! Numbers, their derivatives, and small matrices, without any mechanics.
//!
//! | module | contents |
//! |---|---|
//! | [`platform`] | services of the standard library, and their replacements without it |
//! | [`scalar`] | number types, vector lanes, exact sums |
//! | [`random`] | random streams: one seed, independent draws for each purpose |
//! | [`ops`] | the one table of operations: values, first and second partial derivatives |
//! | [`forward`] | forward numbers: dual, hyper-dual, jets |
//! | [`linalg`] | small symmetric systems in batches: solve, eigenvalues, inertia, minors, signatures |
//! | [`tape`] | reverse mode: eager, recorded programs, and the engine of all second derivatives of a Lagrangian |

pub mod forward;
pub mod linalg;
pub mod ops;
pub mod platform;
pub mod random;
pub mod scalar;
pub mod tape;
