//! `lnn inspect`: prints the Euler-Lagrange terms of states with all digits.

use crate::CliError;
use crate::arguments::constraints::constrained;
use crate::arguments::input;
use crate::arguments::number::{Precision, in_precision, list};
use crate::arguments::source::{Source, SystemOrModel};
use crate::terminal::format::{Format, chunk, print_rows};
use crate::terminal::output;
use crate::thresholds::EXAMINED_MOTION_STATES;
use lnn::analysis::StateReporter;
use lnn::lagrangian::{EulerLagrange, LeastNorm};
use lnn::recording::NumberTable;
use lnn::scalar::Scalar;
use lnn::symmetry::{Canonical, CanonicalForm};
use std::path::PathBuf;

mod inverse;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: SystemOrModel,
    /// CSV of states, or - for standard input. Its header has the columns of the system, in any order; other columns, such as t
    /// and energy of a roll-out, are ignored.
    #[arg(long, value_name = "FILE.csv", required_unless_present = "structure")]
    states: Option<PathBuf>,
    /// Print which second derivatives of L are zero, constant or vary with the state, and which coordinates do not couple. No states are
    /// needed.
    #[arg(long, conflicts_with_all = ["states", "inverse", "canonical", "constraints", "least_norm", "linearize"])]
    structure: bool,
    /// Print the forces that cause given accelerations; the CSV also has the accelerations (COORDINATE_ddot).
    /// generalized_force is M a + c - g, the total force besides that of L, including friction. friction is that of the model,
    /// -dD/dv. external_force is the difference of the two, the force that must be applied from outside. Other columns are
    /// ignored.
    #[arg(long)]
    inverse: bool,
    /// Coordinates on which the external force of --inverse acts, such as that of a motor, for systems under constraints: at least as many as
    /// degrees of freedom. With more, the external force is the shortest. [default: all, with the shortest external force]
    #[arg(long, value_name = "COORD,..", value_delimiter = ',', requires = "inverse")]
    drives: Vec<String>,
    /// Fix factor and gauge of L, which motion does not determine, at a base state, coordinates before velocities [default: the first state
    /// of the file]. The terms are those of s (L - L0 - p0.(v - v0)) with |det M0| |s|^n = 1, for which L = 0 and p = 0 there.
    #[arg(
        long,
        value_name = "Q1,..,V1,..",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "",
        conflicts_with = "inverse"
    )]
    canonical: Option<String>,
    /// Constraints that hold the motion, a file with a table [constraints] as `lnn constraints --out` writes it.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "inverse")]
    constraints: Option<PathBuf>,
    /// Take the acceleration of least norm where the mass matrix is singular; null_directions are the free directions.
    #[arg(long, conflicts_with = "inverse")]
    least_norm: bool,
    /// Add the derivatives of the accelerations: acceleration_by_q, acceleration_by_v and acceleration_by_force have a row for each
    /// acceleration; acceleration_by_parameters, of a system, has a row for each parameter.
    #[arg(long, conflicts_with = "inverse")]
    linearize: bool,
    /// Precision of all arithmetic, including the reading of the states.
    #[arg(long, value_enum, value_name = "TYPE", default_value = "f64")]
    precision: Precision,
    /// One JSON object per line, or text. csv is for --inverse: the external forces, after the time if there is a column t.
    /// [default: json, and text for --structure]
    #[arg(long, value_enum, value_name = "FORMAT")]
    format: Option<Format>,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

/// Prints one object per state.
///
/// # Errors
/// A usage or data error; after the last state, a data error if any state had a singular mass matrix or a term that is
/// not finite.
pub fn run(args: &Args) -> Result<(), CliError> {
    in_precision!(args.precision, inspect(args))
}

fn inspect<S: Scalar>(args: &Args) -> Result<(), CliError> {
    let source = args.subject.read(Source::<S>::model, Source::<S>::system)?;
    let Some(file) = &args.states else { return structure(args, &source) };
    let format = args.format.unwrap_or(Format::Json);
    if source.model.is_timed() && (args.linearize || args.canonical.is_some()) {
        return Err(CliError::usage("--linearize and --canonical need a system that does not depend on the time"));
    }
    if args.inverse {
        return inverse::inverse(file, format, &source, &args.drives);
    }
    if format == Format::Csv {
        return Err(CliError::usage("--format csv needs --inverse; use json or table"));
    }
    let n = source.columns.len() / 2;
    let time = source.model.is_timed().then(|| "t".to_string());
    let width = 2 * n + time.iter().len();
    let columns: Vec<String> = source.columns.iter().cloned().chain(time).collect();
    let table = input::table::<S>(file, &columns)?;
    let (model, factor) = requested(args, source.model, &source.columns, &table)?;
    let mut reporter = StateReporter::new(model.as_ref(), args.linearize, factor);
    print_rows(file, &table.rows, chunk(n), |places| {
        let part = |columns| table.part(places.clone(), columns);
        let reports = reporter.terms(&part(0..n), &part(n..2 * n), &part(2 * n..width));
        let rows = reports.map_err(|error| CliError::input(file, error))?.into_iter().zip(&table.rows[places.clone()]);
        Ok(rows.map(|(report, row)| (format.state(*row, &report), report.problem)).collect())
    })
}

/// Prints which second derivatives are zero, constant or state-dependent.
fn structure<S: Scalar>(args: &Args, source: &Source<S>) -> Result<(), CliError> {
    let pattern = source.model.pattern();
    let pattern = pattern.ok_or_else(|| CliError::data("--structure: the Lagrangian is too large to be recorded"))?;
    if args.format == Some(Format::Json) || args.json {
        let text = serde_json::to_string(&pattern).map_err(CliError::data)?;
        return output::print(&format!("{text}\n"));
    }
    output::print(&pattern.to_string())
}

/// A model with its Lagrangian.
type Model<S> = Box<dyn EulerLagrange<S>>;

/// Creates the model under the constraints, in the requested form and with the requested accelerations; also returns the factor of its
/// canonical form.
fn requested<S: Scalar>(
    args: &Args,
    model: Model<S>,
    columns: &[String],
    table: &NumberTable<S>,
) -> Result<(Model<S>, Option<S>), CliError> {
    let n = columns.len() / 2;
    let few = |columns| table.part(0..EXAMINED_MOTION_STATES, columns);
    let model = match &args.constraints {
        Some(file) => constrained(model, columns, file, (&few(0..n), &few(n..2 * n)))?,
        None => model,
    };
    let (model, factor): (Model<S>, _) = match &args.canonical {
        None => (model, None),
        Some(text) => {
            let base = if text.is_empty() { table.part(0..1, 0..2 * n) } else { list("--canonical", text, columns)? };
            let form = CanonicalForm::at(model.as_ref(), &base[..n], &base[n..]);
            let form = form.map_err(|error| CliError::data(format_args!("--canonical: {error}")))?;
            let factor = form.factor;
            (Box::new(Canonical::new(model, form)), Some(factor))
        }
    };
    Ok((if args.least_norm { Box::new(LeastNorm(model)) } else { model }, factor))
}
