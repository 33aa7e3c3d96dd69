//! Comma-separated numbers, read line by line.

use super::Problem;
use super::builder::Builder;
use super::select::Selection;
use crate::recording::Columns;
use std::io::{BufRead, Read};

/// Longest line in bytes.
const LONGEST: u64 = 1 << 20;

/// Reads rows of numbers, with or without a header, into trajectories.
///
/// The first line that is not blank is a header if none of its fields is a number. Fields are separated by commas;
/// spaces around them, double quotes, a byte order mark, blank lines, Windows line ends and a `#` before the header are
/// accepted.
pub fn read<'a>(mut input: impl BufRead, columns: &'a Columns) -> Result<Builder<'a>, Problem> {
    let (mut line, mut row, mut values) = (Vec::new(), 0, Vec::new());
    let mut begun: Option<(Builder<'a>, Vec<Option<usize>>)> = None;
    loop {
        line.clear();
        if input.by_ref().take(LONGEST).read_until(b'\n', &mut line)? == 0 {
            break;
        }
        row += 1;
        if line.len() as u64 == LONGEST {
            return Err(Problem::LongLine { row, limit: LONGEST });
        }
        let mut text = line.as_slice();
        if row == 1 {
            text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
            if text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff") {
                return Err(Problem::NotText(row));
            }
        }
        let text = text.trim_ascii();
        if text.is_empty() {
            continue;
        }
        let (builder, slots) = match &mut begun {
            Some(known) => known,
            None => {
                let (selection, header) = begin(text, row, columns)?;
                let mut slots = vec![None; selection.width];
                for (slot, used) in selection.values.iter().enumerate() {
                    slots[used.position] = Some(slot);
                }
                values.resize(selection.values.len(), 0.0);
                let known = begun.insert((Builder::new(columns, selection), slots));
                if header {
                    continue;
                }
                known
            }
        };
        take_row(text, row, builder, slots, &mut values)?;
    }
    begun.map(|(builder, _)| builder).ok_or(Problem::Empty)
}

/// Reads the numbers of one line.
fn take_row(
    text: &[u8],
    row: u64,
    builder: &mut Builder<'_>,
    slots: &[Option<usize>],
    values: &mut [f64],
) -> Result<(), Problem> {
    let label_at = builder.selection().trajectory.as_ref().map(|used| used.position);
    let (mut found, mut label) = (0, None);
    for field in fields(text) {
        if let Some(slot) = slots.get(found).copied().flatten() {
            values[slot] = match number(field) {
                Some(x) if x.is_finite() => x,
                _ => {
                    let expected = slots.len();
                    let count = fields(text).count();
                    if count != expected {
                        return Err(Problem::Ragged { row, expected, found: count });
                    }
                    let shown = std::str::from_utf8(field).map_err(|_| Problem::NotText(row))?;
                    let column = builder.selection().values[slot].name.clone();
                    return Err(Problem::Field { row, column, found: unquoted(shown).chars().take(40).collect() });
                }
            };
        } else if label_at == Some(found) {
            label = Some(unquoted(std::str::from_utf8(field).map_err(|_| Problem::NotText(row))?));
        }
        found += 1;
    }
    if found != slots.len() {
        return Err(Problem::Ragged { row, expected: slots.len(), found });
    }
    builder.push(row, values, label)
}

/// Finds the columns by the first line; says whether it is a header.
fn begin(text: &[u8], row: u64, columns: &Columns) -> Result<(Selection, bool), Problem> {
    let text = std::str::from_utf8(text).map_err(|_| Problem::NotText(row))?;
    separator(text).map_or(Ok(()), |separator| Err(Problem::Separator { row, separator }))?;
    let first: Vec<&str> = fields(text.as_bytes())
        .map(|field| std::str::from_utf8(field).map(unquoted).map_err(|_| Problem::NotText(row)))
        .collect::<Result<_, _>>()?;
    let header = first.iter().all(|field| field.parse::<f64>().is_err());
    if let Some(names) = &columns.names {
        if header {
            return Err(Problem::Header { row, found: text.chars().take(80).collect() });
        }
        if names.len() != first.len() {
            return Err(Problem::Width { row, expected: names.len(), found: first.len() });
        }
        return Ok((Selection::new(columns, Some(names), first.len(), row)?, false));
    }
    if !header {
        return Ok((Selection::new(columns, None, first.len(), row)?, false));
    }
    let names: Vec<String> = first
        .iter()
        .enumerate()
        .map(|(k, name)| if k == 0 { name.trim_start_matches('#').trim() } else { name }.to_string())
        .collect();
    Ok((Selection::new(columns, Some(&names), names.len(), row)?, true))
}

/// What separates the fields of a line if it is not commas.
fn separator(line: &str) -> Option<char> {
    let outside: String = line.split('"').step_by(2).collect();
    if let Some(found) = [';', '\t', '|'].into_iter().find(|c| outside.contains(*c)) {
        return Some(found);
    }
    let mut words = outside.split_whitespace();
    (!outside.contains(',') && words.clone().count() > 1 && words.all(|word| word.parse::<f64>().is_ok()))
        .then_some(' ')
}

/// The fields of a line; commas between double quotes do not separate.
fn fields(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut quoted = false;
    line.split(move |byte| {
        quoted ^= *byte == b'"';
        *byte == b',' && !quoted
    })
}

/// A number, fast if nothing stands around it.
fn number(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    text.parse().or_else(|_| unquoted(text).parse()).ok()
}

/// A field without the spaces and quotes around it.
pub(crate) fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).map_or(field, str::trim)
}
