//! Configuration files that need not be complete: keys that are not there have the values of a base, and all mistakes
//! are found at once.

use crate::cli::config::lines;
use crate::cli::mistake::Mistake;
use crate::cli::{CliError, input};
use crate::names::plain;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::Path;
use toml::{Table, Value};

/// Largest configuration that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// A file as it was read.
#[derive(Debug)]
pub struct ConfigFile {
    name: String,
    table: Table,
    /// Line of every key, by its path.
    lines: BTreeMap<String, usize>,
    /// Whole numbers that are larger than those of a table, which has 0 in their place, by their path.
    large: BTreeMap<String, u64>,
}

impl ConfigFile {
    /// Reads a file, or standard input if it is `-`.
    ///
    /// # Errors
    /// A data error for a file that cannot be read, a usage error for text that is not TOML.
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let (name, text) = read_text(path)?;
        Self::parse(name, &text)
    }

    /// Reads a file by a parser of its whole text that says line and problem.
    ///
    /// # Errors
    /// A data error for a file that cannot be read, a usage error for text that the parser refuses.
    pub fn read_with<T>(path: &Path, parse: impl FnOnce(&str) -> Result<T, (usize, String)>) -> Result<T, CliError> {
        let (name, text) = read_text(path)?;
        parse(&text).map_err(|(line, problem)| CliError::usage(format_args!("{name}:{line}: {problem}")))
    }

    /// Takes the text of a file apart.
    ///
    /// # Errors
    /// A usage error for text that is not TOML.
    pub fn parse(name: String, text: &str) -> Result<Self, CliError> {
        let (small, large) = without_large(text);
        let refused = |line: usize, problem: &str| CliError::usage(format_args!("{name}:{line}: {problem}"));
        match lines(text).and_then(|lines| Ok((lines, crate::cli::config::parse(&small)?))) {
            Ok((lines, table)) => Ok(Self { name, table, lines, large }),
            Err((line, problem)) => Err(refused(line, &problem)),
        }
    }

    /// The value of a key, if it is there.
    pub fn get(&self, path: &[&str]) -> Option<&Value> {
        let (last, tables) = path.split_last()?;
        tables.iter().try_fold(&self.table, |table, name| table.get(*name)?.as_table())?.get(*last)
    }

    /// Takes a key out of the file, so that nothing else is said about it.
    pub fn take(&mut self, key: &str) -> Option<Value> {
        self.table.remove(key)
    }

    /// `true` if a key is there, by its path in messages, such as `phase[0].rate`.
    pub fn has(&self, path: &str) -> bool {
        self.lines.contains_key(path)
    }

    /// A whole number that is larger than those of a table, which a seed may be.
    pub fn large(&self, path: &[&str]) -> Option<u64> {
        self.large.get(&path.join(".")).copied()
    }

    /// The text of a key, if it is there and text.
    pub fn text(&self, path: &[&str]) -> Option<String> {
        self.get(path)?.as_str().map(str::to_string)
    }

    /// The base with every value of the file that it can have, and what is wrong with the others.
    ///
    /// Tables of a list take the values of the base's table of the same number, or of its last.
    ///
    /// # Errors
    /// A data error if the base itself cannot be written.
    pub fn over<T: Serialize + DeserializeOwned>(&self, base: &T) -> Result<(T, Vec<Mistake>), CliError> {
        let root = Value::try_from(base).map_err(CliError::data)?;
        let mut filled = Filled { root, mistakes: Vec::new(), accepts: accepts::<T> };
        for (name, value) in &self.table {
            filled.visit(&mut vec![Step::Key(name.clone())], value);
        }
        let value = T::deserialize(filled.root).map_err(CliError::data)?;
        Ok((value, filled.mistakes))
    }

    /// All mistakes of the file, in its order, each with its line.
    ///
    /// # Errors
    /// A usage error, if there are any.
    pub fn check(&self, mistakes: Vec<Mistake>) -> Result<(), CliError> {
        let mut placed: Vec<(usize, String)> = mistakes
            .into_iter()
            .map(|Mistake { key, problem }| {
                let mistake = Mistake { key, problem };
                let line = mistake.line(&self.lines);
                let place = line.map_or(self.name.clone(), |line| format!("{}:{line}", self.name));
                (line.unwrap_or(0), format!("{place}: {}", mistake.text()))
            })
            .collect();
        placed.sort();
        placed.dedup();
        CliError::all_usage(placed.into_iter().map(|(_, text)| text))
    }
}

/// The name of a file in messages, and its text; standard input if it is `-`.
fn read_text(path: &Path) -> Result<(String, String), CliError> {
    let name = input::name(path);
    let bytes = input::read(path, MAX_BYTES).map_err(|e| CliError::data(format_args!("{name}: {e}")))?;
    let text = String::from_utf8(bytes).map_err(|_| CliError::usage(format_args!("{name}: not UTF-8 text")))?;
    Ok((name, text))
}

/// The text with 0 in the place of the seeds that are larger than the integers of a table, and these seeds by their paths.
fn without_large(text: &str) -> (String, BTreeMap<String, u64>) {
    #[derive(serde::Deserialize)]
    struct Seeds {
        seed: Option<u64>,
        training: Option<Inner>,
    }
    #[derive(serde::Deserialize)]
    struct Inner {
        seed: Option<u64>,
    }
    let mut found = BTreeMap::new();
    // Of another type or in text that is not TOML there are none; whoever reads on finds out.
    let Ok(seeds) = toml::from_str::<Seeds>(text) else { return (text.to_string(), found) };
    let large = |seed: Option<u64>| seed.filter(|seed| i64::try_from(*seed).is_err());
    found.extend(large(seeds.seed).map(|seed| ("seed".to_string(), seed)));
    found.extend(large(seeds.training.and_then(|t| t.seed)).map(|seed| ("training.seed".to_string(), seed)));
    (found.values().fold(text.to_string(), |text, seed| text.replacen(&seed.to_string(), "0", 1)), found)
}

/// A step of a path.
#[derive(Clone, Debug)]
enum Step {
    Key(String),
    Index(usize),
}

/// `phase[0].rate`.
fn text_of(path: &[Step]) -> String {
    path.iter().fold(String::new(), |text, step| match step {
        Step::Key(name) if text.is_empty() => name.clone(),
        Step::Key(name) => format!("{text}.{name}"),
        Step::Index(k) => format!("{text}[{k}]"),
    })
}

fn get<'a>(root: &'a Value, path: &[Step]) -> Option<&'a Value> {
    path.iter().try_fold(root, |value, step| match step {
        Step::Key(name) => value.as_table()?.get(name),
        Step::Index(k) => value.as_array()?.get(*k),
    })
}

/// The value at a path that may be new at its end.
fn with(root: &Value, path: &[Step], value: &Value) -> Value {
    let Some((first, rest)) = path.split_first() else { return value.clone() };
    match (root, first) {
        (Value::Table(table), Step::Key(name)) => {
            let mut table = table.clone();
            let empty = Value::Table(Table::new());
            let inner = with(table.get(name).unwrap_or(&empty), rest, value);
            table.insert(name.clone(), inner);
            Value::Table(table)
        }
        (Value::Array(items), Step::Index(k)) => {
            let mut items = items.clone();
            if let Some(item) = items.get_mut(*k) {
                *item = with(item, rest, value);
            }
            Value::Array(items)
        }
        _ => value.clone(),
    }
}

/// Test of a value: it is a `T`, or serde says why not.
fn accepts<T: DeserializeOwned>(value: &Value) -> Result<(), String> {
    T::deserialize(value.clone()).map(drop).map_err(|e| e.message().to_string())
}

/// A base that takes the values of a file one by one.
struct Filled {
    /// The part read so far; it is always accepted.
    root: Value,
    mistakes: Vec<Mistake>,
    accepts: fn(&Value) -> Result<(), String>,
}

impl Filled {
    fn visit(&mut self, path: &mut Vec<Step>, value: &Value) {
        let base = get(&self.root, path).cloned();
        match (&base, value) {
            (Some(Value::Table(base)), Value::Table(table)) if base.contains_key(KIND) => {
                let candidates = choices(base, table);
                self.choose(path, table, &candidates);
            }
            (Some(Value::Table(_)), Value::Table(table)) => self.visit_all(path, table),
            (Some(Value::Array(base)), Value::Array(items)) if is_list_of_tables(base) && is_list_of_tables(items) => {
                let last = base.len() - 1;
                let base = (0..items.len()).map(|k| base[k.min(last)].clone()).collect();
                self.root = with(&self.root, path, &Value::Array(base));
                for (k, item) in items.iter().enumerate() {
                    path.push(Step::Index(k));
                    self.visit(path, item);
                    path.pop();
                }
            }
            (None, Value::Table(table)) => {
                // A table that may be left out: its keys one by one if not as a whole.
                if self.attempt(path, value).is_err() {
                    self.visit_all(path, table);
                }
            }
            _ => {
                if let Err(problem) = self.attempt(path, value) {
                    self.mistake(path, &problem);
                }
            }
        }
    }

    fn visit_all(&mut self, path: &mut Vec<Step>, table: &Table) {
        for (name, value) in table {
            path.push(Step::Key(name.clone()));
            self.visit(path, value);
            path.pop();
        }
    }

    /// Sets a value if that is accepted.
    fn attempt(&mut self, path: &[Step], value: &Value) -> Result<(), String> {
        let root = with(&self.root, path, value);
        (self.accepts)(&root)?;
        self.root = root;
        Ok(())
    }

    /// Sets a table that is one of several kinds: the first candidate that is accepted, if any is.
    fn choose(&mut self, path: &mut Vec<Step>, table: &Table, candidates: &[Table]) {
        let mut problems = Vec::new();
        for candidate in candidates {
            match self.attempt(path, &Value::Table(candidate.clone())) {
                Ok(()) => return,
                Err(problem) => problems.push(problem),
            }
        }
        // The keys of a table of the same kind tell by themselves which of them is wrong.
        let same = get(&self.root, path).and_then(|base| base.get(KIND)) == table.get(KIND);
        if same || !table.contains_key(KIND) {
            return self.visit_all_plain(path, table);
        }
        let problem = problems.pop().unwrap_or_default();
        let key = match problem.split('`').nth(1) {
            _ if problem.starts_with("unknown variant") => Some(KIND),
            Some(name) if table.contains_key(name) => Some(name),
            _ => None,
        };
        path.extend(key.map(|key| Step::Key(key.to_string())));
        self.mistake(path, &problem);
        path.truncate(path.len() - usize::from(key.is_some()));
    }

    fn visit_all_plain(&mut self, path: &mut Vec<Step>, table: &Table) {
        for (name, value) in table {
            path.push(Step::Key(name.clone()));
            if let Err(problem) = self.attempt(path, value) {
                self.mistake(path, &problem);
            }
            path.pop();
        }
    }

    fn mistake(&mut self, path: &[Step], problem: &str) {
        // Of an unknown table the table is named, not each of its keys.
        let unknown = problem.strip_prefix("unknown field `").and_then(|rest| rest.split('`').next());
        let at = path.iter().position(|step| matches!(step, Step::Key(name) if Some(name.as_str()) == unknown));
        let path = at.map_or(path, |at| &path[..=at]);
        let mistake = Mistake::new(text_of(path), plain(problem));
        if !self.mistakes.contains(&mistake) {
            self.mistakes.push(mistake);
        }
    }
}

/// The key that says of which kind a table is.
const KIND: &str = "kind";

/// Results that a table of several kinds may have: of the same kind, the base's with the file's values; of another one, what the
/// two kinds have in common comes from the base.
fn choices(base: &Table, file: &Table) -> Vec<Table> {
    let over = |keep: &dyn Fn(&str) -> bool| -> Table {
        let kept = base.iter().filter(|(name, _)| keep(name)).map(|(name, value)| (name.clone(), value.clone()));
        kept.chain(file.iter().map(|(name, value)| (name.clone(), value.clone()))).collect()
    };
    match file.get(KIND) {
        Some(kind) if Some(kind) != base.get(KIND) => {
            vec![over(&|name| name != KIND), over(&|name| name == "lambda"), file.clone()]
        }
        _ => vec![over(&|_| true)],
    }
}

fn is_list_of_tables(items: &[Value]) -> bool {
    !items.is_empty() && items.iter().all(Value::is_table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::{Config, Lbfgs, Regularizer};
    use crate::lagrangian::configure;
    use crate::presets::Preset;

    fn base(system: &str) -> Config {
        Preset::Quick.config(&configure(system, &[]).unwrap()).unwrap()
    }

    fn over(system: &str, text: &str) -> (Config, Vec<String>) {
        let file = ConfigFile::parse("c.toml".to_string(), text).unwrap();
        let (config, mistakes) = file.over(&base(system)).unwrap();
        let said = file.check(mistakes).err().map(|e| e.to_string());
        (config, said.iter().flat_map(|text| text.split("\nerror: ").map(str::to_string)).collect())
    }

    #[test]
    fn missing_keys_have_the_bases_values() {
        let text =
            "seed = 7\n[network]\nhidden = [8]\n[optimizer]\nclip = inf\n[lbfgs]\nmemory = 3\n[parameters]\nm1 = 2\n";
        let (config, mistakes) = over("double-pendulum", text);
        assert!(mistakes.is_empty(), "{mistakes:?}");
        let mut expected = base("double-pendulum");
        (expected.seed, expected.network.hidden, expected.optimizer.clip) = (7, vec![8], f64::INFINITY);
        expected.lbfgs = Some(Lbfgs { memory: 3, ..Lbfgs::default() });
        expected.parameters.insert("m1".to_string(), 2.0);
        assert_eq!(config, expected);
        // Phases are as many as the file's; those beyond the base's are as its last.
        let (config, mistakes) = over("double-pendulum", "[[phase]]\nepochs = 3\n[[phase]]\nrate = 1\n");
        assert!(mistakes.is_empty(), "{mistakes:?}");
        assert_eq!(config.phases.len(), 2);
        assert_eq!((config.phases[0].epochs, config.phases[1].epochs, config.phases[1].rate), (3, 40, 1.0));
        assert_eq!(over("double-pendulum", "").0, base("double-pendulum"));
    }

    #[test]
    fn a_penalty_of_another_kind_keeps_its_weight() {
        let penalty = |system: &str, text: &str| over(system, &format!("[penalty]\n{text}"));
        let of = |text: &str| penalty("double-pendulum", text).0.penalty;
        assert_eq!(of("lambda = 5"), Regularizer::Eigenvalue { lambda: 5.0 });
        assert_eq!(of("kind = 'sylvester'"), Regularizer::Sylvester { lambda: 100.0 });
        assert_eq!(of("kind = 'none'"), Regularizer::None);
        let lorentzian = Regularizer::LorentzianSylvester { lambda: 2.0, time: "theta1".to_string() };
        assert_eq!(of("kind = 'lorentzian-sylvester'\nlambda = 2\ntime = 'theta1'"), lorentzian);
        assert_eq!(
            penalty("ads4-geodesic", "kind = 'eigenvalue'").0.penalty,
            Regularizer::Eigenvalue { lambda: 100.0 }
        );
        let wrong = |text: &str| penalty("double-pendulum", text).1;
        assert_eq!(
            wrong("kind = 'sylvster'"),
            ["c.toml:2: penalty.kind: unknown value \"sylvster\", did you mean \"sylvester\"?"]
        );
        assert_eq!(wrong("lamda = 5"), ["c.toml:2: penalty.lamda: unknown key \"lamda\", did you mean \"lambda\"?"]);
        let missing = wrong("lambda = 5\nkind = 'lorentzian-sylvester'");
        assert!(
            missing.len() == 1 && missing[0].starts_with("c.toml:1: penalty: ") && missing[0].contains("time"),
            "{missing:?}"
        );
        let wrong = wrong("lambda = 'much'");
        assert!(wrong.len() == 1 && wrong[0].starts_with("c.toml:2: penalty.lambda: "), "{wrong:?}");
    }

    #[test]
    fn all_mistakes_are_found() {
        let text = "sede = 1\nprecision = 'f16'\n[netwrok]\nhidden = [1]\nalpha = 1\n[network]\nhiden = [1]\nalpha = 'x'\n\
                    [data]\ntraining = -1\n[[phase]]\nrate = true\n[[phase]]\nepoch = 3\n[lbfgs]\nmemory = 3\nitration = 4\n";
        let (config, mistakes) = over("double-pendulum", text);
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
        assert_eq!(mistakes.len(), beginnings.len(), "{mistakes:#?}");
        for (mistake, beginning) in mistakes.iter().zip(beginnings) {
            assert!(mistake.starts_with(beginning), "{mistake} is not {beginning}");
        }
        // What is right is taken.
        assert_eq!(config.lbfgs.unwrap().memory, 3);
    }

    #[test]
    fn values_of_another_shape_are_mistakes_of_their_key() {
        for (text, beginning) in [
            ("seed = { a = 1 }", "c.toml:1: seed"),
            ("phase = 3", "c.toml:1: phase"),
            ("[phase]\nrate = 1", "c.toml:1: phase"),
            ("phase = []", ""),
            ("penalty = 'none'", "c.toml:1: penalty"),
            ("network = [1]", "c.toml:1: network"),
        ] {
            let (_, mistakes) = over("double-pendulum", text);
            assert!(mistakes.iter().all(|m| m.starts_with(beginning)), "{text}: {mistakes:?}");
            assert_eq!(mistakes.is_empty(), beginning.is_empty(), "{text}: {mistakes:?}");
        }
    }

    #[test]
    fn seeds_may_be_larger_than_integers_of_a_table() {
        let text = format!("seed = {}\n[training]\nseed = {}\n", u64::MAX, 1u64 << 63);
        let file = ConfigFile::parse("c.toml".to_string(), &text).unwrap();
        assert_eq!((file.large(&["seed"]), file.large(&["training", "seed"])), (Some(u64::MAX), Some(1 << 63)));
        let file = ConfigFile::parse("c.toml".to_string(), "seed = 9223372036854775807\n").unwrap();
        assert_eq!((file.large(&["seed"]), file.get(&["seed"]).unwrap().as_integer()), (None, Some(i64::MAX)));
        assert!(ConfigFile::parse("c.toml".to_string(), "x = 18446744073709551615\n").is_err());
    }

    #[test]
    fn files_are_named() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("c.toml");
        assert_eq!(ConfigFile::read(&path).unwrap_err().kind(), crate::cli::Kind::Data);
        std::fs::write(&path, "seed = 1\nseed = 2\n").unwrap();
        let error = ConfigFile::read(&path).unwrap_err();
        assert_eq!(error.kind(), crate::cli::Kind::Usage);
        assert!(error.to_string().contains("c.toml:2: duplicate key"), "{error}");
    }
}
