//! Arrays of NumPy's format NPY (NEP 1), numbers only.

use super::Problem;
use super::builder::Builder;
use super::element::Element;
use super::fill::{Source, fill};
use super::select::Selection;
use super::shared::Shared;
use super::thresholds::LONGEST_HEADER;
use crate::names::pluralize;
use crate::recording::Columns;
use std::io::{BufReader, Read};

/// First bytes of an NPY file.
pub const MAGIC: &[u8] = b"\x93NUMPY";

/// An array before its numbers are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Rows.
    pub rows: usize,
    /// Columns; 1 for a vector.
    pub columns: usize,
    /// Number of dimensions, 1 or 2.
    pub dimensions: usize,
    /// Type of the numbers.
    pub element: Element,
    /// `true` for Fortran order, which stores column after column.
    pub fortran: bool,
    /// Bytes before the first number.
    pub start: u64,
}

impl Header {
    /// Reads the header of an array that has `available` bytes including its header. Their number must match the shape exactly, which is
    /// checked before a number is read.
    pub fn read(input: &mut impl Read, available: u64) -> Result<Self, Problem> {
        let short = |_| Problem::Array("the header of the array is cut off".to_string());
        let mut start = [0; 8];
        input.read_exact(&mut start).map_err(short)?;
        if start[..6] != *MAGIC {
            return Err(Problem::Array("expected an array of NumPy, found something else".to_string()));
        }
        let (length, prefix) = match start[6] {
            1 => {
                let mut length = [0; 2];
                input.read_exact(&mut length).map_err(short)?;
                (usize::from(u16::from_le_bytes(length)), 10)
            }
            2 | 3 => {
                let mut length = [0; 4];
                input.read_exact(&mut length).map_err(short)?;
                (u32::from_le_bytes(length) as usize, 12)
            }
            other => return Err(Problem::Array(format!("version {other} of NPY, expected 1, 2 or 3"))),
        };
        if length > LONGEST_HEADER {
            return Err(Problem::Array(format!(
                "the header of the array has {length} bytes, expected at most {LONGEST_HEADER}"
            )));
        }
        let mut text = vec![0; length];
        input.read_exact(&mut text).map_err(short)?;
        let text = String::from_utf8(text).map_err(|_| Problem::Array("the array's header is not text".to_string()))?;
        let header = Self { start: prefix + length as u64, ..Self::parse(&text)? };
        let bytes = (header.rows as u128) * (header.columns as u128) * (header.element.size() as u128);
        let behind = available.saturating_sub(header.start);
        if bytes != u128::from(behind) {
            let (rows, columns) = (header.rows, header.columns);
            return Err(Problem::Array(format!(
                "the header states {rows} x {columns} numbers ({bytes} bytes), but {behind} bytes follow it"
            )));
        }
        Ok(header)
    }

    /// Parses the Python dictionary of a header.
    fn parse(text: &str) -> Result<Self, Problem> {
        let value = |key: &str| {
            let quoted = [format!("'{key}'"), format!("\"{key}\"")];
            let at = quoted.iter().find_map(|quoted| text.find(quoted.as_str()).map(|at| at + quoted.len()));
            at.and_then(|at| text[at..].trim_start().strip_prefix(':'))
                .map(str::trim_start)
                .ok_or_else(|| Problem::Array(format!("the array's header has no {key}")))
        };
        let descr = value("descr")?;
        let element = match descr.split(['\'', '"']).nth(1) {
            Some(name) if descr.starts_with(['\'', '"']) => Element::parse(name)?,
            _ => return Err(Problem::Array("an array of records, expected an array of numbers".to_string())),
        };
        let order = value("fortran_order")?;
        let fortran = match (order.starts_with("True"), order.starts_with("False")) {
            (true, _) => true,
            (_, true) => false,
            _ => return Err(Problem::Array("the array's header has no order".to_string())),
        };
        let shape = value("shape")?.strip_prefix('(').and_then(|rest| rest.split_once(')')).map(|(inside, _)| inside);
        let lengths: Option<Vec<usize>> = shape.and_then(|inside| {
            inside.split(',').map(str::trim).filter(|text| !text.is_empty()).map(|text| text.parse().ok()).collect()
        });
        match lengths.as_deref() {
            Some(&[rows]) => Ok(Self { rows, columns: 1, dimensions: 1, element, fortran, start: 0 }),
            Some(&[rows, columns]) => Ok(Self { rows, columns, dimensions: 2, element, fortran, start: 0 }),
            Some(other) => Err(Problem::Array(format!(
                "an array of {}, expected 2 (rows and columns)",
                pluralize(other.len(), "dimension", "dimensions")
            ))),
            None => Err(Problem::Array("the array's header has no readable shape".to_string())),
        }
    }
}

/// Reads a table of numbers in a file of its own.
pub fn read(file: Shared, available: u64, columns: &Columns) -> Result<Vec<Builder<'_>>, Problem> {
    let header = Header::read(&mut BufReader::new(file.clone()), available)?;
    table(&header, columns, |offset| Ok(Box::new(BufReader::with_capacity(1 << 16, file.at(offset)))))
}

/// Reads a table of numbers, columns by number or by the given names; `open` gives a reader at a number of bytes after the beginning of the
/// array.
pub fn table<'a, 'f>(
    header: &Header,
    columns: &'a Columns,
    mut open: impl FnMut(u64) -> Result<Box<dyn Read + 'f>, Problem>,
) -> Result<Vec<Builder<'a>>, Problem> {
    let &Header { rows, columns: width, element, fortran, start, .. } = header;
    let names = columns.names.as_deref();
    if let Some(names) = names
        && names.len() != width
    {
        return Err(Problem::Width { row: 1, expected: names.len(), found: width });
    }
    let source = |input, width, wanted| Source { input, element, width, wanted, whole: !fortran, name: String::new() };
    let mut one = |selection: Selection| {
        let wanted: Vec<(usize, usize)> =
            selection.used().enumerate().map(|(place, used)| (used.position, place)).collect();
        let mut sources = Vec::new();
        if fortran {
            for (column, place) in wanted {
                let before = (rows * column * element.size()) as u64;
                sources.push(source(open(start + before)?, 1, vec![(0, place)]));
            }
        } else {
            sources.push(source(open(start)?, width, wanted));
        }
        fill(Builder::new(columns, selection), rows, &mut sources)
    };
    Selection::all(columns, names, width, 1)?.into_iter().map(&mut one).collect()
}
