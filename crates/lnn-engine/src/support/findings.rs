//! Reports of results as sentences and tables, which can be shown in a terminal, a page or a notebook.

use crate::names::{WIDTH, cut, cut_hard, width, wrap_text};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt::{Display, Formatter, Result};

/// A part of [`Findings`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// The most important result: a sentence, and a few quantities with their values.
    Summary {
        /// The sentence.
        sentence: String,
        /// Quantities and values.
        rows: Vec<[String; 2]>,
    },
    /// A heading for the following items.
    Heading(String),
    /// A sentence, or a line of a list.
    Line(String),
    /// Text to copy, such as a formula or a command, which is never wrapped.
    Code(String),
    /// The end of a paragraph.
    Gap,
    /// A table: column headers and rows.
    Table {
        /// One or two words for each column.
        headers: Vec<String>,
        /// Rows, which may be shorter than the headers.
        rows: Vec<Vec<String>>,
    },
}

/// The report of a result, in reading order.
///
/// [`Display`] formats it for a terminal, in lines of at most 120 characters; other media use the parts.
///
/// ```
/// use lnn::findings::Findings;
///
/// let mut findings = Findings::default();
/// findings.line("2 roots").table(&["root", "value"], [["first", "1.5"], ["second", "-2"]]);
/// assert_eq!(findings.to_string(), "2 roots\nroot    value\n-------------\nfirst     1.5\nsecond     -2\n");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    parts: Vec<Finding>,
}

impl Findings {
    /// Adds the most important result: a sentence, and quantities with their values.
    pub fn summary(&mut self, sentence: impl Into<String>, rows: &[[String; 2]]) -> &mut Self {
        self.parts.push(Finding::Summary { sentence: sentence.into(), rows: rows.to_vec() });
        self
    }

    /// Adds a heading.
    pub fn heading(&mut self, text: impl Into<String>) -> &mut Self {
        self.parts.push(Finding::Heading(text.into()));
        self
    }

    /// Adds a sentence.
    pub fn line(&mut self, text: impl Into<String>) -> &mut Self {
        self.parts.push(Finding::Line(text.into()));
        self
    }

    /// Adds several sentences, each as a line.
    pub fn lines<T: Into<String>>(&mut self, texts: impl IntoIterator<Item = T>) -> &mut Self {
        self.parts.extend(texts.into_iter().map(|text| Finding::Line(text.into())));
        self
    }

    /// Adds text to copy.
    pub fn code(&mut self, text: impl Into<String>) -> &mut Self {
        self.parts.push(Finding::Code(text.into()));
        self
    }

    /// Ends a paragraph.
    pub fn gap(&mut self) -> &mut Self {
        self.parts.push(Finding::Gap);
        self
    }

    /// Adds a table, unless it has no rows.
    pub fn table<H: ToString, C: ToString, R: IntoIterator<Item = C>>(
        &mut self,
        headers: &[H],
        rows: impl IntoIterator<Item = R>,
    ) -> &mut Self {
        let rows: Vec<Vec<String>> =
            rows.into_iter().map(|row| row.into_iter().map(|cell| cell.to_string()).collect()).collect();
        if !rows.is_empty() {
            self.parts.push(Finding::Table { headers: headers.iter().map(H::to_string).collect(), rows });
        }
        self
    }

    /// Adds the parts of another report.
    pub fn append(&mut self, other: Self) -> &mut Self {
        self.parts.extend(other.parts);
        self
    }

    /// Returns the parts in order.
    pub fn parts(&self) -> &[Finding] {
        &self.parts
    }
}

impl Display for Findings {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        for (place, part) in self.parts.iter().enumerate() {
            let mut line = |text: &str| writeln!(f, "{}", wrap_text(text, WIDTH));
            match part {
                Finding::Summary { sentence, rows } => {
                    line(sentence)?;
                    rows.iter().try_for_each(|[what, value]| line(&format!("{what}: {value}")))?;
                }
                Finding::Heading(text) if place == 0 => line(text)?,
                Finding::Heading(text) => line(&format!("\n{text}"))?,
                Finding::Code(text) => writeln!(f, "{text}")?,
                Finding::Line(text) => line(text)?,
                Finding::Gap => writeln!(f)?,
                Finding::Table { headers, rows } => f.write_str(&text_table(headers, rows))?,
            }
        }
        Ok(())
    }
}

/// Number of spaces between two columns.
const GAP: usize = 2;
/// Smallest width to which a column of words is narrowed.
const LEAST: usize = 24;

/// Formats a table with aligned columns: numbers to the right, words to the left, without trailing spaces, in lines of at most `WIDTH`
/// characters.
///
/// In a wider table the headers are wrapped at spaces, then the longest words; finally it is split into several tables, each of which
/// starts with the same column. Rows may be shorter than the header. A cell counts as a number if it begins with a digit, a sign or a
/// point.
pub fn text_table<H: AsRef<str>, C: AsRef<str>>(headers: &[H], rows: &[Vec<C>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(headers.len());
    let columns: Vec<Column> = (0..columns).map(|k| Column::new(headers, rows, k)).collect();
    let Some((first, others)) = columns.split_first() else { return "\n\n".to_string() };
    let mut blocks: Vec<Vec<&Column>> = vec![vec![first]];
    for column in others {
        let block = blocks.last_mut().filter(|block| {
            let least = block.iter().chain([&column]).map(|column| column.least());
            block.len() == 1 || least.sum::<usize>() + GAP * block.len() <= WIDTH
        });
        match block {
            Some(block) => block.push(column),
            None => blocks.push(vec![first, column]),
        }
    }
    blocks.iter().map(|block| block_text(block)).collect::<Vec<_>>().join("\n")
}

/// One column.
struct Column {
    header: String,
    cells: Vec<String>,
    numeric: bool,
}

impl Column {
    fn new<H: AsRef<str>, C: AsRef<str>>(headers: &[H], rows: &[Vec<C>], k: usize) -> Self {
        let cells: Vec<String> = rows.iter().map(|row| row.get(k).map_or("", AsRef::as_ref).to_string()).collect();
        let is_number = |cell: &String| {
            cell.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
                || ["", "NaN", "inf"].contains(&cell.as_str())
        };
        let numeric = !cells.is_empty() && cells.iter().all(is_number);
        Self { header: headers.get(k).map_or("", AsRef::as_ref).to_string(), cells, numeric }
    }

    /// Returns the width of the unwrapped cells.
    fn cells(&self) -> usize {
        self.cells.iter().map(|cell| width(cell)).max().unwrap_or(0)
    }

    /// Returns the width of the cells and of the header in one line.
    fn natural(&self) -> usize {
        self.cells().max(width(&self.header))
    }

    /// Returns the width of the longest word of the header.
    fn word(&self) -> usize {
        self.header.split(' ').map(width).max().unwrap_or(0)
    }

    /// Returns the smallest width; numbers are never wrapped.
    fn least(&self) -> usize {
        let cells = if self.numeric { self.cells() } else { self.cells().min(LEAST) };
        cells.max(self.word())
    }

    /// Wraps the header to a width.
    fn header(&self, at: usize) -> Vec<String> {
        cut(&self.header, at)
    }
}

/// Computes the widths of adjacent columns.
fn widths(columns: &[&Column]) -> Vec<usize> {
    let most = WIDTH.saturating_sub(GAP * (columns.len() - 1));
    let natural: Vec<usize> = columns.iter().map(|column| column.natural()).collect();
    if natural.iter().sum::<usize>() <= most {
        return natural;
    }
    let mut widths: Vec<usize> = columns.iter().map(|column| column.cells().max(column.word())).collect();
    // Always narrow the widest column.
    for _ in most..widths.iter().sum::<usize>() {
        let narrowed = (0..columns.len()).filter(|&k| widths[k] > columns[k].least()).max_by_key(|&k| widths[k]);
        let Some(k) = narrowed else { break };
        widths[k] -= 1;
    }
    // Headers get the remaining width, starting with those of the most lines.
    loop {
        let used: usize = widths.iter().sum();
        let wider = |k: usize| {
            let lines = columns[k].header(widths[k]).len();
            let at =
                (widths[k] + 1..=widths[k] + most.saturating_sub(used)).find(|&at| columns[k].header(at).len() < lines);
            at.map(|at| (lines, k, at))
        };
        match (0..columns.len()).filter_map(wider).max_by_key(|&(lines, k, _)| (lines, columns.len() - k)) {
            Some((_, k, at)) => widths[k] = at,
            None => return widths,
        }
    }
}

/// Formats adjacent columns.
fn block_text(columns: &[&Column]) -> String {
    let widths = widths(columns);
    let mut text = String::new();
    let headers: Vec<Vec<String>> = columns.iter().zip(&widths).map(|(column, &at)| column.header(at)).collect();
    let lines = headers.iter().map(Vec::len).max().unwrap_or(1);
    // Headers of fewer lines are aligned at the bottom.
    let header =
        |k: usize, line: usize| (line + headers[k].len()).checked_sub(lines).map(|line| headers[k][line].as_str());
    for line in 0..lines {
        push_line(&mut text, columns, &widths, |k| header(k, line).unwrap_or(""));
    }
    text.push_str(&"-".repeat(widths.iter().sum::<usize>() + GAP * (columns.len() - 1)));
    text.push('\n');
    for row in 0..columns[0].cells.len() {
        let cells: Vec<Vec<String>> =
            columns.iter().zip(&widths).map(|(column, &at)| cell_lines(&column.cells[row], at)).collect();
        for line in 0..cells.iter().map(Vec::len).max().unwrap_or(1) {
            push_line(&mut text, columns, &widths, |k| cells[k].get(line).map_or("", String::as_str));
        }
    }
    text
}

fn cell_lines(cell: &str, at: usize) -> Vec<String> {
    if width(cell) <= at { vec![cell.to_string()] } else { cut_hard(cell, at) }
}

fn push_line<'a>(text: &mut String, columns: &[&Column], widths: &[usize], cell: impl Fn(usize) -> &'a str) {
    let mut line = String::new();
    for (k, (column, &at)) in columns.iter().zip(widths).enumerate() {
        let cell = cell(k);
        let pad = " ".repeat(at.saturating_sub(width(cell)));
        if k > 0 {
            line.push_str(&" ".repeat(GAP));
        }
        let (left, right) = if column.numeric { (pad.as_str(), cell) } else { (cell, pad.as_str()) };
        line.push_str(left);
        line.push_str(right);
    }
    text.push_str(line.trim_end());
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_stand_in_order_and_empty_tables_are_left_out() {
        let mut findings = Findings::default();
        findings.line("first").gap().table(&["a"], [["1"]]).table::<_, &str, [&str; 1]>(&["b"], []).lines(["x", "y"]);
        assert_eq!(findings.to_string(), "first\n\na\n-\n1\nx\ny\n");
        assert_eq!(findings.parts().len(), 5);
        let mut findings = Findings::default();
        findings.heading("on top").summary("good", &[["of", "it"].map(String::from)]).heading("below");
        assert_eq!(findings.to_string(), "on top\ngood\nof: it\n\nbelow\n");
        // Words are wrapped, but text to be copied is not.
        let long = "word ".repeat(40);
        let mut findings = Findings::default();
        findings.line(long.trim_end()).code(long.trim_end());
        assert_eq!(findings.to_string().lines().map(|line| line.split(' ').count()).collect::<Vec<_>>(), [24, 16, 40]);
    }

    #[test]
    fn columns_align() {
        let text = text_table(&["name", "error"], &[vec!["θ₁", "1.5e-3"], vec!["longer", "-2"], vec!["short"]]);
        assert_eq!(text, "name     error\n--------------\nθ₁      1.5e-3\nlonger      -2\nshort\n");
        assert_eq!(text_table::<&str, &str>(&[], &[]), "\n\n");
    }

    fn widest(text: &str) -> usize {
        text.lines().map(width).max().unwrap_or(0)
    }

    #[test]
    fn wide_headers_are_cut_first() {
        let headers: Vec<String> = (0..8).map(|k| format!("a long header of {k} [rad/s]")).collect();
        let text = text_table(&headers, &[vec!["0.0123"; 8]]);
        assert!(widest(&text) <= WIDTH, "{text}");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert!(lines[2].starts_with("---") && lines[3].split_whitespace().count() == 8, "{text}");
        // A header of fewer lines is aligned at the bottom.
        let text = text_table(&[&headers[..], &["n".to_string()]].concat(), &[vec!["0.0123"; 9]]);
        assert!(text.lines().nth(2).unwrap().ends_with(" n") && widest(&text) <= WIDTH, "{text}");
    }

    #[test]
    fn long_words_are_cut_next() {
        let remark =
            "theta1_dot outside the training range at 0.5; exact motion: a singular mass matrix at 0.7; and so on";
        let path = "/a/very/long/path/of/a/file/that/nobody/would/want/to/read/in/a/table/of/a/terminal/motion.csv";
        let text = text_table(&["file", "error [rad]", "remarks"], &[vec![path, "1.5", remark], vec!["x", "2", ""]]);
        assert!(widest(&text) <= WIDTH, "{text}");
        let words: Vec<&str> = text.split_whitespace().collect();
        assert!(remark.split(' ').all(|word| words.contains(&word)), "{text}");
        assert!(text.contains(&path[..24]) && !text.contains(path), "{text}");
    }

    #[test]
    fn too_many_columns_make_several_tables() {
        let headers: Vec<String> = (0..30).map(|k| format!("column{k}")).collect();
        let rows = vec![(0..30).map(|k| format!("{k}.5")).collect::<Vec<_>>(); 2];
        let text = text_table(&headers, &rows);
        assert!(widest(&text) <= WIDTH, "{text}");
        assert_eq!(text.matches("column0").count(), text.split("\n\n").count());
        assert!(headers.iter().all(|header| text.contains(header)) && text.split("\n\n").count() > 1, "{text}");
        assert_eq!(text.matches("29.5").count(), 2);
    }
}
