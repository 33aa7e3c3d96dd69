//! Tables for files and scripts, and of what learned metrics say of black holes.

use crate::experiments::RunSpread;
use crate::names::{percentage, rounded};
use crate::relativity::Reading;
use serde_json::{Map, Value};

/// A table whose cells are numbers, text or nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct DataTable {
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells, as many in every row.
    pub rows: Vec<Vec<Value>>,
}

impl DataTable {
    /// Comma-separated values: numbers as they are, text in double quotes, nothing where there is no value.
    pub fn to_csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let cell = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) => quoted(text),
            other => other.to_string(),
        };
        let header = self.header.join(",");
        let rows = self.rows.iter().map(|row| row.iter().map(cell).collect::<Vec<_>>().join(",") + "\n");
        format!("{header}\n{}", rows.collect::<String>())
    }

    /// One object per row.
    pub fn objects(&self) -> Vec<Map<String, Value>> {
        let object = |row: &Vec<Value>| self.header.iter().cloned().zip(row.iter().cloned()).collect();
        self.rows.iter().map(object).collect()
    }
}

/// Header of [`reading_table`].
pub const READING_HEADER: [&str; 6] =
    ["quantity", "exact", "learned", "error, median [%]", "error, largest [%]", "aim [%]"];

/// The readings of the runs of a row, a line per quantity in the order of the first run, below [`READING_HEADER`]: values as mean
/// [lowest, highest], errors in per cent; where some of the runs have no value the line says how many have.
pub fn reading_table(runs: &[Vec<Reading>]) -> Vec<Vec<String>> {
    let Some(first) = runs.first() else { return Vec::new() };
    first.iter().map(|reading| line(reading, runs)).collect()
}

fn line(reading: &Reading, runs: &[Vec<Reading>]) -> Vec<String> {
    let same = |readings: &'_ Vec<Reading>| readings.iter().find(|r| r.quantity == reading.quantity).cloned();
    let all: Vec<Reading> = runs.iter().filter_map(same).collect();
    let dash = || "-".to_string();
    let digits = |x: f64| rounded(x, 5);
    let learned = RunSpread::of(all.iter().filter_map(|r| r.learned)).map_or_else(
        dash,
        |RunSpread { mean, low, high, .. }| {
            if low == high { digits(mean) } else { format!("{} [{}, {}]", digits(mean), digits(low), digits(high)) }
        },
    );
    let mut errors: Vec<f64> = all.iter().filter_map(|r| r.error).filter(|e| e.is_finite()).collect();
    errors.sort_by(f64::total_cmp);
    let (median, largest) = (errors.get(errors.len() / 2).copied(), errors.last().copied());
    let largest = largest.map_or_else(dash, percentage);
    let largest = match (errors.len(), runs.len()) {
        (found, runs) if found < runs => format!("{largest} ({found} of {runs} runs)"),
        _ => largest,
    };
    vec![
        reading.quantity.clone(),
        reading.exact.map_or_else(dash, digits),
        learned,
        median.map_or_else(dash, percentage),
        largest,
        percentage(reading.aim),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_stay_numbers() {
        let header = ["run", "loss", "runs"].map(String::from).to_vec();
        let table = DataTable { header, rows: vec![vec![json!("a \"b\", c"), json!(1.5e-7), Value::Null]] };
        assert_eq!(table.to_csv(), "run,loss,runs\n\"a \"\"b\"\", c\",1.5e-7,\n");
        assert_eq!(table.objects()[0]["loss"], json!(1.5e-7));
    }

    #[test]
    fn a_line_holds_the_spread_of_the_runs_and_counts_what_is_missing() {
        let reading = |learned: Option<f64>| Reading {
            quantity: "orbit of light [M]".into(),
            exact: Some(3.0),
            learned,
            error: learned.map(|x| (x / 3.0 - 1.0).abs()),
            aim: 5e-4,
        };
        let runs = [vec![reading(Some(3.003))], vec![reading(Some(2.997))], vec![reading(None)]];
        let expected =
            ["orbit of light [M]", "3.0000", "3.0000 [2.9970, 3.0030]", "0.100", "0.100 (2 of 3 runs)", "0.0500"];
        assert_eq!(reading_table(&runs), [expected.map(String::from).to_vec()]);
        assert_eq!(reading_table(&runs[..1])[0][2..5], ["3.0030", "0.100", "0.100"].map(String::from));
        assert!(reading_table(&[]).is_empty());
    }
}
