//! Recorded motion as Python gives it.

use crate::errors::{pipeline, value};
use lnn::pipeline::PipelineError;
use lnn::recording::read::read_recording;
use lnn::recording::{Columns, LoadedRecording, RecordedTrajectory, Recording};
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
            Self::Files(files, columns) => {
                read_recording(&files, &columns).map_err(|error| pipeline(PipelineError::Data(error)))
            }
        }
    }
}
