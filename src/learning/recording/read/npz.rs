//! Archives of arrays of NumPy's format NPZ.

use super::Problem;
use super::archive::{self, bounded, broken};
use super::builder::Builder;
use super::fill::{Source, fill};
use super::npy::{self, Header};
use super::select::{Selection, Used};
use super::shared::Shared;
use super::thresholds::MOST_ARRAYS;
use crate::recording::Columns;
use std::io::{BufReader, Read};
use zip::ZipArchive;

/// Reads vectors of equal length, each a column by its name, or a single table.
///
/// Shapes and sizes are compared with each other and with the file before a number is unpacked, and the columns are unpacked together, row
/// by row: only the trajectories are kept in memory.
pub fn read(mut archive: ZipArchive<Shared>, columns: &Columns) -> Result<Vec<Builder<'_>>, Problem> {
    if archive.is_empty() {
        return Err(Problem::Array("the archive holds no arrays".to_string()));
    }
    if archive.len() > MOST_ARRAYS {
        return Err(Problem::Array(format!("{} arrays, expected at most {MOST_ARRAYS}", archive.len())));
    }
    if archive.len() == 1 {
        bounded(&mut archive, [0])?;
        let (header, _) = open(&mut archive, 0)?;
        if header.dimensions == 2 {
            return table(&archive, &header, columns);
        }
    }
    let mut names = archive::names(&archive)?;
    for name in &mut names {
        name.truncate(name.strip_suffix(".npy").unwrap_or(name).len());
    }
    let selections = Selection::all(columns, Some(&names), names.len(), 1)?;
    selections.into_iter().map(|selection| vectors(&mut archive, columns, selection)).collect()
}

/// Vectors of equal length.
fn vectors<'a>(
    archive: &mut ZipArchive<Shared>,
    columns: &'a Columns,
    selection: Selection,
) -> Result<Builder<'a>, Problem> {
    let used: Vec<Used> = selection.used().cloned().collect();
    bounded(archive, used.iter().map(|used| used.position))?;
    let mut archives = vec![archive.clone(); used.len()];
    let (mut sources, mut rows) = (Vec::with_capacity(used.len()), 0);
    for (place, (archive, Used { name, position, .. })) in archives.iter_mut().zip(&used).enumerate() {
        let in_array = |problem: Problem| match problem {
            Problem::Array(text) => Problem::Array(format!("array {name}: {text}")),
            other => other,
        };
        let (header, input) = open(archive, *position).map_err(in_array)?;
        if header.columns != 1 {
            let text = format!("{} x {} numbers, expected one column", header.rows, header.columns);
            return Err(in_array(Problem::Array(text)));
        }
        if place > 0 && header.rows != rows {
            let text = format!("{} numbers, expected {rows} as in array {}", header.rows, used[0].name);
            return Err(in_array(Problem::Array(text)));
        }
        rows = header.rows;
        let (element, name) = (header.element, format!("array {name}: "));
        sources.push(Source { input, element, width: 1, wanted: vec![(0, place)], whole: true, name });
    }
    fill(Builder::new(columns, selection), rows, &mut sources)
}

/// A single table: one reader for its rows, or one for each of its used columns if those follow each other.
fn table<'a>(archive: &ZipArchive<Shared>, header: &Header, columns: &'a Columns) -> Result<Vec<Builder<'a>>, Problem> {
    // Trajectories side by side share a column of time.
    let readers = if header.fortran || columns.wide { 2 * header.columns } else { 1 };
    let mut archives = vec![archive.clone(); readers];
    let mut free = archives.iter_mut();
    npy::table(header, columns, |offset| {
        let archive = free.next().ok_or_else(|| Problem::Array("more columns than the array has".to_string()))?;
        let mut entry = archive.by_index(0).map_err(broken)?;
        std::io::copy(&mut (&mut entry).take(offset), &mut std::io::sink())?;
        Ok(Box::new(BufReader::with_capacity(1 << 16, entry)))
    })
}

/// The header of an array and a reader of what follows.
fn open(archive: &mut ZipArchive<Shared>, index: usize) -> Result<(Header, Box<dyn Read + '_>), Problem> {
    let entry = archive.by_index(index).map_err(broken)?;
    let size = entry.size();
    let mut input = BufReader::with_capacity(1 << 16, entry);
    let header = Header::read(&mut input, size)?;
    Ok((header, Box::new(input)))
}
