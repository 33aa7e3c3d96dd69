//! The network Lagrangian: a sum of multilayer perceptrons as `L(q, v)`, with optional friction, evaluated in batches.
//!
//! ```
//! use lnn::lagrangian::{EulerLagrange, Request, Terms};
//! use lnn::network::{ModelFile, NetworkLagrangian};
//!
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! // A double pendulum that was learned, beside the examples; two states of it.
//! let file = ModelFile::<f64>::load("examples/data/double_pendulum.safetensors".as_ref())?;
//! let model = NetworkLagrangian::new(file.header.architecture, file.weights)?;
//! let mut terms = Terms::default();
//! let (q, v) = ([0.5, 0.5, 1.0, -0.2], [0.1, 0.1, 0.0, 0.3]);
//! model.terms(&q, &v, Request::MASS_MATRIX | Request::ACCELERATION, &mut terms)?;
//! // L is learned up to a factor, and so is M: its elements are as 2 : cos(q1 - q2) : 1.
//! let [m11, m12, _, m22] = terms.mass_matrix[..4] else { unreachable!() };
//! assert!((m11 / m22 - 2.0).abs() < 0.1 && (m12 / m22 - 1.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod config;
mod dynamics;
#[cfg(feature = "model-files")]
#[doc(hidden)]
pub mod file;
mod joint_friction;
mod layout;
mod model;
mod recorded;
mod slopes;
mod structure;
mod thresholds;

pub use crate::ops::Activation;
pub use config::{ActivationChoice, Architecture, Initialization, InputLayer, UnknownActivation};
#[cfg(feature = "model-files")]
pub use file::{Header, ModelFile, ModelFileError, StoredPrecision};
pub use joint_friction::JointFriction;
pub(crate) use layout::{DissipationLayout, Layer};
pub use model::{NetworkError, NetworkLagrangian};
pub use structure::{Factor, Form, Radial, Sizes, Structure};
#[doc(hidden)]
pub use {
    dynamics::{Dynamics, Model},
    layout::{Layout, LinearMap},
};
