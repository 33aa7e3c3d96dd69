//! Checks the names, texts and counts of a description.

use super::{Description, DescriptionError};
use crate::lagrangian::expression::{is_name, is_reserved};
use crate::lagrangian::thresholds::{MOST_COORDINATES, MOST_NAMES};
use alloc::string::{String, ToString};

/// Number of constants of a link and its joint.
const CONSTANTS: usize = 13;

/// Rejects names that cannot be used in formulas.
pub(super) fn check_name(key: String, name: &str) -> Result<(), DescriptionError> {
    if !is_name(name) {
        let problem =
            format!("{name:?} is not a valid name: expected a letter or _, then letters, digits and _, 64 at most");
        return Err(DescriptionError::new(key, problem));
    }
    match is_reserved(name) {
        true => Err(DescriptionError::new(key, format!("`{name}` is a function or constant of formulas"))),
        false => Ok(()),
    }
}

/// Returns `true` if a name is valid for a coordinate and not reserved.
pub fn is_free_name(name: &str) -> bool {
    is_name(name) && !is_reserved(name)
}

impl Description {
    /// Checks that displayed names and units are short and on one line.
    pub(super) fn check_texts(&self) -> Result<(), DescriptionError> {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let name = &self.name;
        if name.is_empty() || name.len() > 64 || !name.chars().all(plain) || name.starts_with('-') {
            let problem = "expected a name of 1 to 64 letters, digits, `-` and `_`";
            return Err(DescriptionError::new("name", problem));
        }
        let inputs = self.inputs.iter().map(|(name, unit)| (format!("inputs.{name}"), unit));
        let measured = self.measured.iter().map(|(name, own)| (format!("measured.{name}.unit"), &own.unit));
        let units = self.coordinates.iter().enumerate().map(|(i, c)| (format!("coordinates[{i}].unit"), &c.unit));
        let parameters = self.parameters.iter().map(|(name, p)| (format!("parameters.{name}.unit"), &p.unit));
        let texts = self.title.iter().map(|title| ("title".to_string(), title));
        let texts = texts
            .chain(self.time_unit.iter().map(|unit| ("time_unit".to_string(), unit)))
            .chain(units)
            .chain(inputs)
            .chain(measured)
            .chain(parameters);
        for (key, text) in texts {
            if text.is_empty() || text.chars().count() > 100 || text.chars().any(char::is_control) {
                return Err(DescriptionError::new(key, "expected 1 to 100 characters on one line"));
            }
        }
        Ok(())
    }

    /// Checks the number of entries; the expanded constants of links are not counted.
    pub(super) fn check_counts(&self, plain: &Self) -> Result<(), DescriptionError> {
        let n = plain.coordinates.len();
        let of_links = self.links.len() * CONSTANTS;
        if n == 0 || n > MOST_COORDINATES {
            let problem = format!("expected 1 to {MOST_COORDINATES} tables [[coordinates]], found {n}");
            return Err(DescriptionError::new("coordinates", problem));
        }
        let counts = [
            ("parameters", self.parameters.len(), MOST_NAMES + of_links),
            ("definitions", self.definitions.len(), MOST_NAMES),
            ("inputs", self.inputs.len(), MOST_NAMES),
            ("constraints", self.constraints.len(), MOST_NAMES),
            ("events", self.events.len(), MOST_NAMES),
            ("measured", self.measured.len(), MOST_NAMES),
        ];
        for (key, count, most) in counts {
            if count > most {
                return Err(DescriptionError::new(key, format!("expected at most {most} names, found {count}")));
            }
        }
        Ok(())
    }
}
