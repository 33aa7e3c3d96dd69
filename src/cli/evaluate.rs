//! `lnn evaluate`: a model against the system it learned.

use crate::cli::evaluation::{Evaluation, Plan, evaluate};
use crate::cli::folder::Folder;
use crate::cli::learned::Learned;
use crate::cli::number::{count, threads};
use crate::cli::{CliError, output};
use crate::report::Report;
use crate::training::{Stream, sample};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Fresh states on which accelerations are compared.
const STATES: usize = 12_000;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Model file.
    model: PathBuf,
    /// Random starts of the trajectory test.
    #[arg(long, value_name = "N", default_value = "4", allow_hyphen_values = true, value_parser = count)]
    starts: usize,
    /// Seed of the states and starts [default: the model's].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<u64>,
    /// Threads [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = count)]
    threads: Option<usize>,
    /// Directory for evaluation.json, report.html and pictures [default: evaluation, beside the model].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print evaluation.json instead of tables.
    #[arg(long)]
    json: bool,
}

/// What `evaluation.json` holds.
#[derive(Serialize)]
struct Summary<'a> {
    system: &'a str,
    seed: u64,
    validation_loss: f64,
    #[serde(flatten)]
    evaluation: &'a Evaluation,
}

/// Runs the paper's trajectory test and writes tables and pictures.
///
/// # Errors
/// A data error for a bad model, an unknown system or a directory that cannot be written.
pub fn run(args: &Args) -> Result<(), CliError> {
    let learned = Learned::<f64>::load(&args.model)?;
    let system = learned.system(&args.model)?;
    let beside = || args.model.parent().unwrap_or(Path::new("")).join("evaluation");
    let folder = Folder::open(&args.out.clone().unwrap_or_else(beside))?;

    let seed = args.seed.unwrap_or(learned.header.seed);
    let bounds = (system.system.validation)(system.coordinates);
    let pairs = |bounds: &[(f64, f64)]| bounds.iter().map(|&(low, high)| [low, high]).collect::<Vec<_>>();
    let bounds = (pairs(&bounds.positions), pairs(&bounds.velocities));
    let mut random = Stream::Test.generator(seed);
    let states =
        sample(&system, "validation bounds", (&bounds.0, &bounds.1), STATES, &mut random).map_err(CliError::data)?;

    let plan = Plan {
        states: (states.q(), states.v()),
        starts: args.starts,
        horizon: 1.0,
        seed,
        threads: threads(args.threads),
    };
    let evaluation = evaluate(&system, &learned.network, plan)?;
    let validation_loss = learned.header.validation_loss;
    let summary = Summary { system: system.system.name, seed, validation_loss, evaluation: &evaluation };
    let json = serde_json::to_string_pretty(&summary).map_err(CliError::data)? + "\n";
    let title = format!("{}: learned against exact", system.system.title);
    let report = Report::new(&title).paragraph(&format!("Model {}, starts of seed {seed}.", args.model.display()));
    for figure in &evaluation.figures {
        folder.write(&figure.file, &figure.png)?;
    }
    folder.write("evaluation.json", json.as_bytes())?;
    folder.write("report.html", evaluation.report(report).to_html().as_bytes())?;
    if args.json {
        return output::print(&json);
    }
    output::print(&format!("{}\nreport: {}\n", evaluation.text(), folder.file("report.html").display()))
}
