//! The choice of activations: one for the whole network, or one for each of several networks that add up.

use crate::network::Activation;
use serde::{Deserialize, Serialize};

/// Builds the choice from the rows of the table of activations.
macro_rules! choices {
    ($($(#[$($doc:tt)*])* $name:ident $text:literal;)*) => {
        /// Activation of the hidden layers, as a configuration chooses it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum ActivationChoice {
            $($(#[$($doc)*])* #[serde(rename = $text)] $name,)*
            /// Two networks of half the widths added up, one with `ln(1 + e^x)`, one with `x^2` (Liu et al. 2021).
            #[serde(rename = "quadratic-softplus")]
            QuadraticSoftplus,
        }

        impl ActivationChoice {
            /// Every choice.
            pub const ALL: [Self; [$($text),*].len() + 1] = [$(Self::$name,)* Self::QuadraticSoftplus];
            /// The names of all choices, separated by commas.
            pub const NAMES: &'static str = concat!($($text, ", ",)* "quadratic-softplus");

            /// Activation of each branch; the branches share the widths equally.
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
#[error("unknown activation `{0}`; known are {known}", known = ActivationChoice::NAMES)]
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
            assert!(ActivationChoice::NAMES.split(", ").any(|name| name == choice.name()));
        }
        for unknown in ["relu", "identity"] {
            let error = unknown.parse::<ActivationChoice>().unwrap_err().to_string();
            assert!(error.contains(unknown) && error.ends_with(ActivationChoice::NAMES), "{error}");
        }
    }
}
