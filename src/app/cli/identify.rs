//! `lnn identify`: the constants of a system whose form is known, from recorded motion.

use crate::cli::files::OutputFile;
use crate::cli::number::{positive, seconds, thread_count, threads};
use crate::cli::recording_args::{RecordingArgs, read as read_files};
use crate::cli::source::parameter;
use crate::cli::watch::search;
use crate::cli::{CliError, parse_system, system_arg};
use crate::identification::{
    Between, Bodies, Constant, Identified, IdentifyError, IdentifyOptions, Undetermined, identify,
};
use crate::lagrangian::{SystemInstance, configure_system};
use crate::names::{number, pluralize, rounded};
use crate::recording::{Columns, LoadedRecording, Targets};
use crate::report::text_table;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Outliers that are printed.
const SHOWN: usize = 10;

/// Arguments.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args(of_the_system))]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// The system whose constants are unknown, by name or by the file that describes it.
    #[arg(long, value_name = "NAME|FILE.toml")]
    system: String,
    /// The unknown constants, by symbol [default: those with learn = true in the file; all if there are none].
    #[arg(long, value_name = "SYMBOL,..", value_delimiter = ',')]
    constants: Vec<String>,
    /// Value of a parameter: of an unknown constant where the search starts; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", value_parser = parameter)]
    param: Vec<(String, String)>,
    /// Coordinates whose sensor has an unknown offset.
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    offset: Vec<String>,
    /// Coordinates whose sensor has an unknown gain.
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    gain: Vec<String>,
    /// Coordinates whose sensor is late by an unknown time.
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    delay: Vec<String>,
    /// Standard deviation of the noise of every coordinate [default: estimated].
    #[arg(long, value_name = "S1,S2,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = positive)]
    noise: Option<Vec<f64>>,
    /// Columns of the standard deviations of the positions, row by row, one per coordinate and in its unit; residuals are weighed by them.
    #[arg(long, value_name = "COLUMN,..", value_delimiter = ',', conflicts_with = "noise")]
    error: Vec<String>,
    /// What the constants are fitted to: the motion, or the known forces [default: the forces of a chain of links, else the motion].
    #[arg(long, value_enum, value_name = "WHAT")]
    targets: Option<Met>,
    /// Known forces between the samples [default: what meets the motion best].
    #[arg(long, value_enum, value_name = "WAY")]
    between: Option<Between>,
    /// Length of the segments that are followed, in s [default: what makes the constants best known].
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, value_parser = seconds)]
    segment: Option<f64>,
    /// Let residuals beyond three standard deviations count linearly, so that outliers move little.
    #[arg(long)]
    robust: bool,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    /// One JSON object instead of tables.
    #[arg(long)]
    json: bool,
    /// Write the system with the constants that were found, as a file that rolls out, trains and is known to a grey box.
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    /// Replace the file.
    #[arg(long, requires = "out")]
    overwrite: bool,
}

/// What is met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Met {
    /// The motion.
    Motion,
    /// Known forces.
    Forces,
}

impl From<Met> for Targets {
    fn from(met: Met) -> Self {
        match met {
            Met::Motion => Self::Motion,
            Met::Forces => Self::Forces,
        }
    }
}

/// Columns are those of the system unless others are named.
fn of_the_system(argument: clap::Arg) -> clap::Arg {
    match argument.get_id().as_str() {
        "coords" => {
            argument.required(false).help("Columns of the coordinates, in the order of the system [default: its names]")
        }
        "periodic" => argument.help("Coordinates that are angles, which are unwrapped [default: those of the system]"),
        _ => argument,
    }
}

/// Identifies constants and prints them.
///
/// # Errors
/// A usage error for contradicting arguments, a data error for files that cannot be used.
pub fn run(args: &Args) -> Result<(), CliError> {
    let system = system_arg::system(&args.system)?;
    if args.out.is_some() && system.description().is_none() {
        let problem = "the Lagrangian of a listed system is no formula; give its constants by --param";
        return Err(CliError::usage(format_args!("--out: {problem}")));
    }
    let inputs: Vec<&Path> =
        args.recording.data.iter().map(PathBuf::as_path).chain([Path::new(&args.system)]).collect();
    let out = args.out.as_deref().map(|out| OutputFile::claim_system(out, &inputs, args.overwrite)).transpose()?;
    let instance =
        configure_system::<f64>(system, &args.param).map_err(|e| CliError::usage(format_args!("--param: {e}")))?;
    let reading = read(args, &instance)?;
    let options = IdentifyOptions {
        constants: args.constants.clone(),
        offsets: args.offset.clone(),
        gains: args.gain.clone(),
        delays: args.delay.clone(),
        noise: args.noise.clone(),
        errors: reading.errors.clone(),
        targets: args.targets.map(Targets::from),
        between: args.between,
        segment: args.segment,
        robust: args.robust,
        threads: threads(args.threads),
        cancellation: search()?,
    };
    let found = identify(&instance, &reading.recording, &options).map_err(refused)?;
    drop(options);
    if let Some(out) = &out {
        write(out, &instance, &found)?;
    }
    let text = if args.json { json_text(&found, &reading)? } else { text(&found, &reading, args) };
    OutputFile::print(out, &text)
}

/// The recording, its columns by the names of the system unless others are given.
fn read(args: &Args, instance: &SystemInstance<f64>) -> Result<LoadedRecording, CliError> {
    let coordinates = instance.system.coordinates(instance.coordinates);
    let mut recording = args.recording.clone();
    if recording.coords.is_empty() {
        recording.coords = coordinates.iter().map(|c| c.name.to_string()).collect();
    }
    if recording.coords.len() != coordinates.len() {
        let (expected, found) = (coordinates.len(), recording.coords.len());
        let columns = pluralize(expected, "column", "columns");
        return Err(CliError::usage(format_args!(
            "--coords: expected {columns}, as many as {} has coordinates, found {found}",
            instance.system.name
        )));
    }
    if recording.periodic.is_empty() {
        let angles = recording.coords.iter().zip(&coordinates).filter(|(_, coordinate)| coordinate.periodic);
        recording.periodic = angles.map(|(column, _)| column.clone()).collect();
    }
    let columns = Columns { error: args.error.clone(), whole: true, ..recording.meaning() };
    read_files(&recording.data, &columns)
}

/// What the user chose, or what the data are.
fn refused(error: IdentifyError) -> CliError {
    match &error {
        IdentifyError::Constant { .. } | IdentifyError::Repeated { what: "constants", .. } => {
            CliError::usage(format_args!("--{error}"))
        }
        IdentifyError::Sensor { what, .. } | IdentifyError::Repeated { what, .. } => {
            // Options are in the singular.
            let text = error.to_string();
            CliError::usage(format_args!("--{}{}", what.trim_end_matches('s'), &text[what.len()..]))
        }
        IdentifyError::Smooth(problem) if problem.to_string().starts_with("noise") => {
            CliError::usage(format_args!("--{error}"))
        }
        IdentifyError::Cancelled(_) => CliError::nothing_written(),
        IdentifyError::Option { .. } => CliError::usage(format_args!("--{error}")),
        IdentifyError::Constrained { .. } | IdentifyError::Nothing { .. } => {
            CliError::usage(format_args!("--system: {error}"))
        }
        _ => CliError::data(error),
    }
}

/// Writes the description with the values that were found.
fn write(out: &OutputFile<'_>, instance: &SystemInstance<f64>, found: &Identified) -> Result<(), CliError> {
    let given = instance.system.parameters.iter().zip(&instance.parameters);
    let mut values: Vec<(&str, f64)> = given.map(|(parameter, value)| (parameter.symbol.as_ref(), *value)).collect();
    for constant in &found.constants {
        values.iter_mut().filter(|(name, _)| *name == constant.symbol).for_each(|(_, x)| *x = constant.value);
    }
    let Some(description) = instance.system.with_defaults(&values) else { return Ok(()) };
    let text = toml::to_string(&description).map_err(CliError::data)?;
    parse_system(&text).map_err(|(_, problem)| CliError::data(format_args!("--out: no system file: {problem}")))?;
    out.write(text.as_bytes())
}

/// Name of the file and the row of a sample.
fn place(reading: &LoadedRecording, track: usize, sample: usize) -> (String, u64) {
    (reading.recording.tracks[track].name.clone(), reading.rows[track].row(sample))
}

fn json_text(found: &Identified, reading: &LoadedRecording) -> Result<String, CliError> {
    let constants: Map<String, Value> = found
        .constants
        .iter()
        .map(|c| {
            let value =
                json!({ "value": c.value, "standard_error": c.standard_error, "unit": c.unit, "start": c.start, "at_bound": c.at_bound });
            (c.symbol.clone(), value)
        })
        .collect();
    let names: Vec<String> =
        found.constants.iter().map(|c| c.symbol.clone()).chain(found.sensors.iter().map(sensor)).collect();
    let m = names.len();
    let matrix: Vec<&[f64]> = found.correlations.chunks(m.max(1)).collect();
    let outliers: Vec<Value> = found
        .outliers
        .iter()
        .map(|o| {
            let (trajectory, row) = place(reading, o.track, o.sample);
            json!({ "trajectory": trajectory, "row": row, "t": o.time, "coordinate": o.coordinate, "size": o.size })
        })
        .collect();
    let whole = json!({
        "constants": constants,
        "sensors": found.sensors,
        "obstacles": found.obstacles,
        "converged": found.converged,
        "decrement": found.decrement,
        "undetermined": found.undetermined,
        "combinations": found.combinations,
        "bodies": found.bodies,
        "correlations": { "names": names, "matrix": matrix },
        "residual": {
            "coordinates": found.residuals,
            "over_noise": found.over_noise,
            "explained": found.explained,
            "verdict": found.verdict,
            "says": found.verdict.to_string(),
            "inflation": found.inflation,
        },
        "force_noise": found.force_noise,
        "outliers": outliers,
        "outlier_count": found.outlier_count,
        "samples": found.samples,
        "segments": found.segments,
        "segment_seconds": found.segment_seconds,
        "steps_between_samples": found.substeps,
        "forces_between_samples": found.between,
    });
    Ok(serde_json::to_string(&whole).map_err(CliError::data)? + "\n")
}

fn sensor(sensor: &crate::identification::SensorConstant) -> String {
    format!("{} of {}", sensor.kind, sensor.coordinate)
}

/// A value with the digits that its error leaves it, and the error.
fn with_error(value: f64, error: Option<f64>) -> [String; 2] {
    let Some(error) = error.filter(|error| error.is_finite() && *error > 0.0) else {
        return [rounded(value, 4), "-".to_string()];
    };
    let exponent = |x: f64| x.abs().log10().floor() as i32;
    let digits = if value == 0.0 { 2 } else { exponent(value) - exponent(error) + 2 };
    [rounded(value, digits.clamp(1, 17) as usize), rounded(error, 2)]
}

/// What became of the inertias of links.
fn bodies(bodies: &Bodies) -> String {
    let Bodies { moved, largest_change, exist } = bodies;
    let links = moved.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let change = rounded(*largest_change, 2);
    match (moved.is_empty(), exist) {
        (_, false) if moved.is_empty() => "\nno bodies have the constants that are given\n".into(),
        (_, false) => format!(
            "\nno bodies have these sums within their errors: the nearest ones are {change} standard errors away; is the form complete?\n"
        ),
        (true, true) => String::new(),
        (false, true) => format!(
            "\nthe constants of links {links} are the nearest to the start that bodies have; known sums change by {change} standard errors at most\n"
        ),
    }
}

fn text(found: &Identified, reading: &LoadedRecording, args: &Args) -> String {
    let row = |name: String, (value, error): (f64, Option<f64>), unit: &str, start: f64| {
        let [value, error] = with_error(value, error);
        vec![name, value, error, unit.to_string(), rounded(start, 4)]
    };
    // Where sums are known, constants that they alone tell have no row of their own.
    let alone = |c: &&Constant| found.combinations.is_empty() || c.standard_error.is_some();
    let rows = found.constants.iter().filter(alone).map(|c| {
        let mut row = row(c.symbol.clone(), (c.value, c.standard_error), &c.unit, c.start);
        if c.at_bound {
            row[2] = "at its bound".to_string();
        }
        row
    });
    let perfect = |kind: &str| if kind == "gain" { 1.0 } else { 0.0 };
    let sensors = found.sensors.iter().map(|s| {
        let unit = if s.kind == "delay" { "s" } else { "" };
        row(sensor(s), (s.value, s.standard_error), unit, perfect(s.kind))
    });
    let headers = ["constant", "value", "standard error", "unit", "start"];
    let said: String = found.obstacles.iter().map(|obstacle| format!("{obstacle}\n")).collect();
    let mut text = said + &text_table(&headers, &rows.chain(sensors).collect::<Vec<_>>());
    let sums = found.combinations.iter().filter(|sum| sum.terms.len() > 1);
    let known = sums.chain(found.undetermined.iter().flat_map(|open| &open.known)).map(|known| {
        let [value, error] = with_error(known.value, Some(known.standard_error));
        vec![known.name.clone(), value, error, known.unit.clone()]
    });
    let known: Vec<Vec<String>> = known.collect();
    if !known.is_empty() {
        text += &format!("\n{}", text_table(&["combination", "value", "standard error", "unit"], &known));
    }
    for Undetermined { text: open, cure, .. } in &found.undetermined {
        text += &format!("\n{open}\n  what would determine it: {cure}\n");
    }
    text += &found.bodies.as_ref().map(bodies).unwrap_or_default();
    let m = found.constants.len() + found.sensors.len();
    let names: Vec<String> =
        found.constants.iter().map(|c| c.symbol.clone()).chain(found.sensors.iter().map(sensor)).collect();
    let mut pairs: Vec<(usize, usize, f64)> =
        (0..m).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| (i, j, found.correlations[i * m + j])).collect();
    pairs.retain(|(_, _, c)| c.abs() > 0.9);
    pairs.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    if !pairs.is_empty() {
        let listed = pairs.iter().take(SHOWN).map(|(i, j, c)| format!("{} and {} {c:.3}", names[*j], names[*i]));
        text += &format!("\ncorrelations of errors beyond 0.9: {}\n", listed.collect::<Vec<_>>().join(", "));
    }
    let rows = found.residuals.iter().map(|r| {
        let white = if r.white { "independent" } else { "correlated" };
        vec![
            r.coordinate.clone(),
            number(r.rms),
            number(r.noise),
            number(r.spread),
            format!("{:.2}", r.autocorrelation),
            white.to_string(),
        ]
    });
    let what = if found.segments == 0 { "force on" } else { "coordinate" };
    let headers = [what, "residual", "noise", "spread", "autocorrelation", ""];
    text += &format!("\n{}", text_table(&headers, &rows.collect::<Vec<_>>()));
    text += &format!("{}\n", found.verdict);
    if !found.converged {
        text += &format!("{} times the variance of the noise is left to gain\n", number(found.decrement));
    }
    text += &pluralize(found.samples, "sample", "samples");
    if found.segments > 0 {
        let segments = pluralize(found.segments, "segment", "segments");
        text += &format!(" in {segments} of {} s", number(found.segment_seconds));
    }
    if let Some(between) = found.between {
        let way = between.name();
        text += &format!(", forces {way} between the samples (roll-outs: --between {way})");
    }
    if !found.force_noise.is_empty() {
        let sizes: Vec<String> = found.force_noise.iter().map(|size| rounded(*size, 2)).collect();
        text += &format!(", noise of forces {}", sizes.join(", "));
    }
    text += "\n";
    if found.outlier_count > 0 {
        let rows = found.outliers.iter().take(SHOWN).map(|o| {
            let (trajectory, row) = place(reading, o.track, o.sample);
            vec![trajectory, row.to_string(), rounded(o.time, 6), o.coordinate.clone(), rounded(o.size, 3)]
        });
        let headers = ["trajectory", "row", "t", "coordinate", "residual / typical"];
        let advice = if args.robust || found.segments == 0 { "" } else { "; --robust limits their influence" };
        let samples = pluralize(found.outlier_count, "sample", "samples");
        text +=
            &format!("\n{samples} far from the motion{advice}\n{}", text_table(&headers, &rows.collect::<Vec<_>>()));
    }
    text
}
