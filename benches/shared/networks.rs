//! The network that speed is measured on.

use lnn::network::{ActivationChoice, Architecture, Form, InputLayer};

/// Scale of every coordinate.
pub const SCALE: f64 = 10.0;

/// Three hidden layers, the paper's "4 layers", of GELU units, and `alpha |v/s|^2`: with `alpha = 1` and the default weights
/// all mass matrices are positive definite.
pub fn architecture(n: usize, width: usize, alpha: f64) -> Architecture {
    Architecture {
        coordinates: n,
        hidden: vec![width; 3],
        activation: ActivationChoice::Gelu,
        alpha,
        time_like: None,
        scale: vec![SCALE; n],
        periodic: vec![false; n],
        embed_periodic: false,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    }
}
