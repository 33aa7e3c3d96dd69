//! Number types of files.

use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Number type of stored numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StoredPrecision {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl StoredPrecision {
    /// That of a number type, if files know it.
    pub(crate) fn of<S: Scalar>() -> Option<Self> {
        [Self::F32, Self::F64].into_iter().find(|precision| precision.name() == S::NAME)
    }
    /// `"f32"` or `"f64"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}
