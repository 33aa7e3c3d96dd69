//! What the models of an experiment say of their black holes, beside the exact metrics.

use crate::configuration::Config;
use crate::experiments::{Experiment, Picture, Record, Run};
use crate::lagrangian::Configured;
use crate::network::NetworkLagrangian;
use crate::network::file::ModelFile;
use crate::pipeline::experiment_store::ExperimentStore;
use crate::pipeline::{Event, MODEL, PipelineError, Watch};
use crate::relativity::{Around, Pair, Reading};
use crate::report::{READING_HEADER, reading_table};

/// Name of the file of a run's readings.
const READINGS: &str = "readings.json";

/// Coordinates and learned distances of a configuration; `None` if they are not those around a centre.
fn around(config: &Config, system: &Configured<f64>) -> Option<(Around, (f64, f64))> {
    let coordinates = system.system.coordinates(system.coordinates);
    let names: Vec<&str> = coordinates.iter().map(|c| c.name.as_ref()).collect();
    let around = Around::of_names(&names)?;
    let box_of = |i: usize| config.phases.first().and_then(|phase| phase.position.get(i)).map(|b| (b[0], b[1]));
    let range = match around {
        Around::Cartesian { .. } => config.data.shell_radius.map(|[low, high]| (low, high)),
        Around::Spherical { radius, .. } => box_of(radius),
    };
    Some((around, range?))
}

/// The readings of a finished run: those of its file, or new ones, which are kept there.
///
/// # Errors
/// A model file that cannot be read, a system without the coordinates of a hole, files that cannot be written; none for a run
/// without a model.
pub(crate) fn readings_of(
    run: &Run,
    store: &dyn ExperimentStore,
    watch: &Watch,
) -> Result<Vec<Reading>, PipelineError> {
    if let Some(readings) = store.read(&run.name, READINGS).and_then(|json| serde_json::from_slice(&json).ok()) {
        return Ok(readings);
    }
    let system = run.config.system()?;
    let unfit = || PipelineError::Hole(run.config.system.clone());
    let (around, range) = around(&run.config, &system).ok_or_else(unfit)?;
    // A run that learned nothing has no model.
    let Some(bytes) = store.read(&run.name, MODEL) else { return Ok(Vec::new()) };
    let wrong = |source| PipelineError::Model { path: MODEL.into(), source };
    let ModelFile { header, weights } = ModelFile::<f64>::from_bytes(&bytes).map_err(wrong)?;
    let learned = NetworkLagrangian::new(header.architecture, weights)?;
    let exact = system.build()?;
    let pair = Pair { exact: exact.as_ref(), learned: &learned, system: &system, around, range };
    let said = |part: &str| watch.say(Event::Note(&format!("{}: {part}", run.name)));
    let readings = pair.readings(&said).map_err(|_| unfit())?;
    let json = serde_json::to_string_pretty(&readings).map_err(PipelineError::format)? + "\n";
    store.open_run(&run.name)?.write(READINGS, json.as_bytes())?;
    Ok(readings)
}

/// Tables of the rows of an experiment, each with its label, below [`READING_HEADER`](crate::report::READING_HEADER); written as
/// `readings.csv` too. None for an experiment that reads no holes.
///
/// # Errors
/// As [`readings_of`].
pub(crate) fn reading_tables(
    experiment: &Experiment,
    results: &[(Run, Option<Record>)],
    store: &dyn ExperimentStore,
    watch: &Watch,
) -> Result<Vec<(String, Vec<Vec<String>>)>, PipelineError> {
    if !experiment.pictures.contains(&Picture::BlackHole) {
        return Ok(Vec::new());
    }
    let mut rows: Vec<(String, Vec<Vec<Reading>>)> = Vec::new();
    for (run, _) in results.iter().filter(|(_, record)| record.is_some()) {
        let readings = readings_of(run, store, watch)?;
        match rows.iter_mut().find(|(label, _)| *label == run.label) {
            _ if readings.is_empty() => {}
            Some((_, all)) => all.push(readings),
            None => rows.push((run.label.clone(), vec![readings])),
        }
    }
    let tables: Vec<_> = rows.into_iter().map(|(label, runs)| (label, reading_table(&runs))).collect();
    let cell = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let line = |cells: &mut dyn Iterator<Item = &str>| cells.map(cell).collect::<Vec<_>>().join(",") + "\n";
    let mut csv = line(&mut ["row"].into_iter().chain(READING_HEADER));
    for (label, table) in &tables {
        csv.extend(
            table.iter().map(|row| line(&mut [label.as_str()].into_iter().chain(row.iter().map(String::as_str)))),
        );
    }
    store.write("readings.csv", csv.as_bytes())?;
    Ok(tables)
}
