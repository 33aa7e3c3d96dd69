//! The configuration of a fit, stored in `config.toml`.

use crate::configuration::table::{Below, count, table};
use crate::configuration::{Config, ConfigError, Faults, Known, Ranges as _};
use crate::data::PrepareOptions;
use crate::network::Initialization;
use crate::pipeline::thresholds::{HELD_OUT, MOST_MEMBERS, MOST_WINDOW_SAMPLES, RESIDUAL_DECAY, RESIDUAL_WIDTH};
use crate::recording::smooth::SmoothOptions;
use crate::recording::{Columns, Targets};
use crate::rollout::Between;
use crate::shooting::Shooting;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

table! {
    /// Everything that determines a fit.
    pub struct FitConfig {
        /// What the fit learns from: measured accelerations, smoothed ones, known forces, or the motion itself; chosen by the data unless set.
        #[key("measured, smoothed, forces, motion", example = "\"smoothed\"", flag = "targets")]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub targets: Option<Targets> = None,
        /// Share of the samples that is held out to test the model; 0 for none.
        #[key("0 to below 1", example = "0.2", flag = "hold-out", check = |x| (0.0..1.0).contains(x))]
        pub held_out: f64 = HELD_OUT,
        /// Length of the smoothing windows; chosen unless set.
        #[key("an odd number of samples", example = "21", flag = "window", check = count(MOST_WINDOW_SAMPLES))]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub window: Option<usize> = None,
        /// Standard deviation of the noise of every coordinate; estimated unless set.
        #[key("in SI units", example = "[0.01, 0.01]", flag = "noise", check = positive)]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub noise: Option<Vec<f64>> = None,
        /// How far ahead held-out motion is predicted; chosen unless set.
        #[key("above 0, in s", example = "0.5", flag = "horizon", check = positive)]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub horizon: Option<f64> = None,
        /// Interpolation of the known forces between the samples, for learning from motion and for predictions.
        #[key("held, linear, cubic, band-limited", example = "\"band-limited\"", flag = "between")]
        #[serde(skip_serializing_if = "is_linear")]
        pub between: Between = Between::Linear,
        /// Constraints between the coordinates: none, find to look for them in the motion, or a file whose table `constraints` has
        /// formulas that vanish.
        #[key("none, find, or a file", example = "\"find\"", flag = "constraints")]
        pub constraints: FitConstraints = FitConstraints::None,
        /// Whether to look for a formula of the Lagrangian in the training motion, with friction if the model has it; this takes minutes.
        #[key("true, false", flag = "formula")]
        pub formula: bool = false,
        /// Number of networks that are trained on the same recording, with this seed and those that follow it; where they differ, the
        /// recording or the training does not determine the model.
        #[key("1 to 32", example = "5", flag = "members", check = count(MOST_MEMBERS))]
        #[serde(skip_serializing_if = "is_one")]
        pub members: usize = 1,
        /// The files and the meaning of their columns, as in the options of the same names.
        #[table("recording", Below::Keys(FitColumns::KEYS))]
        pub recording: FitColumns = FitColumns::default(),
        /// Multiple shooting, for a fit to the motion itself.
        #[table("shooting", Below::Keys(Shooting::KEYS))]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub shooting: Option<Shooting> = None,
        /// The supervised training.
        #[table("training", Below::Keys(Config::KEYS))]
        pub training: Config = Config { system: "measured".to_string(), ..Config::default() },
    }
}

table! {
    /// The files of recorded motion and what their columns mean. A fit in memory needs none of it but names of its forces, if they
    /// are to have any.
    pub struct FitColumns {
        /// Files of recorded motion: CSV, XLSX, NPY or NPZ.
        #[key("paths", example = "[\"data.csv\"]")]
        pub files: Vec<String> = Vec::new(),
        /// Columns of the coordinates, by name or by number from 1.
        #[key("columns", example = "[\"q1\", \"q2\"]")]
        pub coords: Vec<String> = Vec::new(),
        /// Columns of measured velocities.
        #[key("columns", example = "[\"v1\", \"v2\"]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub velocity: Vec<String> = Vec::new(),
        /// Columns of measured accelerations.
        #[key("columns", example = "[\"a1\", \"a2\"]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub acceleration: Vec<String> = Vec::new(),
        /// Columns of known external generalized forces.
        #[key("columns", example = "[\"f1\", \"f2\"]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub force: Vec<String> = Vec::new(),
        /// Column of the time.
        #[key("a column", example = "\"t\"")]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub time: Option<String> = None,
        /// Rate, if no column holds the time.
        #[key("above 0, in samples per second", example = "100.0", check = positive)]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub rate: Option<f64> = None,
        /// Column whose value distinguishes the trajectories of a file.
        #[key("a column", example = "\"run\"")]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub trajectory: Option<String> = None,
        /// Whether trajectories are side by side, those of `s` in the columns `s1`, `s2`.
        #[key("true, false", example = "true")]
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        pub wide: bool = false,
        /// Coordinates that are angles.
        #[key("coordinates", example = "[\"q1\"]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub periodic: Vec<String> = Vec::new(),
        /// Units of columns that are not SI, or factors to SI.
        #[key("COLUMN=UNIT", example = "[\"q1=deg\"]", check = |text| unit(text).is_some())]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub units: Vec<String> = Vec::new(),
        /// Names of all columns of files without a header.
        #[key("names", example = "[\"t\", \"q1\"]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub columns: Vec<String> = Vec::new(),
    }
}

/// Constraints of a fit, which hold between the coordinates of its motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub enum FitConstraints {
    /// None: every coordinate moves by itself.
    #[default]
    None,
    /// Constraints found in the training motion, if there are any.
    Find,
    /// Formulas by name, over coordinates and their velocities `NAME_dot`, that vanish.
    Formulas(BTreeMap<String, String>),
}

/// Constraints in the form in which a file stores them.
#[derive(Clone, Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Name(String),
    Formulas(BTreeMap<String, String>),
}

impl TryFrom<Written> for FitConstraints {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        match written {
            Written::Formulas(formulas) => Ok(Self::Formulas(formulas)),
            Written::Name(name) if name == "none" => Ok(Self::None),
            Written::Name(name) if name == "find" => Ok(Self::Find),
            Written::Name(name) => Err(format!("expected none, find, or a table of formulas, found {name:?}")),
        }
    }
}

impl From<FitConstraints> for Written {
    fn from(constraints: FitConstraints) -> Self {
        match constraints {
            FitConstraints::None => Self::Name("none".to_string()),
            FitConstraints::Find => Self::Name("find".to_string()),
            FitConstraints::Formulas(formulas) => Self::Formulas(formulas),
        }
    }
}

/// Linear interpolation is the default and is not written.
fn is_linear(between: &Between) -> bool {
    *between == Between::Linear
}

/// A single network is the default and is not written.
fn is_one(count: &usize) -> bool {
    *count == 1
}

/// `true` for a finite positive number.
fn positive(x: &f64) -> bool {
    x.is_finite() && *x > 0.0
}

/// Parses `column=unit`.
pub fn unit(text: &str) -> Option<(String, String)> {
    let (column, unit) = text.split_once('=')?;
    let (column, unit) = (column.trim(), unit.trim());
    (!column.is_empty() && !unit.is_empty()).then(|| (column.to_string(), unit.to_string()))
}

impl FitColumns {
    /// Converts to the meaning of the columns.
    pub fn meaning(&self) -> Columns {
        let Self { coords, velocity, acceleration, force, time, rate, trajectory, wide, periodic, .. } = self.clone();
        let units = self.units.iter().filter_map(|text| unit(text)).collect();
        let names = (!self.columns.is_empty()).then(|| self.columns.clone());
        let columns = Columns { coords, velocity, acceleration, force, periodic, ..Columns::default() };
        Columns { time, rate, trajectory, wide, units, names, ..columns }
    }
}

impl From<&Columns> for FitColumns {
    fn from(given: &Columns) -> Self {
        let Columns { coords, velocity, acceleration, force, time, rate, trajectory, wide, periodic, .. } =
            given.clone();
        let units = given.units.iter().map(|(column, unit)| format!("{column}={unit}")).collect();
        let columns = Self { coords, velocity, acceleration, force, periodic, ..Self::default() };
        Self { time, rate, trajectory, wide, units, columns: given.names.clone().unwrap_or_default(), ..columns }
    }
}

impl FitConfig {
    /// Applies the settings for a network next to a known part: a small network with almost no initial output, and the shooting settings of
    /// a grey box.
    pub fn take_known(&mut self, known: Option<Known>) {
        let network = &mut self.training.network;
        (network.hidden, network.alpha) = (vec![RESIDUAL_WIDTH], 0.0);
        (network.initialization, network.known) = (Initialization::NearZero, known);
        self.training.optimizer.weight_decay = RESIDUAL_DECAY;
        self.shooting = self.shooting.take().map(|_| Shooting::grey_box());
    }

    /// Copies the configuration without file names, which may change.
    pub fn without_files(&self) -> Self {
        let mut other = self.clone();
        other.recording.files.clear();
        other
    }

    /// Returns every value out of range, for `n` coordinates. Settings that need the data are not checked.
    pub fn faults(&self, n: usize) -> Vec<ConfigError> {
        let mut faults = Faults::default();
        // The training settings are checked together with the conditions on several keys.
        Self { training: Config::default(), ..self.clone() }.ranges("", &mut faults);
        let (time, rate) = (&self.recording.time, self.recording.rate);
        if let (Some(_), Some(rate)) = (time, rate) {
            faults.check(false, "recording.rate", "no rate beside a column of times", rate.to_string());
        }
        let decided = ["training.data.", "position", "velocity", "log_uniform"];
        for mut fault in self.training.faults(n) {
            fault.field.insert_str(0, "training.");
            if !decided.iter().any(|part| fault.field.contains(part)) {
                faults.0.push(fault);
            }
        }
        faults.0
    }
}

/// Settings of a fit that apply before its configuration exists, such as targets and held-out data.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FitOptions {
    /// Targets to learn from; by default, those that suit the data.
    pub targets: Option<Targets>,
    /// Share of the samples that is held out to judge the model; 0: none.
    pub held_out: f64,
    /// Length of the smoothing windows in samples, odd; by default, chosen from the data.
    pub window: Option<usize>,
    /// Standard deviation of the noise of every coordinate, in SI units; by default, estimated.
    pub noise: Option<Vec<f64>>,
    /// Known forces between the samples.
    pub between: Between,
    /// Constraints between the coordinates.
    pub constraints: FitConstraints,
    /// Seed of held-out trajectories.
    pub seed: u64,
}

impl Default for FitOptions {
    fn default() -> Self {
        let (between, constraints) = (Between::default(), FitConstraints::None);
        Self { targets: None, held_out: HELD_OUT, window: None, noise: None, between, constraints, seed: 0 }
    }
}

impl From<&FitConfig> for FitOptions {
    fn from(config: &FitConfig) -> Self {
        let FitConfig { targets, held_out, window, noise, between, constraints, training, .. } = config.clone();
        Self { targets, held_out, window, noise, between, constraints, seed: training.seed }
    }
}

impl FitOptions {
    /// Converts to the options for splitting a recording.
    pub(crate) fn preparation(&self) -> PrepareOptions {
        let smoothing = SmoothOptions { window: self.window, noise: self.noise.clone(), ..SmoothOptions::default() };
        let Self { held_out, seed, between, .. } = *self;
        PrepareOptions { smoothing, held_out, seed, between, ..PrepareOptions::default() }
    }
}
