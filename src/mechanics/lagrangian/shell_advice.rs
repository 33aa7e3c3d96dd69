//! Shells around a centre in which a system is best learned.

use std::borrow::Cow;

/// Shell around a centre, and how fast what moves in it is at most.
#[derive(Clone, Debug, PartialEq)]
pub struct ShellAdvice {
    /// Cartesian coordinates around the centre.
    pub coordinates: Cow<'static, [usize]>,
    /// Lowest and highest distance from it.
    pub radius: (f64, f64),
    /// Largest rapidity in a local frame.
    pub rapidity: f64,
}
