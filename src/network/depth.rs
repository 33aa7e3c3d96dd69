//! How far a chunk is evaluated.

/// How far a chunk is evaluated; each step includes those before it.
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
    /// As `Motion`, keeping what the adjoint identity needs.
    Training,
}

impl Depth {
    /// Channels of the forward pass: the value, the `n` velocities, the direction `(v, 0)`.
    pub(super) fn channels(self, n: usize) -> usize {
        match self {
            Self::Value | Self::Gradient => 1,
            Self::MassMatrix => 1 + n,
            Self::Motion | Self::Training => 2 + n,
        }
    }

    /// Derivatives of the activations that are kept.
    pub(super) fn slopes(self) -> usize {
        match self {
            Self::Value => 0,
            Self::Gradient => 1,
            Self::MassMatrix | Self::Motion => 2,
            Self::Training => 3,
        }
    }
}
