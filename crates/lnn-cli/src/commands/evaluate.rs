//! `lnn evaluate`: compares a model with the system it learned.

use crate::CliError;
use crate::arguments::learned::{Learned, model_file};
use crate::arguments::number::{bounds, positive, seed, thread_count, threads, tolerance, whole};
use crate::arguments::source;
use crate::directories::output_dir::{self, Wanted};
use crate::directories::results::Writer;
use crate::terminal::watch::watch;
use crate::terminal::{interrupt, output};
use lnn::lagrangian::SystemInstance;
use lnn::lagrangian::system::{Bounds, TrajectoryTest};
use lnn::pipeline::{Evaluation, EvaluationOptions, PipelineError, RTOL};
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Model, a file or the directory of a run.
    model: PathBuf,
    /// System to compare with, by name or by its file, instead of the learned one. Use it with a model of recorded motion,
    /// such as one of lnn fit.
    #[arg(long, value_name = "NAME|FILE")]
    system: Option<String>,
    /// A parameter of that system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", requires = "system", value_parser = source::parameter)]
    param: Vec<(String, String)>,
    /// Random initial conditions of the trajectory test.
    #[arg(long, value_name = "N", default_value = "4", allow_hyphen_values = true, value_parser = whole(1, 1_000_000))]
    starts: usize,
    /// Seed of the states and initial conditions [default: the model's].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = seed)]
    seed: Option<u64>,
    /// Bounds of the initial coordinates, one pair for all of them or one for each, in the system's units [default: the
    /// paper's].
    #[arg(long, value_name = "LOW:HIGH,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = bounds)]
    positions: Vec<(f64, f64)>,
    /// The same for the velocities; a velocity that a mass shell determines is not used.
    #[arg(long, value_name = "LOW:HIGH,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = bounds)]
    velocities: Vec<(f64, f64)>,
    /// Time span of the motions, in the time unit of the system, for geodesics of the proper time [default: the paper's].
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = positive)]
    until: Option<f64>,
    /// Relative tolerance of a step of the learned motion, at least 2e-15; the absolute one is a hundredth of it.
    #[arg(long, value_name = "R", default_value_t = RTOL, allow_hyphen_values = true, value_parser = tolerance)]
    rtol: f64,
    /// Threads [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    /// Directory for evaluation.json, report.html and plots; one that holds an evaluation is refused [default:
    /// evaluation beside the model, or the first free of evaluation-2, evaluation-3, ..].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace the evaluation in the directory.
    #[arg(long)]
    overwrite: bool,
    /// Print evaluation.json instead of tables.
    #[arg(long)]
    json: bool,
}

/// The starts and time span of the paper, unless the arguments replace them.
fn span(args: &Args, system: &SystemInstance<f64>) -> Result<TrajectoryTest, CliError> {
    let n = system.coordinates;
    let replaced = |option: &str, given: &[(f64, f64)], paper: Vec<(f64, f64)>| match given {
        [] => Ok(paper),
        [all] => Ok(vec![*all; n]),
        each if each.len() == n => Ok(each.to_vec()),
        _ => {
            let found = given.len();
            Err(CliError::usage(format_args!("{option}: expected 1 or {n} pairs LOW:HIGH, found {found}")))
        }
    };
    let TrajectoryTest { start: Bounds { positions, velocities }, t_end, dt } = system.system.trajectory(n);
    let positions = replaced("--positions", &args.positions, positions)?;
    let velocities = replaced("--velocities", &args.velocities, velocities)?;
    Ok(TrajectoryTest { start: Bounds { positions, velocities }, t_end: args.until.unwrap_or(t_end), dt })
}

/// Runs the paper's trajectory test and writes tables and pictures.
///
/// # Errors
/// A data error for a bad model, an unknown system or a directory that cannot be written.
pub fn run(args: &Args) -> Result<(), CliError> {
    let learned = Learned::<f64>::load(&args.model)?;
    let system = match &args.system {
        Some(name) => learned.beside(name, &args.param)?,
        None => learned.system(&args.model)?,
    };
    let file = model_file(&args.model)?;
    let usual = file.parent().unwrap_or(Path::new("")).join("evaluation");
    let (out, inputs) = (args.out.as_deref(), [file.as_path()]);
    let wanted = Wanted { out, usual: &usual, overwrite: args.overwrite, inputs: &inputs, writer: Writer::Evaluator };
    let folder = output_dir::open(&wanted)?;

    let seed = args.seed.unwrap_or(learned.header.seed);
    let mut options = EvaluationOptions::new(&system, learned.domain(), seed)?;
    (options.starts, options.span, options.rtol) = (args.starts, span(args, &system)?, args.rtol);
    options.threads = threads(args.threads);
    // If the model's file describes a system, the constraints are already part of that system.
    options.constraints = learned.header.description.is_none().then(|| learned.header.constraints.clone());
    let stop = interrupt::flag()?;
    let evaluation = match Evaluation::of(&system, &learned.network, options, &watch(&stop)) {
        Err(PipelineError::Interrupted) => {
            return Err(CliError::interrupted("interrupted before anything was compared"));
        }
        evaluation => evaluation?,
    };
    let model = args.model.display().to_string();
    let json = evaluation.write(&system, (&model, &learned.header, &learned.network), seed, &folder)?;
    if args.json {
        output::print(&json)?;
    } else {
        let report = folder.file("report.html");
        output::print(&format!("{}\nreport: {}\n", evaluation.findings(&system.system.title), report.display()))?;
    }
    match evaluation.interrupted {
        Some(part) => {
            let place = folder.path().display();
            Err(CliError::interrupted(format_args!("interrupted, the evaluation in {place} is of {part}")))
        }
        None => Ok(()),
    }
}
