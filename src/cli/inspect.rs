//! `lnn inspect`: the Euler-Lagrange terms of states, full digits.

use crate::cli::source::{Source, parameter};
use crate::cli::{CliError, States, input, json, output, parse_states, states};
use crate::lagrangian::{MechanicsError, Request, Terms};
use crate::linalg::{Workspace, eigenvalues};
use crate::scalar::{Dd, Scalar};
use std::path::PathBuf;

/// States evaluated together; bounds the memory whatever the length of the file.
const CHUNK: usize = 256;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name (`lnn systems` lists them).
    #[arg(long, value_name = "NAME", required_unless_present = "model", conflicts_with = "model")]
    system: Option<String>,
    /// A trained model, a file or the directory of a run.
    #[arg(long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// A parameter of the system, decimal text read in the working precision; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1.., value_parser = parameter, conflicts_with = "model")]
    param: Vec<(String, String)>,
    /// CSV of states, or - for standard input: the system's columns as header, in any order; other columns, such as t and
    /// energy of a roll-out, are left out.
    #[arg(long, value_name = "FILE.csv")]
    states: PathBuf,
    /// Precision of everything, the reading of the states included.
    #[arg(long, value_enum, value_name = "TYPE", default_value = "f64")]
    precision: Precision,
    /// What is printed.
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "json")]
    format: Format,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Precision {
    /// Single, 9 digits.
    F32,
    /// Double, 17 digits.
    F64,
    /// Double-double, about 32 digits.
    Dd,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// One object per line.
    Json,
    /// Text.
    Table,
}

/// Prints one object per state.
///
/// # Errors
/// A usage or data error; after the last state, a data error if any state had a singular mass matrix or a term that is
/// not finite.
pub fn run(args: &Args) -> Result<(), CliError> {
    match args.precision {
        Precision::F32 => inspect::<f32>(args),
        Precision::F64 => inspect::<f64>(args),
        Precision::Dd => inspect::<Dd>(args),
    }
}

fn inspect<S: Scalar>(args: &Args) -> Result<(), CliError> {
    let source = match &args.model {
        Some(path) => Source::<S>::model(path)?,
        None => Source::<S>::system(args.system.as_deref().unwrap_or_default(), &args.param)?,
    };
    let place = input::name(&args.states);
    let bytes =
        input::read(&args.states, states::MAX_BYTES).map_err(|e| CliError::data(format_args!("{place}: {e}")))?;
    let states: States<S> =
        parse_states(&bytes, &source.columns).map_err(|e| CliError::data(format_args!("{place}: {e}")))?;
    drop(bytes);

    let n = source.columns.len() / 2;
    let mut failures: Vec<(usize, String)> = Vec::new();
    let mut terms = Terms::default();
    for ((q, v), rows) in states.q.chunks(CHUNK * n).zip(states.v.chunks(CHUNK * n)).zip(states.rows.chunks(CHUNK)) {
        let mut text = String::new();
        if source.model.terms(q, v, Request::ALL, &mut terms).is_ok() {
            let spectrum = spectrum(n, &terms.mass_matrix);
            for (k, &row) in rows.iter().enumerate() {
                text += &show(args.format, row, &fields(n, k, &terms, &spectrum), None);
            }
        } else {
            // One state of the chunk failed: take them one by one, so that each says its own reason.
            for ((q, v), &row) in q.chunks(n).zip(v.chunks(n)).zip(rows) {
                let problem = source.model.terms(q, v, Request::ALL, &mut terms).err().map(explain);
                let spectrum = spectrum(n, &terms.mass_matrix);
                text += &show(args.format, row, &fields(n, 0, &terms, &spectrum), problem.as_deref());
                failures.extend(problem.map(|text| (row, text)));
            }
        }
        output::print(&text)?;
    }
    match failures.as_slice() {
        [] => Ok(()),
        [(row, problem)] => Err(CliError::data(format_args!("{place}: row {row}: {problem}"))),
        [(row, problem), rest @ ..] => {
            Err(CliError::data(format_args!("{place}: row {row}: {problem} (and {} more rows)", rest.len())))
        }
    }
}

/// Eigenvalues of a batch of mass matrices, ascending; of one that is not finite, `NaN`.
fn spectrum<S: Scalar>(n: usize, matrices: &[S]) -> Vec<S> {
    let mut values = vec![S::NAN; matrices.len() / n];
    // The matrix that fails has NaN eigenvalues already; the state itself is reported by its terms.
    let _ = eigenvalues(n, matrices, &mut values, &mut Workspace::new());
    values
}

/// The reason without the batch row, which means nothing to a reader of the file.
fn explain(error: MechanicsError) -> String {
    match error {
        MechanicsError::Singular { condition, .. } => {
            format!("the mass matrix is singular (condition number {condition:.3e})")
        }
        MechanicsError::NotFinite { what, .. } => format!("{what} is not finite"),
        other => other.to_string(),
    }
}

/// A named result: its numbers and the length of a row if it is a matrix.
struct Field<'a, S> {
    name: &'static str,
    values: &'a [S],
    shape: Shape,
}

enum Shape {
    Number,
    Vector,
    Matrix,
}

/// Everything there is to say about state `k` of a batch.
fn fields<'a, S>(n: usize, k: usize, terms: &'a Terms<S>, spectrum: &'a [S]) -> Vec<Field<'a, S>> {
    let part = |values: &'a [S], size: usize| values.get(k * size..(k + 1) * size).unwrap_or(&[]);
    let number = |name, values| Field { name, values: part(values, 1), shape: Shape::Number };
    let vector = |name, values| Field { name, values: part(values, n), shape: Shape::Vector };
    let mut fields = vec![
        number("lagrangian", &terms.lagrangian),
        vector("momentum", &terms.momentum),
        vector("dl_dq", &terms.dl_dq),
        Field { name: "mass_matrix", values: part(&terms.mass_matrix, n * n), shape: Shape::Matrix },
        vector("eigenvalues", spectrum),
        vector("coriolis", &terms.coriolis),
        vector("acceleration", &terms.acceleration),
        number("energy", &terms.energy),
    ];
    if !terms.force.is_empty() {
        fields.extend([vector("force", &terms.force), number("dissipation", &terms.dissipation)]);
    }
    fields
}

/// One state as a line of JSON or a block of text; a failed acceleration is `null`.
fn show<S: Scalar>(format: Format, row: usize, fields: &[Field<'_, S>], problem: Option<&str>) -> String {
    let n = fields.iter().find(|f| matches!(f.shape, Shape::Vector)).map_or(1, |f| f.values.len());
    let mut parts: Vec<(&str, String)> = fields
        .iter()
        .map(|field| {
            let lost = field.values.is_empty() || (problem.is_some() && field.values.iter().any(|x| !x.is_finite()));
            let text = match field.shape {
                _ if lost => "null".to_string(),
                Shape::Number => field.values.iter().map(|x| json::number(*x)).collect(),
                Shape::Vector => json::vector(field.values),
                Shape::Matrix => json::matrix(field.values, n),
            };
            (field.name, text)
        })
        .collect();
    parts.extend(problem.map(|text| ("error", json::string(text))));
    match format {
        Format::Json => {
            let parts: Vec<String> = parts.iter().map(|(name, text)| format!("\"{name}\":{text}")).collect();
            format!("{{{}}}\n", parts.join(","))
        }
        Format::Table => {
            let lines: String = parts.iter().map(|(name, text)| format!("  {name:<13}{text}\n")).collect();
            format!("row {row}\n{lines}")
        }
    }
}
