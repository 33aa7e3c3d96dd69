//! Archives of arrays of NumPy's format NPZ.

use super::Problem;
use super::builder::Builder;
use super::npy::{self, Header};
use super::select::Selection;
use crate::recording::Columns;
use std::fs::File;
use std::io::{BufReader, Read};
use zip::ZipArchive;
use zip::result::ZipError;

/// First bytes of such a file.
pub const MAGIC: &[u8] = b"PK\x03\x04";
/// Most arrays of an archive.
const MOST: usize = 10_000;
/// More than any byte of deflated data can become.
const EXPANSION: u64 = 1100;

fn broken(error: ZipError) -> Problem {
    match error {
        ZipError::Io(error) => Problem::Io(error),
        other => Problem::Array(format!("not a whole archive of arrays: {other}")),
    }
}

/// Reads vectors of equal length, each a column by its name, or a single table.
pub fn read(file: File, columns: &Columns) -> Result<Builder<'_>, Problem> {
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(broken)?;
    if archive.is_empty() {
        return Err(Problem::Empty);
    }
    if archive.len() > MOST {
        return Err(Problem::Array(format!("{} arrays, expected at most {MOST}", archive.len())));
    }
    if archive.len() == 1 {
        let mut entry = archive.by_index(0).map_err(broken)?;
        let available = promised(entry.size(), entry.compressed_size())?;
        let mut start = Vec::new();
        (&mut entry).take(LOOK).read_to_end(&mut start)?;
        if Header::read(&mut start.as_slice(), available)?.dimensions == 2 {
            return npy::read(&mut start.as_slice().chain(entry), available, columns);
        }
    }
    let names: Vec<String> = archive
        .file_names()
        .map(|name| name.map(|name| name.strip_suffix(".npy").unwrap_or(&name).to_string()).map_err(broken))
        .collect::<Result<_, _>>()?;
    let selection = Selection::new(columns, Some(&names), names.len(), 1)?;
    let mut numbers: Vec<Vec<f64>> = Vec::new();
    for used in selection.values.iter().chain(&selection.trajectory) {
        let mut entry = archive.by_index(used.position).map_err(broken)?;
        let available = promised(entry.size(), entry.compressed_size())?;
        let in_array = |problem: Problem| match problem {
            Problem::Array(text) => Problem::Array(format!("array {}: {text}", used.name)),
            other => other,
        };
        let header = Header::read(&mut entry, available).map_err(in_array)?;
        if header.columns != 1 {
            let text = format!("{} x {} numbers, expected one column", header.rows, header.columns);
            return Err(in_array(Problem::Array(text)));
        }
        let column = header.numbers(&mut entry, &[Some(0)]).map_err(in_array)?.swap_remove(0);
        if let Some(first) = numbers.first()
            && first.len() != column.len()
        {
            let (name, expected) = (&selection.values[0].name, first.len());
            let text = format!("{} numbers, expected {expected} as in array {name}", column.len());
            return Err(in_array(Problem::Array(text)));
        }
        numbers.push(column);
    }
    npy::fill(Builder::new(columns, selection), &numbers)
}

/// Bytes that hold any header.
const LOOK: u64 = 1 << 14;

/// Size of an entry, if so many bytes can come out of the compressed ones.
fn promised(size: u64, compressed: u64) -> Result<u64, Problem> {
    if size > compressed.saturating_mul(EXPANSION) {
        return Err(Problem::Array(format!("the archive promises {size} bytes from {compressed}")));
    }
    Ok(size)
}
