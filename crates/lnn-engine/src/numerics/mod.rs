//! Numbers, their derivatives, and small matrices: everything that knows no mechanics.
//!
//! | module | contents |
//! |---|---|
//! | [`platform`] | what the standard library gives, and what stands in for it without |
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
