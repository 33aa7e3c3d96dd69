//! How far a Lagrangian is evaluated.

/// How far a Lagrangian is evaluated; each step includes those before it.
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
