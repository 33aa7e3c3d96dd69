//! Ranges of parameters.

use serde::{Deserialize, Serialize};

/// Values a parameter may take, besides being finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Range {
    /// Any finite number.
    #[default]
    #[serde(rename = "any")]
    Any,
    /// Zero or more.
    #[serde(rename = "at least 0")]
    AtLeastZero,
    /// More than zero.
    #[serde(rename = "positive")]
    Positive,
}

impl Range {
    /// The condition in words.
    pub(crate) const fn text(self) -> &'static str {
        match self {
            Self::Any => "finite",
            Self::AtLeastZero => "finite and at least 0",
            Self::Positive => "finite and above 0",
        }
    }
}
