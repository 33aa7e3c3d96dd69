//! Which violations of the mass matrix's signature are penalised: everything about a penalty except its formula, which is in
//! [`linalg`](crate::linalg).

use crate::configuration::error::{ConfigError, Faults, place};
use crate::linalg::{
    LinalgError, SignatureBuffers, Violation, eigenvalue_violation, has_one_negative, has_signature,
    one_negative_violation, sylvester_violation,
};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Builds the configuration's penalties from rows `Name "name" { further fields };`, each with a weight.
macro_rules! penalties {
    ($(
        $(#[$($doc:tt)*])*
        $name:ident $text:literal { $($(#[$($field_doc:tt)*])* $field:ident: $type:ty)? };
    )*) => {
        /// Penalty of a configuration; `lambda` is its weight beside the loss (the paper tries 1 to 10,000).
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind", deny_unknown_fields)]
        #[non_exhaustive]
        pub enum Regularizer {
            /// None; neither spectrum nor minors are ever computed.
            #[default]
            #[serde(rename = "none")]
            None,
            $(
                $(#[$($doc)*])*
                #[serde(rename = $text)]
                $name {
                    /// Weight of the penalty.
                    lambda: f64,
                    $($(#[$($field_doc)*])* $field: $type,)?
                },
            )*
        }

        impl Regularizer {
            /// The names of all kinds, separated by commas.
            pub const NAMES: &'static str = concat!("none" $(, ", ", $text)*);

            /// Name of its kind.
            pub(crate) fn kind(&self) -> &'static str {
                match self {
                    Self::None => "none",
                    $(Self::$name { .. } => $text,)*
                }
            }

            /// Weight of the penalty, 0 without one.
            pub fn lambda(&self) -> f64 {
                match *self {
                    Self::None => 0.0,
                    $(Self::$name { lambda, .. } => lambda,)*
                }
            }
        }
    };
}

penalties! {
    /// Negative eigenvalues are penalised.
    ///
    /// See [`Penalty::Eigenvalue`].
    Eigenvalue "eigenvalue" {};
    /// Negative leading minors are penalised.
    ///
    /// See [`Penalty::Sylvester`], of a classical system.
    Sylvester "sylvester" {};
    /// As `sylvester`, with a time-like coordinate whose own element must be negative: not for metrics inside a horizon or an ergosphere,
    /// where it is positive.
    ///
    /// See [`Penalty::Sylvester`] for a relativistic system.
    LorentzianSylvester "lorentzian-sylvester" {
        /// Name of the time-like coordinate.
        time: String
    };
    /// Any number of negative eigenvalues but one is penalised, which every spacetime has: no coordinate is named as the time, and the inside of a horizon is right.
    ///
    /// See [`Penalty::Signature`].
    Signature "signature" {};
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
    /// positive, as inside a horizon or an ergosphere, is penalised although it is right.
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
    /// `lambda` times the batch mean of `relu(w_1) + sum_(k > 1) relu(-w_k)`, `w_1 <= w_2 <= ..` the eigenvalues of `D M D`, `D`
    /// diagonal with `(c_i + eps)^(-1/2)`, `c_i` and `eps` as for Sylvester's: one eigenvalue should be negative, all others positive.
    ///
    /// That is the signature of every metric of a spacetime, inside of a horizon and of an ergosphere too, in any coordinates; none
    /// of them is named as the time. Invariant under `M -> s M` and under new units of the coordinates, as long as the `c_i` stay
    /// above `eps`.
    Signature {
        /// Weight of the penalty.
        lambda: f64,
    },
}

impl Penalty {
    /// Weight of the penalty, 0 without one.
    pub fn lambda(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Eigenvalue { lambda } | Self::Sylvester { lambda, .. } | Self::Signature { lambda } => lambda,
        }
    }

    /// `true` if a matrix is measured by the characteristic scales of its batch.
    pub(crate) fn needs_scales(self) -> bool {
        match self {
            Self::None | Self::Eigenvalue { .. } => false,
            Self::Sylvester { .. } | Self::Signature { .. } => true,
        }
    }

    /// `true` if a matrix, `(n, n)`, clearly has no violation.
    pub(crate) fn allows<S: Scalar>(self, n: usize, matrix: &[S], buffers: &mut SignatureBuffers<S>) -> bool {
        match self {
            Self::None => true,
            Self::Eigenvalue { .. } => has_signature(n, matrix, None, buffers),
            Self::Sylvester { time, .. } => has_signature(n, matrix, time, buffers),
            Self::Signature { .. } => has_one_negative(n, matrix, buffers),
        }
    }

    /// The violation of a matrix, `(n, n)`, by the characteristic `scales` of its batch, `(n)`, if they are
    /// [needed](Self::needs_scales).
    ///
    /// # Errors
    /// A matrix that is not finite.
    pub(crate) fn violation<S: Scalar>(
        self,
        n: usize,
        matrix: &[S],
        scales: &[S],
        buffers: &mut SignatureBuffers<S>,
        found: &mut Violation<S>,
    ) -> Result<(), LinalgError> {
        match self {
            Self::None => {
                *found = Violation::default();
                Ok(())
            }
            Self::Eigenvalue { .. } => eigenvalue_violation(n, matrix, buffers, found),
            Self::Sylvester { time, .. } => sylvester_violation(n, matrix, scales, time, buffers, found),
            Self::Signature { .. } => one_negative_violation(n, matrix, scales, buffers, found),
        }
    }
}

impl Regularizer {
    /// Name of the time-like coordinate, if the penalty names one.
    pub(crate) fn time(&self) -> Option<&str> {
        match self {
            Self::LorentzianSylvester { time, .. } => Some(time),
            Self::None | Self::Eigenvalue { .. } | Self::Sylvester { .. } | Self::Signature { .. } => None,
        }
    }

    /// `true` if the penalty is against every negative eigenvalue, which a metric with a time has.
    pub(crate) fn is_classical(&self) -> bool {
        match self {
            Self::Eigenvalue { .. } | Self::Sylvester { .. } => true,
            Self::None | Self::LorentzianSylvester { .. } | Self::Signature { .. } => false,
        }
    }

    /// Faults of a penalty combined with a time-like coordinate, whose metric has a negative eigenvalue.
    pub(super) fn time_faults(&self, time: Option<&str>, faults: &mut Faults) {
        let Some(time) = time.filter(|_| self.lambda() > 0.0) else { return };
        if self.is_classical() {
            let expected = format!("{BESIDE_A_TIME} beside the time-like coordinate {time}");
            faults.check(false, "penalty.kind", expected, self.kind().to_string());
        }
        if let Some(other) = self.time() {
            let expected = format!("the time-like coordinate {time}");
            faults.check(other == time, "penalty.time", expected, other.to_string());
        }
    }

    /// The penalty for a system with these coordinates; a weight of 0 means none.
    ///
    /// # Errors
    /// A time-like coordinate that is not among them.
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
            Self::Signature { lambda } => Penalty::Signature { lambda },
        })
    }
}

/// The kinds of penalty that can be combined with a time-like coordinate.
const BESIDE_A_TIME: &str = "signature, lorentzian-sylvester or none";

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn kinds_agree_with_serde_and_come_back() {
        let of = |kind: &str, rest: serde_json::Value| {
            let mut text = rest;
            text["kind"] = kind.into();
            serde_json::from_value::<Regularizer>(text)
        };
        assert_eq!(of("none", json!({})).unwrap(), Regularizer::None);
        for kind in Regularizer::NAMES.split(", ").filter(|kind| *kind != "none") {
            let shapes = [json!({}), json!({"lambda": 2.0}), json!({"lambda": 2.0, "time": "t"})];
            let found: Vec<Regularizer> = shapes.into_iter().filter_map(|rest| of(kind, rest).ok()).collect();
            let [penalty] = &found[..] else { panic!("{kind}: {found:?}") };
            assert_eq!(penalty.kind(), kind);
            assert_eq!(serde_json::to_value(penalty).unwrap()["kind"], kind);
        }
        assert!(of("sylvster", json!({"lambda": 2.0})).is_err());
    }

    #[test]
    fn a_signature_may_stand_beside_a_time_and_alone() {
        let faults = |penalty: Regularizer| {
            let mut faults = Faults::default();
            penalty.time_faults(Some("t"), &mut faults);
            faults.0.len()
        };
        assert_eq!(faults(Regularizer::Signature { lambda: 1.0 }), 0);
        assert_eq!(faults(Regularizer::Eigenvalue { lambda: 1.0 }), 1);
        let resolved = Regularizer::Signature { lambda: 1.0 }.resolve(std::iter::empty());
        assert_eq!(resolved, Ok(Penalty::Signature { lambda: 1.0 }));
    }
}
