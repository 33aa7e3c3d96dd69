//! The configuration of a fit, as `config.toml` holds it.

use crate::configuration::{Config, ConfigError};
use crate::data::PrepareOptions;
use crate::presets::{Key, Section};
use crate::recording::smooth::SmoothOptions;
use crate::recording::{Columns, Targets};
use crate::shooting::Shooting;
use serde::{Deserialize, Serialize};

/// Share of the samples that is held out unless told otherwise.
pub const HELD_OUT: f64 = 0.2;

/// Everything that determines a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitConfig {
    /// Targets to learn from; as the data advise if they are not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub targets: Option<Targets>,
    /// Share of the samples that is held out; 0: none.
    pub held_out: f64,
    /// Length of the smoothing windows in samples; chosen if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<usize>,
    /// Noise of the coordinates in SI units; estimated if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<Vec<f64>>,
    /// Time over which held-out motion is predicted, in s; chosen if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<f64>,
    /// The files and what their columns mean.
    #[serde(default)]
    pub recording: FitColumns,
    /// Multiple shooting, of a fit to the motion itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shooting: Option<Shooting>,
    /// The supervised training.
    pub training: Config,
}

/// The files of recorded motion and what their columns mean. A fit in memory needs none of it but names of its forces, if they
/// are to have any.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FitColumns {
    /// Files: CSV, NPY or NPZ.
    pub files: Vec<String>,
    /// Columns of the coordinates.
    pub coords: Vec<String>,
    /// Columns of measured velocities.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub velocity: Vec<String>,
    /// Columns of measured accelerations.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub acceleration: Vec<String>,
    /// Columns of known external generalized forces.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force: Vec<String>,
    /// Column of time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Samples per second, if no column holds the time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// Column whose value tells the trajectories of a file apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trajectory: Option<String>,
    /// Coordinates that are angles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub periodic: Vec<String>,
    /// Units of columns that are not SI: `COLUMN=UNIT`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub units: Vec<String>,
    /// Names of all columns of files without a header.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<String>,
}

impl From<&Columns> for FitColumns {
    fn from(columns: &Columns) -> Self {
        let Columns { coords, velocity, acceleration, force, time, rate, trajectory, periodic, units, names } =
            columns.clone();
        Self {
            files: Vec::new(),
            coords,
            velocity,
            acceleration,
            force,
            time,
            rate,
            trajectory,
            periodic,
            units: units.iter().map(|(column, unit)| format!("{column}={unit}")).collect(),
            columns: names.unwrap_or_default(),
        }
    }
}

impl FitConfig {
    /// The same of files that may have other names.
    pub(crate) fn without_files(&self) -> Self {
        let mut other = self.clone();
        other.recording.files.clear();
        other
    }

    /// Every value out of range, for `n` coordinates, in the order of the keys. What the data alone decide is not looked at.
    pub(crate) fn faults(&self, n: usize) -> Vec<ConfigError> {
        let fault = |field: &str, expected: &'static str, found: String| ConfigError {
            field: field.to_string(),
            expected: expected.into(),
            found,
        };
        let mut found = Vec::new();
        if !(0.0..1.0).contains(&self.held_out) {
            found.push(fault("held_out", "0 or a share below 1", self.held_out.to_string()));
        }
        if let Some(window) = self.window.filter(|window| *window == 0) {
            found.push(fault("window", "a whole number above 0", window.to_string()));
        }
        let numbers =
            self.noise.iter().flatten().map(|x| ("noise", x)).chain(self.horizon.iter().map(|x| ("horizon", x)));
        for (key, x) in numbers.filter(|(_, x)| !(x.is_finite() && **x > 0.0)) {
            found.push(fault(key, "a finite number above 0", x.to_string()));
        }
        let training = self.training.faults(n).into_iter().map(|mut fault| {
            fault.field.insert_str(0, "training.");
            fault
        });
        let decided = ["training.data.", "position", "velocity", "log_uniform"];
        let training = training.filter(|fault| !decided.iter().any(|part| fault.field.contains(part)));
        found.extend(training.chain(self.shooting.iter().flat_map(Shooting::faults)));
        found
    }
}

/// Choices of a fit that come before its configuration: what is learned from and what is held out.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Targets to learn from; none for those that the data advise.
    pub targets: Option<Targets>,
    /// Share of the samples that is held out to judge the model; 0: none.
    pub held_out: f64,
    /// Length of the smoothing windows in samples, odd; none to choose it.
    pub window: Option<usize>,
    /// Standard deviation of the noise of every coordinate, in SI units; none to estimate it.
    pub noise: Option<Vec<f64>>,
    /// Seed of held-out trajectories.
    pub seed: u64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self { targets: None, held_out: HELD_OUT, window: None, noise: None, seed: 0 }
    }
}

impl FitOptions {
    /// The same for the division of a recording.
    pub(crate) fn preparation(&self) -> PrepareOptions {
        let smoothing = SmoothOptions { window: self.window, noise: self.noise.clone(), ..SmoothOptions::default() };
        PrepareOptions { smoothing, held_out: self.held_out, seed: self.seed, ..PrepareOptions::default() }
    }
}

const fn optional(name: &'static str, example: &'static str, values: &'static str, purpose: &'static str) -> Key {
    Key { name, values, purpose, example }
}

/// The tables of a fit beside multiple shooting and those of a training.
pub const FIT_SECTIONS: [Section<'static>; 2] = [
    Section {
        name: "",
        purpose: "",
        keys: &[
            optional(
                "targets",
                "\"smoothed\"",
                "measured, smoothed, motion",
                "What is learned from: measured accelerations, smoothed ones, or the motion itself; as the data advise unless \
                 set.",
            ),
            optional("held_out", "0.2", "0 to below 1", "Share of the samples held out to judge the model; 0: none."),
            optional("window", "21", "an odd number of samples", "Length of the smoothing windows; chosen unless set."),
            optional("noise", "[0.01, 0.01]", "in SI units", "Noise of every coordinate; estimated unless set."),
            optional(
                "horizon",
                "0.5",
                "above 0, in s",
                "How far ahead held-out motion is predicted; chosen unless set.",
            ),
        ],
    },
    Section {
        name: "recording",
        purpose: "The files and what their columns mean, as the options of the same names say it.",
        keys: &[
            optional("files", "[\"data.csv\"]", "paths", "Files of recorded motion: CSV, NPY or NPZ."),
            optional(
                "coords",
                "[\"q1\", \"q2\"]",
                "columns",
                "Columns of the coordinates, by name or by number from 1.",
            ),
            optional("velocity", "[\"v1\", \"v2\"]", "columns", "Columns of measured velocities."),
            optional("acceleration", "[\"a1\", \"a2\"]", "columns", "Columns of measured accelerations."),
            optional("force", "[\"f1\", \"f2\"]", "columns", "Columns of known external generalized forces."),
            optional("time", "\"t\"", "a column", "Column of time."),
            optional("rate", "100.0", "above 0, in samples per second", "Rate, if no column holds the time."),
            optional("trajectory", "\"run\"", "a column", "Column whose value tells the trajectories of a file apart."),
            optional("periodic", "[\"q1\"]", "coordinates", "Coordinates that are angles."),
            optional("units", "[\"q1=deg\"]", "COLUMN=UNIT", "Units of columns that are not SI, or factors to SI."),
            optional("columns", "[\"t\", \"q1\"]", "names", "Names of all columns of files without a header."),
        ],
    },
];
