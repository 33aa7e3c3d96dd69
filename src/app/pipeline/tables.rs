//! Values from tables of TOML.

use serde::de::DeserializeOwned;
use toml::Value;

/// Deserializes a value from a table. Types are only read from tables, not from text, so that their code is compiled for a single format.
///
/// # Errors
/// The path of the rejected key, such as `phase[0].rate`, and what is wrong there.
pub fn from_table<T: DeserializeOwned>(table: Value) -> Result<T, (String, String)> {
    // A date would otherwise be accepted as text.
    if let Some(path) = date(&table) {
        return Err((path, "no key accepts a date or a time".to_string()));
    }
    serde_path_to_error::deserialize(table).map_err(|error| {
        let path = error.path().to_string();
        let path = path.trim_end_matches('?').trim_end_matches('.');
        (path.to_string(), error.inner().message().to_string())
    })
}

/// The path of the first date in a value.
fn date(value: &Value) -> Option<String> {
    let inside = |name: String, value| {
        let rest = date(value)?;
        Some(if rest.is_empty() || rest.starts_with('[') { name + &rest } else { format!("{name}.{rest}") })
    };
    match value {
        Value::Datetime(_) => Some(String::new()),
        Value::Table(table) => table.iter().find_map(|(name, value)| inside(name.clone(), value)),
        Value::Array(items) => items.iter().enumerate().find_map(|(k, value)| inside(format!("[{k}]"), value)),
        _ => None,
    }
}
