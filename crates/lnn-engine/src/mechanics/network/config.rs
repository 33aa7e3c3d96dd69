//! Shape of a network Lagrangian and its activations: one for the whole network, or one for each of several networks whose outputs are
//! added.

use super::Form;
use crate::network::Activation;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Distribution of the initial weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Initialization {
    /// Uniform in `+-1/sqrt(fan_in)`, for weights and biases.
    Default,
    /// Normal with standard deviation `gain/sqrt(fan_in)`, where `gain = 1/sqrt(E[act'(Z)^2])` and `Z` is standard normal; zero biases.
    VariancePreserving,
    /// Normal with zero biases, as in the code of Cranmer et al. (2020): standard deviation `2.2/sqrt(n)` for the first map, `0.58
    /// i/sqrt(n)` for the `i`-th after it (`i` = 1, 2, ..), `sqrt(n)` for the output, where `n` is the larger side of the map.
    Cranmer,
    /// As in Hamzaogullari and Ozakin: `0.58 i/sqrt(n)` for the `i`-th of all maps (`i` = 2, 3, ..), where `n` is the `fan_in`.
    CranmerPaper,
    /// As `Default`, with the output layer scaled by 0.01, so that initially `L` is close to `alpha |v|^2` (Liu et al. 2021).
    NearZero,
}

/// Layer between the input features and the first dense layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum InputLayer {
    /// No layer.
    #[default]
    None,
    /// Dynamic tanh, `gamma_i tanh(a x_i) + beta_i`, with learned `a`, `gamma` and `beta`, which start at 0.5, ones and zeros (Zhu et al.
    /// 2025). Every branch has a separate layer.
    Dyt,
}

impl InputLayer {
    /// Returns `true` if there is no input layer.
    pub(crate) fn is_none(&self) -> bool {
        *self == Self::None
    }
}

/// Everything that determines a network Lagrangian except its weights.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Architecture {
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Widths of the hidden layers; the paper's "4 layers of 500" is `[500, 500, 500]` and a linear output without bias. The branches of a
    /// hybrid share the widths equally.
    pub hidden: Vec<usize>,
    /// Activation of the hidden layers.
    pub activation: ActivationChoice,
    /// Coefficient of the added `|v|^2` of scaled velocities; 0 for none.
    pub alpha: f64,
    /// The coordinate whose square is subtracted in the added term: `alpha (-t'^2 + x'^2 + ..)`, the signature of a spacetime. Without it
    /// all squares are added.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub time_like: Option<usize>,
    /// Scale `s_i` of each coordinate: the inputs of the network are `q_i/s_i`, `v_i/s_i`. Ones mean no scaling.
    pub scale: Vec<f64>,
    /// Which coordinates are angles with period `2 pi`, which are wrapped before the network.
    pub periodic: Vec<bool>,
    /// `true` to use `sin q_i`, `cos q_i` of the periodic coordinates as inputs instead of `q_i/s_i`.
    pub embed_periodic: bool,
    /// Layer before the first dense one; absent in files without this key.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "InputLayer::is_none"))]
    pub input_layer: InputLayer,
    /// Number of units of the Rayleigh dissipation `D(q, v)`; without it the motion conserves its energy.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub dissipation: Option<usize>,
    /// Prior knowledge of the Lagrangian; absent in files without this key.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Form::is_default"))]
    pub form: Form,
}

/// Defines the choices from the rows of the table of activations.
macro_rules! choices {
    ($($(#[$($doc:tt)*])* $name:ident $text:literal;)*) => {
        /// Activation of the hidden layers, as chosen in a configuration.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
        #[non_exhaustive]
        pub enum ActivationChoice {
            $($(#[$($doc)*])* #[cfg_attr(feature = "serde", serde(rename = $text))] $name,)*
            /// Sum of two networks with half of the widths, one with `ln(1 + e^x)`, one with `x^2` (Liu et al. 2021).
            #[cfg_attr(feature = "serde", serde(rename = "quadratic-softplus"))]
            QuadraticSoftplus,
        }

        impl ActivationChoice {
            /// All choices.
            pub const ALL: [Self; [$($text),*].len() + 1] = [$(Self::$name,)* Self::QuadraticSoftplus];
            /// The names of all choices, separated by commas.
            pub const NAMES: &'static str = concat!($($text, ", ",)* "quadratic-softplus");

            /// Returns the activation of each branch; the branches share the widths equally.
            pub fn branches(self) -> &'static [Activation] {
                match self {
                    $(Self::$name => &[Activation::$name],)*
                    Self::QuadraticSoftplus => &[Activation::Softplus, Activation::Quadratic],
                }
            }
        }
    };
}

crate::ops::activations! { choices }

impl ActivationChoice {
    /// Returns the name in configuration files.
    pub fn name(self) -> &'static str {
        match self.branches() {
            [single] => single.name(),
            _ => "quadratic-softplus",
        }
    }
}

impl core::fmt::Display for ActivationChoice {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.pad(self.name())
    }
}

/// The error for a text that is not the name of an activation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownActivation(pub String);

impl core::fmt::Display for UnknownActivation {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self(name) = self;
        write!(f, "unknown activation `{name}`; known are {known}", known = ActivationChoice::NAMES)
    }
}

impl core::error::Error for UnknownActivation {}

impl core::str::FromStr for ActivationChoice {
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
            assert!(ActivationChoice::NAMES.split(", ").any(|name| name == choice.name()));
        }
        for unknown in ["relu", "identity"] {
            let error = unknown.parse::<ActivationChoice>().unwrap_err().to_string();
            assert!(error.contains(unknown) && error.ends_with(ActivationChoice::NAMES), "{error}");
        }
    }
}
