//! Errors of the search for a formula.

use crate::cancellation::Cancelled;
use crate::recording::LoadedRecording;
use crate::recording::smooth::SmoothError;
use thiserror::Error;

/// Why no formula could be sought.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FormulaError {
    /// The search was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Too many coordinates, or none.
    #[error("expected 1 to {most} coordinates, found {found}")]
    Coordinates {
        /// Number found.
        found: usize,
        /// Largest number.
        most: usize,
    },
    /// A library that is too large.
    #[error("the library has {found} terms, at most {most} are searched: choose a smaller basis")]
    Terms {
        /// Terms found.
        found: usize,
        /// Largest number.
        most: usize,
    },
    /// An invalid function of the user.
    #[error("function {text:?}: {problem}")]
    Function {
        /// The function.
        text: String,
        /// Description of the error.
        problem: String,
    },
    /// Another number of standard deviations of the noise than of coordinates.
    #[error("noise: expected {expected} numbers, found {found}")]
    Noise {
        /// Number of coordinates.
        expected: usize,
        /// Number of standard deviations.
        found: usize,
    },
    /// A term that gives the scale but is not in the formula.
    #[error("scale: {term:?} is no term of the formula; its terms are {known}")]
    Scale {
        /// The term.
        term: String,
        /// Terms of the formula.
        known: String,
    },
    /// A coordinate that does not move, or follows from others.
    #[error("no law can be found in this motion: {coordinate} {how}; leave the coordinate out")]
    Still {
        /// The coordinate.
        coordinate: String,
        /// Description of how the coordinate stays constant.
        how: String,
    },
    /// A coordinate that keeps its value except for a few large steps.
    #[error(
        "no law can be found in this motion: {coordinate} moves in steps, it keeps its value over {still} of {steps} intervals and jumps in others"
    )]
    Steps {
        /// The coordinate.
        coordinate: String,
        /// Intervals without any motion.
        still: usize,
        /// All intervals.
        steps: usize,
    },
    /// Rows that do not belong to the motion.
    #[error(
        "{coordinate} is {value:.4e} at t = {time} (sample {} of trajectory {}), {} by {size:.3e} where its motion has a range of {range:.3e}; {}",
        sample + 1, if trajectory.is_empty() { (track + 1).to_string() } else { trajectory.clone() }, if *jumps { "it jumps there" } else { "it is off" },
        if *places == 1 { "remove or correct the row".to_string() } else { format!("remove or correct such rows, there are {places}") }
    )]
    Wild {
        /// The coordinate.
        coordinate: String,
        /// The trajectory, from 0.
        track: usize,
        /// The sample, from 0.
        sample: usize,
        /// Name of the trajectory.
        trajectory: String,
        /// Time of the sample.
        time: f64,
        /// Value there.
        value: f64,
        /// `true` if all later values are shifted, `false` for a single one.
        jumps: bool,
        /// Size of the deviation.
        size: f64,
        /// Range of all but one sample in fifty.
        range: f64,
        /// Number of such rows.
        places: usize,
    },
    /// Motion under a constraint.
    #[error(
        "the coordinates are not independent: the motion satisfies {}, so that their Lagrangian is not determined; leave coordinates out or \
         choose others (lnn constraints lists the constraints, lnn fit --constraints find learns with them)",
        formulas.iter().map(|formula| format!("{formula} = 0")).collect::<Vec<_>>().join(" and ")
    )]
    Constrained {
        /// Formulas that vanish along the motion.
        formulas: Vec<String>,
    },
    /// Every choice of terms has a singular mass matrix.
    #[error(
        "every formula that fits the motion has a nearly singular mass matrix: the library contains no law for it, try another basis"
    )]
    Singular,
    /// The motion cannot be smoothed.
    #[error(transparent)]
    Smooth(#[from] SmoothError),
    /// Too little motion.
    #[error("expected at least {needed} consecutive samples, the longest trajectory has {found}")]
    Short {
        /// Samples of the longest trajectory.
        found: usize,
        /// Least number.
        needed: usize,
    },
    /// Too few segments in which the motion changes.
    #[error(
        "the recording has fewer than two segments of {seconds:.3} s without a long gap: record longer, or at a higher rate"
    )]
    Stretches {
        /// Their length.
        seconds: f64,
    },
    /// A model's terms are not finite at any state.
    #[error("the terms of the model are not finite at {failed} of {states} states")]
    NotFinite {
        /// States where they are not.
        failed: usize,
        /// All states.
        states: usize,
    },
}

impl FormulaError {
    /// The field of [`FormulaOptions`](super::FormulaOptions) with a value that cannot be used, such as `scale`; `None` if the motion
    /// or the model is at fault.
    pub fn option(&self) -> Option<&'static str> {
        match self {
            Self::Terms { .. } => Some("families"),
            Self::Function { .. } => Some("functions"),
            Self::Noise { .. } => Some("noise"),
            Self::Scale { .. } => Some("scale"),
            _ => None,
        }
    }

    /// The row of the first sample that does not belong to the motion, in the files of the recording; `None` for other errors.
    pub fn row(&self, loaded: &LoadedRecording) -> Option<u64> {
        match self {
            Self::Wild { track, sample, .. } => Some(loaded.rows[*track].row(*sample)),
            _ => None,
        }
    }
}
