//! Commented configurations: every key with what it means, its allowed values and the value it has.

use crate::presets::{Key, Section};
use toml::{Table, Value};

/// Longest line of a comment.
const WIDTH: usize = 110;

/// Form in which a configuration is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PrintFormat {
    /// A commented configuration file.
    Toml,
    /// Tables of all keys.
    Markdown,
}

/// A configuration file with the values of `root` and a comment for every key of `sections`.
///
/// `remarks` say what the keys of a section mean that lists none.
pub fn commented(sections: &[Section<'_>], root: &Table, remarks: &dyn Fn(&str) -> Option<String>) -> String {
    let mut text = String::new();
    for section in sections {
        let path: Vec<&str> = section.name.split('.').filter(|name| !name.is_empty()).collect();
        let found = path.iter().try_fold(Value::Table(root.clone()), |value, name| value.get(*name).cloned());
        // Of what has no keys of its own there is nothing to take in.
        if found.is_none() && section.keys.is_empty() {
            continue;
        }
        if !section.name.is_empty() {
            text += &format!("\n{}", comment(section.purpose));
        }
        match found {
            Some(Value::Array(tables)) => {
                for (k, table) in tables.iter().filter_map(Value::as_table).enumerate() {
                    // What the keys mean is said once.
                    text += &format!("{}[[{}]]\n", if k > 0 { "\n" } else { "" }, section.name);
                    text += &entries(section.keys, Some(table), k == 0);
                }
            }
            Some(Value::Table(table)) if section.keys.is_empty() && table.values().any(has_tables) => {
                let whole = Table::from_iter([(section.name.to_string(), Value::Table(table))]);
                text += &toml::to_string(&whole).unwrap_or_default();
            }
            Some(Value::Table(table)) => {
                if !section.name.is_empty() {
                    text += &format!("[{}]\n", section.name);
                }
                text += &entries(section.keys, Some(&table), true);
                if section.keys.is_empty() {
                    for (name, value) in &table {
                        text += &remarks(name).map_or(String::new(), |remark| comment(&remark));
                        text += &format!("{} = {value}\n", quoted(name));
                    }
                }
            }
            _ => {
                text += &format!("# [{}]\n", section.name);
                text += &entries(section.keys, None, true);
            }
        }
    }
    text
}

/// `true` if a value is a table, or a list of tables.
fn has_tables(value: &Value) -> bool {
    value.is_table() || value.as_array().is_some_and(|items| items.iter().any(Value::is_table))
}

/// A configuration that was printed with the seed 0, with another one: a seed may be larger than the integers of a table.
pub fn with_seed(text: &str, seed: u64) -> String {
    text.replacen("\nseed = 0\n", &format!("\nseed = {seed}\n"), 1)
}

/// The lines of keys; those without a value are shown by their example, commented out.
fn entries(keys: &[Key], table: Option<&Table>, said: bool) -> String {
    let entry = |key: &Key| {
        let line = match table.and_then(|table| table.get(key.name)) {
            Some(value) => format!("{} = {value}\n", key.name),
            None if key.example.is_empty() => return String::new(),
            None => format!("# {} = {}\n", key.name, key.example),
        };
        if said { format!("{}{line}", comment(&format!("{} ({})", key.purpose, key.values))) } else { line }
    };
    keys.iter().map(entry).collect()
}

/// A key as TOML writes it.
fn quoted(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
    if bare { name.to_string() } else { Value::from(name).to_string() }
}

/// Comment lines of at most [`WIDTH`] characters.
fn comment(text: &str) -> String {
    let (mut lines, mut line) = (String::new(), String::from("#"));
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines += &format!("{line}\n");
            line = String::from("#");
        }
        line += &format!(" {word}");
    }
    lines + &line + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::parse_config;
    use crate::configuration::{Config, Lbfgs};
    use crate::lagrangian::{configure, systems};
    use crate::presets::{Preset, TRAINING_SECTIONS};

    fn print(config: &Config) -> String {
        commented(&TRAINING_SECTIONS, &Table::try_from(config).unwrap(), &|name| Some(format!("about {name}")))
    }

    #[test]
    fn a_commented_configuration_is_the_configuration() {
        for system in systems() {
            for preset in [Preset::Quick, Preset::Best, Preset::Paper] {
                let configured = configure(&system.name, &[]).unwrap();
                let Some(mut config) = preset.config(&configured) else { continue };
                config.parameters.insert("m 1".to_string(), 2.0);
                config.optimizer.clip = f64::INFINITY;
                let text = print(&config);
                assert_eq!(parse_config::<Config>(&text).unwrap(), config, "{text}");
                config.lbfgs = Some(Lbfgs::default());
                config.network.dissipation = Some(3);
                config.from = Some("a \"b\"".to_string());
                assert_eq!(parse_config::<Config>(&print(&config)).unwrap(), config);
            }
        }
    }

    #[test]
    fn every_key_is_commented_and_those_left_out_can_be_taken_in() {
        let config = Preset::Paper.config(&configure("double-pendulum", &[]).unwrap()).unwrap();
        let text = print(&config);
        for section in &TRAINING_SECTIONS {
            for key in section.keys {
                let line =
                    text.lines().position(|l| l.trim_start_matches("# ").starts_with(&format!("{} = ", key.name)));
                let line = line.unwrap_or_else(|| panic!("{} is not in\n{text}", key.name));
                assert!(text.lines().nth(line - 1).unwrap().starts_with("# "), "{}", key.name);
            }
        }
        assert!(text.lines().all(|line| !line.starts_with('#') || line.chars().count() <= WIDTH));
        assert_eq!(text.matches("\n[[phase]]").count(), 3);
        let taken_in = text.replace("# [lbfgs]", "[lbfgs]").replace("# iterations", "iterations");
        let taken_in = taken_in.replace("# memory", "memory").replace("# dissipation =", "dissipation =");
        let config: Config = parse_config(&taken_in).unwrap();
        assert_eq!((config.lbfgs, config.network.dissipation), (Some(Lbfgs::default()), Some(16)));
    }
}
