//! What the models of an experiment say of their black holes, beside the exact metrics: tables and pictures.

use crate::configuration::Config;
use crate::experiments::{Experiment, Picture, Record, Run, Scale};
use crate::lagrangian::{Configured, EulerLagrange};
use crate::network::NetworkLagrangian;
use crate::network::file::ModelFile;
use crate::pipeline::experiment_store::ExperimentStore;
use crate::pipeline::hole_pictures::{orbit_figure, sky_picture};
use crate::pipeline::{Event, MODEL, PipelineError, Watch};
use crate::relativity::{Around, Pair, Reading};
use crate::report::{READING_HEADER, Report, reading_table};

/// Names of the files of a run: its readings, its orbits, its sky.
pub(crate) const READINGS: &str = "readings.json";
const ORBITS: &str = "orbits.svg";
const SKY: &str = "sky.png";

/// Pixels along the edge of a picture of the sky.
const PIXELS: usize = 160;

/// Captions of the pictures.
const ORBITS_CAPTION: &str = "Orbits in the equator from the same states, exact and learned; the disc is the horizon.";
const SKY_CAPTION: &str = "Shadow and sky of a checkerboard from 20 M: through the exact metric, through the learned one, and their difference.";

/// A row of an experiment: what its runs read, and the pictures of its first run.
pub(crate) struct RowOfHoles {
    /// Label of the row.
    pub label: String,
    /// Table below [`READING_HEADER`].
    pub table: Vec<Vec<String>>,
    /// Orbits, SVG.
    orbits: Option<Vec<u8>>,
    /// Shadow and sky, PNG.
    sky: Option<Vec<u8>>,
}

impl RowOfHoles {
    /// The report with this row.
    pub fn add_to(&self, report: Report) -> Report {
        let report = report.heading(&self.label).table(&READING_HEADER, &self.table);
        let report = match &self.orbits {
            Some(svg) => report.image(svg, ORBITS_CAPTION),
            None => report,
        };
        match &self.sky {
            Some(png) => report.pixels(png, SKY_CAPTION),
            None => report,
        }
    }
}

/// The model of a finished run and the hole that it learned.
struct Hole {
    system: Configured<f64>,
    exact: Box<dyn EulerLagrange<f64>>,
    learned: NetworkLagrangian<f64>,
    around: Around,
    range: (f64, f64),
}

impl Hole {
    /// Reads the model of a run; `None` for a run that learned nothing.
    fn load(run: &Run, store: &dyn ExperimentStore) -> Result<Option<Self>, PipelineError> {
        let system = run.config.system()?;
        let unfit = || PipelineError::Hole(run.config.system.clone());
        let (around, range) = around(&run.config, &system).ok_or_else(unfit)?;
        let Some(bytes) = store.read(&run.name, MODEL) else { return Ok(None) };
        let wrong = |source| PipelineError::Model { path: MODEL.into(), source };
        let ModelFile { header, weights } = ModelFile::<f64>::from_bytes(&bytes).map_err(wrong)?;
        let learned = NetworkLagrangian::new(header.architecture, weights)?;
        Ok(Some(Self { exact: system.build()?, system, learned, around, range }))
    }

    fn pair(&self) -> Pair<'_> {
        let Self { system, exact, learned, around, range } = self;
        Pair { exact: exact.as_ref(), learned, system, around: *around, range: *range }
    }
}

/// Coordinates and learned distances of a configuration; `None` if they are not those around a centre.
fn around(config: &Config, system: &Configured<f64>) -> Option<(Around, (f64, f64))> {
    let coordinates = system.system.coordinates(system.coordinates);
    let names: Vec<&str> = coordinates.iter().map(|c| c.name.as_ref()).collect();
    let around = Around::of_names(&names)?;
    let box_of = |i: usize| config.phases.first().and_then(|phase| phase.position.get(i)).map(|b| (b[0], b[1]));
    let range = match around {
        Around::Cartesian(_) => config.data.shell_radius.map(|[low, high]| (low, high)),
        Around::Spherical { radius, .. } => box_of(radius),
    };
    Some((around, range?))
}

/// The readings of a finished run: those of its file, or new ones, which are kept there; none for a run without a model.
fn readings_of(run: &Run, store: &dyn ExperimentStore, watch: &Watch) -> Result<Vec<Reading>, PipelineError> {
    if let Some(readings) = store.read(&run.name, READINGS).and_then(|json| serde_json::from_slice(&json).ok()) {
        return Ok(readings);
    }
    let Some(hole) = Hole::load(run, store)? else { return Ok(Vec::new()) };
    watch.say(Event::Note(&format!("reading the hole of {}", run.name)));
    let readings = hole.pair().readings().map_err(|_| PipelineError::Hole(run.config.system.clone()))?;
    let json = serde_json::to_string_pretty(&readings).map_err(PipelineError::format)? + "\n";
    store.open_run(&run.name)?.write(READINGS, json.as_bytes())?;
    Ok(readings)
}

/// Orbits and sky of a run: those of its files, or new ones, which are kept there.
fn pictures_of(
    run: &Run,
    (store, sky): (&dyn ExperimentStore, (usize, usize)),
    watch: &Watch,
) -> Result<[Option<Vec<u8>>; 2], PipelineError> {
    let there = [ORBITS, SKY].map(|name| store.read(&run.name, name));
    if there.iter().all(Option::is_some) {
        return Ok(there);
    }
    let Some(hole) = Hole::load(run, store)? else { return Ok(there) };
    let pair = hole.pair();
    let mass = pair.mass().map_err(|_| PipelineError::Hole(run.config.system.clone()))?;
    watch.say(Event::Note(&format!("tracing light through the metric of {}", run.name)));
    let orbits = orbit_figure(&pair, mass).map(|figure| figure.picture.to_svg().into_bytes());
    let sky = sky_picture(&pair, mass, sky, &|| watch.is_interrupted())?;
    let output = store.open_run(&run.name)?;
    for (name, bytes) in [(ORBITS, &orbits), (SKY, &sky)] {
        bytes.as_ref().map_or(Ok(()), |bytes| output.write(name, bytes))?;
    }
    Ok([orbits, sky])
}

/// What the finished runs of an experiment read, row by row; written as `readings.csv` too. None for an experiment that reads no holes.
///
/// # Errors
/// A model file that cannot be read, a system without the coordinates of a hole, files that cannot be written.
pub(crate) fn rows_of_holes(
    experiment: &Experiment,
    results: &[(Run, Option<Record>)],
    (store, scale, threads): (&dyn ExperimentStore, Scale, usize),
    watch: &Watch,
) -> Result<Vec<RowOfHoles>, PipelineError> {
    if !experiment.pictures.contains(&Picture::BlackHole) {
        return Ok(Vec::new());
    }
    let mut rows: Vec<(&Run, Vec<Vec<Reading>>)> = Vec::new();
    for (run, _) in results.iter().filter(|(_, record)| record.is_some()) {
        let readings = readings_of(run, store, watch)?;
        match rows.iter_mut().find(|(first, _)| first.label == run.label) {
            _ if readings.is_empty() => {}
            Some((_, all)) => all.push(readings),
            None => rows.push((run, vec![readings])),
        }
    }
    let pixels = if scale == Scale::Smoke { 12 } else { PIXELS };
    let row = |(run, readings): (&Run, Vec<Vec<Reading>>)| {
        let [orbits, sky] = pictures_of(run, (store, (pixels, threads)), watch)?;
        Ok(RowOfHoles { label: run.label.clone(), table: reading_table(&readings), orbits, sky })
    };
    let rows = rows.into_iter().map(row).collect::<Result<Vec<_>, PipelineError>>()?;
    store.write("readings.csv", csv(&rows).as_bytes())?;
    Ok(rows)
}

fn csv(rows: &[RowOfHoles]) -> String {
    let cell = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let line = |cells: &mut dyn Iterator<Item = &str>| cells.map(cell).collect::<Vec<_>>().join(",") + "\n";
    let mut csv = line(&mut ["row"].into_iter().chain(READING_HEADER));
    for RowOfHoles { label, table, .. } in rows {
        csv.extend(
            table.iter().map(|row| line(&mut [label.as_str()].into_iter().chain(row.iter().map(String::as_str)))),
        );
    }
    csv
}
