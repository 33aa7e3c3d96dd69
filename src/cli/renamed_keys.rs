//! Keys of a configuration file by the names of earlier versions.

use crate::configuration::{RENAMED, Renamed};
use std::collections::BTreeMap;
use toml::{Table, Value};

/// Table of a fit's configuration that holds that of a training.
const TRAINING: &str = "training";

/// Gives the keys of a training's configuration, or of a fit's, the names that they have now, in the table of a file and in the
/// lines of its keys.
///
/// # Errors
/// Line and problem of a key that stands there under both names.
pub fn rename(table: &mut Table, lines: &mut BTreeMap<String, usize>) -> Result<(), (usize, String)> {
    for renamed in &RENAMED {
        rename_in(table, "", renamed, lines)?;
        if let Some(Value::Table(training)) = table.get_mut(TRAINING) {
            rename_in(training, "training.", renamed, lines)?;
        }
    }
    Ok(())
}

/// A message of a reader that lists known keys, without those of earlier versions.
pub fn without_old(message: &str) -> String {
    let Some((before, known)) = message.split_once(", expected one of ") else { return message.to_string() };
    let is_old = |name: &&str| RENAMED.iter().any(|renamed| name.trim_matches('`') == renamed.old);
    let known: Vec<&str> = known.split(", ").filter(|name| !is_old(name)).collect();
    format!("{before}, expected one of {}", known.join(", "))
}

/// Renames a key of a configuration whose paths begin so.
fn rename_in(
    config: &mut Table,
    before: &str,
    renamed: &Renamed,
    lines: &mut BTreeMap<String, usize>,
) -> Result<(), (usize, String)> {
    let Renamed { table, .. } = *renamed;
    if table.is_empty() {
        return rename_key(config, before, renamed, lines);
    }
    match config.get_mut(table) {
        Some(Value::Table(inner)) => rename_key(inner, &format!("{before}{table}."), renamed, lines),
        Some(Value::Array(items)) => items.iter_mut().enumerate().try_for_each(|(k, item)| match item {
            Value::Table(inner) => rename_key(inner, &format!("{before}{table}[{k}]."), renamed, lines),
            _ => Ok(()),
        }),
        _ => Ok(()),
    }
}

/// Renames a key of a table whose paths begin so.
fn rename_key(
    table: &mut Table,
    before: &str,
    &Renamed { old, new, .. }: &Renamed,
    lines: &mut BTreeMap<String, usize>,
) -> Result<(), (usize, String)> {
    let Some(value) = table.remove(old) else { return Ok(()) };
    let (past, now) = (format!("{before}{old}"), format!("{before}{new}"));
    if table.contains_key(new) {
        let line = lines.get(&past).copied().unwrap_or_default();
        return Err((line, format!("{past}: the same key as {now}, expected one of them")));
    }
    table.insert(new.to_string(), value);
    let of_it =
        |path: &String| path.strip_prefix(&past).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']));
    let paths: Vec<String> = lines.keys().filter(|path| of_it(path)).cloned().collect();
    for path in paths {
        if let Some(line) = lines.remove(&path) {
            lines.insert(format!("{now}{}", &path[past.len()..]), line);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_earlier_versions_are_not_offered() {
        let listed =
            "unknown field `motions`, expected one of `motions`, `trajectory_fraction`, `polish`, `test`, `relative`";
        assert_eq!(without_old(listed), "unknown field `motions`, expected one of `trajectory_fraction`, `test`");
        assert_eq!(without_old("missing field `relative`"), "missing field `relative`");
    }
}
