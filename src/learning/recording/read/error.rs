//! Mistakes in files of recorded motion.

use super::thresholds::{LISTED_COLUMNS, LISTED_PROBLEMS};
use crate::names::{first_few, one_line, pluralize};
use crate::recording::ColumnsError;
use crate::storage::ReadError;
use thiserror::Error;

/// Why files cannot be read as a recording.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DataError {
    /// The description of the columns is inconsistent.
    #[error(transparent)]
    Columns(#[from] ColumnsError),
    /// No files were given.
    #[error("expected at least one file of data")]
    NoFiles,
    /// One file has a problem.
    #[error("{}", one_line(&format!("{file}: {problem}")))]
    File {
        /// Its path.
        file: String,
        /// The problem.
        problem: Problem,
    },
}

/// A problem of a file; rows are lines of a text file or rows of an array, from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Problem {
    /// The file could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The same file was given twice.
    #[error("the file is given twice")]
    Again,
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// No coordinates were given; contains the columns of the file, by name or by number.
    #[error("no coordinates are given; the columns are {}", .0.join(", "))]
    Names(Vec<String>),
    /// The file is not text; contains the row.
    #[error("row {0}: bytes that are not text")]
    NotText(u64),
    /// The file has a foreign format.
    #[error("{name}, a format that is not supported: {help}")]
    Foreign {
        /// The format.
        name: &'static str,
        /// How to convert the file to a readable format.
        help: &'static str,
    },
    /// One file has several problems.
    #[error("{}", joined(first, *more))]
    Several {
        /// The first few.
        first: Vec<Problem>,
        /// Number of further problems.
        more: usize,
    },
    /// A line is too long to be a row of numbers.
    #[error("row {row}: a line of more than {limit} bytes")]
    LongLine {
        /// The row.
        row: u64,
        /// Longest line.
        limit: u64,
    },
    /// A used column appears twice in the header.
    #[error("row {row}: duplicate column {name}")]
    Duplicate {
        /// Row of the header.
        row: u64,
        /// Its name.
        name: String,
    },
    /// A column is missing.
    #[error("row {row}: missing {what}: {problem}")]
    Missing {
        /// Row of the header.
        row: u64,
        /// Description of what was expected.
        what: &'static str,
        /// Its name, and the most similar name in the file.
        problem: String,
    },
    /// There are neither times nor a rate.
    #[error(
        "no column is called t or time{}: name the column of time, or give the rate in samples per second",
        listed(names)
    )]
    NoTime {
        /// Names of the existing columns; empty if the file has no names.
        names: Vec<String>,
    },
    /// The number of given names differs from the number of columns.
    #[error("row {row}: expected {}, as many as columns are named, found {found}", pluralize(*expected, "field", "fields"))]
    Width {
        /// The row.
        row: u64,
        /// Names given.
        expected: usize,
        /// Fields found.
        found: usize,
    },
    /// Names were given although the file has its own.
    #[error("row {row}: expected numbers below the given names of columns, found the header {found}")]
    Header {
        /// The row.
        row: u64,
        /// Text found there.
        found: String,
    },
    /// A row has too few or too many fields.
    #[error("row {row}: expected {}{separated}, found {found}", pluralize(*expected, "field", "fields"))]
    Ragged {
        /// The row.
        row: u64,
        /// Fields of the first row.
        expected: usize,
        /// Separator of the fields, such as ` separated by blanks`; empty for commas.
        separated: &'static str,
        /// Fields of the row.
        found: usize,
    },
    /// More rows are incomplete than complete.
    #[error("row {row}, column {column}: no reading; {incomplete} rows are incomplete and {whole} are complete")]
    Missings {
        /// The first incomplete row.
        row: u64,
        /// A column whose reading is missing there.
        column: String,
        /// Number of incomplete rows.
        incomplete: usize,
        /// Number of complete rows.
        whole: usize,
    },
    /// A coordinate has no readings at all.
    #[error("column {column}: no reading{}", label.as_ref().map_or(String::new(), |label| format!(" in trajectory {label}")))]
    Unread {
        /// The column.
        column: String,
        /// The trajectory.
        label: Option<String>,
    },
    /// A field is not a finite number.
    #[error("row {row}, column {column}: expected a finite number, found {found:?}")]
    Field {
        /// The row.
        row: u64,
        /// Name of the column.
        column: String,
        /// Text found there.
        found: String,
    },
    /// One row has decimal commas and another has decimal points.
    #[error("row {row}, column {column}: expected a decimal {} as in row {since}, found {found:?}", if *comma { "comma" } else { "point" })]
    Decimal {
        /// The row.
        row: u64,
        /// Name of the column.
        column: String,
        /// Text found there.
        found: String,
        /// `true` if earlier decimals have a comma.
        comma: bool,
        /// Row of the first such decimal.
        since: u64,
    },
    /// A header has an unknown unit.
    #[error("row {row}, column {column}: {problem}; state its unit otherwise, the factor 1 for SI")]
    Unit {
        /// Row of the header.
        row: u64,
        /// Name of the column.
        column: String,
        /// The unit and what was expected.
        problem: String,
    },
    /// Time does not increase.
    #[error("row {row}, column {column}: expected a time later than {before} of row {before_row}, found {found}{hint}")]
    Order {
        /// The row.
        row: u64,
        /// The column of time.
        column: String,
        /// The row before it in the same trajectory.
        before_row: u64,
        /// Its time, as in the file.
        before: f64,
        /// Time of the row, as in the file.
        found: f64,
        /// A possible reason.
        hint: &'static str,
    },
    /// An invalid standard deviation.
    #[error("row {row}, column {column}: expected a standard deviation above 0, found {found}")]
    Error {
        /// The row.
        row: u64,
        /// The column.
        column: String,
        /// The text found there.
        found: f64,
    },
    /// There is a header but no rows.
    #[error("no rows of numbers")]
    NoRows,
    /// Too few rows for a fit.
    #[error("expected at least {least} rows without a gap in time, found {found}")]
    TooFew {
        /// Fewest samples of a trajectory.
        least: usize,
        /// Largest number of samples between two gaps.
        found: usize,
    },
    /// One file has too many trajectories.
    #[error("row {row}, column {column}: more than {most} different values, expected one per trajectory")]
    Trajectories {
        /// The row.
        row: u64,
        /// The column.
        column: String,
        /// Largest number of trajectories in a file.
        most: usize,
    },
    /// An array file is invalid.
    #[error("{0}")]
    Array(String),
    /// The file could not be read to its end.
    #[error("cannot read: {0}")]
    Io(#[from] std::io::Error),
}

/// Collects the problems of one file.
#[derive(Debug, Default)]
pub(super) struct Faults {
    first: Vec<Problem>,
    more: usize,
}

impl Faults {
    /// Adds a problem.
    pub(super) fn add(&mut self, problem: Problem) {
        if self.first.len() < LISTED_PROBLEMS { self.first.push(problem) } else { self.more += 1 }
    }

    /// `true` if there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.first.is_empty()
    }

    /// Returns the value, or adds the problem and returns `None`.
    pub(super) fn good<T>(&mut self, found: Result<T, Problem>) -> Option<T> {
        found.map_err(|problem| self.add(problem)).ok()
    }

    /// The problems, combined into one.
    ///
    /// # Errors
    /// The combined problem, if there are any.
    pub(super) fn end(mut self) -> Result<(), Problem> {
        match self.first.len() {
            0 => Ok(()),
            1 => Err(self.first.remove(0)),
            _ => Err(Problem::Several { first: self.first, more: self.more }),
        }
    }
}

/// Problems one after another.
fn joined(first: &[Problem], more: usize) -> String {
    let listed = first.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
    if more == 0 { listed } else { format!("{listed}; and {more} more") }
}

/// Lists the first few column names, such as ` (there are s, x, y)`; empty if there are none.
fn listed(names: &[String]) -> String {
    if names.is_empty() { String::new() } else { format!(" (there are {})", first_few(names, LISTED_COLUMNS, ", ")) }
}
