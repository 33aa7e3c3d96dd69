//! `lnn formula`: the Lagrangian of recorded motion, or of a model, as a formula.

use crate::CliError;
use crate::arguments::number::{choice, finite, positive, seed, thread_count, threads, whole};
use crate::arguments::probe::Probe;
use crate::arguments::recording_args::RecordingArgs;
use crate::directories::files::{OutputFile, ends_in};
use crate::terminal::output;
use crate::terminal::result_page::{self, PageArgs};
use crate::terminal::watch::search;
use lnn::formula::{Families, FormulaError, FormulaOptions, FoundFormula, MODEL_STATES, MOST_BOOTSTRAPS};
use lnn::identification::Between;
use lnn::pipeline::parse_system;
use lnn::recording::LoadedRecording;
use lnn::report::formula_figures;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args(motion_or_model))]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// Functions in the terms, by family and total degree: polynomial, trigonometric (of sums and differences of
    /// angles too), radial, reciprocal [default: for motion, larger and larger bases until one fits; for a model
    /// polynomial:2,trigonometric:2].
    #[arg(long, value_name = "FAMILY:DEGREE,..", value_parser = families)]
    basis: Option<Families>,
    /// An additional function of the coordinates, such as exp(-x); may be repeated.
    #[arg(long, value_name = "FORMULA", allow_hyphen_values = true)]
    function: Vec<String>,
    /// Leave out terms that are linear in the velocities, as in magnetic fields and rotating frames.
    #[arg(long)]
    no_gyroscopic: bool,
    /// Also look for a Rayleigh dissipation function of the velocities, first with constant coefficients, then with
    /// functions of the coordinates.
    #[arg(long)]
    friction: bool,
    /// Do not look for a periodic drive where no formula without one is found.
    #[arg(long)]
    no_drive: bool,
    /// Standard deviation of the noise of every coordinate, in SI units [default: estimated].
    #[arg(long, value_name = "S1,S2,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = positive)]
    noise: Option<Vec<f64>>,
    /// Interpolation of the known forces between the samples [default: the one that fits the motion best].
    #[arg(long, value_parser = choice(&Between::ALL, Between::name, Between::about), value_name = "NAME")]
    between: Option<Between>,
    /// Term and coefficient that fix the common factor, such as "x_dot^2=0.5" [default: the first square of a velocity, 1/2;
    /// the forces where they are known].
    #[arg(long, value_name = "TERM=VALUE", value_parser = scale)]
    scale: Option<(String, f64)>,
    /// Bootstrap samples of the trajectories, which give every term a probability; at most 10000.
    #[arg(long, value_name = "N", default_value = "40", value_parser = whole(1, MOST_BOOTSTRAPS))]
    bootstraps: usize,
    /// Seed of the held-out trajectories, bootstrap samples and states.
    #[arg(long, value_name = "N", default_value = "0", value_parser = seed)]
    seed: u64,
    /// Threads; the result does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    /// Form of the formula on standard output.
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "text")]
    format: Format,
    /// One JSON object instead.
    #[arg(long, conflicts_with = "format")]
    json: bool,
    /// Write the formula as a system file for train, rollout and certify, with its constants as parameters.
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    #[command(flatten)]
    page: PageArgs,
    /// Name of the system in the file.
    #[arg(long, value_name = "NAME", default_value = "formula", value_parser = system_name)]
    name: String,
}

/// Form of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// The formula, and a table of its terms.
    Text,
    /// A system file.
    Toml,
    /// LaTeX.
    Latex,
    /// A Rust type with this Lagrangian.
    Rust,
}

/// Column options apply only to recorded motion, not to a model.
fn motion_or_model(argument: clap::Arg) -> clap::Arg {
    match argument.get_id().as_str() {
        "data" => argument.value_name("DATA|MODEL").help(
            "Files of recorded motion: CSV, XLSX, NPY or NPZ, one of them - for standard input; or one model, a file or the directory of a run",
        ),
        _ => argument,
    }
}

fn families(text: &str) -> Result<Families, String> {
    text.parse()
}

fn scale(text: &str) -> Result<(String, f64), String> {
    let wrong = || "expected TERM=VALUE, such as x_dot^2=0.5".to_string();
    let (term, value) = text.rsplit_once('=').ok_or_else(wrong)?;
    let value = finite(value).ok().filter(|value| *value != 0.0).ok_or_else(wrong)?;
    Ok((term.trim().to_string(), value))
}

fn system_name(text: &str) -> Result<String, String> {
    let known = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if !text.is_empty() && text.len() <= 64 && text.chars().all(known) {
        Ok(text.to_string())
    } else {
        Err("expected 1 to 64 letters, digits, - and _".to_string())
    }
}

impl Args {
    fn options(&self) -> Result<FormulaOptions, CliError> {
        Ok(FormulaOptions {
            families: self.basis,
            functions: self.function.clone(),
            gyroscopic: !self.no_gyroscopic,
            friction: self.friction,
            drive: !self.no_drive,
            noise: self.noise.clone(),
            between: self.between,
            scale: self.scale.clone(),
            bootstraps: self.bootstraps,
            seed: self.seed,
            threads: threads(self.threads),
            cancellation: search()?,
            ..FormulaOptions::default()
        })
    }
}

/// Finds a formula and prints it.
///
/// # Errors
/// A usage error for contradicting arguments, a data error for files that cannot be used.
pub fn run(args: &Args) -> Result<(), CliError> {
    let inputs: Vec<&Path> = args.recording.data.iter().map(PathBuf::as_path).collect();
    let out = args.out.as_deref().map(|out| OutputFile::claim_system(out, &inputs, args.page.overwrite)).transpose()?;
    let page = args.page.claim(&inputs)?;
    let found = match args.recording.data.as_slice() {
        [path] if is_model(path) => of_model(args, path)?,
        _ => of_motion(args)?,
    };
    if let Some(out) = &out {
        let text = found.system_file(&args.name);
        parse_system(&text)
            .map_err(|(_, problem)| CliError::usage(format_args!("--out: no system file: {problem}")))?;
        out.write(text.as_bytes())?;
    }
    result_page::write(page, "The Lagrangian as a formula", &found.findings(), &formula_figures(&found))?;
    if args.json {
        return OutputFile::print(out, &output::json(&found.summary(&args.name))?);
    }
    let text = match args.format {
        Format::Text => found.findings().to_string(),
        Format::Toml => found.system_file(&args.name),
        Format::Latex => {
            let friction = if args.friction { format!("D = {}\n", found.latex(true)) } else { String::new() };
            format!("L = {}\n{friction}", found.latex(false))
        }
        Format::Rust => found.rust(),
    };
    OutputFile::print(out, &text)
}

/// `true` for a directory, and for a file of a model.
fn is_model(path: &Path) -> bool {
    path.is_dir() || ends_in(path, &["safetensors"])
}

fn of_motion(args: &Args) -> Result<FoundFormula, CliError> {
    let (reading, _) = args.recording.read()?;
    let n = reading.recording.coordinates.len();
    if let Some(noise) = args.noise.as_ref().filter(|noise| noise.len() != n) {
        return Err(CliError::usage(format_args!("--noise: expected {n} numbers, found {}", noise.len())));
    }
    let units = reading.coordinate_units();
    FoundFormula::of_motion(&reading.recording, &FormulaOptions { units, ..args.options()? })
        .map_err(|error| in_file(error, &reading))
}

fn of_model(args: &Args, path: &Path) -> Result<FoundFormula, CliError> {
    let columns = [
        ("--coords", args.recording.coords.is_empty()),
        ("--noise", args.noise.is_none()),
        ("--between", args.between.is_none()),
        ("--trajectory", args.recording.trajectory.is_none()),
    ];
    if let Some((option, _)) = columns.iter().find(|(_, unused)| !unused) {
        return Err(CliError::usage(format_args!(
            "{option} applies to recorded motion, but {} is a model",
            path.display()
        )));
    }
    let probe = Probe::model(path)?;
    let (q, v) = probe.states(MODEL_STATES, args.seed)?;
    let chart = (probe.coordinates(), &probe.periodic[..]);
    let (units, time_unit) = probe.units();
    let options = FormulaOptions { units, time_unit, ..args.options()? };
    FoundFormula::of_model(probe.model.as_ref(), chart, (&q, &v), &options).map_err(refused)
}

/// Like [`refused`], with the row in the file.
fn in_file(error: FormulaError, reading: &LoadedRecording) -> CliError {
    match &error {
        FormulaError::Wild { track, sample, .. } => {
            CliError::data(format_args!("row {}: {error}", reading.rows[*track].row(*sample)))
        }
        _ => refused(error),
    }
}

/// Distinguishes usage errors, caused by options, from data errors.
fn refused(error: FormulaError) -> CliError {
    match &error {
        FormulaError::Terms { .. } => CliError::usage(format_args!("--basis: {error}")),
        FormulaError::Function { .. } => CliError::usage(format_args!("--function: {error}")),
        FormulaError::Cancelled(_) => CliError::nothing_written(),
        FormulaError::Scale { .. } => CliError::usage(format_args!("--{error}")),
        _ => CliError::data(error),
    }
}
