//! Verdicts about the model.

use crate::names::rounded;
use serde::Serialize;
use std::fmt::{Display, Formatter, Result};

/// Whether the model fits the recording, and if not, why.
///
/// A model fits a recording if all of the following conditions hold. The verdict names the first one that fails: the search has converged;
/// residuals are below half of the spread and consistent with the noise; at most one sample in a hundred is an outlier; residuals are not
/// correlated over time; segments agree about the constants; and every second segment can start where the previous one ends.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Verdict {
    /// Residuals are consistent with the noise.
    Explained,
    /// Residuals are as small as the accuracy of the integration.
    Exact,
    /// The search ended before it reached the best constants.
    #[default]
    NotConverged,
    /// The noise is at least half of the fitted quantity.
    Uninformative {
        /// The coordinate.
        coordinate: String,
        /// Residual over the spread of the fitted quantity.
        share: f64,
    },
    /// Residuals are larger than the noise.
    Large {
        /// The coordinate.
        coordinate: String,
        /// Residual over the noise.
        over_noise: f64,
        /// Residual over the spread of the fitted quantity.
        share: f64,
    },
    /// Too many samples are far from the motion.
    Outliers {
        /// Their share.
        share: f64,
    },
    /// Residuals are correlated over time.
    Correlated {
        /// The coordinate.
        coordinate: String,
        /// p-value: probability that independent noise is at least as correlated.
        probability: f64,
        /// Residual over the spread of the fitted quantity.
        share: f64,
    },
    /// Segments disagree about the constants.
    Disagreement {
        /// p-value: probability that noise makes them differ at least as much.
        probability: f64,
    },
    /// Segments do not continue each other.
    Discontinuous {
        /// p-value: probability that noise causes discontinuities at least as large.
        probability: f64,
        /// Their typical length in s.
        seconds: f64,
    },
}

impl Verdict {
    /// `true` if the model fits the recording.
    pub fn explains(&self) -> bool {
        matches!(self, Self::Explained | Self::Exact)
    }
}

impl Display for Verdict {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let percent = |share: f64| format!("{} %", rounded(100.0 * share, 2));
        if !self.explains() && !matches!(self, Self::Uninformative { .. }) {
            f.write_str("The model does not fit: ")?;
        }
        match self {
            Self::Explained => f.write_str("The model fits: the residuals are consistent with the noise."),
            Self::Exact => f.write_str("The model fits: the residuals are exact to the precision of the integration, which the standard errors do not include."),
            Self::NotConverged => f.write_str("the search has not converged."),
            Self::Uninformative { coordinate, share } => write!(
                f,
                "These data cannot test the model: the noise of {coordinate} is {} of its spread.",
                percent(*share)
            ),
            Self::Large { coordinate, over_noise, share } => write!(
                f,
                "the residual of {coordinate} is {} times the noise, {} of the spread.",
                rounded(*over_noise, 2),
                percent(*share)
            ),
            Self::Outliers { share } => write!(f, "{} of the samples lie far from the model.", percent(*share)),
            Self::Correlated { coordinate, probability, share } => write!(
                f,
                "the residuals of {coordinate}, {} of the spread, are correlated over time (p-value {}): \
                 a term is missing, or the noise itself is correlated.",
                percent(*share),
                rounded(*probability, 2)
            ),
            Self::Disagreement { probability } => {
                write!(f, "the segments disagree about the constants (p-value {}).", rounded(*probability, 2))
            }
            Self::Discontinuous { probability, seconds } => write!(
                f,
                "the model fits segments of {} s, but these do not continue each other (p-value {}): \
                 a slowly acting term is missing, or the noise varies slowly.",
                rounded(*seconds, 2),
                rounded(*probability, 2)
            ),
        }
    }
}
