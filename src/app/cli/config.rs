//! TOML configurations with errors that name file, line, key and the nearest known key.

use crate::names::plain;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Parses a configuration.
///
/// # Errors
/// Line, from 1, and what is wrong there.
pub fn parse<T: DeserializeOwned>(text: &str) -> Result<T, (usize, String)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    toml::from_str(text).map_err(|error| {
        let span = error.span().unwrap_or(0..0);
        let line = 1 + text.as_bytes()[..span.start.min(text.len())].iter().filter(|b| **b == b'\n').count();
        let problem = plain(error.message());
        match DeTable::parse(text).ok().and_then(|table| key_at(table.get_ref(), &span)) {
            Some(key) => (line, format!("{key}: {problem}")),
            None => (line, problem),
        }
    })
}

/// Line, from 1, of every key of a text, by its path, such as `phase[0].rate`.
///
/// # Errors
/// As [`parse`], for text that is not TOML.
pub(super) fn lines(text: &str) -> Result<BTreeMap<String, usize>, (usize, String)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let line = |at: usize| 1 + text.as_bytes()[..at.min(text.len())].iter().filter(|b| **b == b'\n').count();
    let table = DeTable::parse(text)
        .map_err(|error| (line(error.span().map_or(0, |span| span.start)), error.message().to_string()))?;
    let mut found = BTreeMap::new();
    note_lines(table.get_ref(), "", &line, &mut found);
    Ok(found)
}

/// Notes the lines of the keys of a table.
fn note_lines(table: &DeTable<'_>, before: &str, line: &dyn Fn(usize) -> usize, found: &mut BTreeMap<String, usize>) {
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

/// Path of the innermost key whose name or value holds `span`, such as `phase[0].rate`.
fn key_at(table: &DeTable<'_>, span: &Range<usize>) -> Option<String> {
    let holds = |outer: Range<usize>| outer.start <= span.start && span.end <= outer.end && !span.is_empty();
    table.iter().find_map(|(key, value)| {
        let name: &str = key.get_ref();
        let below = within(value.get_ref(), span);
        (below.is_some() || holds(key.span()) || holds(value.span()))
            .then(|| format!("{name}{}", below.unwrap_or_default()))
    })
}

/// The rest of the path below a value.
fn within(value: &DeValue<'_>, span: &Range<usize>) -> Option<String> {
    match value {
        DeValue::Table(table) => key_at(table, span).map(|rest| format!(".{rest}")),
        DeValue::Array(items) => items.iter().enumerate().find_map(|(k, item)| {
            let below = within(item.get_ref(), span);
            let outer = item.span();
            let here = matches!(item.get_ref(), DeValue::Table(_)) || outer.start > span.start || span.end > outer.end;
            (below.is_some() || !here).then(|| format!("[{k}]{}", below.unwrap_or_default()))
        }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Config {
        seed: u64,
        optimizer: Optimizer,
        phase: Vec<Phase>,
    }
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Optimizer {
        method: Method,
        clip: f64,
    }
    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Method {
        Adam,
        RAdam,
    }
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Phase {
        epochs: usize,
        rates: Vec<f64>,
    }

    const GOOD: &str = "seed = 1\n[optimizer]\nmethod = \"adam\"\nclip = 1\n[[phase]]\nepochs = 3\nrates = [1, 2.5]\n\
                        [[phase]]\nepochs = 4\nrates = []\n";

    fn refusal(old: &str, new: &str) -> String {
        assert!(GOOD.contains(old));
        let (line, problem) = parse::<Config>(&GOOD.replacen(old, new, 1)).unwrap_err();
        format!("{line}: {problem}")
    }

    #[test]
    fn good_files_are_read() {
        let config: Config = parse(GOOD).unwrap();
        assert_eq!((config.seed, config.phase[0].rates.as_slice()), (1, [1.0, 2.5].as_slice()));
    }

    #[test]
    fn unknown_names_are_met_with_near_ones() {
        assert!(refusal("epochs = 4", "epcohs = 4").contains("unknown key \"epcohs\", did you mean \"epochs\"?"));
        assert!(refusal("epochs = 4", "epcohs = 4").starts_with("9: "));
        assert!(refusal("seed = 1", "seeed = 1").contains("1: seeed: unknown key \"seeed\", did you mean \"seed\"?"));
        assert!(refusal("\"adam\"", "\"adma\"").contains("unknown value \"adma\", did you mean \"adam\"?"));
        assert!(refusal("clip = 1", "zzzz = 1").contains("expected one of method, clip"));
    }

    #[test]
    fn types_duplicates_and_syntax_are_placed() {
        assert_eq!(
            refusal("epochs = 3", "epochs = \"x\""),
            "6: phase[0].epochs: expected a whole number of at least 0, found \"x\""
        );
        assert!(
            refusal("epochs = 3", "epochs = -3")
                .ends_with("6: phase[0].epochs: expected a whole number of at least 0, found -3")
        );
        assert!(refusal("2.5]", "true]").ends_with("7: phase[0].rates[1]: expected a number, found true"));
        assert!(refusal("clip = 1", "clip = 1\nclip = 2").starts_with("5: "));
        assert!(refusal("seed = 1", "seed = 1\nseed = 2").contains("duplicate key"));
        assert!(refusal("seed = 1", "seed = ").starts_with("1: "));
        assert!(refusal("seed = 1\n", "").contains("missing key \"seed\""));
    }
}
