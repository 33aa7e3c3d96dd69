//! `lnn formula`: the Lagrangian of recorded motion, or of a model, as a formula.

use crate::CliError;
use crate::arguments::number::{choice, coefficient, positive, seed, thread_count, threads, whole};
use crate::arguments::plain_name::system_name;
use crate::arguments::probe::Probe;
use crate::arguments::recording_args::{RecordingArgs, data_or};
use crate::directories::files::OutputFile;
use crate::terminal::output;
use crate::terminal::result_page::PageArgs;
use crate::terminal::watch::search;
use lnn::formula::{Families, FormulaError, FormulaOptions, FoundFormula, MODEL_STATES, MOST_BOOTSTRAPS};
use lnn::identification::Between;
use lnn::report::formula_figures;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args(data_or(
    "DATA|MODEL",
    "Files of recorded motion: CSV, XLSX, NPY or NPZ, one of them - for standard input; or one model, a file or the directory of a run",
)))]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// Functions in the terms, by family and total degree: polynomial, trigonometric (of sums and differences of
    /// angles too), radial, reciprocal [default: for motion, larger and larger bases until one fits; for a model
    /// polynomial:2,trigonometric:2].
    #[arg(long, value_name = "FAMILY:DEGREE,..", value_parser = str::parse::<Families>)]
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
    #[arg(long, value_name = "TERM=VALUE", value_parser = coefficient)]
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

impl Args {
    fn options(&self) -> Result<FormulaOptions, CliError> {
        let Self { function: functions, friction, noise, between, scale, bootstraps, seed, .. } = self.clone();
        let (gyroscopic, drive, threads) = (!self.no_gyroscopic, !self.no_drive, threads(self.threads));
        let options = FormulaOptions { functions, friction, noise, between, scale, ..FormulaOptions::default() };
        let options = FormulaOptions { families: self.basis, gyroscopic, drive, bootstraps, seed, threads, ..options };
        Ok(FormulaOptions { cancellation: search()?, ..options })
    }
}

/// Finds a formula and prints it.
///
/// # Errors
/// A usage error for contradicting arguments, a data error for files that cannot be used.
pub fn run(args: &Args) -> Result<(), CliError> {
    let files = args.page.files(args.out.as_deref(), &args.recording.inputs(), OutputFile::claim_system)?;
    let found = match args.recording.model() {
        Some(path) => of_model(args, path)?,
        None => of_motion(args)?,
    };
    if let Some(out) = &files.out {
        out.write_system(&found.system_file(&args.name), CliError::usage)?;
    }
    files.write_page("The Lagrangian as a formula", &found.findings(), &formula_figures(&found))?;
    let text = match args.format {
        _ if args.json => output::json(&found.summary(&args.name))?,
        Format::Text => found.findings().to_string(),
        Format::Toml => found.system_file(&args.name),
        Format::Latex => found.latex_equations(),
        Format::Rust => found.rust(),
    };
    files.print(&text)
}

fn of_motion(args: &Args) -> Result<FoundFormula, CliError> {
    let (reading, _) = args.recording.read()?;
    let options = FormulaOptions { units: reading.coordinate_units(), ..args.options()? };
    FoundFormula::of_motion(&reading.recording, &options).map_err(|error| match error.row(&reading) {
        Some(row) => CliError::data(format_args!("row {row}: {error}")),
        None => refused(&error),
    })
}

fn of_model(args: &Args, path: &Path) -> Result<FoundFormula, CliError> {
    let given = [
        ("--coords", !args.recording.coords.is_empty()),
        ("--noise", args.noise.is_some()),
        ("--between", args.between.is_some()),
        ("--trajectory", args.recording.trajectory.is_some()),
    ];
    if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
        let model = path.display();
        return Err(CliError::usage(format_args!("{option} applies to recorded motion, but {model} is a model")));
    }
    let probe = Probe::model(path)?;
    let (q, v) = probe.states(MODEL_STATES, args.seed)?;
    let (chart, (units, time_unit)) = ((probe.coordinates(), &probe.periodic[..]), probe.units());
    let options = FormulaOptions { units, time_unit, ..args.options()? };
    FoundFormula::of_model(probe.model.as_ref(), chart, (&q, &v), &options).map_err(|error| refused(&error))
}

/// Distinguishes usage errors, caused by options, from data errors.
fn refused(error: &FormulaError) -> CliError {
    match (error, error.option()) {
        (FormulaError::Cancelled(_), _) => CliError::nothing_written(),
        (_, Some("families")) => CliError::option("basis", "families", error),
        (_, Some("functions")) => CliError::option("function", "functions", error),
        (_, Some(name)) => CliError::option(name, name, error),
        (_, None) => CliError::data(error),
    }
}
