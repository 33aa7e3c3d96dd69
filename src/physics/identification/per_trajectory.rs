//! Constants with a value for each trajectory.

use super::{IdentifyError, IdentifyOptions};
use crate::lagrangian::{SystemInstance, configure_system};
use crate::recording::{RecordedTrajectory, Recording};
use std::borrow::Cow;
use std::path::Path;

/// Most trajectories with constants of their own.
const MOST: usize = 64;

/// The system with a constant for each trajectory in place of every parameter that has such values, and the options that mark the trajectories;
/// `None` for a system without such parameters.
pub(super) fn per_trajectory(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Option<(SystemInstance<f64>, IdentifyOptions)>, IdentifyError> {
    let Some(description) = instance.system.description().filter(|own| own.is_per_trajectory()) else {
        return Ok(None);
    };
    let of_tracks: Vec<String> = recording.tracks.iter().map(label).collect();
    let mut names = of_tracks.clone();
    names.sort();
    names.dedup();
    if names.len() > MOST {
        let expected = format!("at most {MOST} trajectories with constants of their own");
        return Err(IdentifyError::Option { what: "per", expected, found: names.len().to_string() });
    }
    let mut own = description.clone();
    for (parameter, value) in instance.system.parameters.iter().zip(&instance.parameters) {
        own.with_default(&parameter.symbol, *value);
    }
    let (all, marks) = own.per_trajectory(&names)?;
    let given: Vec<&String> = description.inputs.keys().collect();
    let rows = |(at, track): (usize, &RecordedTrajectory)| -> Vec<f64> {
        let known = options.inputs.get(at).map_or(&[][..], Vec::as_slice);
        let value = |sample: usize, name: &String| match given.iter().position(|own| *own == name) {
            Some(k) => known.get(sample * given.len() + k).copied().unwrap_or(f64::NAN),
            None => f64::from(u8::from(
                marks.iter().position(|mark| mark == name) == names.iter().position(|own| *own == of_tracks[at]),
            )),
        };
        (0..track.len())
            .flat_map(|sample| all.inputs.keys().map(move |name| (sample, name)))
            .map(|(sample, name)| value(sample, name))
            .collect()
    };
    let inputs = recording.tracks.iter().enumerate().map(rows).collect();
    let system = all.system()?;
    let single = |symbol: &String| -> Vec<String> {
        let is_one = |own: &&str| own.strip_prefix(symbol.as_str()).is_some_and(|rest| rest.starts_with('_'));
        let is_per = description.parameters.get(symbol).is_some_and(|own| own.per.is_some());
        match is_per {
            true => all
                .parameters
                .iter()
                .filter(|(_, own)| own.learn)
                .map(|(name, _)| name.as_str())
                .filter(is_one)
                .map(str::to_string)
                .collect(),
            false => vec![symbol.clone()],
        }
    };
    let constants = options.constants.iter().flat_map(single).collect();
    let instance = configure_system::<f64>(Cow::Owned(system), &[]).map_err(|error| IdentifyError::Option {
        what: "per",
        expected: "constants of every trajectory".to_string(),
        found: error.to_string(),
    })?;
    Ok(Some((instance, IdentifyOptions { constants, inputs, ..options.clone() })))
}

/// The name of a trajectory: what distinguishes it in its file, or the name of the file.
fn label(track: &RecordedTrajectory) -> String {
    match track.name.rsplit_once(" trajectory ") {
        Some((_, label)) => label.to_string(),
        None => Path::new(&track.name)
            .file_stem()
            .map_or_else(|| track.name.clone(), |stem| stem.to_string_lossy().into_owned()),
    }
}
