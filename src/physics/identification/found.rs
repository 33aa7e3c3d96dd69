//! The result of an identification.

use super::by_trajectory::ByTrajectory;
use super::driven::Segment;
use super::thresholds::NEAR_DECREMENT;
use super::{Between, Verdict};
use crate::lagrangian::SystemInstance;
use crate::recording::{LoadedRecording, Recording};
use serde::{Serialize, Serializer};

/// A constant of the system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Constant {
    /// Its symbol.
    pub symbol: String,
    /// Its value.
    pub value: f64,
    /// Its standard error. `None` if the motion does not determine it, and its value is then the starting value; also if the search stopped farther
    /// from the best constants than their errors.
    pub standard_error: Option<f64>,
    /// Its unit.
    pub unit: String,
    /// The value it started with.
    pub start: f64,
    /// `true` if it lies at a bound of its range and the fit would be better beyond it. Its error is then not symmetric.
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
    /// Its standard error; `None` if the motion does not determine it.
    pub standard_error: Option<f64>,
}

impl SensorConstant {
    /// Its kind and coordinate, such as `"offset of q1"`.
    pub fn name(&self) -> String {
        format!("{} of {}", self.kind, self.coordinate)
    }
}

/// Constants that the motion does not determine individually.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undetermined {
    /// The constants.
    pub constants: Vec<String>,
    /// Relative change of each constant along each direction that the motion leaves open, `(directions, constants)`; the largest is 1. Changes are
    /// relative to the value or the start of a constant, whichever is larger.
    pub directions: Vec<Vec<f64>>,
    /// Combinations that are determined nevertheless. Each is confirmed by moving the constants by a factor of two along every direction and
    /// fitting the others again.
    pub known: Vec<Combination>,
    /// Largest standard error along a direction, relative to the values; `None` if the motion does not depend on a direction at all.
    pub relative_error: Option<f64>,
    /// Describes what is not determined.
    pub text: String,
    /// Advice on how to determine it.
    pub advice: String,
}

/// A sum, or a product of powers, that is determined although its constants are not, such as a base parameter of a robot.
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
    /// Its unit; empty if it has none.
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

/// How the inertias of a chain of links were made physical, with positive masses and positive definite pseudo-inertias
/// `[[tr(I)/2 E - I, h], [h', m]]` (Wensing, Kim and Slotine, "Linear matrix inequalities for physically consistent inertial parameter
/// identification", 2018).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bodies {
    /// Links whose constants had to be changed, counted from 1.
    pub moved: Vec<usize>,
    /// Largest resulting change of a determined sum, in its standard errors.
    pub largest_change: f64,
    /// `false` if no rigid bodies match the determined sums within their errors, or the given constants.
    pub exist: bool,
}

/// The residual of one coordinate: of its position, or of the force on it, averaged over neighbouring samples.
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
    /// Autocorrelation of the innovations at lag 1; that of white noise is 0. Innovations are residuals minus their prediction from earlier ones,
    /// so that fitted initial states do not correlate them.
    pub autocorrelation: f64,
    /// `true` if a joint test over 20 lags finds no autocorrelation at the level of 1 %.
    pub white: bool,
}

/// A sample far from the fitted motion.
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
    /// Its residual over the typical one.
    pub size: f64,
}

/// Correlations of the errors of constants, then of sensor constants; 0 for those without a standard error.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Correlations {
    /// Symbols of the constants, and `"offset of q1"` and the like.
    pub names: Vec<String>,
    /// The matrix, one row for each name.
    pub matrix: Vec<Vec<f64>>,
}

/// Measured positions, or known forces if these were fitted, with their residuals at successive samples of a trajectory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResidualPath {
    /// Times in s, `(samples)`.
    pub times: Vec<f64>,
    /// Measured values in SI units, `(samples, n)`.
    pub measured: Vec<f64>,
    /// Measured minus fitted values in SI units, `(samples, n)`; `NaN` at missing readings.
    pub residuals: Vec<f64>,
}

impl ResidualPath {
    /// From the residuals of a segment in units of the noise; `noise` gives this by sample of the trajectory and coordinate.
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

/// Identified constants with their standard errors, and the verdict on the model.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Identified {
    /// The constants that were unknown, in the order of the system; in JSON an object by symbol.
    #[serde(serialize_with = "by_symbol")]
    pub constants: Vec<Constant>,
    /// Constants of sensors.
    pub sensors: Vec<SensorConstant>,
    /// Correlations of the errors.
    pub correlations: Correlations,
    /// Constants that the motion does not determine.
    pub undetermined: Vec<Undetermined>,
    /// Determined sums of constants, if forces are fitted that are linear in the constants.
    pub combinations: Vec<Combination>,
    /// How the inertias were made physical; `None` for a system that is not a chain of links.
    pub bodies: Option<Bodies>,
    /// Residuals by coordinate.
    pub residuals: Vec<Residual>,
    /// Root mean square over all coordinates of the residual over the noise, as given or as estimated before the fit.
    pub over_noise: f64,
    /// `true` if the fit was robust: residuals beyond three standard deviations counted linearly.
    pub robust: bool,
    /// Messages about the data: coordinates that stand still, repeated or missing readings, forces that the interpolation leaves uncertain.
    pub obstacles: Vec<String>,
    /// `true` if the search converged; otherwise, the constants are those at which it stopped.
    pub converged: bool,
    /// The Newton decrement: the decrease of the sum of squares that another step would bring, over the variance of the noise.
    pub decrement: f64,
    /// Whether the model fits the recording, and if not, why; JSON also has the text, as `says`.
    #[serde(serialize_with = "in_words")]
    pub verdict: Verdict,
    /// `true` if the model fits: [`Verdict::explains`].
    pub explained: bool,
    /// Samples far from the fitted motion, the farthest first, at most 100.
    pub outliers: Vec<Outlier>,
    /// Number of all samples far from the fitted motion.
    pub outlier_count: usize,
    /// Mean factor by which the variances of the unknowns exceed those of independent residuals of the same size.
    pub inflation: f64,
    /// Standard deviation of the noise of the known force on every coordinate, estimated from the motion; empty if no noise is detected.
    pub force_noise: Vec<f64>,
    /// Number of samples whose motion or forces were fitted.
    pub samples: usize,
    /// Number of segments; 0 if forces were fitted.
    pub segments: usize,
    /// Length of a typical segment in s.
    pub segment_seconds: f64,
    /// Number of integration steps between samples.
    pub substeps: usize,
    /// Interpolation of known forces and inputs between the samples; `None` without them.
    pub between: Option<Between>,
    /// The constants of every trajectory alone, if requested.
    pub by_trajectory: Option<ByTrajectory>,
    /// The fitted quantity with its residuals, by segment, for figures.
    #[serde(skip)]
    pub paths: Vec<ResidualPath>,
}

impl Identified {
    /// Adds the names of trajectories, and rows as samples counted from 1. If the search stopped far from the best constants, removes the standard
    /// errors and all statements about what is determined.
    pub(super) fn finished(mut self, recording: &Recording, robust: bool) -> Self {
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

    /// Values of all parameters of the system, by symbol and in its order: the identified values of constants that were unknown,
    /// otherwise those of the system.
    pub fn parameters<'a>(&self, system: &'a SystemInstance<f64>) -> Vec<(&'a str, f64)> {
        let value = |(symbol, given): (&'a str, f64)| {
            let identified = self.constants.iter().find(|constant| constant.symbol == symbol);
            (symbol, identified.map_or(given, |constant| constant.value))
        };
        let symbols = system.system.parameters.iter().map(|parameter| parameter.symbol.as_ref());
        symbols.zip(system.parameters.iter().copied()).map(value).collect()
    }

    /// Sets the rows of outliers to those in the files of the recording.
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
            found.finished(&recording, false).constants[0].standard_error
        };
        assert_eq!([stopped(true, 1e-9), stopped(false, 0.01)], [Some(0.1); 2]);
        assert_eq!([stopped(false, 46.0), stopped(false, f64::NAN)], [None; 2]);
    }
}
