//! Reads all columns of a file, whatever their meaning.

use super::thresholds::{LARGEST_FILE, MOST_SEPARATE_COLUMNS};
use super::{Problem, parse};
use crate::recording::{Columns, DataError};
use crate::storage::open_regular;
use std::path::Path;

/// The columns of a file in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct RawTable {
    /// Names; numbers from 1 where the file has none, or has one twice.
    pub names: Vec<String>,
    /// Numbers of each column in SI as far as the header states units, `(rows)`; the problem of a column that does not hold a number in
    /// every row.
    pub numbers: Vec<Result<Vec<f64>, String>>,
    has_names: bool,
}

impl RawTable {
    /// `true` of a file without names of columns.
    pub fn is_unnamed(&self) -> bool {
        !self.has_names && !self.names.is_empty()
    }

    /// Reads every column of a file; `named` are the names of a file without a header.
    ///
    /// # Errors
    /// [`DataError::File`] for a file that cannot be read as a table.
    pub fn read(path: &Path, named: Option<&[String]>) -> Result<Self, DataError> {
        Self::of(path, named).map_err(|problem| DataError::File { file: path.display().to_string(), problem })
    }

    fn of(path: &Path, named: Option<&[String]>) -> Result<Self, Problem> {
        // One sample per second, so that no column needs to be the time.
        let asked = |coords: &[String]| Columns {
            coords: coords.to_vec(),
            rate: Some(1.0),
            names: named.map(<[String]>::to_vec),
            whole: true,
            ..Columns::default()
        };
        let names = match rows(path, &asked(&[])) {
            Err(Problem::Names(names)) => names,
            Err(problem) => return Err(problem),
            Ok(_) => Vec::new(),
        };
        // A row of numbers is not a header.
        let has_names = names.iter().any(|name| name.parse::<f64>().is_err());
        let twice = names.iter().enumerate().any(|(k, name)| names[..k].contains(name));
        let names = if twice { (1..=names.len()).map(|k| k.to_string()).collect() } else { names };
        let numbers: Vec<Result<Vec<f64>, String>> = match rows(path, &asked(&names)) {
            Ok(rows) => columns(&rows, names.len()).into_iter().map(Ok).collect(),
            Err(problem) if names.len() > MOST_SEPARATE_COLUMNS => return Err(problem),
            Err(_) => names
                .iter()
                .map(|name| rows(path, &asked(std::slice::from_ref(name))).map_err(|problem| problem.to_string()))
                .collect(),
        };
        // Columns that lack readings are not compared with the others.
        let most = numbers.iter().flatten().map(Vec::len).max().unwrap_or(0);
        let beside = |column: Result<Vec<f64>, String>| {
            column.and_then(|own| match most - own.len() {
                0 => Ok(own),
                missing => Err(format!("{missing} of {most} readings are missing")),
            })
        };
        let numbers = numbers.into_iter().map(beside).collect();
        Ok(Self { names, numbers, has_names })
    }
}

/// The rows of a file, `(rows, columns)`.
fn rows(path: &Path, columns: &Columns) -> Result<Vec<f64>, Problem> {
    let (file, size) = open_regular(path, LARGEST_FILE)?;
    let tracks = parse(file, size, columns)?.1.into_iter().flat_map(|builder| builder.tracks);
    Ok(tracks.flat_map(|track| track.track.q).collect())
}

/// Transposes rows to columns.
fn columns(rows: &[f64], width: usize) -> Vec<Vec<f64>> {
    (0..width).map(|k| rows.iter().skip(k).step_by(width).copied().collect()).collect()
}
