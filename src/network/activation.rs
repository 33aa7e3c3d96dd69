//! Activation functions and their derivatives.

use serde::{Deserialize, Serialize};

/// Activation function of the hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
