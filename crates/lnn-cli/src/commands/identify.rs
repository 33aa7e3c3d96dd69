//! `lnn identify`: determines the constants of a known Lagrangian from recorded motion.

use crate::CliError;
use crate::arguments::number::{choice, positive, seconds, thread_count, threads};
use crate::arguments::recording_args::RecordingArgs;
use crate::arguments::source::parameter;
use crate::arguments::system_arg;
use crate::directories::files::OutputFile;
use crate::terminal::output;
use crate::terminal::result_page::PageArgs;
use crate::terminal::watch::search;
use lnn::identification::{Between, Identified, IdentifyError, IdentifyOptions, identify};
use lnn::lagrangian::SystemInstance;
use lnn::pipeline::{is_robot, rewrite_robot};
use lnn::recording::Targets;
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
    let mut inputs = args.recording.inputs();
    inputs.push(Path::new(&args.system));
    let files = args.page.files(args.out.as_deref(), &inputs, |out, inputs, overwrite| match rewritten(args) {
        None => OutputFile::claim_system(out, inputs, overwrite),
        Some(robot) => {
            // Detects before the search what cannot be written after it.
            system_arg::from_robot(robot, |text| rewrite_robot(text, &[]))?;
            OutputFile::claim(out, inputs, overwrite)
        }
    })?;
    let instance =
        SystemInstance::<f64>::new(system, &args.param).map_err(|e| CliError::usage(format_args!("--param: {e}")))?;
    system_arg::note_impacts(&instance);
    let reading = args.recording.read_of(&instance, &args.error)?;
    let options = IdentifyOptions::new()
        .constants(&args.constants)
        .offsets(&args.offset)
        .gains(&args.gain)
        .delays(&args.delay)
        .noise(args.noise.clone())
        .of_recording(&reading)
        .targets(args.targets)
        .between(args.between)
        .segment(args.segment)
        .robust(args.robust)
        .by_trajectory(args.by_trajectory)
        .threads(threads(args.threads))
        .cancellation(search()?);
    let found = identify(&instance, &reading.recording, &options).map_err(refused)?;
    drop(options);
    match (&files.out, rewritten(args)) {
        (Some(out), Some(robot)) => {
            let values = found.parameters(&instance);
            out.write(system_arg::from_robot(robot, |text| rewrite_robot(text, &values))?.as_bytes())?;
        }
        (Some(out), None) => {
            if let Some(text) = found.system_file(&instance)? {
                out.write_system(&text, CliError::data)?;
            }
        }
        (None, _) => {}
    }
    let found = found.with_rows_of(&reading);
    let title = format!("Constants of {}", instance.system.name);
    files.write_page(&title, &found.findings(), &identification_figures(&found, &reading.recording.periodic))?;
    files.print(&output::shown(&found, args.json, Identified::findings)?)
}

/// The robot's file that is written with other constants, if the system is a robot and `--out` names a robot's file.
fn rewritten(args: &Args) -> Option<&Path> {
    args.out.as_deref().filter(|out| is_robot(out)).map(|_| Path::new(&args.system)).filter(|system| is_robot(system))
}

/// Distinguishes usage errors, caused by options, from data errors.
fn refused(error: IdentifyError) -> CliError {
    match (&error, error.option()) {
        (IdentifyError::Cancelled(_), _) => CliError::nothing_written(),
        (_, Some(name @ ("offsets" | "gains" | "delays"))) => {
            CliError::option(name.trim_end_matches('s'), name, &error)
        }
        (_, Some(name)) => CliError::option(&name.replace('_', "-"), name, &error),
        (_, None) => CliError::data(&error),
    }
}
