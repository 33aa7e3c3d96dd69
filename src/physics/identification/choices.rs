//! Checks the options and resolves them: unknown constants, sensors, errors of positions, inputs, and the quantity that is fitted.

use super::driven::Inputs;
use super::smoothed::Quantity;
use super::solve::{Sensor, SensorKind};
use super::{IdentifyError, IdentifyOptions};
use crate::lagrangian::SystemInstance;
use crate::names::pluralize;
use crate::recording::{RecordedTrajectory, Recording, Targets};

/// Checks the standard errors of positions: one positive number for each position.
pub(super) fn check_errors(recording: &Recording, errors: &[Vec<f64>]) -> Result<(), IdentifyError> {
    if errors.is_empty() {
        return Ok(());
    }
    for (at, track) in recording.tracks.iter().enumerate() {
        let own = errors.get(at).map_or(&[][..], Vec::as_slice);
        let (track, expected) = (track.name.clone(), track.q.len());
        if own.len() != expected {
            return Err(IdentifyError::Errors { track, expected, found: pluralize(own.len(), "number", "numbers") });
        }
        if let Some(sample) = own.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            let found = format!("{} of sample {}", own[sample], sample / recording.n());
            return Err(IdentifyError::Errors { track, expected, found });
        }
    }
    Ok(())
}

/// Checks the marks of missing readings, and returns a message for each coordinate with missing readings. Trajectories without missing readings
/// may have no marks.
pub(super) fn missing(recording: &Recording, missing: &[Vec<bool>]) -> Result<Vec<String>, IdentifyError> {
    let n = recording.n();
    let wrong = recording.tracks.iter().zip(missing).find(|(track, own)| !own.is_empty() && own.len() != track.q.len());
    if let Some((track, own)) = wrong {
        let (track, expected) = (track.name.clone(), track.q.len());
        return Err(IdentifyError::Missing { track, expected, found: own.len() });
    }
    let samples = recording.samples();
    let of = |(i, name): (usize, &String)| {
        let count = missing.iter().flat_map(|own| own.iter().skip(i).step_by(n)).filter(|missing| **missing).count();
        (count > 0).then(|| format!("{name}: {count} of {samples} readings are missing"))
    };
    Ok(recording.coordinates.iter().enumerate().filter_map(of).collect())
}

/// The inputs of every trajectory. The options must give one finite number for each input and sample.
pub(super) fn inputs<'a>(
    instance: &SystemInstance<f64>,
    recording: &'a Recording,
    options: &'a IdentifyOptions,
) -> Result<Vec<Inputs<'a>>, IdentifyError> {
    let count = instance.inputs().count();
    if count == 0 && options.inputs.is_empty() {
        return Ok(Vec::new());
    }
    let of = |(at, track): (usize, &'a RecordedTrajectory)| {
        let values = options.inputs.get(at).map_or(&[][..], Vec::as_slice);
        let expected = track.len() * count;
        let found = match values.iter().position(|x| !x.is_finite()) {
            None if values.len() == expected => return Ok(Inputs { times: &track.times, values }),
            None => pluralize(values.len(), "number", "numbers"),
            Some(at) => format!("{} of sample {}", values[at], at / count.max(1)),
        };
        Err(IdentifyError::Inputs { track: track.name.clone(), expected, found })
    };
    recording.tracks.iter().enumerate().map(of).collect()
}

/// The quantity that the constants are fitted to.
pub(super) fn fitted_quantity(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Quantity, IdentifyError> {
    let driven = recording.is_driven();
    // A joint without an actuator has a known force of 0.
    let mut forces = recording.tracks.iter().flat_map(|track| &track.force);
    let known = recording.tracks.iter().all(|track| !track.force.is_empty()) && forces.any(|force| *force != 0.0);
    // Each of these options requires a fit to the motion.
    let needs_motion = options.segment.is_some()
        || !options.errors.is_empty()
        || [&options.offsets, &options.gains, &options.delays].iter().any(|names| !names.is_empty());
    let refused = |expected: &str, found: &str| {
        let (expected, found) = (expected.to_string(), found.to_string());
        Err(IdentifyError::Option { what: "targets", expected, found })
    };
    match options.targets {
        Some(Targets::Motion) => Ok(Quantity::Accelerations),
        Some(Targets::Forces) if !known => refused("motion, because the recording has no known forces", "forces"),
        Some(Targets::Forces) if needs_motion => {
            refused("motion, because sensor constants, position errors or a segment length are given", "forces")
        }
        Some(Targets::Forces) => Ok(Quantity::Forces),
        Some(other) => refused("motion or forces", other.name()),
        None if instance.system.is_chain() && driven && !needs_motion => Ok(Quantity::Forces),
        None => Ok(Quantity::Accelerations),
    }
}

/// Indices of the unknown parameters, in the order of the system.
pub(super) fn chosen(instance: &SystemInstance<f64>, options: &IdentifyOptions) -> Result<Vec<usize>, IdentifyError> {
    let parameters = &instance.system.parameters;
    let mut chosen = Vec::new();
    for symbol in &options.constants {
        let known = || parameters.iter().map(|parameter| parameter.symbol.to_string()).collect();
        let found = parameters.iter().position(|parameter| parameter.symbol == *symbol);
        let at = found.ok_or_else(|| IdentifyError::Constant { symbol: symbol.clone(), known: known() })?;
        if chosen.contains(&at) {
            return Err(IdentifyError::Repeated { what: "constants", name: symbol.clone() });
        }
        chosen.push(at);
    }
    if chosen.is_empty() {
        let learned: Vec<usize> = (0..parameters.len()).filter(|&k| parameters[k].learn).collect();
        chosen = if learned.is_empty() { (0..parameters.len()).collect() } else { learned };
    }
    chosen.sort_unstable();
    match chosen.is_empty() {
        true => Err(IdentifyError::Nothing { system: instance.system.name.to_string() }),
        false => Ok(chosen),
    }
}

/// The unknown constants of sensors.
pub(super) fn sensors(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Vec<Sensor>, IdentifyError> {
    let mut sensors = Vec::new();
    let all = [
        ("offsets", SensorKind::Offset, &options.offsets),
        ("gains", SensorKind::Gain, &options.gains),
        ("delays", SensorKind::Delay, &options.delays),
    ];
    for (what, kind, names) in all {
        if !(names.is_empty() || instance.readings().is_empty()) {
            return Err(IdentifyError::SensorsBesideReadings { what });
        }
        for name in names {
            let missing = || IdentifyError::Sensor { what, name: name.clone(), known: recording.coordinates.clone() };
            let coordinate = recording.coordinates.iter().position(|known| known == name).ok_or_else(missing)?;
            let sensor = Sensor { kind, coordinate };
            if sensors.contains(&sensor) {
                return Err(IdentifyError::Repeated { what, name: name.clone() });
            }
            sensors.push(sensor);
        }
    }
    Ok(sensors)
}
