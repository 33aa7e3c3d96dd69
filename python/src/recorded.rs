//! Recorded motion as Python gives it.

use crate::errors::{pipeline, value};
use lnn::pipeline::PipelineError;
use lnn::recording::{ColumnGuess, Columns, DataError, Guess, LoadedRecording, RecordedTrajectory, Recording, factor};
use pyo3::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One trajectory in memory: name, times, positions, and velocities, accelerations and forces, empty if there are none.
pub type Track = (String, Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>);

/// Files, or trajectories in memory, and what their columns mean, as JSON.
pub type Motion = (Vec<PathBuf>, Vec<Track>, String);

/// Meaning of the columns.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Meaning {
    coordinates: Vec<String>,
    angles: Vec<String>,
    columns: BTreeMap<String, Value>,
}

/// Origin of recorded motion.
pub enum Source {
    Files(Vec<PathBuf>, Box<Columns>),
    Memory(Recording),
}

impl Source {
    /// The motion, its columns looked at, its files not yet.
    ///
    /// # Errors
    /// `ValueError` for columns or trajectories that are none.
    pub fn of(motion: Motion) -> PyResult<Self> {
        Self::read_off(motion, false)
    }

    /// The same of trajectories that stay whole, see [`Columns::whole`].
    ///
    /// # Errors
    /// As of [`of`](Self::of).
    pub fn whole(motion: Motion) -> PyResult<Self> {
        Self::read_off(motion, true)
    }

    fn read_off((files, tracks, meaning): Motion, whole: bool) -> PyResult<Self> {
        let Meaning { coordinates, angles, columns: more } = serde_json::from_str(&meaning).map_err(value)?;
        if files.is_empty() {
            let periodic = coordinates.iter().map(|name| angles.contains(name)).collect();
            let track = |(name, times, q, v, a, force)| RecordedTrajectory { name, times, q, v, a, force };
            let tracks: Vec<_> = tracks.into_iter().map(track).collect();
            for track in &tracks {
                match whole {
                    true => track.validate_repeated(coordinates.len()),
                    false => track.validate(coordinates.len()),
                }
                .map_err(value)?;
            }
            return Ok(Self::Memory(Recording { coordinates, periodic, tracks }));
        }
        let mut columns = Columns { coords: coordinates, periodic: angles, whole, ..Columns::default() };
        for (key, given) in more {
            let bad = |_| value(format_args!("{key}: expected another value, found {given}"));
            let given = given.clone();
            match key.as_str() {
                "velocities" => columns.velocity = serde_json::from_value(given).map_err(bad)?,
                "accelerations" => columns.acceleration = serde_json::from_value(given).map_err(bad)?,
                "errors" => columns.error = serde_json::from_value(given).map_err(bad)?,
                "inputs" => columns.input = serde_json::from_value(given).map_err(bad)?,
                "forces" => columns.force = serde_json::from_value(given).map_err(bad)?,
                "time" => columns.time = serde_json::from_value(given).map_err(bad)?,
                "trajectory" => columns.trajectory = serde_json::from_value(given).map_err(bad)?,
                "wide" => columns.wide = serde_json::from_value(given).map_err(bad)?,
                "rate" => columns.rate = serde_json::from_value(given).map_err(bad)?,
                "units" => {
                    let units: BTreeMap<String, String> = serde_json::from_value(given).map_err(bad)?;
                    columns.units = units.into_iter().collect();
                }
                _ => return Err(value(format_args!("columns: no such key, {key:?}"))),
            }
        }
        Ok(Self::Files(files, Box::new(columns)))
    }

    /// The recording with the rows of its samples, read from its files if it has some.
    ///
    /// # Errors
    /// `OSError` for files that cannot be read, `ValueError` for files that are not as said.
    pub fn read(self) -> PyResult<LoadedRecording> {
        match self {
            Self::Memory(recording) => Ok(recording.into()),
            Self::Files(files, columns) => LoadedRecording::read(&files, &columns).map_err(refused),
        }
    }

    /// The same, after a guess of what the columns of files are if no coordinates are named; the arguments of a call that reads it again, and
    /// what the columns were taken as.
    ///
    /// # Errors
    /// As of [`read`](Self::read).
    pub fn look(self) -> PyResult<(LoadedRecording, String, Vec<ColumnGuess>)> {
        match self {
            Self::Memory(recording) => {
                let angles = recording.coordinates.iter().zip(&recording.periodic).filter(|(_, angle)| **angle);
                let columns = Columns {
                    coords: recording.coordinates.clone(),
                    periodic: angles.map(|(name, _)| name.clone()).collect(),
                    ..Columns::default()
                };
                Ok((recording.into(), arguments("data", &columns), Vec::new()))
            }
            Self::Files(files, columns) => {
                let mut found = Guess { columns: *columns, table: Vec::new() };
                if found.columns.coords.is_empty() {
                    found = Guess::of(&files, &found.columns).map_err(refused)?;
                }
                let loaded = found.read(&files).map_err(refused)?;
                let names: Vec<_> = files.iter().map(|file| quoted(&file.display().to_string())).collect();
                let data = if let [one] = names.as_slice() { one.clone() } else { format!("[{}]", names.join(", ")) };
                Ok((loaded, arguments(&data, &found.columns), found.table))
            }
        }
    }
}

fn refused(error: DataError) -> PyErr {
    pipeline(PipelineError::Data(error))
}

/// A text as Python writes it.
fn quoted(text: &str) -> String {
    Value::from(text).to_string()
}

/// The arguments of a call that reads recorded motion with this meaning of its columns.
fn arguments(data: &str, columns: &Columns) -> String {
    let list = |names: &[String]| format!("[{}]", names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", "));
    let mut text = format!("{data}, coordinates={}", list(&columns.coords));
    if !columns.periodic.is_empty() {
        text += &format!(", angles={}", list(&columns.periodic));
    }
    if let Some(name) = &columns.trajectory {
        text += &format!(", trajectory={}", quoted(name));
    }
    if !columns.units.is_empty() {
        let pairs = columns.units.iter().map(|(column, unit)| format!("{}: {}", quoted(column), quoted(unit)));
        text += &format!(", units={{{}}}", pairs.collect::<Vec<_>>().join(", "));
    }
    let many =
        [("velocities", &columns.velocity), ("accelerations", &columns.acceleration), ("forces", &columns.force)];
    let many = many.into_iter().filter(|(_, names)| !names.is_empty()).map(|(key, names)| (key, list(names)));
    // The usual names need not be said.
    let time = columns.time.iter().filter(|name| *name != "t" && *name != "time").map(|name| ("time", quoted(name)));
    let rate = columns.rate.iter().map(|rate| ("rate", rate.to_string()));
    let more: Vec<String> =
        many.chain(time).chain(rate).map(|(key, value)| format!("{}: {value}", quoted(key))).collect();
    if !more.is_empty() {
        text += &format!(", columns={{{}}}", more.join(", "));
    }
    text
}

/// The factor that turns numbers in a unit into SI.
#[pyfunction]
pub fn unit_factor(column: &str, unit: &str) -> PyResult<f64> {
    factor(unit).map_err(|problem| value(format_args!("units: {column}: {problem}")))
}
