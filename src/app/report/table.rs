//! Tables for files and scripts.

use serde_json::{Map, Value};

/// A table whose cells are numbers, text or nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct DataTable {
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells; all rows have the same number.
    pub rows: Vec<Vec<Value>>,
}

impl DataTable {
    /// Formats comma-separated values: plain numbers, text in double quotes, empty fields where there is no value.
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

    /// Converts every row to an object.
    pub fn objects(&self) -> Vec<Map<String, Value>> {
        let object = |row: &Vec<Value>| self.header.iter().cloned().zip(row.iter().cloned()).collect();
        self.rows.iter().map(object).collect()
    }
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
}
