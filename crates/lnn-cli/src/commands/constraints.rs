//! `lnn constraints`: constraints of recorded motion, or constraints and degenerate directions of a Lagrangian.

use crate::CliError;
use crate::arguments::config;
use crate::arguments::number::whole;
use crate::arguments::probe::Probe;
use crate::arguments::recording_args::RecordingArgs;
use crate::directories::files::{OutputFile, ends_in};
use crate::terminal::output;
use crate::terminal::result_page::{self, PageArgs};
use crate::terminal::watch::search;
use lnn::constraints::{
    ConstraintSearch, ConstraintSearchError, EXAMINED_STATES, ExaminedLagrangian, FoundConstraints, MotionSamples,
    examine,
};
use lnn::lagrangian::{EulerLagrange, FormulaConstraints};
use lnn::recording::SmoothOptions;
use lnn::report::found_constraint_figures;
use lnn::scalar::Scalar;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(mut_args(optional))]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// Largest total degree of the functions of the coordinates; angles enter by sine and cosine.
    #[arg(long, value_name = "N", default_value = "2", value_parser = whole(1, ConstraintSearch::MOST_DEGREE))]
    degree: usize,
    /// Largest total degree of the coefficients of the velocities.
    #[arg(long, value_name = "N", default_value = "1", value_parser = whole(0, ConstraintSearch::MOST_DEGREE))]
    velocity_degree: usize,
    /// Write the table [constraints] to this file; system files and roll-outs take it.
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    #[command(flatten)]
    page: PageArgs,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Column options apply only to data, not to a Lagrangian.
fn optional(argument: clap::Arg) -> clap::Arg {
    match argument.get_id().as_str() {
        "data" => argument.value_name("DATA|MODEL|SYSTEM").help(
            "Files of recorded motion, with --coords as for lnn check; or, without --coords, one trained model or system (name or file), \
             to list its constraints and degenerate directions",
        ),
        _ => argument,
    }
}

/// `true` for a file that is neither a model nor a system.
fn is_data(path: &Path) -> bool {
    path.is_file() && !ends_in(path, &["toml", "safetensors"])
}

/// The table of constraints in a file.
#[derive(Serialize, Deserialize)]
struct Table {
    #[serde(default)]
    constraints: BTreeMap<String, String>,
}

/// Finds constraints and prints them.
///
/// # Errors
/// A usage error for arguments, a data error for data or a model that cannot be used, or a file that cannot be written.
pub fn run(args: &Args) -> Result<(), CliError> {
    if let ([one], []) = (args.recording.data.as_slice(), args.recording.coords.as_slice())
        && !is_data(one)
    {
        return examined(&one.to_string_lossy(), args);
    }
    let inputs: Vec<&Path> = args.recording.data.iter().map(PathBuf::as_path).collect();
    let out = args.out.as_deref().map(|out| OutputFile::claim(out, &inputs, args.page.overwrite)).transpose()?;
    let page = args.page.claim(&inputs)?;
    let recording = args.recording.read()?.0.recording;
    let samples = MotionSamples::of(&recording, &SmoothOptions::default()).map_err(CliError::data)?.watched(&search()?);
    let wanted = ConstraintSearch { degree: args.degree, velocity_degree: args.velocity_degree };
    let found = FoundConstraints::of(&samples, wanted).map_err(|error| match error {
        ConstraintSearchError::Cancelled(_) => CliError::nothing_written(),
        error => CliError::data(error),
    })?;
    if let Some(out) = &out {
        write_table(out, &found)?;
    }
    result_page::write(
        page,
        "Constraints of recorded motion",
        &found.findings(),
        &found_constraint_figures(&found, &samples),
    )?;
    OutputFile::print(out, &output::shown(&found, args.json, FoundConstraints::findings)?)
}

/// Writes the constraints of the system as the table that a system file takes.
fn write_table(out: &OutputFile<'_>, found: &FoundConstraints) -> Result<(), CliError> {
    let constraints = found.formulas();
    if constraints.is_empty() {
        return Err(CliError::data("--out: no constraint was found within the noise: there is nothing to write"));
    }
    let text = toml::to_string(&Table { constraints }).map_err(CliError::data)?;
    out.write(text.as_bytes())
}

/// Analyses a system or a model, and prints its constraints and degenerate directions.
fn examined(name: &str, args: &Args) -> Result<(), CliError> {
    if args.out.is_some() {
        return Err(CliError::usage("--out needs recorded motion; a system already lists its constraints in its file"));
    }
    let probe = Probe::with_constraints(name)?;
    let (q, v) = probe.states(EXAMINED_STATES, 0)?;
    let n = probe.model.coordinates();
    let about = (probe.name.as_str(), &probe.columns[..n]);
    let examined = examine(about, probe.model.as_ref(), &probe.constraints, (&q, &v));
    if examined.states == 0 {
        return Err(CliError::data(format_args!("{}: the mass matrix is not finite at any sampled state", probe.name)));
    }
    let page = args.page.claim(&[Path::new(name)])?;
    result_page::write(page, "Constraints of a Lagrangian", &examined.findings(), &[])?;
    output::print(&output::shown(&examined, args.json, ExaminedLagrangian::findings)?)
}

/// The table [constraints] of a file.
///
/// # Errors
/// A usage error for a file without such a table, a data error for one that cannot be read.
pub fn formulas(file: &Path) -> Result<BTreeMap<String, String>, CliError> {
    let (name, text) = config::read_text(file)?;
    let wrong = |problem: &str| CliError::usage(format_args!("{name}: {problem}"));
    let table: toml::Table =
        config::table(&text).map_err(|(line, problem)| CliError::usage(format_args!("{name}:{line}: {problem}")))?;
    let Some(found) = table.get("constraints").cloned() else { return Err(wrong("expected a table [constraints]")) };
    let formulas: BTreeMap<String, String> =
        found.try_into().map_err(|_| wrong("constraints: expected formulas by name"))?;
    if formulas.is_empty() { Err(wrong("expected formulas in the table [constraints]")) } else { Ok(formulas) }
}

/// Line numbers of the constraints of a file, by name.
fn lines(file: &Path) -> Result<impl Fn(&str) -> usize, CliError> {
    let lines = config::lines(&config::read_text(file)?.1);
    Ok(move |name: &str| lines.get(&format!("constraints.{name}")).copied().unwrap_or(usize::MAX))
}

/// Constrains the model by a file's table, as far as the constraints are independent at some states.
///
/// # Errors
/// A usage error for a file without such a table or a mistake in a formula, constraints that contradict each other, or a model that has
/// constraints of its own.
pub fn constrained<S: Scalar>(
    model: Box<dyn EulerLagrange<S>>,
    columns: &[String],
    file: &Path,
    (q, v): (&[S], &[S]),
) -> Result<Box<dyn EulerLagrange<S>>, CliError> {
    let wrong = |problem: &dyn std::fmt::Display| CliError::usage(format_args!("{}: {problem}", file.display()));
    let formulas = formulas(file)?;
    if model.manifold().is_some() {
        return Err(wrong(&"the motion has constraints of its own"));
    }
    let plain = |values: &[S]| values.iter().map(|x| x.to_f64()).collect::<Vec<f64>>();
    let constraints =
        FormulaConstraints::new(&columns[..columns.len() / 2], formulas).map_err(|error| wrong(&error))?;
    let constraints = constraints.in_order(lines(file)?);
    let (constraints, _) = constraints.independent(&plain(q), &plain(v)).map_err(|error| wrong(&error))?;
    constraints.constrain(model).map_err(|error| wrong(&error))
}
