//! Values of a configuration that are out of range.

use std::borrow::Cow;
use thiserror::Error;

/// A value of a configuration that is out of range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{field}: expected {expected}, found {found}")]
pub struct ConfigError {
    /// Path of the value, such as `phase[0].rate`.
    pub field: String,
    /// Values that are allowed.
    pub expected: Cow<'static, str>,
    /// The value found.
    pub found: String,
}

/// Index of a coordinate by its name.
///
/// # Errors
/// A name that is not among them.
pub fn place<'a>(field: &str, name: &str, coordinates: impl Iterator<Item = &'a str>) -> Result<usize, ConfigError> {
    let names: Vec<&str> = coordinates.collect();
    names.iter().position(|known| *known == name).ok_or_else(|| ConfigError {
        field: field.to_string(),
        expected: "the name of a coordinate".into(),
        found: format!("`{name}`; there are {}", names.join(", ")),
    })
}

/// Values out of range, as they are found.
#[derive(Debug, Default)]
pub struct Faults(pub Vec<ConfigError>);

impl Faults {
    /// Notes a value unless it is as expected; returns whether it is.
    pub fn check(&mut self, ok: bool, field: &str, expected: impl Into<Cow<'static, str>>, found: String) -> bool {
        if !ok {
            self.0.push(ConfigError { field: field.to_string(), expected: expected.into(), found });
        }
        ok
    }
    /// A finite `[low, high]` for each of `n` coordinates.
    pub fn bounds(&mut self, field: &str, bounds: &[[f64; 2]], required: bool, n: usize) {
        if bounds.is_empty() && !required {
            return;
        }
        let found = format!("{} for {n}", bounds.len());
        self.check(bounds.len() == n, field, "one [low, high] per coordinate", found);
        for (k, &[low, high]) in bounds.iter().enumerate() {
            let ok = low.is_finite() && high.is_finite() && low <= high;
            let field = format!("{field}[{k}]");
            if self.check(ok, &field, "finite [low, high] in order", format!("[{low}, {high}]")) {
                let expected = "[low, high] no further apart than the largest number";
                self.check((high - low).is_finite(), &field, expected, format!("[{low:e}, {high:e}]"));
            }
        }
    }
}
