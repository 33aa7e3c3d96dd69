//! Activation functions and their derivatives.

mod formula;
mod gain;
mod jets;

use crate::scalar::Real;
use serde::{Deserialize, Serialize};

/// Activation function of the hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
}

impl Activation {
    /// Every activation.
    pub const ALL: [Self; 5] = [Self::Gelu, Self::Softplus, Self::XTanh, Self::Tanh, Self::Quadratic];

    /// The activation of any kind of real number: the reference that nested derivatives go through.
    pub fn apply<R: Real>(self, x: R) -> R {
        match self {
            Self::Gelu => {
                let inverse_sqrt_two = R::constant(Real::sqrt(<R::Scalar as Real>::half()));
                x * (-x * inverse_sqrt_two).erfc() * R::half()
            }
            Self::Softplus => x.softplus(),
            Self::XTanh => x * (x * R::half()).tanh(),
            Self::Tanh => x.tanh(),
            Self::Quadratic => x.sqr(),
        }
    }

    /// The name in configuration files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gelu => "gelu",
            Self::Softplus => "softplus",
            Self::XTanh => "x-tanh",
            Self::Tanh => "tanh",
            Self::Quadratic => "quadratic",
        }
    }
}

impl std::fmt::Display for Activation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// A text that names no activation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown activation `{0}`; known are gelu, softplus, x-tanh, tanh, quadratic")]
pub struct UnknownActivation(pub String);

impl std::str::FromStr for Activation {
    type Err = UnknownActivation;

    fn from_str(text: &str) -> Result<Self, UnknownActivation> {
        Self::ALL.into_iter().find(|a| a.name() == text).ok_or_else(|| UnknownActivation(text.to_owned()))
    }
}

#[cfg(test)]
mod tests;
