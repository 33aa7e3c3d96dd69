//! Prints results for states, one after another, as JSON or text.

use crate::CliError;
use crate::terminal::{json, output};
use crate::thresholds::{NUMBERS_AT_ONCE, ROWS_AT_ONCE};
use lnn::findings::Findings;
use lnn::lagrangian::MechanicsError;
use lnn::names::pluralize;
use lnn::scalar::Scalar;
use serde::Serialize;
use std::path::Path;

/// Number of rows in a chunk for `n` coordinates, whose matrices have `n^2` numbers.
pub fn chunk(n: usize) -> usize {
    (NUMBERS_AT_ONCE / (n * n).max(1)).clamp(1, ROWS_AT_ONCE)
}

/// Form of a result that has no table of numbers alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum TableOrJson {
    /// Text.
    Table,
    /// One object, or one per line.
    Json,
}

/// Form of a result, as arguments.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct FormatArgs {
    /// Text, or one JSON object.
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "table")]
    format: TableOrJson,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

impl FormatArgs {
    /// Prints a result.
    ///
    /// # Errors
    /// Numbers that JSON cannot represent; standard output that cannot be written.
    pub fn print<T: Serialize>(self, result: &T, findings: impl FnOnce(&T) -> Findings) -> Result<(), CliError> {
        output::print(&output::shown(result, self.json || self.format == TableOrJson::Json, findings)?)
    }
}

/// Form in which results are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// One object per line.
    Json,
    /// Text.
    Table,
    /// Numbers separated by commas.
    Csv,
}

/// Reports the first row that failed, and the number of others.
///
/// # Errors
/// A data error if any row failed.
pub fn report_failures(file: &Path, failures: &[(usize, String)]) -> Result<(), CliError> {
    let [(row, problem), rest @ ..] = failures else { return Ok(()) };
    let more = match rest.len() {
        0 => String::new(),
        count => format!(" (and {})", pluralize(count, "more row", "more rows")),
    };
    Err(CliError::input(file, format_args!("row {row}: {problem}{more}")))
}

/// Explains an error without the row in the batch, which means nothing to a user.
pub fn explain(error: MechanicsError) -> String {
    match error {
        MechanicsError::Singular { condition, .. } => {
            format!("the mass matrix is singular (condition number {condition:.3e})")
        }
        MechanicsError::NotFinite { what, .. } => format!("{what} is not finite"),
        MechanicsError::Undriven { .. } => "it can move while the drives stand still".to_string(),
        other => other.to_string(),
    }
}

/// A named result: its numbers, and the row length if it is a matrix.
pub struct Field<'a, S> {
    pub name: &'static str,
    pub values: &'a [S],
    pub shape: Shape,
}

/// Arrangement of the numbers of a result.
pub enum Shape {
    Number,
    Vector,
    Matrix,
}

/// One state as a line of JSON or a block of text; a failed acceleration is `null`.
pub fn show<S: Scalar>(format: Format, row: usize, fields: &[Field<'_, S>], problem: Option<&str>) -> String {
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
        Format::Table | Format::Csv => {
            let width = parts.iter().map(|(name, _)| name.len() + 1).fold(13, usize::max);
            let lines: String = parts.iter().map(|(name, text)| format!("  {name:<width$}{text}\n")).collect();
            format!("row {row}\n{lines}")
        }
    }
}
