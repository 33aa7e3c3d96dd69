//! Shape of a network Lagrangian.

use super::Activation;
use serde::{Deserialize, Serialize};

/// Distribution of the initial weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Initialization {
    /// Uniform in `+-1/sqrt(fan_in)`, weights and biases.
    Default,
    /// Normal, `gain/sqrt(fan_in)` with `gain = 1/sqrt(E[act'(Z)^2])`, `Z` standard normal; zero biases.
    VariancePreserving,
    /// Normal, `v_i/sqrt(fan_in)` with `v_1 = 2.2`, `v_i = 0.58 i`, last `fan_in` (Cranmer et al. 2020); zero biases.
    Cranmer,
}

/// Everything that determines a network Lagrangian but its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Architecture {
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Widths of the hidden layers; the paper's "4 layers of 500" is `[500, 500, 500]` and a linear output without bias.
    pub hidden: Vec<usize>,
    /// Activation of the hidden layers.
    pub activation: Activation,
    /// Factor of the added `|v|^2` of scaled velocities; 0 leaves it out.
    pub alpha: f64,
    /// Scale `s_i` of each coordinate: the network sees `q_i/s_i`, `v_i/s_i`. Ones: no scaling.
    pub scale: Vec<f64>,
    /// Which coordinates are angles with period `2 pi` (wrapped before the network sees them).
    pub periodic: Vec<bool>,
    /// Feed `sin q_i`, `cos q_i` of the periodic coordinates instead of `q_i/s_i`.
    pub embed_periodic: bool,
}
