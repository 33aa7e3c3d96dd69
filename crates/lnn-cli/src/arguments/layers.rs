//! Merges configurations in layers: a base, the values of a file, and options. The result is deserialised once; all mistakes are reported
//! together, each with file and line or with its option.

use crate::CliError;
use crate::arguments::config::{self, Lines, line_of};
use crate::thresholds::MOST_MISTAKES;
use lnn::configuration::{Below, ConfigError, Key, PENALTY, find_key, join};
use lnn::names::unknown;
use lnn::pipeline::from_table;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt;
use std::path::Path;
use toml::{Table, Value};

/// The key that names the kind of a table.
const KIND: &str = "kind";

/// A wrong value of a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Path of the key, such as `phase[0].rate`; empty if it concerns the whole file.
    key: String,
    /// The problem in words.
    problem: String,
    /// The option, if it sets a key that does not exist.
    option: Option<String>,
}

impl Mistake {
    /// Creates a mistake in a key.
    pub fn new(key: impl Into<String>, problem: impl fmt::Display) -> Self {
        Self { key: key.into(), problem: problem.to_string(), option: None }
    }
}

impl From<ConfigError> for Mistake {
    fn from(fault: ConfigError) -> Self {
        Self::new(fault.field, format_args!("expected {}, found {}", fault.expected, fault.found))
    }
}

/// A value that replaces one of the base.
#[derive(Clone, Debug)]
pub struct Entry {
    path: Steps,
    value: Value,
    /// The option that sets the value; `None` if the file does.
    option: Option<String>,
}

/// Path of names and indices from the top of a configuration.
type Steps = Vec<Step>;

#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Key(String),
    Index(usize),
}

/// Formats a path such as `phase[0].rate`.
fn text_of(path: &[Step]) -> String {
    path.iter().fold(String::new(), |text, step| match step {
        Step::Key(name) => join(&text, name),
        Step::Index(k) => format!("{text}[{k}]"),
    })
}

impl Entry {
    /// Creates an entry for a value that an option sets.
    pub fn option(option: impl Into<String>, key: &str, value: impl Into<Value>) -> Self {
        let part = |part: &str| {
            let mut pieces = part.split('[');
            let name = Step::Key(pieces.next().unwrap_or_default().to_string());
            let indices = pieces.filter_map(|index| index.trim_end_matches(']').parse().ok().map(Step::Index));
            std::iter::once(name).chain(indices).collect::<Vec<_>>()
        };
        let path = match key.split_once("parameters.") {
            Some(("", symbol)) => vec![Step::Key("parameters".to_string()), Step::Key(symbol.to_string())],
            _ => key.split('.').flat_map(part).collect(),
        };
        Self { path, value: value.into(), option: Some(option.into()) }
    }

    fn key(&self) -> String {
        text_of(&self.path)
    }

    /// The text of this option, if it sets the key.
    pub fn text(&self, key: &str) -> Option<&str> {
        self.value.as_str().filter(|_| self.option.is_some() && self.key() == key)
    }

    /// Copies the entry with another value.
    pub fn with(self, value: impl Into<Value>) -> Self {
        Self { value: value.into(), ..self }
    }
}

/// Layers of values that replace those of a base.
#[derive(Debug)]
pub struct Layers {
    keys: &'static [Key],
    /// Name of the file.
    file: Option<String>,
    lines: Lines,
    entries: Vec<Entry>,
    /// Keys that do not exist.
    unknown: Vec<Mistake>,
}

impl Layers {
    /// Reads the values of a file, if there is one, and adds options that override them, for a configuration with these keys.
    ///
    /// # Errors
    /// A data error for a file that cannot be read, a usage error for text that is not TOML.
    pub fn new(keys: &'static [Key], file: Option<&Path>, options: Vec<Entry>) -> Result<Self, CliError> {
        let Some(path) = file else { return Self::of(keys, None, options) };
        let (name, text) = config::read_text(path)?;
        Self::of(keys, Some((name, &text)), options)
    }

    fn of(keys: &'static [Key], file: Option<(String, &str)>, options: Vec<Entry>) -> Result<Self, CliError> {
        let mut layers = Self { keys, file: None, lines: Lines::new(), entries: Vec::new(), unknown: Vec::new() };
        if let Some((name, text)) = file {
            let table = config::table(text)
                .map_err(|(line, problem)| CliError::usage(format_args!("{name}:{line}: {problem}")))?;
            layers.lines = config::lines(text);
            layers.file = Some(name);
            layers.add(Entry { path: Vec::new(), value: table.into(), option: None }, Below::Keys(keys));
        }
        for option in options {
            match find_key(keys, &option.key()) {
                Some(key) => layers.add(option, key.below),
                None => layers.refuse(&option, keys),
            }
        }
        Ok(layers)
    }

    /// Splits a value into values of single keys and adds them.
    fn add(&mut self, entry: Entry, below: Below) {
        let Entry { path, value, option } = entry;
        let at = |step: Step| path.iter().cloned().chain([step]).collect::<Steps>();
        match (value, below) {
            (Value::Table(table), Below::Keys(keys)) if !table.is_empty() => {
                // The kind of a table determines its other keys.
                let (kind, others): (Vec<_>, Vec<_>) = table.into_iter().partition(|(name, _)| name == KIND);
                for (name, value) in kind.into_iter().chain(others) {
                    let key = keys.iter().find(|key| key.name == name);
                    let entry = Entry { path: at(Step::Key(name)), value, option: option.clone() };
                    match key {
                        Some(key) => self.add(entry, key.below),
                        None => self.refuse(&entry, keys),
                    }
                }
            }
            (Value::Array(items), Below::Keys(_)) if is_list_of_tables(&items) => {
                let empty = vec![Value::Table(Table::new()); items.len()];
                self.entries.push(Entry { path: path.clone(), value: empty.into(), option: option.clone() });
                for (k, value) in items.into_iter().enumerate() {
                    self.add(Entry { path: at(Step::Index(k)), value, option: option.clone() }, below);
                }
            }
            (Value::Table(table), Below::Open) => {
                for (name, value) in table {
                    self.entries.push(Entry { path: at(Step::Key(name)), value, option: option.clone() });
                }
            }
            (value, _) => self.entries.push(Entry { path, value, option }),
        }
    }

    fn refuse(&mut self, entry: &Entry, known: &[Key]) {
        let key = entry.key();
        let name = key.rsplit('.').next().unwrap_or_default();
        let problem = unknown("key", name, known.iter().map(|key| key.name));
        self.unknown.push(Mistake { option: entry.option.clone(), ..Mistake::new(key, problem) });
    }

    /// The value of a key in the layers.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.entries.iter().rev().find(|entry| entry.key() == key).map(|entry| &entry.value)
    }

    /// The text of a key in the layers.
    pub fn text(&self, key: &str) -> Option<&str> {
        self.get(key)?.as_str()
    }

    /// The numbers of a table in the layers.
    pub fn numbers(&self, table: &str) -> impl Iterator<Item = (String, f64)> {
        let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|x| x as f64));
        self.entries.iter().filter_map(move |entry| match entry.path.as_slice() {
            [Step::Key(name), Step::Key(symbol)] if name == table => Some((symbol.clone(), number(&entry.value)?)),
            _ => None,
        })
    }

    /// `true` if a file is one of the layers.
    pub fn has_file(&self) -> bool {
        self.file.is_some()
    }

    /// `true` if a layer sets a key or one below it.
    pub fn has(&self, key: &str) -> bool {
        self.lines.contains_key(key) || self.entries.iter().any(|entry| covers(key, &entry.key()))
    }

    /// Removes the file's value of a key.
    pub fn forget(&mut self, key: &str) {
        self.entries.retain(|entry| entry.option.is_some() || entry.key() != key);
        self.lines.remove(key);
    }

    /// Adds the values that an option implies for other keys; explicit options override them.
    pub fn add_implied(&mut self, key: &str, also: impl FnOnce(&Value) -> Vec<(String, Value)>) {
        let given = self.entries.iter().find(|entry| entry.option.is_some() && entry.key() == key);
        let Some(Entry { value, option: Some(option), .. }) = given.cloned() else { return };
        let at = self.entries.iter().position(|entry| entry.option.is_some()).unwrap_or_default();
        let implied: Vec<Entry> =
            also(&value).into_iter().map(|(key, value)| Entry::option(option.clone(), &key, value)).collect();
        self.entries.splice(at..at, implied);
    }

    /// Merges all layers into the base; also returns the mistakes in them. Wrong values are skipped.
    ///
    /// # Errors
    /// A data error if the base itself cannot be written.
    pub fn over<T: Serialize + DeserializeOwned>(&self, base: &T) -> Result<(T, Vec<Mistake>), CliError> {
        let base = Value::try_from(base).map_err(CliError::data)?;
        let mut mistakes = self.unknown.clone();
        let mut entries: Vec<&Entry> = self.entries.iter().collect();
        loop {
            let (path, message) = match from_table::<T>(merged(&base, &entries, &mut mistakes)) {
                Ok(value) => return Ok((value, mistakes)),
                Err(refusal) => refusal,
            };
            let refusal = Some((path.clone(), message.clone()));
            let mut suspects: Vec<usize> = (0..entries.len()).rev().collect();
            suspects.retain(|&k| covers(&path, &entries[k].key()) || covers(&entries[k].key(), &path));
            // If tables have kinds, the error does not name the wrong key: it is the key whose removal changes the error.
            let without = |k: usize| {
                let others: Vec<&Entry> =
                    entries.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, entry)| *entry).collect();
                from_table::<T>(merged(&base, &others, &mut Vec::new())).err()
            };
            let culprit = match suspects.as_slice() {
                [] => return Err(CliError::data(format_args!("{path}: {message}"))),
                [only] => *only,
                several => several.iter().copied().find(|&k| without(k) != refusal).unwrap_or(several[0]),
            };
            let entry = entries.remove(culprit);
            let key = if path.len() > entry.key().len() { path } else { entry.key() };
            mistakes.push(Mistake::new(key, self.problem(&entry.key(), &entry.value, &message)));
            if mistakes.len() >= MOST_MISTAKES {
                entries.clear();
            }
        }
    }

    /// Describes why a value was rejected.
    fn problem(&self, path: &str, value: &Value, message: &str) -> String {
        let key = find_key(self.keys, path);
        if let Some(name) = message.strip_prefix("missing field `").and_then(|rest| rest.split('`').next()) {
            return format!("{value} also needs the key {name}");
        }
        let Some(key) = key else { return message.to_string() };
        match key.below {
            Below::Value => {}
            Below::Open if path.contains('.') => return format!("expected a number, found {value}"),
            Below::Keys(_) | Below::Open if !value.is_table() => return format!("expected a table, found {value}"),
            _ => return message.to_string(),
        }
        if message.starts_with("unknown field") {
            return format!("no key of this kind of table: {}", key.purpose());
        }
        match (value, key.names()) {
            (Value::String(text), Some(names)) => unknown("value", text, names),
            _ => {
                let found: String = value.to_string().chars().take(80).collect();
                format!("expected {}, found {found}", key.values)
            }
        }
    }

    /// Reports keys that are determined elsewhere and whose values differ from the `finished` configuration, because they would be ignored
    /// silently.
    pub fn overruled(&self, finished: &Value, decided: impl Fn(&str) -> bool, why: &str) -> Vec<Mistake> {
        let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|x| x as f64));
        let same = |entry: &Entry| {
            let found = entry.path.iter().try_fold(finished, |value, step| match step {
                Step::Key(name) => value.get(name),
                Step::Index(k) => value.get(*k),
            });
            found == Some(&entry.value)
                || number(&entry.value).is_some_and(|given| found.and_then(number) == Some(given))
        };
        let entries = self.entries.iter().filter(|entry| decided(&entry.key()) && !same(entry));
        entries.map(|entry| Mistake::new(entry.key(), why)).collect()
    }

    /// Reports all mistakes in the order of the file, each with its line or its option.
    ///
    /// # Errors
    /// A usage error, if there are any.
    pub fn check(&self, mistakes: Vec<Mistake>) -> Result<(), CliError> {
        let mut placed: Vec<(usize, String)> = mistakes
            .into_iter()
            .map(|Mistake { key, problem, option }| {
                let (line, place) =
                    option.map_or_else(|| self.place(&key), |option| (usize::MAX, format!("{option}: ")));
                let text = if key.is_empty() { problem } else { format!("{key}: {problem}") };
                (line, format!("{place}{text}"))
            })
            .collect();
        placed.sort();
        placed.dedup();
        CliError::all_usage(placed.into_iter().map(|(_, text)| text))
    }

    /// Location of a key: the option that sets it, or its line in the file.
    fn place(&self, key: &str) -> (usize, String) {
        let options = self.entries.iter().filter(|entry| entry.option.is_some());
        let around = |entry: &&Entry| covers(&entry.key(), key);
        let option = options
            .clone()
            .rfind(around)
            .or_else(|| options.clone().rfind(|e| !key.is_empty() && covers(key, &e.key())));
        if let Some(option) = option.and_then(|entry| entry.option.as_deref()) {
            return (usize::MAX, format!("{option}: "));
        }
        match (&self.file, line_of(&self.lines, key)) {
            (Some(name), Some(line)) => (line, format!("{name}:{line}: ")),
            (Some(name), None) => (0, format!("{name}: ")),
            (None, _) => (0, String::new()),
        }
    }
}

/// `true` if one path equals or contains another.
fn covers(outer: &str, inner: &str) -> bool {
    outer.is_empty() || inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// Merges these values into the base.
fn merged(base: &Value, entries: &[&Entry], mistakes: &mut Vec<Mistake>) -> Value {
    let mut root = base.clone();
    for entry in entries {
        if let Err(problem) = put(&mut root, &entry.path, &entry.value) {
            let mistake = Mistake::new(entry.key(), problem);
            if !mistakes.contains(&mistake) {
                mistakes.push(mistake);
            }
        }
    }
    complete(&mut root);
    if let Some(training) = root.get_mut("training") {
        complete(training);
    }
    root
}

/// Sets a value, unless its path does not exist.
fn put(root: &mut Value, path: &[Step], value: &Value) -> Result<(), &'static str> {
    const NOWHERE: &str = "there is no such key or element";
    let Some((first, rest)) = path.split_first() else {
        match (&mut *root, value) {
            // An empty table only states that the key is present.
            (Value::Table(_), Value::Table(new)) if new.is_empty() => {}
            // A list of tables sets the number of tables; additional ones copy the last one of the base.
            (Value::Array(old), Value::Array(new)) if is_list_of_tables(old) && is_list_of_tables(new) => {
                let last = old.last().cloned().unwrap_or_else(|| Table::new().into());
                old.resize(new.len(), last);
            }
            _ => *root = value.clone(),
        }
        return Ok(());
    };
    match (root, first) {
        (Value::Table(table), Step::Key(name)) => {
            let none = |kind: Option<&Value>| kind.and_then(Value::as_str) == Some("none");
            if name != KIND && none(table.get(KIND)) {
                return Err("a table of kind none has no other keys");
            }
            if name == KIND && rest.is_empty() && table.get(KIND) != Some(value) {
                // If the kind changes, only the weight is kept.
                table.retain(|name, _| name == "lambda" && !none(Some(value)));
            }
            let new = || Value::Table(Table::new());
            put(table.entry(name.clone()).or_insert_with(new), rest, value)
        }
        (Value::Array(items), Step::Index(k)) => put(items.get_mut(*k).ok_or(NOWHERE)?, rest, value),
        _ => Err(NOWHERE),
    }
}

/// Completes a penalty with the default weight and the time of the network, if it needs them.
fn complete(config: &mut Value) {
    let time = config.get("network").and_then(|network| network.get("time_like")).cloned();
    let Some(penalty) = config.get_mut("penalty").and_then(Value::as_table_mut) else { return };
    let kind = penalty.get(KIND).and_then(Value::as_str).unwrap_or("none").to_string();
    if kind != "none" {
        penalty.entry("lambda").or_insert(PENALTY.into());
    }
    if let (true, Some(time)) = (kind == "lorentzian-sylvester", time) {
        penalty.entry("time").or_insert(time);
    }
}

fn is_list_of_tables(items: &[Value]) -> bool {
    !items.is_empty() && items.iter().all(Value::is_table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lnn::configuration::{Config, Lbfgs, Regularizer};
    use lnn::lagrangian::SystemInstance;
    use lnn::presets::Preset;

    fn base(system: &str) -> Config {
        Preset::Quick.config(&SystemInstance::named(system, &[]).unwrap()).unwrap()
    }

    fn over(system: &str, text: &str, options: Vec<Entry>) -> (Config, Vec<String>) {
        let layers = Layers::of(Config::KEYS, Some(("c.toml".to_string(), text)), options).unwrap();
        let (config, mistakes) = layers.over(&base(system)).unwrap();
        let said = layers.check(mistakes).err().map(|e| e.to_string());
        (config, said.iter().flat_map(|text| text.split("\nerror: ").map(str::to_string)).collect())
    }

    fn file(system: &str, text: &str) -> (Config, Vec<String>) {
        over(system, text, Vec::new())
    }

    /// Every mistake begins as expected, in this order.
    fn assert_placed(mistakes: &[String], beginnings: &[&str]) {
        assert_eq!(mistakes.len(), beginnings.len(), "{mistakes:#?}");
        for (mistake, beginning) in mistakes.iter().zip(beginnings) {
            assert!(mistake.starts_with(beginning), "{mistake} is not {beginning}");
        }
    }

    #[test]
    fn missing_keys_have_the_bases_values() {
        let text =
            "seed = 7\n[network]\nhidden = [8]\n[optimizer]\nclip = inf\n[lbfgs]\nmemory = 3\n[parameters]\nm1 = 2\n";
        let (config, mistakes) = file("double-pendulum", text);
        assert_placed(&mistakes, &[]);
        let mut expected = base("double-pendulum");
        (expected.seed, expected.network.hidden, expected.optimizer.clip) = (7, vec![8], f64::INFINITY);
        expected.lbfgs = Some(Lbfgs { memory: 3, ..Lbfgs::default() });
        expected.parameters.insert("m1".to_string(), 2.0);
        assert_eq!(config, expected);
        // There are as many phases as in the file; additional ones start from the base's last one.
        let (config, mistakes) = file("double-pendulum", "[[phase]]\nepochs = 3\n[[phase]]\nrate = 1\n");
        assert_placed(&mistakes, &[]);
        assert_eq!(config.phases.len(), 2);
        assert_eq!((config.phases[0].epochs, config.phases[1].epochs, config.phases[1].rate), (3, 40, 1.0));
        assert_eq!(file("double-pendulum", "").0, base("double-pendulum"));
        assert_eq!(file("double-pendulum", "[lbfgs]\n").0.lbfgs, Some(Lbfgs::default()));
        assert!(file("double-pendulum", "phase = []").0.phases.is_empty());
    }

    #[test]
    fn options_stand_over_the_file() {
        let options = vec![
            Entry::option("--seed", "seed", 9),
            Entry::option("--set", "phase[1].rate", 0.5),
            Entry::option("--set", "parameters.m.1", 3.0),
        ];
        let (config, mistakes) = over("double-pendulum", "seed = 7\n[[phase]]\n[[phase]]\n", options);
        assert_placed(&mistakes, &[]);
        assert_eq!((config.seed, config.phases[0].rate, config.phases[1].rate), (9, 5e-3, 0.5));
        assert_eq!(config.parameters["m.1"], 3.0);
        let options = vec![
            Entry::option("--seed", "seed", "x"),
            Entry::option("--set", "phase[7].rate", 0.5),
            Entry::option("--set", "network.hiden", 3),
            Entry::option("--set", "seed.deep", 3),
        ];
        let (_, mistakes) = over("double-pendulum", "precision = 'f16'", options);
        let beginnings = ["c.toml:1: precision", "--seed: seed", "--set: network.hiden", "--set: phase[7].rate"];
        let beginnings = [&beginnings[..], &["--set: seed.deep"]].concat();
        assert_placed(&mistakes, &beginnings);
    }

    #[test]
    fn a_penalty_of_another_kind_keeps_its_weight() {
        let penalty = |system: &str, text: &str| file(system, &format!("[penalty]\n{text}"));
        let of = |text: &str| penalty("double-pendulum", text).0.penalty;
        assert_eq!(of("lambda = 5"), Regularizer::Eigenvalue { lambda: 5.0 });
        assert_eq!(of("kind = 'sylvester'"), Regularizer::Sylvester { lambda: 100.0 });
        assert_eq!(of("kind = 'none'"), Regularizer::None);
        let lorentzian = Regularizer::LorentzianSylvester { lambda: 2.0, time: "theta1".to_string() };
        assert_eq!(of("kind = 'lorentzian-sylvester'\nlambda = 2\ntime = 'theta1'"), lorentzian);
        let eigenvalue = Regularizer::Eigenvalue { lambda: 100.0 };
        assert_eq!(penalty("ads4-geodesic", "kind = 'eigenvalue'").0.penalty, eigenvalue);
        // The time is that of the network, the weight the default if there was none.
        let options = vec![Entry::option("--penalty", "penalty.kind", "lorentzian-sylvester")];
        let (config, _) = over("ads4-geodesic", "[penalty]\nkind = 'none'", options);
        assert_eq!(config.penalty, Regularizer::LorentzianSylvester { lambda: 100.0, time: "t".to_string() });
        for (text, place) in [
            ("kind = 'sylvster'", "c.toml:2: penalty.kind: "),
            ("lamda = 5", "c.toml:2: penalty.lamda: "),
            ("lambda = 5\nkind = 'lorentzian-sylvester'", "c.toml:3: penalty.kind: "),
            ("lambda = 'much'", "c.toml:2: penalty.lambda: "),
            ("kind = 'sylvester'\ntime = 't'", "c.toml:3: penalty.time: "),
            ("lambda = 1\nkind = 'none'", "c.toml:2: penalty.lambda: "),
        ] {
            assert_placed(&penalty("double-pendulum", text).1, &[place]);
        }
    }

    #[test]
    fn all_mistakes_are_found() {
        let text = "sede = 1\nprecision = 'f16'\n[netwrok]\nhidden = [1]\nalpha = 1\n[network]\nhiden = [1]\nalpha = 'x'\n\
                    [data]\ntraining = -1\n[[phase]]\nrate = true\n[[phase]]\nepoch = 3\n[lbfgs]\nmemory = 3\nitration = 4\n";
        let (config, mistakes) = file("double-pendulum", text);
        let beginnings = [
            "c.toml:1: sede: unknown key",
            "c.toml:2: precision: unknown value",
            "c.toml:3: netwrok: unknown key",
            "c.toml:7: network.hiden: unknown key",
            "c.toml:8: network.alpha: ",
            "c.toml:10: data.training: ",
            "c.toml:12: phase[0].rate: ",
            "c.toml:14: phase[1].epoch: unknown key",
            "c.toml:17: lbfgs.itration: unknown key",
        ];
        assert_placed(&mistakes, &beginnings);
        // Valid values are taken.
        assert_eq!(config.lbfgs.unwrap().memory, 3);
    }

    #[test]
    fn not_every_one_of_many_mistakes_is_looked_for() {
        let (_, mistakes) = file("double-pendulum", &"[[phase]]\nrate = true\n".repeat(5000));
        assert_eq!(mistakes.len(), MOST_MISTAKES);
    }

    #[test]
    fn values_of_another_shape_are_mistakes_of_their_key() {
        for (text, beginning) in [
            ("seed = { a = 1 }", "c.toml:1: seed"),
            ("seed = 1.5", "c.toml:1: seed"),
            ("phase = 3", "c.toml:1: phase"),
            ("[phase]\nrate = 1", "c.toml:"),
            ("penalty = 'none'", "c.toml:1: penalty"),
            ("network = [1]", "c.toml:1: network"),
            ("network.hidden = [8, true]", "c.toml:1: network.hidden[1]"),
            ("description = 3", "c.toml:1: description"),
        ] {
            let (_, mistakes) = file("double-pendulum", text);
            assert!(mistakes.len() == 1 && mistakes[0].starts_with(beginning), "{text}: {mistakes:?}");
        }
    }

    #[test]
    fn files_are_named() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("c.toml");
        let read = || Layers::new(Config::KEYS, Some(&path), Vec::new()).unwrap_err();
        assert_eq!(read().kind(), crate::Kind::Data);
        std::fs::write(&path, "seed = 1\nseed = 2\n").unwrap();
        assert_eq!(read().kind(), crate::Kind::Usage);
        assert!(read().to_string().contains("c.toml:2: "), "{}", read());
        std::fs::write(&path, "seed = 18446744073709551615\n").unwrap();
        assert!(read().to_string().contains("c.toml:1: "), "{}", read());
    }
}
