//! What is compiled once for each scalar.

use core::any::Any;

/// What a higher module compiles in this crate for each scalar: code that is generic over the scalar takes it from here, and no crate that
/// calls such code compiles it again.
pub trait Compiled {
    /// A type of the module that evaluates Lagrangians.
    fn routines() -> &'static dyn Any;
}
