//! Recorded motion from files: CSV, NPY, NPZ.

mod builder;
mod csv;
mod element;
mod error;
mod fill;
mod npy;
mod npz;
mod pieces;
mod select;
mod shared;
mod table;
mod text;

pub use error::{DataError, Problem};
pub(crate) use pieces::LEAST;
pub(crate) use table::RawTable;
#[cfg(feature = "cli")]
pub(crate) use text::{Separator, comment, line_end, names_in, split};

use crate::recording::reading::LoadedRecording;
use crate::recording::{Columns, Recording};
use crate::storage::open_regular;
use builder::Builder;
use shared::Shared;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// Largest file in bytes.
const MAX_BYTES: u64 = 1 << 36;

/// Reads recorded trajectories.
///
/// Every file holds one trajectory, or several distinguished by a column; long gaps in time cut them further. The format is recognised
/// by the first bytes: arrays of NumPy (`.npy`, `.npz`; floats of 4 or 8 bytes and integers, either order and byte order),
/// anything else is text of numbers, separated by commas, semicolons, tabs, bars or blanks, with or without a header and with
/// comments behind a `#`; lines end with LF, CR LF, or CR in all of the file. Numbers are converted to SI; angles are
/// unwrapped by the nearest turn; rows that repeat the row before digit by digit are left out and counted. [`Columns::whole`] keeps
/// trajectories whole across all gaps.
///
/// # Errors
/// [`DataError`], naming the file and, where there is one, row and column.
pub fn read_recording<P: AsRef<Path>>(paths: &[P], columns: &Columns) -> Result<LoadedRecording, DataError> {
    columns.validate()?;
    if paths.is_empty() {
        return Err(DataError::NoFiles);
    }
    let recording = Recording { coordinates: columns.coords.clone(), periodic: columns.periodic(), tracks: Vec::new() };
    let mut reading = LoadedRecording { files: paths.len(), ..LoadedRecording::from(recording) };
    for (k, path) in paths.iter().enumerate() {
        let path = path.as_ref();
        let again = paths[..k].iter().any(|earlier| earlier.as_ref() == path);
        let added = if again { Err(Problem::Again) } else { add_file(path, columns, &mut reading) };
        added.map_err(|problem| DataError::File { file: path.display().to_string(), problem })?;
    }
    Ok(reading)
}

/// Adds the trajectories of one file.
fn add_file(path: &Path, columns: &Columns, reading: &mut LoadedRecording) -> Result<(), Problem> {
    let (file, size) = open_regular(path, MAX_BYTES)?;
    let builder = parse(file, size, columns)?;
    reading.time = builder.selection().time().map(ToString::to_string);
    reading.duplicates += builder.duplicates;
    if builder.tracks.is_empty() {
        return Err(Problem::NoRows);
    }
    let name = path.display().to_string();
    let mut most = 0;
    for track in builder.tracks {
        most = most.max(pieces::add(&name, track, columns.whole, reading));
    }
    if most < LEAST && !columns.whole { Err(Problem::TooFew { least: LEAST, found: most }) } else { Ok(()) }
}

/// Tells the format and reads the rows.
fn parse(mut file: File, size: u64, columns: &Columns) -> Result<Builder<'_>, Problem> {
    let mut start = Vec::new();
    (&mut file).take(npy::MAGIC.len() as u64).read_to_end(&mut start)?;
    file.rewind()?;
    if start.starts_with(npy::MAGIC) {
        npy::read(Shared::new(file, size), size, columns)
    } else if npz::MAGIC.iter().any(|magic| start.starts_with(magic)) {
        npz::read(Shared::new(file, size), columns)
    } else {
        csv::read(BufReader::with_capacity(1 << 20, file.take(size)), columns)
    }
}

#[cfg(test)]
mod tests;
