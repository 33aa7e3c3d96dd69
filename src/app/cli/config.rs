//! Text of configuration files: reading, complete configurations, lines of keys.

use crate::cli::{CliError, input};
use crate::pipeline::from_table;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::Path;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

/// Largest configuration that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;

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

/// Line, from 1, of a place in a text.
fn line(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|b| **b == b'\n').count()
}

/// The name of a file in messages, and its text; standard input if it is `-`.
///
/// # Errors
/// A data error for a file that cannot be read, a usage error for one that is not text.
pub fn read_text(path: &Path) -> Result<(String, String), CliError> {
    read_text_within(path, MAX_BYTES)
}

/// The same of a file of at most so many bytes.
///
/// # Errors
/// As of [`read_text`].
pub fn read_text_within(path: &Path, limit: u64) -> Result<(String, String), CliError> {
    let name = input::name(path);
    let bytes = input::read(path, limit).map_err(|e| CliError::data(format_args!("{name}: {e}")))?;
    let text = String::from_utf8(bytes).map_err(|_| CliError::usage(format_args!("{name}: not UTF-8 text")))?;
    Ok((name, text))
}

/// Lines of the keys of a text, from 1, by their paths, such as `phase[0].rate`.
pub type Lines = BTreeMap<String, usize>;

/// Line of the key at a path, or of the innermost table or list around it that has one.
pub fn line_of(lines: &Lines, mut path: &str) -> Option<usize> {
    loop {
        if let Some(line) = lines.get(path) {
            return Some(*line);
        }
        path = &path[..path.rfind(['.', '['])?];
    }
}

/// The lines of all keys of a text that is TOML.
pub fn lines(text: &str) -> Lines {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut found = Lines::new();
    if let Ok(table) = DeTable::parse(text) {
        note_lines(table.get_ref(), "", &|at| line(text, at), &mut found);
    }
    found
}

/// Notes the lines of the keys of a table.
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
