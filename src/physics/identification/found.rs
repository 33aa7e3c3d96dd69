//! What was identified.

use super::Between;
use serde::Serialize;

/// A constant of the system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Constant {
    /// Its symbol.
    pub symbol: String,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where the motion says nothing of it, whose value is then the one it started with.
    pub standard_error: Option<f64>,
    /// Its unit.
    pub unit: String,
    /// The value it started with.
    pub start: f64,
    /// `true` if it lies at the bound of its range, beyond which the data would be met better: its error is no symmetric one.
    pub at_bound: bool,
}

/// A constant of the sensor of a coordinate: measured positions are `gain (q(t - delay)) + offset`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorConstant {
    /// `"offset"`, `"gain"` or `"delay"`.
    pub kind: &'static str,
    /// The coordinate.
    pub coordinate: String,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where the motion says nothing of it.
    pub standard_error: Option<f64>,
}

/// Constants that the motion leaves open, alone or together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undetermined {
    /// The constants.
    pub constants: Vec<String>,
    /// Relative change of each along the direction that is open, the largest 1.
    pub direction: Vec<f64>,
    /// The combinations that are known nevertheless, with their values.
    pub known: Vec<(String, f64)>,
    /// Standard error along the direction, relative to the values; none where the motion does not depend on it at all.
    pub relative_error: Option<f64>,
    /// What is open, in words.
    pub text: String,
    /// What would determine it, in words.
    pub cure: String,
}

/// A sum of constants that is known though they are not: a base parameter of a robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Combination {
    /// Each constant with its factor; the first has the factor 1.
    pub terms: Vec<(String, f64)>,
    /// The value of the sum.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Unit of the sum.
    pub unit: String,
}

/// What is left of the motion of one coordinate, or of the force on it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// The coordinate.
    pub coordinate: String,
    /// Root mean square.
    pub rms: f64,
    /// Standard deviation of the noise, as given or as estimated before the fit; of forces with what the errors of accelerations come to.
    pub noise: f64,
    /// Standard deviation of what is met: of the positions, or of the forces.
    pub spread: f64,
    /// Correlation of residuals that follow each other; that of noise is 0.
    pub autocorrelation: f64,
    /// `true` if they follow each other as noise does.
    pub white: bool,
}

/// A sample far from the motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// Index of the trajectory.
    pub track: usize,
    /// Its sample, from 0.
    pub sample: usize,
    /// Its time in s.
    pub time: f64,
    /// The coordinate.
    pub coordinate: String,
    /// Residual over the usual one.
    pub size: f64,
}

/// Constants with their errors, and how far these can be trusted.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Identified {
    /// The constants that were unknown, in the order of the system.
    pub constants: Vec<Constant>,
    /// Constants of sensors.
    pub sensors: Vec<SensorConstant>,
    /// Correlations of the errors of constants, then sensors, `(m, m)`; 0 beside those without error.
    pub correlations: Vec<f64>,
    /// What the motion leaves open.
    pub undetermined: Vec<Undetermined>,
    /// Sums of constants that are known, where forces are met and are linear in the constants.
    pub combinations: Vec<Combination>,
    /// What is left, by coordinate.
    pub residuals: Vec<Residual>,
    /// Root mean square of the residuals over the noise as it was known before the fit, all coordinates together.
    pub over_noise: f64,
    /// What is to be known before all else: coordinates that stand still.
    pub obstacles: Vec<String>,
    /// `true` if the search arrived; if not, the constants are where it stopped.
    pub converged: bool,
    /// The decrease of the sum of squares that was left to gain at the end, over the variance of the noise: the Newton decrement.
    pub decrement: f64,
    /// `true` if what is left is as large as the noise and white: the form explains the motion.
    pub explained: bool,
    /// Samples far from the motion, the farthest first, 100 at most.
    pub outliers: Vec<Outlier>,
    /// Number of all of them.
    pub outlier_count: usize,
    /// Factor of the standard errors for residuals that are alike all along a segment; 1 for white ones.
    pub inflation: f64,
    /// Samples that were followed, or whose forces were met.
    pub samples: usize,
    /// Number of segments; none where forces were met.
    pub segments: usize,
    /// Length of the usual segment in s.
    pub segment_seconds: f64,
    /// Integration steps from sample to sample.
    pub substeps: usize,
    /// How known forces were taken between the samples; none without forces.
    pub between: Option<Between>,
}
