//! `lnn identify`: determines the constants of a known Lagrangian from recorded motion.

use crate::CliError;
use crate::arguments::number::{choice, positive, seconds, thread_count, threads};
use crate::arguments::recording_args::{RecordingArgs, read as read_files};
use crate::arguments::source::parameter;
use crate::arguments::system_arg;
use crate::directories::files::OutputFile;
use crate::terminal::output;
use crate::terminal::result_page::{self, PageArgs};
use crate::terminal::watch::search;
use lnn::identification::{Between, Identified, IdentifyError, IdentifyOptions, identify};
use lnn::lagrangian::SystemInstance;
use lnn::names::pluralize;
use lnn::pipeline::{is_robot, parse_system, rewrite_robot};
use lnn::recording::{Columns, LoadedRecording, Targets};
use lnn::report::identification_figures;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args(default_to_the_system))]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// The system whose constants are unknown, by name or by the file that describes it.
    #[arg(long, value_name = "NAME|FILE")]
    system: String,
    /// The unknown constants, by symbol [default: those with learn = true in the file; all if there are none].
    #[arg(long, value_name = "SYMBOL,..", value_delimiter = ',')]
    constants: Vec<String>,
    /// Value of a parameter; of an unknown constant it is where the search starts; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", value_parser = parameter)]
    param: Vec<(String, String)>,
    /// Coordinates whose sensor has an unknown offset.
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    offset: Vec<String>,
    /// Coordinates whose sensor has an unknown gain.
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    gain: Vec<String>,
    /// Coordinates whose sensor has an unknown delay.
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    delay: Vec<String>,
    /// Standard deviation of the noise of every coordinate [default: estimated].
    #[arg(long, value_name = "S1,S2,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = positive)]
    noise: Option<Vec<f64>>,
    /// Columns of the standard deviations of the positions, one per coordinate and in its unit; residuals are weighted by them.
    #[arg(long, value_name = "COLUMN,..", value_delimiter = ',', conflicts_with = "noise")]
    error: Vec<String>,
    /// What the constants are fitted to: the motion or the known forces [default: the forces for a chain of links, else the motion].
    #[arg(long, value_parser = choice(&TARGETS, Targets::name, Targets::about), value_name = "WHAT")]
    targets: Option<Targets>,
    /// Interpolation of the known forces between the samples [default: the one that fits the motion best].
    #[arg(long, value_parser = choice(&Between::ALL, Between::name, Between::about), value_name = "NAME")]
    between: Option<Between>,
    /// Length of the segments, in s [default: the one with the smallest standard errors].
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, value_parser = seconds)]
    segment: Option<f64>,
    /// Let residuals beyond three standard deviations count linearly, which limits the influence of outliers.
    #[arg(long)]
    robust: bool,
    /// Also identify each trajectory alone, and compare the constants.
    #[arg(long)]
    by_trajectory: bool,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    /// One JSON object instead of tables.
    #[arg(long)]
    json: bool,
    /// Write the system with the identified constants, as a file for rollout, train and grey boxes; if the system is a URDF, FILE.urdf
    /// writes that URDF.
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    #[command(flatten)]
    page: PageArgs,
}

/// Quantities to which constants can be fitted.
const TARGETS: [Targets; 2] = [Targets::Motion, Targets::Forces];

/// Makes the columns optional, because they default to the coordinates of the system.
fn default_to_the_system(argument: clap::Arg) -> clap::Arg {
    match argument.get_id().as_str() {
        "coords" => argument.help("Columns of the coordinates, in the order of the system [default: its names]"),
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
        let problem = "only a system that a file describes can be written; use the constants with --param";
        return Err(CliError::usage(format_args!("--out: {problem}")));
    }
    let inputs: Vec<&Path> =
        args.recording.data.iter().map(PathBuf::as_path).chain([Path::new(&args.system)]).collect();
    let out = args.out.as_deref().map(|out| claim(args, out, &inputs)).transpose()?;
    let page = args.page.claim(&inputs)?;
    let instance =
        SystemInstance::<f64>::new(system, &args.param).map_err(|e| CliError::usage(format_args!("--param: {e}")))?;
    system_arg::note_impacts(&instance);
    let reading = read(args, &instance)?;
    let options = IdentifyOptions::new()
        .constants(&args.constants)
        .offsets(&args.offset)
        .gains(&args.gain)
        .delays(&args.delay)
        .noise(args.noise.clone())
        .errors(reading.errors.clone())
        .inputs(reading.inputs.clone())
        .missing(reading.missing.clone())
        .targets(args.targets)
        .between(args.between)
        .segment(args.segment)
        .robust(args.robust)
        .by_trajectory(args.by_trajectory)
        .threads(threads(args.threads))
        .cancellation(search()?);
    let found = identify(&instance, &reading.recording, &options).map_err(refused)?;
    drop(options);
    if let Some(out) = &out {
        write(args, out, &instance, &found)?;
    }
    let found = found.with_rows_of(&reading);
    let title = format!("Constants of {}", instance.system.name);
    result_page::write(page, &title, &found.findings(), &identification_figures(&found, &reading.recording.periodic))?;
    OutputFile::print(out, &output::shown(&found, args.json, Identified::findings)?)
}

/// Reads the recording; its columns are named like the coordinates unless options name others.
fn read(args: &Args, instance: &SystemInstance<f64>) -> Result<LoadedRecording, CliError> {
    if !instance.readings().is_empty() {
        return read_measured(args, instance);
    }
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
    let (error, input) = (args.error.clone(), instance.inputs().map(str::to_string).collect());
    let columns = Columns { error, input, whole: true, ..recording.meaning() };
    read_files(&recording.data, &columns)
}

/// Reads the recording of the quantities that the system file declares as measured; the columns have their names.
fn read_measured(args: &Args, instance: &SystemInstance<f64>) -> Result<LoadedRecording, CliError> {
    let mut recording = args.recording.clone();
    let given = [
        ("--coords", recording.coords.is_empty()),
        ("--velocity", recording.velocity.is_empty()),
        ("--acceleration", recording.acceleration.is_empty()),
        ("--force", recording.force.is_empty()),
        ("--error", args.error.is_empty()),
        ("--periodic", recording.periodic.is_empty()),
    ];
    if let Some((option, _)) = given.iter().find(|(_, is_empty)| !is_empty) {
        let problem = "the table [measured] of the system says what the columns are";
        return Err(CliError::usage(format_args!("{option}: {problem}")));
    }
    let readings = instance.readings();
    let columns =
        |angles: bool| readings.iter().filter(move |own| own.periodic || !angles).map(|own| own.column.clone());
    (recording.coords, recording.periodic) = (columns(false).collect(), columns(true).collect());
    let error = readings.iter().filter_map(|own| own.error.clone()).collect();
    let input = instance.inputs().map(str::to_string).collect();
    let columns = Columns { error, input, whole: true, ..recording.meaning() };
    let mut reading = read_files(&recording.data, &columns)?;
    reading.recording.coordinates = instance.measured().map(str::to_string).collect();
    Ok(reading)
}

/// Distinguishes usage errors, caused by options, from data errors.
fn refused(error: IdentifyError) -> CliError {
    match &error {
        IdentifyError::Constant { .. } | IdentifyError::Repeated { what: "constants", .. } => {
            CliError::usage(format_args!("--{error}"))
        }
        IdentifyError::Sensor { what, .. }
        | IdentifyError::SensorsBesideReadings { what }
        | IdentifyError::Repeated { what, .. } => {
            // The messages use plural names, but options are singular.
            let text = error.to_string();
            CliError::usage(format_args!("--{}{}", what.trim_end_matches('s'), &text[what.len()..]))
        }
        IdentifyError::Smooth(problem) if problem.to_string().starts_with("noise") => {
            CliError::usage(format_args!("--{error}"))
        }
        IdentifyError::Cancelled(_) => CliError::nothing_written(),
        IdentifyError::Option { .. } => CliError::usage(format_args!("--{error}")),
        IdentifyError::Description(_)
        | IdentifyError::System(_)
        | IdentifyError::Unknown { .. }
        | IdentifyError::MovesConstraints { .. }
        | IdentifyError::Nothing { .. } => CliError::usage(format_args!("--system: {error}")),
        _ => CliError::data(error),
    }
}

/// `true` if the result goes into a robot file.
fn is_robot_written(args: &Args) -> bool {
    args.out.as_deref().is_some_and(is_robot)
}

/// The file of the result: a system file, or a robot's file if the system is one.
fn claim<'a>(args: &Args, out: &'a Path, inputs: &[&Path]) -> Result<OutputFile<'a>, CliError> {
    match is_robot_written(args) && is_robot(Path::new(&args.system)) {
        true => {
            // Detects before the search what cannot be written after it.
            system_arg::from_robot(Path::new(&args.system), |text| rewrite_robot(text, &[]))?;
            OutputFile::claim(out, inputs, args.page.overwrite)
        }
        false => OutputFile::claim_system(out, inputs, args.page.overwrite),
    }
}

/// Writes the description, or the robot file, with the identified values.
fn write(
    args: &Args,
    out: &OutputFile<'_>,
    instance: &SystemInstance<f64>,
    found: &Identified,
) -> Result<(), CliError> {
    let given = instance.system.parameters.iter().zip(&instance.parameters);
    let mut values: Vec<(&str, f64)> = given.map(|(parameter, value)| (parameter.symbol.as_ref(), *value)).collect();
    for constant in &found.constants {
        values.iter_mut().filter(|(name, _)| *name == constant.symbol).for_each(|(_, x)| *x = constant.value);
    }
    if is_robot_written(args) {
        let written = system_arg::from_robot(Path::new(&args.system), |text| rewrite_robot(text, &values))?;
        return out.write(written.as_bytes());
    }
    let Some(description) = instance.system.with_defaults(&values) else { return Ok(()) };
    let text = toml::to_string(&description).map_err(CliError::data)?;
    parse_system(&text).map_err(|(_, problem)| CliError::data(format_args!("--out: no system file: {problem}")))?;
    out.write(text.as_bytes())
}
