//! Numbers as text, read line by line.

use super::Problem;
use super::builder::Builder;
use super::select::Selection;
use super::text::{Separator, comment, line_end, names_in, split, unquoted};
use crate::recording::Columns;
use std::io::{BufRead, Read};

/// Longest line in bytes.
const LONGEST: u64 = 1 << 20;

/// Reads rows of numbers, with or without a header, into trajectories.
///
/// The first line that is neither blank nor a comment, which begins with `#`, is a header if none of its fields is a number,
/// and says how fields are separated: by commas, semicolons, tabs, bars or blanks. Without a header the last comment above
/// names the columns if it has as many names. Spaces around fields, double quotes, a byte order mark, blank lines and the line
/// ends of Windows and of old Macs are accepted.
pub fn read<'a>(mut input: impl BufRead, columns: &'a Columns) -> Result<Builder<'a>, Problem> {
    let (mut line, mut row, mut values) = (Vec::new(), 0, Vec::new());
    let mut begun: Option<(Builder<'a>, Vec<Option<usize>>, Separator)> = None;
    let mut remark = None;
    let end = line_end(input.fill_buf()?);
    loop {
        line.clear();
        if input.by_ref().take(LONGEST).read_until(end, &mut line)? == 0 {
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
        if let Some(said) = comment(text) {
            if begun.is_none() {
                remark = std::str::from_utf8(said).ok().map(|said| (row, said.to_string()));
            }
            continue;
        }
        let (builder, slots, separator) = match &mut begun {
            Some(known) => known,
            None => {
                let (selection, header, separator) = begin(text, row, columns, remark.take())?;
                let mut slots = vec![None; selection.width];
                for (slot, used) in selection.values.iter().enumerate() {
                    slots[used.position] = Some(slot);
                }
                values.resize(selection.values.len(), 0.0);
                let known = begun.insert((Builder::new(columns, selection), slots, separator));
                if header {
                    continue;
                }
                known
            }
        };
        take_row(text, row, *separator, builder, slots, &mut values)?;
    }
    begun.map(|(builder, ..)| builder).ok_or(Problem::Empty)
}

/// Reads the numbers of one line.
fn take_row(
    text: &[u8],
    row: u64,
    separator: Separator,
    builder: &mut Builder<'_>,
    slots: &[Option<usize>],
    values: &mut [f64],
) -> Result<(), Problem> {
    let label_at = builder.selection().trajectory.as_ref().map(|used| used.position);
    let (mut found, mut label) = (0, None);
    for field in separator.fields(text) {
        if let Some(slot) = slots.get(found).copied().flatten() {
            values[slot] = match number(field) {
                Some(x) if x.is_finite() => x,
                _ => {
                    let expected = slots.len();
                    let count = separator.fields(text).count();
                    if count != expected {
                        return Err(Problem::Ragged { row, expected, separated: separator.named(), found: count });
                    }
                    let shown = std::str::from_utf8(field).map_err(|_| Problem::NotText(row))?;
                    let column = builder.selection().values[slot].name.clone();
                    let found: String = unquoted(shown).chars().take(40).collect();
                    return Err(if is_number_with_comma(&found) {
                        Problem::DecimalComma { row, column, found }
                    } else {
                        Problem::Field { row, column, found }
                    });
                }
            };
        } else if label_at == Some(found) {
            label = Some(unquoted(std::str::from_utf8(field).map_err(|_| Problem::NotText(row))?));
        }
        found += 1;
    }
    if found != slots.len() {
        return Err(Problem::Ragged { row, expected: slots.len(), separated: separator.named(), found });
    }
    builder.push(row, values, label)
}

/// Finds the columns by the first line, or by the comment above it; says whether the line is a header, and what separates
/// its fields.
fn begin(
    text: &[u8],
    row: u64,
    columns: &Columns,
    remark: Option<(u64, String)>,
) -> Result<(Selection, bool, Separator), Problem> {
    let text = std::str::from_utf8(text).map_err(|_| Problem::NotText(row))?;
    let separator = Separator::of(text);
    let first = split(text, separator);
    let width = first.len();
    let header = first.iter().all(|field| field.parse::<f64>().is_err() && !is_number_with_comma(field));
    let select = |names: Option<&[String]>, row| Selection::new(columns, names, width, row);
    let selection = match (&columns.names, header) {
        (Some(_), true) => return Err(Problem::Header { row, found: text.chars().take(80).collect() }),
        (Some(names), false) if names.len() != width => {
            return Err(Problem::Width { row, expected: names.len(), found: width });
        }
        (Some(names), false) => select(Some(names), row)?,
        (None, true) => select(Some(&first.iter().map(ToString::to_string).collect::<Vec<_>>()), row)?,
        (None, false) => match remark.and_then(|(row, said)| Some((row, names_in(&said, width)?))) {
            Some((row, names)) => select(Some(&names), row)?,
            None => select(None, row)?,
        },
    };
    Ok((selection, header, separator))
}

/// `0,5`.
fn is_number_with_comma(field: &str) -> bool {
    field.contains(',') && field.replacen(',', ".", 1).parse::<f64>().is_ok()
}

/// A number, fast if nothing stands around it.
fn number(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    text.parse().or_else(|_| unquoted(text).parse()).ok()
}
