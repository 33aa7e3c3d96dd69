//! What may be said of the form.

use crate::names::rounded;
use serde::Serialize;
use std::fmt::{Display, Formatter, Result};

/// Whether the form explains what was measured, and why not.
///
/// A form explains a recording if all of this holds; the first that does not is named:
/// the search has converged; residuals are below half of the motion; they are as large as the noise; at most one sample in a hundred lies far
/// from the motion; residuals do not follow from the earlier ones; segments of the motion agree about the constants, and every second one can start
/// where the one before it ends.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Verdict {
    /// Residuals are consistent with the noise.
    Explained,
    /// Residuals are as small as integration and rounding let them be.
    Exact,
    /// The search ended before the best constants were reached.
    #[default]
    NotConverged,
    /// The noise is half of what is met or more.
    Uninformative {
        /// The coordinate.
        coordinate: String,
        /// Residual over the spread of what is met.
        share: f64,
    },
    /// Residuals are larger than the noise.
    Large {
        /// The coordinate.
        coordinate: String,
        /// Residual over the noise.
        over_noise: f64,
        /// Residual over the spread of what is met.
        share: f64,
    },
    /// Too many samples are far from the motion.
    Outliers {
        /// Their share.
        share: f64,
    },
    /// Residuals follow from the earlier ones.
    Correlated {
        /// The coordinate.
        coordinate: String,
        /// Probability that independent noise is as correlated by chance.
        probability: f64,
        /// Residual over the spread of what is met.
        share: f64,
    },
    /// Parts of the recording ask for different constants.
    Disagreement {
        /// Probability that noise makes them differ as much.
        probability: f64,
    },
    /// Parts of the recording do not continue each other.
    Discontinuous {
        /// Probability that noise makes their ends and starts differ as much.
        probability: f64,
        /// Their usual length in s.
        seconds: f64,
    },
}

impl Verdict {
    /// `true` if the form explains what was measured.
    pub fn explains(&self) -> bool {
        matches!(self, Self::Explained | Self::Exact)
    }
}

impl Display for Verdict {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let percent = |share: f64| format!("{} %", rounded(100.0 * share, 2));
        if !self.explains() && !matches!(self, Self::Uninformative { .. }) {
            f.write_str("The model does not explain what was measured: ")?;
        }
        match self {
            Self::Explained => f.write_str("The model fits: the residuals are consistent with the noise."),
            Self::Exact => f.write_str("The model fits: the residuals are exact to the precision of the integration."),
            Self::NotConverged => f.write_str("the search has not converged."),
            Self::Uninformative { coordinate, share } => write!(
                f,
                "These data tell nothing of the model: the residual of {coordinate}, {} of its spread, is noise.",
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
                "the residuals of {coordinate}, {} of the spread, are correlated over time (probability by chance {}): \
                 a term is missing, or the noise itself is correlated.",
                percent(*share),
                rounded(*probability, 2)
            ),
            Self::Disagreement { probability } => write!(
                f,
                "parts of the recording ask for different constants (probability by chance {}).",
                rounded(*probability, 2)
            ),
            Self::Discontinuous { probability, seconds } => write!(
                f,
                "motion is followed over {} s each, but not on from there (probability by chance {}): \
                 a slow term is missing, or the noise itself is slow.",
                rounded(*seconds, 2),
                rounded(*probability, 2)
            ),
        }
    }
}
