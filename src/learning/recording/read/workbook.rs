//! The first sheet of an Excel workbook (`.xlsx`) as lines of fields.

use super::Problem;
use super::archive::{bounded, broken};
use super::shared::Shared;
use super::thresholds::{SHEET_BYTES, SHEET_COLUMNS, SHEET_ROWS};
use super::xml::{Tag, damaged, next};
use std::io::BufReader;
use zip::ZipArchive;

/// The entry that identifies a workbook.
pub const MARK: &str = "xl/workbook.xml";

/// The cells of the first sheet, separated by tabs, every row on the line of its number.
pub fn text(mut archive: ZipArchive<Shared>) -> Result<String, Problem> {
    let mut first = None;
    each_tag(&mut archive, MARK, |tag| {
        if tag.name == "sheet" && first.is_none() {
            first = tag.attribute("id");
        }
        Ok(())
    })?;
    let mut sheet = None;
    each_tag(&mut archive, "xl/_rels/workbook.xml.rels", |tag| {
        if tag.name == "Relationship" && first.is_some() && tag.attribute("Id") == first {
            sheet = tag.attribute("Target");
        }
        Ok(())
    })?;
    let target = sheet.ok_or_else(damaged)?;
    let sheet = target.strip_prefix('/').map_or_else(|| format!("xl/{target}"), str::to_string);
    let mut texts = SharedStrings::default();
    if archive.index_for_name("xl/sharedStrings.xml").is_some() {
        each_tag(&mut archive, "xl/sharedStrings.xml", |tag| {
            texts.take(&tag);
            Ok(())
        })?;
    }
    let mut cells = Cells { texts: texts.all, ..Cells::default() };
    each_tag(&mut archive, &sheet, |tag| cells.take(&tag))?;
    Ok(cells.lines)
}

/// Calls `take` with every tag of an entry.
fn each_tag(
    archive: &mut ZipArchive<Shared>,
    name: &str,
    mut take: impl FnMut(Tag) -> Result<(), Problem>,
) -> Result<(), Problem> {
    let index = archive.index_for_name(name).ok_or_else(damaged)?;
    bounded(archive, [index])?;
    let mut input = BufReader::with_capacity(1 << 16, archive.by_index(index).map_err(broken)?);
    while let Some(tag) = next(&mut input)? {
        take(tag)?;
    }
    Ok(())
}

/// Strings that cells share.
#[derive(Default)]
struct SharedStrings {
    all: Vec<String>,
    current: String,
    /// `true` inside a phonetic guide, which is not part of the text.
    aside: bool,
}

impl SharedStrings {
    fn take(&mut self, tag: &Tag) {
        match (tag.name.as_str(), tag.end) {
            ("rPh", _) => self.aside = !tag.end,
            ("t", true) if !self.aside => self.current += &tag.text,
            ("si", true) => self.all.push(std::mem::take(&mut self.current)),
            _ => {}
        }
    }
}

/// Rows of a sheet, built tag by tag.
#[derive(Default)]
struct Cells {
    texts: Vec<String>,
    lines: String,
    /// Number of the row, from 1.
    row: usize,
    /// Number of fields in the first row that is not empty.
    width: usize,
    fields: Vec<String>,
    /// Bytes of the fields so far.
    size: usize,
    /// Position and type of the cell.
    column: usize,
    kind: String,
    value: String,
}

impl Cells {
    fn take(&mut self, tag: &Tag) -> Result<(), Problem> {
        let value = ["v", "t"].contains(&tag.name.as_str());
        match (tag.name.as_str(), tag.start, tag.end) {
            ("row", true, _) => {
                let row = tag.attribute("r").map_or(Some(self.row + 1), |text| text.parse().ok());
                let row = row.filter(|row| *row > self.row && *row <= SHEET_ROWS).ok_or_else(damaged)?;
                // Missing rows become blank lines.
                self.lines.extend(std::iter::repeat_n('\n', row - self.row - 1));
                self.row = row;
            }
            ("c", true, end) => {
                let place = tag.attribute("r").map_or(Some(self.fields.len()), |text| column(&text));
                self.column = place.filter(|at| *at < SHEET_COLUMNS && *at >= self.fields.len()).ok_or_else(damaged)?;
                self.kind = tag.attribute("t").unwrap_or_default();
                if end {
                    self.end_cell()?;
                }
            }
            ("c", _, true) => self.end_cell()?,
            (_, _, true) if value => self.value += &tag.text,
            _ => {}
        }
        if tag.name == "row" && tag.end {
            self.end_row();
        }
        Ok(())
    }

    /// Keeps the value of a cell: a number unchanged, a text in quotes.
    fn end_cell(&mut self) -> Result<(), Problem> {
        let mut value = std::mem::take(&mut self.value);
        if self.kind == "s" {
            let text = value.trim().parse().ok().and_then(|index: usize| self.texts.get(index));
            value.clone_from(text.ok_or_else(damaged)?);
        }
        if value.parse::<f64>().is_err() && !value.is_empty() {
            let plain = |letter: char| match letter {
                '"' => '\'',
                letter if letter.is_control() => ' ',
                letter => letter,
            };
            value = format!("\"{}\"", value.chars().map(plain).collect::<String>());
        }
        self.size += value.len();
        if self.size + self.lines.len() > SHEET_BYTES {
            return Err(Problem::Array("a workbook of more than 256 MB of text: save the sheet as CSV".to_string()));
        }
        self.fields.resize(self.column, String::new());
        self.fields.push(value);
        Ok(())
    }

    /// Writes a row, with as many fields as the first unless it has more.
    fn end_row(&mut self) {
        while self.fields.last().is_some_and(String::is_empty) {
            self.fields.pop();
        }
        if !self.fields.is_empty() {
            self.width = if self.width == 0 { self.fields.len() } else { self.width };
            self.fields.resize(self.fields.len().max(self.width), String::new());
        }
        self.lines += &self.fields.join("\t");
        self.lines.push('\n');
        (self.fields, self.size) = (Vec::new(), 0);
    }
}

/// Column of a cell such as `AB12`, from 0.
fn column(place: &str) -> Option<usize> {
    let letters = place.bytes().take_while(u8::is_ascii_uppercase).take(4);
    let number = letters.fold(0, |number, letter| number * 26 + usize::from(letter - b'A') + 1);
    number.checked_sub(1)
}
