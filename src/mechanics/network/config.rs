//! Shape of a network Lagrangian.

use super::{ActivationChoice, Form};
use serde::{Deserialize, Serialize};

/// Distribution of the initial weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Initialization {
    /// Uniform in `+-1/sqrt(fan_in)`, weights and biases.
    Default,
    /// Normal, `gain/sqrt(fan_in)` with `gain = 1/sqrt(E[act'(Z)^2])`, `Z` standard normal; zero biases.
    VariancePreserving,
    /// Normal, zero biases; as the code of Cranmer et al. (2020) has it: `2.2/sqrt(n)` for the first map, `0.58 i/sqrt(n)` for
    /// the `i`-th after it (`i` = 1, 2, ..), `sqrt(n)` for the output, `n` the larger side of the map.
    Cranmer,
    /// The same as Hamzaogullari and Ozakin have it: `0.58 i/sqrt(n)` for the `i`-th map of all (`i` = 2, 3, ..), `n` the
    /// `fan_in`.
    CranmerPaper,
    /// As `Default`, the output layer scaled by 0.01, so that `L` starts as `alpha |v|^2` (Liu et al. 2021).
    NearZero,
}

/// Layer between the input features and the first dense layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum InputLayer {
    /// Nothing.
    #[default]
    None,
    /// Dynamic tanh, `gamma_i tanh(a x_i) + beta_i`, with learned `a`, initially 0.5, `gamma`, ones, and `beta`, zeros
    /// (Zhu et al. 2025). Every branch has its own.
    Dyt,
}

impl InputLayer {
    /// `true` if there is none.
    pub(crate) fn is_none(&self) -> bool {
        *self == Self::None
    }
}

/// Everything that determines a network Lagrangian but its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Architecture {
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Widths of the hidden layers; the paper's "4 layers of 500" is `[500, 500, 500]` and a linear output without bias.
    /// The branches of a hybrid share them equally.
    pub hidden: Vec<usize>,
    /// Activation of the hidden layers.
    pub activation: ActivationChoice,
    /// Factor of the added `|v|^2` of scaled velocities; 0 leaves it out.
    pub alpha: f64,
    /// The coordinate whose square counts negative in the added term: `alpha (-t'^2 + x'^2 + ..)`, the signature of a
    /// spacetime. Without it all squares are added.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_like: Option<usize>,
    /// Scale `s_i` of each coordinate: the network sees `q_i/s_i`, `v_i/s_i`. Ones: no scaling.
    pub scale: Vec<f64>,
    /// Which coordinates are angles with period `2 pi` (wrapped before the network sees them).
    pub periodic: Vec<bool>,
    /// Feed `sin q_i`, `cos q_i` of the periodic coordinates instead of `q_i/s_i`.
    pub embed_periodic: bool,
    /// Layer before the first dense one; files without this key have none.
    #[serde(default, skip_serializing_if = "InputLayer::is_none")]
    pub input_layer: InputLayer,
    /// Units of the Rayleigh dissipation `D(q, v)` beside `L`; without it the motion
    /// keeps its energy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dissipation: Option<usize>,
    /// Knowledge of the Lagrangian beforehand; files without this key have none.
    #[serde(default, skip_serializing_if = "Form::is_default")]
    pub form: Form,
}
