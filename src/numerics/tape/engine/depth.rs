//! Depth of an evaluation.

/// Depth of an evaluation of a Lagrangian; each step includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// `L`: one pass.
    Value,
    /// `p`, `g`: two passes.
    Gradient,
    /// `M`: `n + 2` passes.
    MassMatrix,
    /// `c`: `n + 3` passes.
    Motion,
    /// As `Motion`, keeping what gradients of losses need.
    Training,
}
