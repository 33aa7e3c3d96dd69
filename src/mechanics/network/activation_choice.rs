//! The choice of activations: one for the whole network, or one for each of several networks that add up.

use crate::network::Activation;
use serde::{Deserialize, Serialize};

/// Activation of the hidden layers, as a configuration chooses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ActivationChoice {
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
    /// Two networks of half the widths added up, one with `ln(1 + e^x)`, one with `x^2` (Liu et al. 2021).
    QuadraticSoftplus,
}

impl ActivationChoice {
    /// Every choice.
    pub const ALL: [Self; 6] =
        [Self::Gelu, Self::Softplus, Self::XTanh, Self::Tanh, Self::Quadratic, Self::QuadraticSoftplus];

    /// Activation of each branch; the branches share the widths equally.
    pub fn branches(self) -> &'static [Activation] {
        match self {
            Self::Gelu => &[Activation::Gelu],
            Self::Softplus => &[Activation::Softplus],
            Self::XTanh => &[Activation::XTanh],
            Self::Tanh => &[Activation::Tanh],
            Self::Quadratic => &[Activation::Quadratic],
            Self::QuadraticSoftplus => &[Activation::Softplus, Activation::Quadratic],
        }
    }

    /// The name in configuration files.
    pub fn name(self) -> &'static str {
        match self.branches() {
            [single] => single.name(),
            _ => "quadratic-softplus",
        }
    }
}

impl std::fmt::Display for ActivationChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// A text that names no activation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown activation `{0}`; known are {known}", known = ActivationChoice::ALL.map(ActivationChoice::name).join(", "))]
pub struct UnknownActivation(pub String);

impl std::str::FromStr for ActivationChoice {
    type Err = UnknownActivation;

    fn from_str(text: &str) -> Result<Self, UnknownActivation> {
        Self::ALL.into_iter().find(|a| a.name() == text).ok_or_else(|| UnknownActivation(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_agree_with_serde() {
        for choice in ActivationChoice::ALL {
            assert_eq!(serde_json::to_string(&choice).unwrap(), format!("\"{choice}\""));
            assert_eq!(choice.to_string().parse::<ActivationChoice>(), Ok(choice));
        }
        for unknown in ["relu", "identity"] {
            let error = unknown.parse::<ActivationChoice>().unwrap_err().to_string();
            assert!(error.contains(unknown) && error.ends_with("quadratic, quadratic-softplus"), "{error}");
        }
    }
}
