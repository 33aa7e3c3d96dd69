//! Values from tables of TOML.

use serde::de::DeserializeOwned;

/// A value from a table. All are read from tables and not from texts, so that the code of every type is compiled for one format.
///
/// # Errors
/// The path of the key that is refused, such as `phase[0].rate`, and what is wrong there.
pub(crate) fn from_table<T: DeserializeOwned>(table: toml::Value) -> Result<T, (String, String)> {
    serde_path_to_error::deserialize(table).map_err(|error| {
        let path = error.path().to_string();
        let path = path.trim_end_matches('?').trim_end_matches('.');
        (path.to_string(), error.inner().message().to_string())
    })
}
