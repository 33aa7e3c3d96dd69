//! Recorded motion from files: CSV, packed or not, Excel workbooks, NPY, NPZ.

mod archive;
mod builder;
mod csv;
mod element;
mod encoding;
mod error;
mod facts;
mod fill;
mod force_formulas;
mod foreign;
mod gzip;
mod npy;
mod npz;
mod number;
mod number_table;
mod pieces;
mod select;
mod shared;
mod table;
mod text;
mod thresholds;
mod wide;
mod workbook;
mod xml;

pub use encoding::Encoding;
pub use error::{DataError, Problem};
pub use facts::{FileFacts, FileKind};
pub use number_table::{NumberTable, NumberTableError};
pub use table::RawTable;
pub use text::Separator;
use thresholds::LARGEST_FILE;
pub(crate) use thresholds::LEAST_SAMPLES;

use crate::recording::reading::LoadedRecording;
use crate::recording::{Columns, Recording};
use crate::storage::open_regular;
use builder::Builder;
use force_formulas::ForceFormulas;
use shared::Shared;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

impl LoadedRecording {
    /// Reads recorded trajectories.
    ///
    /// Every file holds one trajectory, or several distinguished by a column or side by side; long gaps in time cut them further. The format is
    /// recognised by the first bytes: arrays of NumPy (`.npy`, `.npz`; floats of 4 or 8 bytes and integers, either order and byte order), the
    /// first sheet of an Excel workbook (`.xlsx`), anything else is text of numbers, separated by commas, semicolons, tabs, bars or blanks,
    /// with or without a header and with comments behind a `#`; lines end with LF, CR LF, or CR in all of the file. Text may be packed by gzip,
    /// and be in UTF-8, UTF-16 or Windows-1252; its decimals have a point or a comma. The [`LoadedRecording`] states the recognised format.
    ///
    /// Numbers are converted to SI, by the units of the description or else by those in brackets after the names of a header; angles are
    /// unwrapped by the nearest turn; rows that repeat the row before digit by digit are left out and counted. [`Columns::whole`] keeps
    /// trajectories whole across all gaps. Forces that are formulas are evaluated at the samples.
    ///
    /// # Errors
    /// [`DataError`], naming the file and, where there is one, row and column; several mistakes in the rows of a file at once.
    pub fn read<P: AsRef<Path>>(paths: &[P], columns: &Columns) -> Result<Self, DataError> {
        if let Some((formulas, plain)) = ForceFormulas::of(columns)? {
            let mut reading = LoadedRecording::read(paths, &plain)?;
            formulas.apply(columns, &mut reading)?;
            return Ok(reading);
        }
        columns.validate()?;
        if paths.is_empty() {
            return Err(DataError::NoFiles);
        }
        let recording =
            Recording { coordinates: columns.coords.clone(), periodic: columns.periodic(), tracks: Vec::new() };
        let mut reading = LoadedRecording { files: paths.len(), ..LoadedRecording::from(recording) };
        for (k, path) in paths.iter().enumerate() {
            let path = path.as_ref();
            let again = paths[..k].iter().any(|earlier| earlier.as_ref() == path);
            let added = if again { Err(Problem::Again) } else { add_file(path, columns, &mut reading) };
            added.map_err(|problem| DataError::File { file: path.display().to_string(), problem })?;
        }
        // The names in headers are known only after reading.
        reading.columns.validate()?;
        reading.recording.coordinates.clone_from(&reading.columns.coords);
        Ok(reading)
    }
}

/// Adds the trajectories of one file.
fn add_file(path: &Path, columns: &Columns, reading: &mut LoadedRecording) -> Result<(), Problem> {
    let (file, size) = open_regular(path, LARGEST_FILE)?;
    let (facts, builders) = parse(file, size, columns)?;
    let name = path.display().to_string();
    let mut most = None;
    let mut units = BTreeMap::new();
    for builder in builders {
        let selection = builder.selection();
        reading.time = selection.time().map(ToString::to_string);
        reading.duplicates += builder.duplicates;
        let (incomplete, first) = builder.incomplete.clone();
        let whole: usize = builder.tracks.iter().map(|track| track.track.len()).sum();
        // If most rows are incomplete, the file was probably misread.
        if let Some((row, column)) = first.filter(|_| incomplete > whole) {
            return Err(Problem::Missings { row, column, incomplete, whole });
        }
        reading.incomplete += incomplete;
        for used in selection.used() {
            let name = selection.number.as_ref().and_then(|number| used.name.strip_suffix(number.as_str()));
            units.extend(used.unit.clone().map(|unit| (name.unwrap_or(&used.name).to_string(), unit)));
        }
        if reading.formats.is_empty() {
            reading.columns = builder.columns_in_file();
        }
        for mut track in builder.tracks {
            track.missing = track.track.fill_missing(columns.coords.len()).map_err(|i| {
                let column = reading.columns.coords.get(i).or(columns.coords.get(i)).cloned().unwrap_or_default();
                Problem::Unread { column, label: track.label.clone() }
            })?;
            most = most.max(Some(pieces::add(&name, track, columns.whole, reading)));
        }
    }
    reading.formats.push(FileFacts { file: name, units, ..facts });
    let most = most.ok_or(Problem::NoRows)?;
    if most < LEAST_SAMPLES && !columns.whole {
        Err(Problem::TooFew { least: LEAST_SAMPLES, found: most })
    } else {
        Ok(())
    }
}

/// Recognises the format and reads the rows.
fn parse(mut file: File, size: u64, columns: &Columns) -> Result<(FileFacts, Vec<Builder<'_>>), Problem> {
    let mut start = Vec::new();
    (&mut file).take(foreign::LOOKED_AT).read_to_end(&mut start)?;
    file.rewind()?;
    let of = |kind| FileFacts { kind, ..FileFacts::default() };
    if start.starts_with(npy::MAGIC) {
        return Ok((of(FileKind::Npy), npy::read(Shared::new(file, size), size, columns)?));
    }
    if archive::MAGIC.iter().any(|magic| start.starts_with(magic)) {
        let archive = archive::open(Shared::new(file, size))?;
        let names = archive::names(&archive)?;
        if names.iter().any(|name| name == workbook::MARK) {
            let table = workbook::text(archive)?;
            return Ok((of(FileKind::Xlsx), csv::read(table.as_bytes(), columns, Some(Separator::Tab))?.1));
        }
        return match foreign::archive(names.iter().map(String::as_str)) {
            Some(problem) => Err(problem),
            None => Ok((of(FileKind::Npz), npz::read(archive, columns)?)),
        };
    }
    let gzip = start.starts_with(gzip::MAGIC);
    let packed = BufReader::with_capacity(1 << 20, file.take(size));
    let mut input: Box<dyn BufRead> = Box::new(packed);
    if gzip {
        let mut unpacked = BufReader::with_capacity(1 << 20, gzip::Gzip::new(input, size));
        start = unpacked.fill_buf()?.iter().take(foreign::LOOKED_AT as usize).copied().collect();
        input = Box::new(unpacked);
        let packed = [npy::MAGIC, gzip::MAGIC].into_iter().chain(archive::MAGIC);
        if packed.into_iter().any(|magic| start.starts_with(magic)) {
            return Err(Problem::Foreign { name: "an archive or array packed by gzip", help: "unpack it first" });
        }
    }
    foreign::refuse(&start)?;
    let wide = encoding::is_utf16(&start);
    if wide {
        input = Box::new(BufReader::with_capacity(1 << 20, encoding::Utf16::new(input)));
    }
    let (text, builders) = csv::read(input, columns, None)?;
    let encoding = Some(if wide { Encoding::Utf16 } else { text.encoding });
    let (separator, decimal_comma) = (Some(text.separator), text.numbers.have_commas());
    Ok((FileFacts { gzip, encoding, separator, decimal_comma, ..FileFacts::default() }, builders))
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod variety_tests;
