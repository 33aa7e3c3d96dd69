//! Messages of the readers of TOML, JSON and numbers in the words of those who write files and arguments.

use super::unknown;

/// A message of a foreign reader without names of machine types: what was expected and what was found.
pub fn plain(message: &str) -> String {
    // JSON places what it says.
    let (said, place) = match message.find(" at line ") {
        Some(at) => message.split_at(at),
        None => (message, ""),
    };
    format!("{}{place}", translated(said))
}

fn translated(said: &str) -> String {
    for start in ["invalid type: ", "invalid value: ", "invalid length "] {
        if let Some((found, expected)) = said.strip_prefix(start).and_then(|rest| rest.rsplit_once(", expected ")) {
            let found = if start == "invalid length " { format!("{found} of them") } else { thing(found) };
            return format!("expected {}, found {found}", kind(expected));
        }
    }
    for (start, what) in [("unknown field ", "key"), ("unknown variant ", "value")] {
        if let Some(rest) = said.strip_prefix(start) {
            let mut quoted = rest.split('`').skip(1).step_by(2);
            let name = quoted.next().unwrap_or_default();
            return unknown(what, name, quoted.collect::<Vec<_>>());
        }
    }
    for (start, text) in [("missing field `", "missing key"), ("duplicate field `", "duplicate key")] {
        if let Some(name) = said.strip_prefix(start).and_then(|rest| rest.split('`').next()) {
            return format!("{text} {name:?}");
        }
    }
    let known = [
        ("EOF while parsing", "it ends too early"),
        ("expected ident", "expected a value"),
        ("trailing characters", "something stands behind its end"),
        ("key must be a string", "expected a key in quotes"),
        ("invalid digit found in string", "expected a whole number"),
        ("cannot parse integer from empty string", "expected a whole number"),
        ("number too large to fit", "the number is too large"),
        ("number too small to fit", "the number is too small"),
        ("invalid float literal", "expected a number"),
        ("cannot parse float from empty string", "expected a number"),
        ("provided string was not", "expected true or false"),
        ("unexpected key or value", "expected one key = value on a line"),
    ];
    match known.iter().find(|(start, _)| said.starts_with(start)) {
        Some((_, text)) => text.to_string(),
        None => said.to_string(),
    }
}

/// Expected value.
fn kind(expected: &str) -> String {
    let first = expected.split(' ').next().unwrap_or_default();
    let number = |text: &str| text.chars().find(char::is_ascii_digit).map(|_| text.to_string());
    match first {
        "usize" | "u8" | "u16" | "u32" | "u64" | "u128" => "a whole number of at least 0".to_string(),
        "isize" | "i8" | "i16" | "i32" | "i64" | "i128" => "a whole number".to_string(),
        "f32" | "f64" => "a number".to_string(),
        "bool" => "true or false".to_string(),
        "struct" | "map" | "newtype" => "a table".to_string(),
        "enum" | "variant" | "unit" => "a name in quotes".to_string(),
        "tuple" => "a list of values".to_string(),
        _ => match expected {
            "a boolean" => "true or false".to_string(),
            "a string" | "string" | "str" | "a borrowed string" => "text in quotes".to_string(),
            "a sequence" | "sequence" => "a list".to_string(),
            "a map" => "a table".to_string(),
            "string or table" => "a name in quotes".to_string(),
            "field identifier" => "a key".to_string(),
            // `an array of length 2`, `a tuple of size 2`.
            _ if expected.starts_with("an array of length") || expected.starts_with("a tuple of size") => {
                let count = expected.rsplit(' ').next().and_then(number).unwrap_or_default();
                format!("a list of {count} values")
            }
            other => other.to_string(),
        },
    }
}

/// Value found.
fn thing(found: &str) -> String {
    let found = found.trim_end_matches(" as i128").trim_end_matches(" as u128");
    let inside = found.split('`').nth(1);
    match (found.split(' ').next().unwrap_or_default(), inside) {
        ("boolean" | "integer" | "floating" | "character", Some(value)) => value.to_string(),
        ("string", _) => found.strip_prefix("string ").unwrap_or(found).to_string(),
        ("sequence", _) => "a list".to_string(),
        ("map", _) => "a table".to_string(),
        ("unit" | "null" | "Option", _) => "nothing".to_string(),
        ("enum" | "newtype" | "tuple" | "struct", _) => "something else".to_string(),
        _ => found.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn machine_types_become_words() {
        for (message, expected) in [
            ("invalid type: string \"x\", expected usize", "expected a whole number of at least 0, found \"x\""),
            ("invalid value: integer `-3`, expected u64", "expected a whole number of at least 0, found -3"),
            (
                "invalid type: integer `99999999999999999999` as i128, expected u64",
                "expected a whole number of at least 0, found 99999999999999999999",
            ),
            ("invalid type: floating point `1.5`, expected usize", "expected a whole number of at least 0, found 1.5"),
            ("invalid type: boolean `true`, expected f64", "expected a number, found true"),
            ("invalid type: map, expected a sequence", "expected a list, found a table"),
            ("invalid type: sequence, expected struct Config", "expected a table, found a list"),
            (
                "invalid type: string \"a, expected b\", expected a boolean",
                "expected true or false, found \"a, expected b\"",
            ),
            ("invalid length 3, expected an array of length 2", "expected a list of 2 values, found 3 of them"),
            (
                "unknown variant `adma`, expected one of `adam`, `soap`, `radam`",
                "unknown value \"adma\", did you mean \"adam\"?",
            ),
            (
                "unknown variant `f16`, expected `f32` or `f64` at line 1 column 9",
                "unknown value \"f16\", expected one of f32, f64 at line 1 column 9",
            ),
            ("unknown field `zzz`, there are no fields", "unknown key \"zzz\": there are none"),
            ("missing field `system`", "missing key \"system\""),
            ("EOF while parsing a list at line 1 column 2", "it ends too early at line 1 column 2"),
            ("invalid digit found in string", "expected a whole number"),
            ("something new", "something new"),
        ] {
            assert_eq!(plain(message), expected, "{message}");
        }
    }
}
