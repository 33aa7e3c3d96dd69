//! Arrays of NumPy's format NPY (NEP 1), numbers only.

use super::Problem;
use super::builder::Builder;
use super::select::Selection;
use crate::recording::Columns;
use std::io::Read;

/// First bytes of such a file.
pub const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header in bytes; NumPy itself takes no longer one without being asked to.
const LONGEST: usize = 10_000;

/// Type of the elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Element {
    /// `f`, `i` or `u`.
    kind: u8,
    /// Bytes.
    size: usize,
    big_endian: bool,
}

/// An array before its numbers are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Rows.
    pub rows: usize,
    /// Columns; 1 of a vector.
    pub columns: usize,
    /// Number of dimensions, 1 or 2.
    pub dimensions: usize,
    element: Element,
    fortran: bool,
}

impl Header {
    /// Reads the header of an array in a file of `available` bytes.
    pub fn read(input: &mut impl Read, available: u64) -> Result<Self, Problem> {
        let short = |_| Problem::Array("the header of the array is cut off".to_string());
        let mut start = [0; 8];
        input.read_exact(&mut start).map_err(short)?;
        if start[..6] != *MAGIC {
            return Err(Problem::Array("expected an array of NumPy, found something else".to_string()));
        }
        let length = match start[6] {
            1 => {
                let mut length = [0; 2];
                input.read_exact(&mut length).map_err(short)?;
                usize::from(u16::from_le_bytes(length))
            }
            2 | 3 => {
                let mut length = [0; 4];
                input.read_exact(&mut length).map_err(short)?;
                u32::from_le_bytes(length) as usize
            }
            other => return Err(Problem::Array(format!("version {other} of NPY, expected 1, 2 or 3"))),
        };
        if length > LONGEST {
            return Err(Problem::Array(format!(
                "the header of the array has {length} bytes, expected at most {LONGEST}"
            )));
        }
        let mut text = vec![0; length];
        input.read_exact(&mut text).map_err(short)?;
        let text = String::from_utf8(text).map_err(|_| Problem::Array("the array's header is no text".to_string()))?;
        let header = Self::parse(&text)?;
        let bytes = (header.rows as u128) * (header.columns as u128) * (header.element.size as u128);
        if bytes > u128::from(available) {
            let (rows, columns) = (header.rows, header.columns);
            return Err(Problem::Array(format!(
                "the header promises {rows} x {columns} numbers ({bytes} bytes), the file has {available} bytes"
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
            Some(&[rows]) => Ok(Self { rows, columns: 1, dimensions: 1, element, fortran }),
            Some(&[rows, columns]) => Ok(Self { rows, columns, dimensions: 2, element, fortran }),
            Some(other) => {
                Err(Problem::Array(format!("an array of {} dimensions, expected 2 (rows and columns)", other.len())))
            }
            None => Err(Problem::Array("the array's header has no readable shape".to_string())),
        }
    }

    /// Reads the numbers of some columns; `wanted[c]` is the place of column `c` in the result, if it is wanted.
    pub fn numbers(&self, input: &mut impl Read, wanted: &[Option<usize>]) -> Result<Vec<Vec<f64>>, Problem> {
        let mut columns = vec![Vec::new(); wanted.iter().flatten().count()];
        let (total, size) = (self.rows * self.columns, self.element.size);
        let mut buffer = vec![0; (8192 * size).min(total * size)];
        let mut index = 0;
        while index < total {
            let bytes = &mut buffer[..((total - index) * size).min(8192 * size)];
            input.read_exact(bytes).map_err(|error| match error.kind() {
                std::io::ErrorKind::UnexpectedEof => Problem::Array("the numbers of the array are cut off".to_string()),
                _ => Problem::Io(error),
            })?;
            for element in bytes.chunks_exact(size) {
                // In either order the numbers of one column come by ascending row.
                let column = if self.fortran { index / self.rows } else { index % self.columns };
                if let Some(place) = wanted[column] {
                    columns[place].push(self.element.decode(element));
                }
                index += 1;
            }
        }
        Ok(columns)
    }
}

impl Element {
    /// A type string such as `<f8`.
    fn parse(name: &str) -> Result<Self, Problem> {
        let expected = "expected floats of 4 or 8 bytes or integers of 1 to 8";
        let found = |what: &str| Problem::Array(format!("an array of {what} ({name}), {expected}"));
        let bytes = name.as_bytes();
        let (&[order, kind], Some(size)) = (bytes.get(..2).unwrap_or(&[0, 0]), name.get(2..)) else {
            return Err(found("unknown elements"));
        };
        match (kind, size.parse::<usize>()) {
            (b'f', Ok(size @ (4 | 8))) | (b'i' | b'u', Ok(size @ (1 | 2 | 4 | 8))) => {
                Ok(Self { kind, size, big_endian: order == b'>' })
            }
            (b'O', _) => Err(found("Python objects")),
            (b'c', _) => Err(found("complex numbers")),
            (b'S' | b'U', _) => Err(found("text")),
            (b'b', _) => Err(found("truth values")),
            _ => Err(found("other elements")),
        }
    }

    /// The nearest `f64` of an element's bytes.
    fn decode(self, bytes: &[u8]) -> f64 {
        let mut word = [0; 8];
        for (k, byte) in bytes.iter().enumerate() {
            word[if self.big_endian { self.size - 1 - k } else { k }] = *byte;
        }
        let bits = u64::from_le_bytes(word);
        let unused = 64 - 8 * self.size as u32;
        match (self.kind, self.size) {
            (b'f', 4) => f64::from(f32::from_bits(bits as u32)),
            (b'f', _) => f64::from_bits(bits),
            (b'i', _) => ((bits << unused) as i64 >> unused) as f64,
            _ => bits as f64,
        }
    }
}

/// Reads a table of numbers, columns by number or by the given names.
pub fn read<'a>(input: &mut impl Read, available: u64, columns: &'a Columns) -> Result<Builder<'a>, Problem> {
    let header = Header::read(input, available)?;
    let names = columns.names.as_deref();
    if let Some(names) = names
        && names.len() != header.columns
    {
        return Err(Problem::Width { row: 1, expected: names.len(), found: header.columns });
    }
    let selection = Selection::new(columns, names, header.columns, 1)?;
    let mut wanted = vec![None; header.columns];
    for (place, used) in selection.values.iter().chain(&selection.trajectory).enumerate() {
        wanted[used.position] = Some(place);
    }
    let numbers = header.numbers(input, &wanted)?;
    fill(Builder::new(columns, selection), &numbers)
}

/// Adds all rows of columns in the order of the selection, the trajectory's column last.
pub fn fill<'a>(mut builder: Builder<'a>, numbers: &[Vec<f64>]) -> Result<Builder<'a>, Problem> {
    let count = builder.selection().values.len();
    let mut values = vec![0.0; count];
    for index in 0..numbers.first().map_or(0, Vec::len) {
        let row = index as u64 + 1;
        for (k, column) in numbers.iter().enumerate() {
            let selection = builder.selection();
            if !column[index].is_finite() {
                let used = selection.values.get(k).or(selection.trajectory.as_ref());
                let name = used.map(|used| used.name.clone()).unwrap_or_default();
                return Err(Problem::Field { row, column: name, found: column[index].to_string() });
            }
            if k < count {
                values[k] = column[index];
            }
        }
        let label = numbers.get(count).map(|column| column[index].to_string());
        builder.push(row, &values, label.as_deref())?;
    }
    Ok(builder)
}
