//! Prints commented configurations and the reference of all keys: meaning, allowed values and present value.

use crate::thresholds::COMMENT_WIDTH;
use lnn::configuration::{Below, Config, Key, join};
use lnn::lagrangian::SystemInstance;
use lnn::pipeline::FitConfig;
use lnn::presets::Preset;
use lnn::shooting::Shooting;
use serde_json::{Value as Json, json};
use toml::{Table, Value};

/// Form in which a configuration is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PrintFormat {
    /// A commented configuration file.
    Toml,
    /// Tables of all keys.
    Markdown,
}

/// A configuration file with the values of `root` and a comment for each of `keys`; `remark` explains the names in an open table.
pub fn commented(keys: &[Key], root: &Table, remark: &dyn Fn(&str) -> Option<String>) -> String {
    let mut text = String::new();
    write_table(keys, Some(root), "", true, remark, &mut text);
    text
}

/// Writes the keys of a table at `path`, then its subtables; each key is explained only once.
fn write_table(
    keys: &[Key],
    table: Option<&Table>,
    path: &str,
    explain: bool,
    remark: &dyn Fn(&str) -> Option<String>,
    text: &mut String,
) {
    let is_value = |key: &&Key| matches!(key.below, Below::Value);
    for key in keys.iter().filter(is_value) {
        let line = match table.and_then(|table| table.get(key.name)) {
            Some(value) => format!("{} = {value}\n", key.name),
            None if key.example.is_empty() => continue,
            None => format!("# {} = {}\n", key.name, key.example),
        };
        if explain {
            *text += &comment(&format!("{} ({})", key.purpose(), key.values));
        }
        *text += &line;
    }
    for key in keys.iter().filter(|key| !is_value(key)) {
        let path = join(path, key.name);
        let found = table.and_then(|table| table.get(key.name));
        let head = format!("\n{}", comment(&key.purpose()));
        match (found, key.below) {
            (Some(Value::Array(tables)), Below::Keys(keys)) => {
                *text += &head;
                for (k, table) in tables.iter().enumerate() {
                    *text += &format!("{}[[{path}]]\n", if k > 0 { "\n" } else { "" });
                    write_table(keys, table.as_table(), &path, k == 0, remark, text);
                }
            }
            (Some(Value::Table(table)), Below::Keys(keys)) => {
                *text += &format!("{head}[{path}]\n");
                write_table(keys, Some(table), &path, explain, remark, text);
            }
            (None, Below::Keys(keys)) => {
                *text += &format!("{head}# [{path}]\n");
                write_table(keys, None, &path, explain, remark, text);
            }
            (Some(Value::Table(table)), Below::Open) if !table.is_empty() => {
                *text += &format!("{head}[{path}]\n");
                for (name, value) in table {
                    *text += &remark(name).map_or(String::new(), |remark| comment(&remark));
                    *text += &format!("{} = {value}\n", quoted(name));
                }
            }
            (Some(value), Below::Whole) => {
                let whole = Table::from_iter([(key.name.to_string(), value.clone())]);
                *text += &(head + &toml::to_string(&whole).unwrap_or_default());
            }
            _ => {}
        }
    }
}

/// The keys of a training as a page of Markdown: a table for every table of the file, with the values of the quick preset for the
/// double pendulum.
pub fn training_reference() -> String {
    let quick =
        SystemInstance::<f64>::named("double-pendulum", &[]).ok().and_then(|system| Preset::Quick.config(&system));
    let mut page = String::new();
    let shooting: Vec<Key> = FitConfig::KEYS.iter().filter(|key| key.name == "shooting").copied().collect();
    describe(Config::KEYS, &serde_json::to_value(quick).unwrap_or_default(), "quick preset", &mut page);
    describe(&shooting, &json!({ "shooting": Shooting::default() }), "default", &mut page);
    page
}

/// The keys that a fit has in addition to those of a training.
pub fn fit_reference() -> String {
    let mut page = String::new();
    let own = FitConfig::KEYS.iter().filter(|key| !["shooting", "training"].contains(&key.name));
    describe(&own.copied().collect::<Vec<_>>(), &Json::Null, "default", &mut page);
    page
}

/// Writes the reference of keys and of the tables within, with `values`, which are described by `whose`.
fn describe(keys: &[Key], values: &Json, whose: &str, page: &mut String) {
    // Brackets outside code would become links.
    let cell = |text: &str| text.replace('|', "\\|").replace('[', "\\[");
    let (own, tables): (Vec<&Key>, Vec<&Key>) = keys.iter().partition(|key| matches!(key.below, Below::Value));
    if !own.is_empty() {
        *page += &format!("| key | values | {whose} | what it is |\n|---|---|---|---|\n");
    }
    for key in &own {
        let value = if values[key.name].is_null() { "-".to_string() } else { format!("`{}`", values[key.name]) };
        *page += &format!("| `{}` | {} | {value} | {} |\n", key.name, cell(key.values), cell(&key.purpose()));
    }
    if !own.is_empty() {
        *page += "\n";
    }
    for key in tables {
        let name = if values[key.name].is_array() { format!("[[{}]]", key.name) } else { format!("[{}]", key.name) };
        *page += &format!("### `{name}`\n\n{}\n\n", key.purpose());
        if let Below::Keys(keys) = key.below {
            let first = values[key.name].get(0).unwrap_or(&values[key.name]);
            describe(keys, first, whose, page);
        }
    }
}

/// Formats a key for TOML.
fn quoted(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
    if bare { name.to_string() } else { Value::from(name).to_string() }
}

/// Formats comment lines of at most [`COMMENT_WIDTH`] characters.
fn comment(text: &str) -> String {
    let (mut lines, mut line) = (String::new(), String::from("#"));
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > COMMENT_WIDTH {
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
    use crate::parse_config;
    use lnn::configuration::find_key;
    use lnn::configuration::{Known, Lbfgs, Regularizer};
    use lnn::lagrangian::System;
    use lnn::recording::Targets;
    use std::collections::BTreeSet;

    fn print(config: &Config) -> String {
        commented(Config::KEYS, &Table::try_from(config).unwrap(), &|name| Some(format!("about {name}")))
    }

    #[test]
    fn a_commented_configuration_is_the_configuration() {
        for system in System::unconstrained() {
            for preset in [Preset::Quick, Preset::Best, Preset::Paper] {
                let configured = SystemInstance::named(&system.name, &[]).unwrap();
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
        let mut fit = FitConfig { shooting: Some(Shooting::default()), ..FitConfig::default() };
        (fit.targets, fit.window, fit.noise) = (Some(Targets::Motion), Some(21), Some(vec![0.1, 0.2]));
        fit.recording.files = vec!["a b.csv".to_string()];
        (fit.recording.units, fit.recording.rate) = (vec!["x=deg".to_string()], Some(10.0));
        let text = commented(FitConfig::KEYS, &Table::try_from(&fit).unwrap(), &|_| None);
        assert_eq!(parse_config::<FitConfig>(&text).unwrap(), fit, "{text}");
    }

    #[test]
    fn every_key_is_commented_and_those_left_out_can_be_taken_in() {
        let config = Preset::Paper.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
        let text = print(&config);
        assert!(text.lines().all(|line| !line.starts_with('#') || line.chars().count() <= COMMENT_WIDTH));
        assert_eq!(text.matches("\n[[phase]]").count(), 3);
        let taken_in = text.replace("# [lbfgs]", "[lbfgs]").replace("# iterations", "iterations");
        let taken_in = taken_in.replace("# memory", "memory").replace("# dissipation =", "dissipation =");
        let config: Config = parse_config(&taken_in).unwrap();
        assert_eq!((config.lbfgs, config.network.dissipation), (Some(Lbfgs::default()), Some(16)));
    }

    /// Examples and lists of names are values of their keys.
    #[test]
    fn examples_and_names_are_values() {
        fn visit(keys: &'static [Key], path: &str, tried: &mut usize) {
            for key in keys {
                let path = join(path, key.name);
                if let Below::Keys(keys) = key.below {
                    visit(keys, &path, tried);
                    continue;
                }
                assert!(find_key(FitConfig::KEYS, &path).is_some_and(|key| !key.purpose().is_empty()), "{path}");
                let names: Vec<String> = key.values.split(", ").map(|name| format!("{name:?}")).collect();
                let is_name = |name: &String| name.chars().all(|c| c.is_alphanumeric() || "-\"".contains(c));
                let listed = names.len() > 1 && names.iter().all(is_name) && key.values != "true, false";
                let texts = if listed { names } else { vec![key.example.to_string()] };
                for text in texts.iter().filter(|text| !text.is_empty() && !path.ends_with("penalty.time")) {
                    // The kind of a penalty decides its other keys.
                    let beside = match text.as_str() {
                        "\"lorentzian-sylvester\"" => "lambda = 1\ntime = \"t\"\n",
                        _ if path.ends_with("penalty.kind") && text != "\"none\"" => "lambda = 1\n",
                        _ if path.ends_with("penalty.lambda") => "kind = \"eigenvalue\"\n",
                        _ => "",
                    };
                    let (table, name) = path.rsplit_once('.').unwrap_or(("", &path));
                    let table = match table {
                        "" => String::new(),
                        "training.phase" => "[[training.phase]]\n".to_string(),
                        table => format!("[{table}]\n"),
                    };
                    let file = format!("{table}{name} = {text}\n{beside}");
                    assert!(parse_config::<FitConfig>(&file).is_ok(), "{file}: {:?}", parse_config::<FitConfig>(&file));
                    *tried += 1;
                }
            }
        }
        let mut tried = 0;
        visit(FitConfig::KEYS, "", &mut tried);
        assert!(tried > 60, "{tried}");
    }

    /// Every key is declared in the order of its table, and none is missing.
    #[test]
    fn the_declared_keys_are_those_that_are_written() {
        let mut config = Preset::Quick.config(&SystemInstance::named("ads4-geodesic", &[]).unwrap()).unwrap();
        config.network.known = Some(Known::File("a.toml".to_string()));
        config.penalty = Regularizer::LorentzianSylvester { lambda: 1.0, time: "t".to_string() };
        let table = Table::try_from(&config).unwrap();
        let written: BTreeSet<&str> = table.keys().map(String::as_str).collect();
        let declared: BTreeSet<&str> = Config::KEYS.iter().map(|key| key.name).collect();
        assert!(written.is_subset(&declared), "{written:?}");
        for key in Config::KEYS {
            let (Below::Keys(keys), Some(Value::Table(table))) = (key.below, table.get(key.name)) else { continue };
            assert!(table.keys().all(|name| keys.iter().any(|key| key.name == name)), "{table:?}");
        }
    }

    #[test]
    fn the_reference_is_a_page_of_tables() {
        let page = training_reference();
        assert!(page.contains("| `hidden` | 1 to 64 widths of 1 to 65536 | `[128,128,128]` |"), "{page}");
        assert!(page.contains("### `[[phase]]`") && page.contains("### `[shooting]`") && page.contains("\\|v\\|^2"));
        assert!(fit_reference().contains("| `held_out` |"));
    }
}
