//! Penalties on mass matrices with unphysical signatures.

use serde::{Deserialize, Serialize};

/// Which violations of the mass matrix's signature are penalised, and how much.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum Penalty {
    /// Nothing; the spectrum is never computed.
    #[default]
    None,
    /// `lambda` times the batch mean of `sum_i relu(-eigenvalue_i)` of the scaled mass matrix.
    Eigenvalue {
        /// Weight of the penalty beside the loss.
        lambda: f64,
    },
}
