//! CSV files, printed tables, diagrams and the report.

use lnn::findings::text_table;
use lnn::report::{Figure, LinePlot, Report, Series, line_plot};
use lnn::storage::write_atomically;
use std::path::Path;

/// A table by its column names.
#[derive(Clone, Debug, Default)]
pub struct Table {
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new<T: Into<String>>(header: impl IntoIterator<Item = T>) -> Self {
        Self { header: header.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    fn csv(&self, comments: &str) -> String {
        let mut text = String::new();
        for line in comments.lines() {
            text.push_str(&format!("# {line}\n"));
        }
        for row in std::iter::once(&self.header).chain(&self.rows) {
            let fields: Vec<String> = row.iter().map(|field| quoted(field)).collect();
            text.push_str(&fields.join(","));
            text.push('\n');
        }
        text
    }
}

/// A CSV field, in quotes where the format demands them.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.into() }
}

/// What one part brought.
pub struct Section {
    /// Name of its files.
    pub name: &'static str,
    pub title: &'static str,
    /// What was measured and how, one remark per line.
    pub method: String,
    pub raw: Table,
    pub summary: Table,
    /// What failed or was left out: case, reason.
    pub failures: Table,
    pub figures: Vec<Figure>,
}

impl Section {
    pub fn new(name: &'static str, title: &'static str, method: &str, raw: Table, summary: Table) -> Self {
        let failures = Table::new(["case", "reason"]);
        Self { name, title, method: method.into(), raw, summary, failures, figures: Vec::new() }
    }

    /// Notes what failed or was left out.
    pub fn failed(&mut self, case: impl Into<String>, reason: impl Into<String>) {
        self.failures.rows.push(vec![case.into(), reason.into()]);
    }

    /// Adds a diagram of `y` over the decimal logarithm of the error; one that shows nothing is noted as left out.
    pub fn diagram(&mut self, file: String, title: &str, x: &str, y: &str, mut curves: Vec<Series>) {
        let places = || curves.iter().flat_map(|c| &c.points).map(|p| p.0).filter(|x| x.is_finite());
        let (low, high) = (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max));
        let room = 0.03 * (high - low);
        if let Some(last) = curves.last_mut() {
            // Points without height widen the axis, so that none lies on its end.
            last.points.extend([low - room, high + room].map(|x| (x, f64::NAN)));
        }
        let plot = LinePlot {
            x_label: format!("log10 of {x}"),
            y_label: y.into(),
            log_y: true,
            series: curves,
            ..LinePlot::default()
        };
        match line_plot(&plot) {
            Ok(picture) => {
                let (file, heading) = (format!("{}_{file}.svg", self.name), title.to_string());
                self.figures.push(Figure { file, heading, picture, caption: String::new() });
            }
            Err(error) => self.failed(file, error.to_string()),
        }
    }
}

/// Places on the logarithmic axis; an error of 0 has none.
fn places(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().filter(|p| p.0 > 0.0 && p.0.is_finite()).map(|&(x, y)| (x.log10(), y)).collect()
}

/// Unconnected points `(error, y)`.
pub fn dots(name: &str, points: &[(f64, f64)]) -> Series {
    // A point between gaps is drawn as a dot.
    let points = places(points).into_iter().flat_map(|point| [(f64::NAN, f64::NAN), point]);
    Series { name: name.into(), points: points.collect(), over: false }
}

/// A curve through `(error, y)`, its points marked.
pub fn curve(name: &str, points: &[(f64, f64)]) -> Series {
    let mut series = dots(name, points);
    series.points.splice(..0, places(points));
    series
}

/// A line at one error over the whole height of these curves.
pub fn level(name: &str, error: f64, curves: &[Series]) -> Series {
    let heights = || curves.iter().flat_map(|c| &c.points).map(|p| p.1).filter(|y| y.is_finite() && *y > 0.0);
    let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(0.0, f64::max));
    Series::new(name, &[error.log10(); 2], &[low, high])
}

/// A number of a table.
pub fn short(x: f64) -> String {
    if x.is_nan() { String::new() } else { format!("{x:.3e}") }
}

/// Writes the files of a section, prints its summary and failures, and adds it to the report.
///
/// # Errors
/// The file that cannot be written.
pub fn write(section: &Section, out: &Path, machine: &str, report: Report) -> Result<Report, String> {
    let comments = format!("{machine}\n{}", section.method);
    for (suffix, table) in [("", &section.raw), ("_summary", &section.summary), ("_failures", &section.failures)] {
        save(&out.join(format!("{}{suffix}.csv", section.name)), table.csv(&comments).as_bytes())?;
    }
    println!("\n{}\n{}\n", section.title, text_table(&section.summary.header, &section.summary.rows));
    let mut report = report.heading(section.title);
    for line in section.method.lines() {
        report = report.paragraph(line);
    }
    report = report.table(&section.summary.header, &section.summary.rows);
    if !section.failures.rows.is_empty() {
        println!("failed or left out\n{}", text_table(&section.failures.header, &section.failures.rows));
        report = report.paragraph("Failed or left out:").table(&section.failures.header, &section.failures.rows);
    }
    for figure in &section.figures {
        save(&out.join(&figure.file), figure.to_svg().as_bytes())?;
    }
    Ok(report.figures(&section.figures))
}

/// Writes a file whole or not at all.
///
/// # Errors
/// Which file and why.
pub fn save(path: &Path, bytes: &[u8]) -> Result<(), String> {
    write_atomically(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}
