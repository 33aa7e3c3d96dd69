//! Parses configurations and systems, finds the lines of keys, and writes results as system files.

use crate::constraints::FoundConstraints;
use crate::identification::Identified;
use crate::lagrangian::{Description, System, SystemInstance};
use crate::pipeline::{PipelineError, from_table};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

/// Parses the description of a system in TOML.
///
/// # Errors
/// Line, from 1, and what is wrong there.
pub fn parse_system(text: &str) -> Result<System, (usize, String)> {
    let mut description: Description = parse(text)?;
    let lines = lines(text);
    let names = description.constraints.keys();
    let placed = names.filter_map(|name| Some((name.clone(), *lines.get(&format!("constraints.{name}"))?))).collect();
    description.constraint_lines.0 = placed;
    description.system().map_err(|error| (line_of(&lines, &error.key).unwrap_or(1), error.to_string()))
}

/// Parses the formulas of the table `[constraints]` of a system file, by name.
///
/// # Errors
/// Line, from 1, if it is known, and what is wrong there.
pub fn constraints(text: &str) -> Result<BTreeMap<String, String>, (Option<usize>, String)> {
    let wrong = |problem: &str| (None, problem.to_string());
    let mut table = table(text).map_err(|(line, problem)| (Some(line), problem))?;
    let found = table.remove("constraints").ok_or_else(|| wrong("expected a table [constraints]"))?;
    let formulas: BTreeMap<String, String> =
        found.try_into().map_err(|_| wrong("constraints: expected formulas by name"))?;
    if formulas.is_empty() { Err(wrong("expected formulas in the table [constraints]")) } else { Ok(formulas) }
}

impl FoundConstraints {
    /// The table `[constraints]` of a system file with the constraints of the system; `None` if there are none.
    ///
    /// # Errors
    /// [`PipelineError::Format`] for formulas that TOML cannot hold.
    pub fn system_table(&self) -> Result<Option<String>, PipelineError> {
        let formulas = self.formulas();
        if formulas.is_empty() {
            return Ok(None);
        }
        let table = BTreeMap::from([("constraints", formulas)]);
        toml::to_string(&table).map(Some).map_err(PipelineError::format)
    }
}

impl Identified {
    /// The system file with the identified constants; `None` if the system is one of the catalogue, which has no file.
    ///
    /// # Errors
    /// [`PipelineError::Format`] for a description that TOML cannot hold.
    pub fn system_file(&self, system: &SystemInstance<f64>) -> Result<Option<String>, PipelineError> {
        let described = system.system.with_defaults(&self.parameters(system));
        described.map(|description| toml::to_string(&description).map_err(PipelineError::format)).transpose()
    }
}

/// Parses a configuration.
///
/// # Errors
/// Line, from 1, and what is wrong there.
pub fn parse<T: DeserializeOwned>(text: &str) -> Result<T, (usize, String)> {
    from_table(Value::Table(table(text)?)).map_err(|(path, problem)| {
        let key = if path.is_empty() { String::new() } else { format!("{path}: ") };
        (line_of(&lines(text), &path).unwrap_or(1), format!("{key}{problem}"))
    })
}

/// Parses a table.
///
/// # Errors
/// Line, from 1, and what is wrong there.
pub fn table(text: &str) -> Result<Table, (usize, String)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let place = |error: &toml::de::Error| line(text, error.span().map_or(0, |span| span.start));
    text.parse().map_err(|error| (place(&error), error.message().to_string()))
}

/// Line number, from 1, of a byte offset.
fn line(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|b| **b == b'\n').count()
}

/// Line numbers, from 1, of the keys of a text, by path, such as `phase[0].rate`.
pub type Lines = BTreeMap<String, usize>;

/// Line of the key at a path, or of the innermost enclosing table or list with a known line.
pub fn line_of(lines: &Lines, mut path: &str) -> Option<usize> {
    loop {
        if let Some(line) = lines.get(path) {
            return Some(*line);
        }
        path = &path[..path.rfind(['.', '['])?];
    }
}

/// Finds the lines of all keys of a TOML text.
pub fn lines(text: &str) -> Lines {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut found = Lines::new();
    if let Ok(table) = DeTable::parse(text) {
        note_lines(table.get_ref(), "", &|at| line(text, at), &mut found);
    }
    found
}

/// Records the lines of the keys of a table.
fn note_lines(table: &DeTable<'_>, before: &str, line: &dyn Fn(usize) -> usize, found: &mut Lines) {
    for (key, value) in table {
        let name: &str = key.get_ref();
        let path = if before.is_empty() { name.to_string() } else { format!("{before}.{name}") };
        found.insert(path.clone(), line(key.span().start));
        match value.get_ref() {
            DeValue::Table(inner) => note_lines(inner, &path, line, found),
            DeValue::Array(items) => {
                for (k, item) in items.iter().enumerate() {
                    let path = format!("{path}[{k}]");
                    found.insert(path.clone(), line(item.span().start));
                    if let DeValue::Table(inner) = item.get_ref() {
                        note_lines(inner, &path, line, found);
                    }
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Config;

    #[test]
    fn constraints_are_read_from_their_table() {
        let refused = |text: &str| constraints(text).unwrap_err();
        assert_eq!(constraints("[constraints]\nrod = \"x^2 + y^2 - 1\"\n").unwrap()["rod"], "x^2 + y^2 - 1");
        assert_eq!(refused("name = \"x\"\n"), (None, "expected a table [constraints]".to_string()));
        assert_eq!(refused("[constraints]\n").1, "expected formulas in the table [constraints]");
        assert_eq!(refused("[constraints]\nrod = 1\n").1, "constraints: expected formulas by name");
        assert!(refused("[constraints\n").0.is_some());
    }

    #[test]
    fn refusals_are_placed() {
        let text = "seed = 1\n[optimizer]\nmethod = \"adam\"\nclip = 1\n[[phase]]\nepochs = 3\n[[phase]]\nepochs = 4\n";
        let config: Config = parse(text).unwrap();
        assert_eq!((config.seed, config.phases[1].epochs, config.optimizer.clip), (1, 4, 1.0));
        for (old, new, at, key) in [
            ("epochs = 4", "epcohs = 4", 8, "epcohs"),
            ("epochs = 3", "epochs = \"x\"", 6, "phase[0].epochs: "),
            ("\"adam\"", "\"adma\"", 3, "adma"),
            ("clip = 1", "clip = 1\nclip = 2", 5, "duplicate"),
            ("seed = 1", "seed = ", 1, ""),
        ] {
            let (line, problem) = parse::<Config>(&text.replacen(old, new, 1)).unwrap_err();
            assert!(line == at && problem.contains(key), "{new}: {line}: {problem}");
        }
        assert_eq!(line_of(&lines(text), "phase[1].rate[0]"), Some(7));
    }
}
