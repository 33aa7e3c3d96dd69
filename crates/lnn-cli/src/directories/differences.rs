//! Lists the differences between two configurations.

use crate::thresholds::SHOWN_NAMES;
use lnn::names::first_few;
use toml::{Table, Value};

/// The first few values that differ, such as `seed: 0 in the checkpoint, 5 requested`; empty if the texts agree.
pub fn differences(saved: &str, asked: &str) -> String {
    let parse =
        |text: &str| text.parse::<Table>().map(Value::Table).unwrap_or_else(|_| Value::String(text.to_string()));
    let mut found = Vec::new();
    compare("", &parse(saved), &parse(asked), &mut found);
    first_few(&found, SHOWN_NAMES, "; ")
}

fn compare(path: &str, saved: &Value, asked: &Value, found: &mut Vec<String>) {
    match (saved, asked) {
        (Value::Table(a), Value::Table(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort_unstable();
            keys.dedup();
            for key in keys {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                match (a.get(key), b.get(key)) {
                    (Some(a), Some(b)) => compare(&path, a, b, found),
                    (Some(a), None) => found.push(format!("{path}: {a} in the checkpoint, not requested")),
                    (None, Some(b)) => found.push(format!("{path}: not in the checkpoint, {b} requested")),
                    (None, None) => {}
                }
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (k, (a, b)) in a.iter().zip(b).enumerate() {
                compare(&format!("{path}[{k}]"), a, b, found);
            }
        }
        _ if saved.to_string() == asked.to_string() => {}
        _ => found.push(format!("{path}: {saved} in the checkpoint, {asked} requested")),
    }
}

#[cfg(test)]
mod tests {
    use super::differences;

    #[test]
    fn differing_values_are_named() {
        let saved = "seed = 0\nrate = inf\n[data]\nn = [1, 2]\n[[phase]]\nepochs = 3\n";
        assert_eq!(differences(saved, saved), "");
        let asked = "seed = 5\nrate = inf\n[data]\nn = [1, 3]\nm = 1\n[[phase]]\n";
        assert_eq!(
            differences(saved, asked),
            "data.m: not in the checkpoint, 1 requested; data.n[1]: 2 in the checkpoint, 3 requested; \
             phase[0].epochs: 3 in the checkpoint, not requested; seed: 0 in the checkpoint, 5 requested"
        );
        assert!(differences("a = 1", "b = [1]\nc = 2\nd = 3\ne = 4\n").ends_with("and 1 more"));
    }
}
