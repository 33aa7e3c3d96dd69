//! What was identified.

use super::by_trajectory::ByTrajectory;
use super::follow::Segment;
use super::thresholds::NEAR_DECREMENT;
use super::{Between, Verdict};
use crate::recording::{LoadedRecording, Recording};
use serde::{Serialize, Serializer};

/// A constant of the system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Constant {
    /// Its symbol.
    pub symbol: String,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where the motion does not determine it, and its value is then the starting value, and none where the search
    /// stopped farther from the best constants than their errors.
    pub standard_error: Option<f64>,
    /// Its unit.
    pub unit: String,
    /// The value it started with.
    pub start: f64,
    /// `true` if it lies at a bound of its range and the data would be fitted better beyond it: its error is then not symmetric.
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
    /// Its standard error; none where the motion does not determine it.
    pub standard_error: Option<f64>,
}

impl SensorConstant {
    /// Its kind and coordinate: `"offset of q1"`.
    pub fn name(&self) -> String {
        format!("{} of {}", self.kind, self.coordinate)
    }
}

/// Constants that the motion does not determine, alone or together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undetermined {
    /// The constants.
    pub constants: Vec<String>,
    /// Relative change of each constant along each open direction, the largest 1: `(directions, constants)`. A constant is compared with its
    /// value or its start, whichever is larger.
    pub directions: Vec<Vec<f64>>,
    /// Combinations that are nevertheless determined, each confirmed by moving the constants by a factor of two along every direction and
    /// fitting the others again.
    pub known: Vec<Combination>,
    /// Largest standard error along a direction, relative to the values; none where the motion does not depend on a direction at all.
    pub relative_error: Option<f64>,
    /// What is not determined, in words.
    pub text: String,
    /// What would determine it, in words.
    pub cure: String,
}

/// A sum or a product of powers of constants that is determined although they are not, such as a base parameter of a robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Combination {
    /// Its formula, such as `c1/(g^2*m1)` or `m1 + 0.5*m2`.
    pub name: String,
    /// `true` for a product of powers.
    pub product: bool,
    /// Each constant with its factor in a sum, or its exponent in a product; as an object in JSON.
    #[serde(serialize_with = "as_object")]
    pub terms: Vec<(String, f64)>,
    /// Its value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Its unit; empty where it has none.
    pub unit: String,
}

fn by_symbol<S: Serializer>(constants: &[Constant], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(constants.iter().map(|constant| (&constant.symbol, constant)))
}

fn in_words<S: Serializer>(verdict: &Verdict, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct InWords<'a> {
        #[serde(flatten)]
        verdict: &'a Verdict,
        says: String,
    }
    InWords { verdict, says: verdict.to_string() }.serialize(serializer)
}

fn as_object<S: Serializer>(pairs: &[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().map(|(name, x)| (name, x)))
}

/// How the inertias of a chain of links became those of bodies: positive masses and positive definite pseudo-inertias
/// `[[tr(I)/2 E - I, h], [h', m]]` (Wensing, Kim and Slotine, "Linear matrix inequalities for physically consistent inertial parameter
/// identification", 2018).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bodies {
    /// Links whose constants had to be moved, from 1.
    pub moved: Vec<usize>,
    /// Largest change of a determined sum that this causes, in standard errors of the sum.
    pub largest_change: f64,
    /// `false` if no physical bodies have the determined sums within their errors, or none have the given constants.
    pub exist: bool,
}

/// The residual of one coordinate, of its motion or of the force on it. Neighbouring force equations are averaged first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// The coordinate.
    pub coordinate: String,
    /// Root mean square.
    pub rms: f64,
    /// Standard deviation of the noise, as given or as estimated before the fit; for forces, it includes the errors of the accelerations.
    pub noise: f64,
    /// Standard deviation of the fitted quantity: the positions or the forces.
    pub spread: f64,
    /// Autocorrelation of the residuals beyond what the initial state of a segment causes; that of white noise is 0.
    pub autocorrelation: f64,
    /// `true` if the residuals are independent, tested over all lags together at a level of 1 %.
    pub white: bool,
}

/// A sample far from the motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// Index of the trajectory.
    #[serde(skip)]
    pub track: usize,
    /// Its sample, from 0.
    #[serde(skip)]
    pub sample: usize,
    /// Name of the trajectory.
    pub trajectory: String,
    /// Row of the sample in its file, or its number from 1: see [`Identified::with_rows_of`].
    pub row: u64,
    /// Its time in s.
    pub time: f64,
    /// The coordinate.
    pub coordinate: String,
    /// Residual over the typical one.
    pub size: f64,
}

/// Correlations of the errors of constants, then of sensors; 0 for those without an error.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Correlations {
    /// Symbols of the constants, and `"offset of q1"` and the like.
    pub names: Vec<String>,
    /// One row for each.
    pub matrix: Vec<Vec<f64>>,
}

/// Measured numbers and their residuals at successive samples of a trajectory: positions, or the known forces where these were fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResidualPath {
    /// Times in s, `(samples)`.
    pub times: Vec<f64>,
    /// What was measured, in SI, `(samples, n)`.
    pub measured: Vec<f64>,
    /// Measured minus fitted, in SI, `(samples, n)`; `NaN` where nothing was fitted.
    pub residuals: Vec<f64>,
}

impl ResidualPath {
    /// Positions of a segment and their residuals, which are in units of the noise: `noise` by sample of the trajectory and coordinate.
    pub(crate) fn of(
        recording: &Recording,
        segment: &Segment,
        residuals: &[f64],
        noise: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let (track, n) = (&recording.tracks[segment.track], recording.n());
        let samples = segment.first..segment.first + segment.samples;
        let own = residuals.iter().enumerate().map(|(k, r)| r * noise(segment.first + k / n, k % n));
        Self {
            times: track.times[samples.clone()].to_vec(),
            measured: track.q[samples.start * n..samples.end * n].to_vec(),
            residuals: own.collect(),
        }
    }
}

/// Constants with their standard errors, and how far these can be trusted.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Identified {
    /// The constants that were unknown, in the order of the system; in JSON an object by symbol.
    #[serde(serialize_with = "by_symbol")]
    pub constants: Vec<Constant>,
    /// Constants of sensors.
    pub sensors: Vec<SensorConstant>,
    /// How the errors are correlated.
    pub correlations: Correlations,
    /// Constants that the motion does not determine.
    pub undetermined: Vec<Undetermined>,
    /// Sums of constants that are determined, if forces are fitted and are linear in the constants.
    pub combinations: Vec<Combination>,
    /// How the inertias were made physical; none for a system that is not a chain of links.
    pub bodies: Option<Bodies>,
    /// Residuals by coordinate.
    pub residuals: Vec<Residual>,
    /// Root mean square of the residuals over the noise as it was known before the fit, all coordinates together.
    pub over_noise: f64,
    /// `true` if residuals beyond three standard deviations counted linearly.
    pub robust: bool,
    /// Obstacles to read first: coordinates that stand still, forces that are not known well enough between the samples.
    pub obstacles: Vec<String>,
    /// `true` if the search converged; if not, the constants are where it stopped.
    pub converged: bool,
    /// The Newton decrement: the decrease of the sum of squares that another step would bring, over the variance of the noise.
    pub decrement: f64,
    /// Whether the model fits the recording, and if not, why; in JSON also in words, as `says`.
    #[serde(serialize_with = "in_words")]
    pub verdict: Verdict,
    /// `true` if it does: [`Verdict::explains`].
    pub explained: bool,
    /// Samples far from the motion, the farthest first, 100 at most.
    pub outliers: Vec<Outlier>,
    /// Number of all of them.
    pub outlier_count: usize,
    /// Mean factor by which variances of the unknowns are larger than those of independent residuals of the same size.
    pub inflation: f64,
    /// Standard deviation of the noise of the known force on every coordinate, estimated from the motion; empty if none is visible.
    pub force_noise: Vec<f64>,
    /// Samples whose motion was followed, or whose forces were fitted.
    pub samples: usize,
    /// Number of segments; none if forces were fitted.
    pub segments: usize,
    /// Length of a typical segment in s.
    pub segment_seconds: f64,
    /// Integration steps from sample to sample.
    pub substeps: usize,
    /// Interpolation of known forces between the samples; none without forces.
    pub between: Option<Between>,
    /// The constants by every trajectory alone, if that was asked for.
    pub by_trajectory: Option<ByTrajectory>,
    /// What was fitted, stretch by stretch, for pictures.
    #[serde(skip)]
    pub paths: Vec<ResidualPath>,
}

impl Identified {
    /// The same with the names of trajectories; rows are samples, counted from 1. Where the search stopped far from the best constants, it says
    /// nothing of errors and of what is determined.
    pub(super) fn named(mut self, recording: &Recording, robust: bool) -> Self {
        self.robust = robust;
        if !self.converged && (self.decrement.is_nan() || self.decrement >= NEAR_DECREMENT) {
            self.constants.iter_mut().for_each(|constant| constant.standard_error = None);
            self.sensors.iter_mut().for_each(|sensor| sensor.standard_error = None);
            self.correlations.matrix.iter_mut().flatten().for_each(|correlation| *correlation = 0.0);
            self.undetermined.clear();
            self.combinations.clear();
        }
        for outlier in &mut self.outliers {
            outlier.trajectory.clone_from(&recording.tracks[outlier.track].name);
            outlier.row = outlier.sample as u64 + 1;
        }
        self
    }

    /// The same with the rows of the files that a recording was read from.
    #[must_use]
    pub fn with_rows_of(mut self, loaded: &LoadedRecording) -> Self {
        for outlier in &mut self.outliers {
            outlier.row = loaded.rows[outlier.track].row(outlier.sample);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_that_stopped_far_away_has_no_errors() {
        let stopped = |converged: bool, decrement: f64| {
            let (symbol, unit) = ("k".to_string(), "1".to_string());
            let constant =
                Constant { symbol, value: 2.0, standard_error: Some(0.1), unit, start: 1.0, at_bound: false };
            let found = Identified { constants: vec![constant], converged, decrement, ..Identified::default() };
            let recording = Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: Vec::new() };
            found.named(&recording, false).constants[0].standard_error
        };
        assert_eq!([stopped(true, 1e-9), stopped(false, 0.01)], [Some(0.1); 2]);
        assert_eq!([stopped(false, 46.0), stopped(false, f64::NAN)], [None; 2]);
    }
}
