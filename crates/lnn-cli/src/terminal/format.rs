//! Prints results for states, one after another, as JSON or text.

use crate::CliError;
use crate::terminal::output;
use crate::thresholds::{NUMBERS_AT_ONCE, ROWS_AT_ONCE};
use lnn::analysis::StateReport;
use lnn::findings::Findings;
use lnn::names::pluralize;
use lnn::scalar::Scalar;
use serde::Serialize;
use std::ops::Range;
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
fn report_failures(file: &Path, failures: &[(usize, String)]) -> Result<(), CliError> {
    let [(row, problem), rest @ ..] = failures else { return Ok(()) };
    let more = match rest.len() {
        0 => String::new(),
        count => format!(" (and {})", pluralize(count, "more row", "more rows")),
    };
    Err(CliError::input(file, format_args!("row {row}: {problem}{more}")))
}

/// Prints the texts of the rows of a file, a batch of at most `size` after another, and reports the rows that failed.
///
/// `batch` takes positions in `rows`, whose entries are lines of the file, and returns for each its text and what is wrong with it.
///
/// # Errors
/// Those of `batch`; a data error if any row failed.
pub fn print_rows(
    file: &Path,
    rows: &[usize],
    size: usize,
    mut batch: impl FnMut(Range<usize>) -> Result<Vec<(String, Option<String>)>, CliError>,
) -> Result<(), CliError> {
    let mut failures = Vec::new();
    for start in (0..rows.len()).step_by(size) {
        let places = start..rows.len().min(start + size);
        let (texts, problems): (String, Vec<Option<String>>) = batch(places.clone())?.into_iter().unzip();
        failures.extend(rows[places].iter().zip(problems).filter_map(|(row, problem)| Some((*row, problem?))));
        output::print(&texts)?;
    }
    report_failures(file, &failures)
}

impl Format {
    /// The text of the state on a row of a file.
    pub fn state<S: Scalar>(self, row: usize, report: &StateReport<S>) -> String {
        if self == Self::Json { report.json() } else { report.text(&format!("row {row}")) }
    }
}
