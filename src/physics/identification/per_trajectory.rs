//! Parameters that have a separate value for each trajectory.

use super::thresholds::MOST_OWN_CONSTANTS;
use super::{IdentifyError, IdentifyOptions};
use crate::lagrangian::{PerTrajectory, SystemInstance};
use crate::recording::{RecordedTrajectory, Recording};
use std::borrow::Cow;
use std::path::Path;

/// Replaces every such parameter of the system by one constant for each trajectory, and adds inputs to the options that mark the trajectories.
/// `None` for a system without such parameters.
pub(super) fn per_trajectory(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Option<(SystemInstance<f64>, IdentifyOptions)>, IdentifyError> {
    let Some(description) = instance.system.description().filter(|own| own.is_per_trajectory()) else {
        return Ok(None);
    };
    let mut names: Vec<String> = recording.tracks.iter().map(label).collect();
    names.sort();
    names.dedup();
    if names.len() > MOST_OWN_CONSTANTS {
        let expected = format!("at most {MOST_OWN_CONSTANTS} trajectories with constants of their own");
        return Err(IdentifyError::Option { what: "per", expected, found: names.len().to_string() });
    }
    let mut own = description.clone();
    for (parameter, value) in instance.system.parameters.iter().zip(&instance.parameters) {
        own.with_default(&parameter.symbol, *value);
    }
    let PerTrajectory { description: all, marks, unknown } = own.per_trajectory(&names)?;
    // Every input either marks a trajectory or was measured.
    let measured: Vec<&String> = description.inputs.keys().collect();
    let place = |list: &[&String], name: &String| list.iter().position(|own| *own == name);
    let marks: Vec<&String> = marks.iter().collect();
    let columns: Vec<_> = all.inputs.keys().map(|name| (place(&marks, name), place(&measured, name))).collect();
    let rows = |(at, track): (usize, &RecordedTrajectory)| -> Vec<f64> {
        let own = names.iter().position(|name| *name == label(track));
        let given = options.inputs.get(at).map_or(&[][..], Vec::as_slice);
        let value = |sample: usize, column: &(Option<usize>, Option<usize>)| match column {
            (mark @ Some(_), _) => f64::from(u8::from(*mark == own)),
            (None, Some(k)) => given.get(sample * measured.len() + k).copied().unwrap_or(f64::NAN),
            (None, None) => f64::NAN,
        };
        let sample = |sample: usize| columns.iter().map(move |column| value(sample, column));
        (0..track.len()).flat_map(sample).collect()
    };
    let inputs = recording.tracks.iter().enumerate().map(rows).collect();
    let each = |symbol: &String| unknown.get(symbol).cloned().unwrap_or_else(|| vec![symbol.clone()]);
    let constants = options.constants.iter().flat_map(each).collect();
    let instance = SystemInstance::<f64>::new(Cow::Owned(all.system()?), &[])?;
    Ok(Some((instance, IdentifyOptions { constants, inputs, ..options.clone() })))
}

/// The name of a trajectory: its label within its file, or the name of the file.
fn label(track: &RecordedTrajectory) -> String {
    match track.name.rsplit_once(" trajectory ") {
        Some((_, label)) => label.to_string(),
        None => Path::new(&track.name)
            .file_stem()
            .map_or_else(|| track.name.clone(), |stem| stem.to_string_lossy().into_owned()),
    }
}
