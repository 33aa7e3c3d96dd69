//! Black holes as the models of an experiment have them, beside the exact metrics: tables and pictures.

use super::hole_pictures::{orbit_figure, sky_picture};
use lnn::configuration::Config;
use lnn::experiments::{Record, Run, RunSpread};
use lnn::geometry::GeometryError;
use lnn::lagrangian::SystemInstance;
use lnn::names::{percentage, rounded};
use lnn::network::{ModelFile, NetworkLagrangian};
use lnn::pipeline::{Event, ExperimentDirectory, Output, PipelineError, Watch};
use lnn::relativity::{CentralCoordinates, LearnedHole, Reading};
use lnn::report::Report;
use std::sync::atomic::Ordering;

/// Names of the files of a run: its readings, its orbits, its sky.
const READINGS: &str = "readings.json";
const ORBITS: &str = "orbits.svg";
const SKY: &str = "sky.png";
/// All of them that another run must not find.
pub const FILES: [&str; 1] = [READINGS];
/// Name of the table of an experiment.
pub const TABLE: &str = "readings.csv";

/// Pixels along the edge of a picture of the sky, but at the scale `smoke`.
pub const PIXELS: usize = 160;

/// Headings and captions of the pictures.
const ORBITS_TEXTS: [&str; 2] = [
    "Orbits around the hole: learned beside exact",
    "Orbits in the equator from the same states, exact and learned; the disc is the horizon.",
];
const SKY_TEXTS: [&str; 2] = [
    "The shadow of the hole, as the learned metric shows it",
    "Shadow and sky of a checkerboard from 20 M: through the exact metric, through the learned one, and their difference.",
];

/// A result that JSON cannot hold.
fn format(error: serde_json::Error) -> PipelineError {
    PipelineError::Format(error.to_string())
}

/// A row of an experiment: what its runs read, and the pictures of its first run.
pub struct RowOfHoles {
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
        let report = report.heading(&self.label);
        let report = match &self.orbits {
            Some(svg) => report.image(svg, ORBITS_TEXTS),
            None => report,
        };
        let report = match &self.sky {
            Some(png) => report.pixels(png, SKY_TEXTS),
            None => report,
        };
        report.table(&READING_HEADER, &self.table)
    }
}

/// Coordinates and learned distances of a configuration; `None` if they are not those around a centre.
fn around(config: &Config, system: &SystemInstance<f64>) -> Option<(CentralCoordinates, (f64, f64))> {
    let coordinates = system.system.coordinates(system.coordinates);
    let names: Vec<&str> = coordinates.iter().map(|c| c.name.as_ref()).collect();
    let around = CentralCoordinates::of_names(&names)?;
    let box_of = |i: usize| config.phases.first().and_then(|phase| phase.position.get(i)).map(|b| (b[0], b[1]));
    let range = match around {
        CentralCoordinates::Cartesian(_) => config.data.shell_radius.map(|[low, high]| (low, high)),
        CentralCoordinates::Spherical { radius, .. } => box_of(radius),
        _ => None,
    };
    Some((around, range?))
}

/// Result of `look` at the hole of a configuration and at a model that learned it.
///
/// # Errors
/// [`PipelineError::Hole`] for a system that is none.
fn look_at<T>(
    config: &Config,
    learned: &NetworkLagrangian<f64>,
    look: impl FnOnce(&LearnedHole<'_>) -> Result<T, GeometryError>,
) -> Result<T, PipelineError> {
    let system = config.system()?;
    let unfit = || PipelineError::Hole(config.system.clone());
    let (around, range) = around(config, &system).ok_or_else(unfit)?;
    let exact = system.build()?;
    let pair = LearnedHole { exact: exact.as_ref(), learned, system: &system, around, range };
    look(&pair).map_err(|_| unfit())
}

/// Reads the hole of a model that was just learned, into the output of its run; of the first seed pictures too.
///
/// # Errors
/// A system without the coordinates of a hole, files that cannot be written.
pub fn read_hole(
    run: &Run,
    learned: &NetworkLagrangian<f64>,
    (pixels, threads): (usize, usize),
    output: &dyn Output,
    watch: &Watch,
) -> Result<(), PipelineError> {
    let wanted = run.config.seed == 0;
    let (readings, orbits, sky) = look_at(&run.config, learned, |pair| {
        let (readings, mass) = (pair.readings()?, pair.mass()?);
        let orbits = wanted.then(|| orbit_figure(pair, mass)).flatten();
        let sky = if wanted {
            sky_picture(pair, mass, (pixels, threads), &|| watch.interrupt.load(Ordering::SeqCst))
        } else {
            None
        };
        Ok((readings, orbits, sky))
    })?;
    output.write(READINGS, (serde_json::to_string_pretty(&readings).map_err(format)? + "\n").as_bytes())?;
    orbits.map_or(Ok(()), |picture| output.write(ORBITS, picture.to_svg("").as_bytes()))?;
    sky.map_or(Ok(()), |png| output.write(SKY, &png))
}

/// The readings of a finished run: those of its file, or those of its model; none for a run that learned nothing.
fn readings_of(run: &Run, store: &ExperimentDirectory) -> Result<Vec<Reading>, PipelineError> {
    if let Some(readings) = store.read(&run.name, READINGS).and_then(|json| serde_json::from_slice(&json).ok()) {
        return Ok(readings);
    }
    const MODEL: &str = "model.safetensors";
    let Some(bytes) = store.read(&run.name, MODEL) else { return Ok(Vec::new()) };
    let wrong = |source| PipelineError::Model { path: MODEL.into(), source };
    let ModelFile { header, weights } = ModelFile::<f64>::from_bytes(&bytes).map_err(wrong)?;
    let learned = NetworkLagrangian::new(header.architecture, weights)?;
    look_at(&run.config, &learned, |pair| pair.readings())
}

/// Readings of the finished runs, row by row; written as [`TABLE`] too. A run whose files give none is left out with a remark.
///
/// # Errors
/// Files that cannot be written.
pub fn rows_of_holes(
    results: &[(Run, Option<Record>)],
    store: &ExperimentDirectory,
    output: &dyn Output,
    watch: &Watch,
) -> Result<Vec<RowOfHoles>, PipelineError> {
    let mut rows: Vec<(&Run, Vec<Vec<Reading>>)> = Vec::new();
    for (run, _) in results.iter().filter(|(_, record)| record.is_some()) {
        let readings = readings_of(run, store).unwrap_or_else(|error| {
            if let Some(events) = &watch.events {
                events(Event::Note(&format!("{}: {error}; it is left out of the readings", run.name)));
            }
            Vec::new()
        });
        match rows.iter_mut().find(|(first, _)| first.label == run.label) {
            _ if readings.is_empty() => {}
            Some((_, all)) => all.push(readings),
            None => rows.push((run, vec![readings])),
        }
    }
    let row = |(run, readings): (&Run, Vec<Vec<Reading>>)| {
        let [orbits, sky] = [ORBITS, SKY].map(|name| store.read(&run.name, name));
        RowOfHoles { label: run.label.clone(), table: reading_table(&readings), orbits, sky }
    };
    let rows: Vec<RowOfHoles> = rows.into_iter().map(row).collect();
    output.write(TABLE, csv(&rows).as_bytes())?;
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

/// Header of [`reading_table`].
pub const READING_HEADER: [&str; 6] =
    ["quantity", "exact", "learned", "error, median [%]", "error, largest [%]", "aim [%]"];

/// The readings of the runs of a row, a line per quantity in the order of the first run, below [`READING_HEADER`]: values as mean
/// [lowest, highest], errors in per cent; where some of the runs have no value the line says how many have.
pub fn reading_table(runs: &[Vec<Reading>]) -> Vec<Vec<String>> {
    let Some(first) = runs.first() else { return Vec::new() };
    first.iter().map(|reading| line(reading, runs)).collect()
}

fn line(reading: &Reading, runs: &[Vec<Reading>]) -> Vec<String> {
    let same = |readings: &'_ Vec<Reading>| readings.iter().find(|r| r.quantity == reading.quantity).cloned();
    let all: Vec<Reading> = runs.iter().filter_map(same).collect();
    let dash = || "-".to_string();
    let digits = |x: f64| rounded(x, 5);
    let learned = RunSpread::of(all.iter().filter_map(|r| r.learned)).map_or_else(
        dash,
        |RunSpread { mean, low, high, .. }| {
            if low == high { digits(mean) } else { format!("{} [{}, {}]", digits(mean), digits(low), digits(high)) }
        },
    );
    let mut errors: Vec<f64> = all.iter().filter_map(|r| r.error).filter(|e| e.is_finite()).collect();
    errors.sort_by(f64::total_cmp);
    let (median, largest) = (errors.get(errors.len() / 2).copied(), errors.last().copied());
    let largest = largest.map_or_else(dash, percentage);
    let largest = match (errors.len(), runs.len()) {
        (found, runs) if found < runs => format!("{largest} ({found} of {runs} runs)"),
        _ => largest,
    };
    vec![
        reading.quantity.clone(),
        reading.exact.map_or_else(dash, digits),
        learned,
        median.map_or_else(dash, percentage),
        largest,
        percentage(reading.aim),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_holds_the_spread_of_the_runs_and_counts_what_is_missing() {
        let reading = |learned: Option<f64>| Reading {
            quantity: "orbit of light [M]".into(),
            exact: Some(3.0),
            learned,
            error: learned.map(|x| (x / 3.0 - 1.0).abs()),
            aim: 5e-4,
        };
        let runs = [vec![reading(Some(3.003))], vec![reading(Some(2.997))], vec![reading(None)]];
        let expected =
            ["orbit of light [M]", "3.0000", "3.0000 [2.9970, 3.0030]", "0.100", "0.100 (2 of 3 runs)", "0.0500"];
        assert_eq!(reading_table(&runs), [expected.map(String::from).to_vec()]);
        assert_eq!(reading_table(&runs[..1])[0][2..5], ["3.0030", "0.100", "0.100"].map(String::from));
        assert!(reading_table(&[]).is_empty());
    }
}
