//! Mistakes in a configuration: a key and its problem.

use std::collections::BTreeMap;

/// A wrong value of a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Path of the key, such as `phase[0].rate`; empty for what concerns the whole file.
    pub key: String,
    /// The problem in words.
    pub problem: String,
}

impl Mistake {
    /// A mistake in a key.
    pub fn new(key: impl Into<String>, problem: impl std::fmt::Display) -> Self {
        Self { key: key.into(), problem: problem.to_string() }
    }
    /// Line of the key, or of the innermost table or list around it that has one.
    pub fn line(&self, lines: &BTreeMap<String, usize>) -> Option<usize> {
        let mut path = self.key.as_str();
        loop {
            if let Some(line) = lines.get(path) {
                return Some(*line);
            }
            path = &path[..path.rfind(['.', '['])?];
        }
    }
    /// Key and problem.
    pub fn text(&self) -> String {
        if self.key.is_empty() { self.problem.clone() } else { format!("{}: {}", self.key, self.problem) }
    }
}

impl From<crate::configuration::ConfigError> for Mistake {
    fn from(fault: crate::configuration::ConfigError) -> Self {
        let problem = format!("expected {}, found {}", fault.expected, fault.found);
        Self { key: fault.field, problem }
    }
}
