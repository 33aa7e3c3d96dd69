//! Numbers as text, read line by line.

use super::Problem;
use super::builder::Builder;
use super::encoding::{Encoding, MARK, decode};
use super::error::Faults;
use super::number::Numbers;
use super::select::Selection;
use super::text::{Separator, comment, line_end, names_in, split, unquoted, with_point};
use super::thresholds::LONGEST_LINE;
use super::wide::Lane;
use crate::recording::Columns;
use std::io::{BufRead, Read};

/// The trajectories of a text while its lines are read, and the recognised format.
pub struct TextReader<'a> {
    /// One trajectory, several that a column distinguishes, or several side by side.
    lanes: Vec<Lane<'a>>,
    /// `true` if trajectories are side by side.
    wide: bool,
    /// For every column of the file, its index among the used columns of its trajectory.
    slots: Vec<Option<usize>>,
    /// Position of the column that distinguishes trajectories.
    label_at: Option<usize>,
    faults: Faults,
    /// Recognises the decimal mark.
    pub numbers: Numbers,
    /// Encoding of the text.
    pub encoding: Encoding,
    /// Separator of the fields.
    pub separator: Separator,
}

/// Reads rows of numbers, with or without a header, into trajectories; `known` is the separator if it is given.
///
/// The first line that is neither blank nor a comment, which begins with `#`, is a header if none of its fields is a number,
/// and says how fields are separated: by commas, semicolons, tabs, bars or blanks. Without a header the last comment above
/// names the columns if it has as many names. Spaces around fields, double quotes, a byte order mark, blank lines, the line
/// ends of Windows and of old Macs, decimal commas, Excel's line `sep=;` and a title above the header are accepted.
pub fn read<'a>(
    mut input: impl BufRead,
    columns: &'a Columns,
    known: Option<Separator>,
) -> Result<(TextReader<'a>, Vec<Builder<'a>>), Problem> {
    let (mut line, mut row) = (Vec::new(), 0);
    let mut reader: Option<TextReader<'a>> = None;
    let mut last_comment = None;
    let end = line_end(input.fill_buf()?);
    loop {
        line.clear();
        if input.by_ref().take(LONGEST_LINE).read_until(end, &mut line)? == 0 {
            break;
        }
        row += 1;
        if line.len() as u64 == LONGEST_LINE {
            return Err(Problem::LongLine { row, limit: LONGEST_LINE });
        }
        let mut whole = line.as_slice();
        if row == 1 {
            whole = whole.strip_prefix(MARK).unwrap_or(whole);
        }
        let text = whole.trim_ascii();
        if text.is_empty() {
            continue;
        }
        if let Some(said) = comment(text) {
            if reader.is_none() {
                last_comment = decode(said).map(|(said, _)| (row, said.to_string()));
            }
            continue;
        }
        match &mut reader {
            Some(known) => known.take(whole, text, row)?,
            None if text.strip_prefix(b"sep=").is_some_and(|mark| mark.len() <= 1) => {}
            None if is_title(text, input.fill_buf()?) => {}
            None => {
                let (first, header) = TextReader::begin(whole, row, columns, last_comment.take(), known)?;
                let first = reader.insert(first);
                if !header {
                    first.take(whole, text, row)?;
                }
            }
        }
    }
    let mut text = reader.ok_or(Problem::Empty)?;
    std::mem::take(&mut text.faults).end()?;
    let builders = std::mem::take(&mut text.lanes).into_iter().map(|lane| lane.builder).collect();
    Ok((text, builders))
}

/// `true` for a line of one field above a line of several that are not numbers: a title above the header, such as the name of a track.
fn is_title(line: &[u8], rest: &[u8]) -> bool {
    let next = rest.split(|byte| matches!(byte, b'\n' | b'\r')).find(|line| !line.trim_ascii().is_empty());
    let (Some((title, _)), Some((next, _))) = (decode(line), next.and_then(decode)) else { return false };
    let separator = Separator::of(&next);
    let names = |text: &str| {
        let fields = split(text.trim(), separator);
        fields.iter().all(|field| field.parse::<f64>().is_err() && with_point(field).is_none()).then_some(fields.len())
    };
    names(&title) == Some(1) && names(&next).is_some_and(|count| count > 1)
}

impl<'a> TextReader<'a> {
    /// Finds the columns by the first line, or by the comment above it; returns whether the line is a header.
    fn begin(
        line: &[u8],
        row: u64,
        columns: &'a Columns,
        last_comment: Option<(u64, String)>,
        known: Option<Separator>,
    ) -> Result<(Self, bool), Problem> {
        let (text, encoding) = decode(line).ok_or(Problem::NotText(row))?;
        let separator = known.unwrap_or_else(|| Separator::of(&text));
        // In a table with row names, the first column has no name.
        let text = if separator == Separator::Tab { text.trim_matches(' ').trim_end() } else { text.trim() };
        let first = split(text, separator);
        let width = first.len();
        let header = first.iter().all(|field| field.parse::<f64>().is_err() && with_point(field).is_none());
        let select = |names: Option<&[String]>, row| Selection::all(columns, names, width, row);
        let selections = match (&columns.names, header) {
            (Some(_), true) => return Err(Problem::Header { row, found: text.chars().take(80).collect() }),
            (Some(names), false) if names.len() != width => {
                return Err(Problem::Width { row, expected: names.len(), found: width });
            }
            (Some(names), false) => select(Some(names), row)?,
            (None, true) => select(Some(&first.iter().map(ToString::to_string).collect::<Vec<_>>()), row)?,
            (None, false) => match last_comment.and_then(|(row, said)| Some((row, names_in(&said, width)?))) {
                Some((row, names)) => select(Some(&names), row)?,
                None => select(None, row)?,
            },
        };
        let (mut slots, mut label_at) = (vec![None; width], None);
        for selection in &selections {
            for (slot, used) in selection.values.iter().enumerate() {
                slots[used.position] = Some(slot);
            }
            label_at = selection.trajectory.as_ref().map(|used| used.position);
        }
        let lanes = selections.into_iter().map(|selection| Lane::new(Builder::new(columns, selection))).collect();
        let (faults, numbers) = (Faults::default(), Numbers::default());
        Ok((Self { lanes, wide: columns.wide, slots, label_at, faults, numbers, encoding, separator }, header))
    }

    /// Parses the numbers of one line; `text` is the line without surrounding blanks.
    fn take<'b>(&mut self, line: &'b [u8], mut text: &'b [u8], row: u64) -> Result<(), Problem> {
        if self.separator == Separator::Tab {
            // Tabs at the ends separate empty fields.
            let whole = line.trim_ascii_end().len();
            let whole = &line[..whole + line[whole..].iter().take_while(|byte| matches!(byte, b'\t' | b' ')).count()];
            if whole.len() != text.len() && self.separator.fields(text).count() != self.slots.len() {
                text = whole;
            }
        }
        if self.wide {
            return self.take_wide(text, row);
        }
        let Some(lane) = self.lanes.first_mut() else { return Ok(()) };
        let (mut found, mut good, mut label) = (0, true, None);
        for field in self.separator.fields(text) {
            if let Some(slot) = self.slots.get(found).copied().flatten() {
                match self.numbers.reading(field, row) {
                    Some(x) => lane.values[slot] = x,
                    None => good = false,
                }
            } else if self.label_at == Some(found) {
                label = Some(field);
            }
            found += 1;
        }
        if !good || found != self.slots.len() {
            self.note_mistakes(text, row);
            return Ok(());
        }
        // After a mistake, the remaining rows are only checked for further mistakes.
        if !self.faults.is_empty() {
            return Ok(());
        }
        let Some(label) = label else { return lane.builder.push(row, &lane.values, None) };
        let (label, encoding) = decode(label).ok_or(Problem::NotText(row))?;
        if encoding != Encoding::Utf8 {
            self.encoding = encoding;
        }
        lane.builder.push(row, &lane.values, Some(unquoted(&label)))
    }

    /// Reads the numbers of trajectories side by side.
    fn take_wide(&mut self, text: &[u8], row: u64) -> Result<(), Problem> {
        let fields: Vec<&[u8]> = self.separator.fields(text).collect();
        if fields.len() != self.slots.len() {
            self.note_mistakes(text, row);
            return Ok(());
        }
        self.lanes.iter_mut().try_for_each(|lane| lane.take(&fields, row, &mut self.numbers, &mut self.faults))
    }

    /// Collects every mistake of a line.
    fn note_mistakes(&mut self, text: &[u8], row: u64) {
        let (expected, found) = (self.slots.len(), self.separator.fields(text).count());
        if found != expected {
            return self.faults.add(Problem::Ragged { row, expected, separated: self.separator.named(), found });
        }
        for (field, slot) in self.separator.fields(text).zip(&self.slots) {
            if let Some(slot) = slot
                && self.numbers.reading(field, row).is_none()
                && let Some(lane) = self.lanes.first()
            {
                let column = &lane.builder.selection().values[*slot].name;
                self.faults.add(self.numbers.refusal(field, row, column));
            }
        }
    }
}
