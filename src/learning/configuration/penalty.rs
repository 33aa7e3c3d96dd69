//! Which violations of the mass matrix's signature are penalised.

use crate::configuration::error::{ConfigError, Faults, place};
use serde::{Deserialize, Serialize};

/// Regularizer of a configuration; `lambda` is its weight beside the loss (the paper tries 1 to 10,000).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
#[non_exhaustive]
pub enum Regularizer {
    /// None; neither spectrum nor minors are ever computed.
    #[default]
    None,
    /// [`Penalty::Eigenvalue`].
    Eigenvalue {
        /// Weight of the penalty.
        lambda: f64,
    },
    /// [`Penalty::Sylvester`] of a classical system.
    Sylvester {
        /// Weight of the penalty.
        lambda: f64,
    },
    /// [`Penalty::Sylvester`] of a relativistic system: it asks for a negative element of the time, which a metric has not inside of
    /// a horizon or of an ergosphere.
    LorentzianSylvester {
        /// Weight of the penalty.
        lambda: f64,
        /// Name of the time-like coordinate.
        time: String,
    },
}

/// A penalty on scaled mass matrices `M`, `(batch, n, n)`; formulas in Hamzaogullari and Ozakin, "Hessian Regularization".
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Penalty {
    /// Nothing.
    #[default]
    None,
    /// `lambda` times the batch mean of `sum_i relu(-eigenvalue_i)`. Scales with `M`.
    Eigenvalue {
        /// Weight of the penalty.
        lambda: f64,
    },
    /// `lambda` times the batch mean of `sum_k relu(-det M_k) / (s_k + eps)`, `M_k` the leading `k` by `k` block,
    /// `s_k = c_1 .. c_k`, `c_i` the lower median of `|M_ii|` over the batch, a constant for the gradient, `eps` 1e-8.
    ///
    /// With a time-like coordinate: the same sum over the block without it, plus `relu(M_tt) / (c_t + eps)`. A metric whose `g_tt` is
    /// positive, as inside of a horizon or of an ergosphere, is penalised for being right there.
    ///
    /// Invariant under `M -> s M` as long as `s_k` stays above `eps`. Where `s_k` falls below it, as after a learned
    /// Lagrangian shrank, the penalty fades with `s_k / eps` and at last no longer acts: the eigenvalue penalty or the
    /// term `alpha |v|^2` guards against that. `s_k` itself neither overflows nor underflows.
    Sylvester {
        /// Weight of the penalty.
        lambda: f64,
        /// The coordinate whose sign is reversed.
        time: Option<usize>,
    },
}

impl Penalty {
    /// Weight of the penalty, 0 without one.
    pub fn lambda(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Eigenvalue { lambda } | Self::Sylvester { lambda, .. } => lambda,
        }
    }
}

impl Regularizer {
    /// Weight of the penalty, 0 without one.
    pub fn lambda(&self) -> f64 {
        match *self {
            Self::None => 0.0,
            Self::Eigenvalue { lambda } | Self::Sylvester { lambda } | Self::LorentzianSylvester { lambda, .. } => {
                lambda
            }
        }
    }

    /// Faults of a penalty beside a time-like coordinate, whose metric has a negative eigenvalue.
    pub(super) fn time_faults(&self, time: Option<&str>, faults: &mut Faults) {
        let Some(time) = time.filter(|_| self.lambda() > 0.0) else { return };
        match self {
            Self::None => {}
            Self::Eigenvalue { .. } | Self::Sylvester { .. } => {
                let kind = if matches!(self, Self::Sylvester { .. }) { "sylvester" } else { "eigenvalue" };
                let expected = format!("lorentzian-sylvester or none beside the time-like coordinate {time}");
                faults.check(false, "penalty.kind", expected, kind.to_string());
            }
            Self::LorentzianSylvester { time: other, .. } => {
                faults.check(other == time, "penalty.time", format!("the time-like coordinate {time}"), other.clone());
            }
        }
    }

    /// The penalty for a system with these coordinates; a weight of 0 is none.
    ///
    /// # Errors
    /// A time-like coordinate that is none of them.
    pub(crate) fn resolve<'a>(&self, coordinates: impl Iterator<Item = &'a str>) -> Result<Penalty, ConfigError> {
        Ok(match *self {
            _ if self.lambda() == 0.0 => Penalty::None,
            Self::None => Penalty::None,
            Self::Eigenvalue { lambda } => Penalty::Eigenvalue { lambda },
            Self::Sylvester { lambda } => Penalty::Sylvester { lambda, time: None },
            Self::LorentzianSylvester { lambda, ref time } => {
                let index = place("penalty.time", time, coordinates)?;
                Penalty::Sylvester { lambda, time: Some(index) }
            }
        })
    }
}
