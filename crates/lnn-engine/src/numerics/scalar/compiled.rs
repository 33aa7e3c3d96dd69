//! Code that is compiled once for each scalar.

use core::any::Any;

/// Code that a higher module compiles in this crate for each scalar: generic code takes it from here, so that no crate that calls such code
/// compiles it again.
pub trait Compiled {
    /// A type of the module that evaluates Lagrangians.
    fn routines() -> &'static dyn Any;
}
