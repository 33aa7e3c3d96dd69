//! Activation functions and their derivatives.

mod formula;
mod gain;
mod jets;

use crate::scalar::Real;

/// Elementwise function that ends a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Activation {
    /// `x Phi(x)`, exact (error function).
    Gelu,
    /// `ln(1 + e^x)`.
    Softplus,
    /// `x tanh(x / 2)`.
    XTanh,
    /// `tanh(x)`.
    Tanh,
    /// `x^2`.
    Quadratic,
    /// `x`, of linear layers.
    Identity,
}

impl Activation {
    /// Every activation.
    pub const ALL: [Self; 6] = [Self::Gelu, Self::Softplus, Self::XTanh, Self::Tanh, Self::Quadratic, Self::Identity];

    /// The activation of any kind of real number.
    pub fn apply<R: Real>(self, x: R) -> R {
        match self {
            Self::Gelu => x.gelu(),
            Self::Softplus => x.softplus(),
            Self::XTanh => x.x_tanh(),
            Self::Tanh => x.tanh(),
            Self::Quadratic => x.sqr(),
            Self::Identity => x,
        }
    }

    /// The name, as in configuration files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gelu => "gelu",
            Self::Softplus => "softplus",
            Self::XTanh => "x-tanh",
            Self::Tanh => "tanh",
            Self::Quadratic => "quadratic",
            Self::Identity => "identity",
        }
    }
}

impl std::fmt::Display for Activation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests;
