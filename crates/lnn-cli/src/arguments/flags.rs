//! Options of configuration keys, generated from the declarations of the keys, and `--set KEY=VALUE` for all others.

use crate::arguments::layers::Entry;
use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use lnn::configuration::{Below, Config, Key, join};
use lnn::pipeline::FitConfig;
use std::ffi::OsStr;
use std::marker::PhantomData;
use toml::{Table, Value};

/// A configuration whose keys have options.
pub trait Flagged {
    /// All keys.
    const KEYS: &'static [Key];
    /// Keys without an option.
    const WITHOUT: &'static [&'static str];
}

impl Flagged for Config {
    const KEYS: &'static [Key] = Self::KEYS;
    // The system is an argument; it determines its time and whether it has friction.
    const WITHOUT: &'static [&'static str] = &["name", "timelike", "friction", "joint-friction"];
}

impl Flagged for FitConfig {
    const KEYS: &'static [Key] = Self::KEYS;
    const WITHOUT: &'static [&'static str] = &[];
}

/// The options of a configuration's keys.
#[derive(Clone, Debug)]
pub struct Flags<T> {
    /// Values given by options.
    pub entries: Vec<Entry>,
    of: PhantomData<fn() -> T>,
}

/// Name of the option for keys that have no option.
const SET: &str = "set";

/// An option of a key.
struct Flag {
    path: String,
    key: &'static Key,
}

impl Flag {
    fn name(&self) -> &'static str {
        self.key.flag.trim_end_matches('?')
    }
    fn is_switch(&self) -> bool {
        self.key.values == "true, false"
    }

    fn argument(&self) -> Arg {
        let (key, name) = (self.key, self.name());
        let help = format!("{} [{}]", key.purpose().trim_end_matches('.'), key.values);
        let argument = Arg::new(name).long(name).help(help);
        if self.is_switch() {
            return argument.action(ArgAction::SetTrue);
        }
        let form = match key.example.chars().next() {
            Some('[') => "V1,V2,..",
            Some('"') => "NAME",
            _ if key.values.contains(", ") => "NAME",
            _ => "N",
        };
        let argument = argument.value_name(form).allow_negative_numbers(true);
        let argument = match key.names() {
            Some(names) => argument.value_parser(Names(names)).hide_possible_values(true),
            None => argument,
        };
        // The example is TOML, the text of an option has no quotes.
        let usual = key.example.trim_matches('"');
        if key.flag.ends_with('?') { argument.num_args(0..=1).default_missing_value(usual) } else { argument }
    }

    /// Converts the text of the option to a value.
    fn value(&self, text: &str) -> Value {
        let scalar = |text: &str, quoted: bool| match text.trim() {
            text if quoted => Value::from(text),
            text => text
                .parse::<i64>()
                .ok()
                .map(Value::from)
                // An integer beyond the range of TOML remains text.
                .or_else(|| text.parse::<f64>().ok().filter(|_| !is_whole(text)).map(Value::from))
                .unwrap_or_else(|| text.into()),
        };
        match self.key.example.strip_prefix('[') {
            Some(item) => text.split(',').map(|text| scalar(text, item.starts_with('"'))).collect::<Vec<_>>().into(),
            None => scalar(text, self.key.example.starts_with('"')),
        }
    }
}

fn is_whole(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Accepts any text; shell completion offers the names.
#[derive(Clone)]
struct Names(Vec<&'static str>);

impl TypedValueParser for Names {
    type Value = String;

    fn parse_ref(&self, command: &Command, argument: Option<&Arg>, value: &OsStr) -> Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, argument, value)
    }
    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.0.iter().map(PossibleValue::new)))
    }
}

/// Options of keys, in the order of a file.
fn flags<T: Flagged>() -> Vec<Flag> {
    fn collect(keys: &'static [Key], path: &str, found: &mut Vec<Flag>) {
        for key in keys {
            let path = join(path, key.name);
            match key.below {
                Below::Keys(keys) => collect(keys, &path, found),
                _ if key.flag.is_empty() => {}
                _ => found.push(Flag { path, key }),
            }
        }
    }
    let mut found = Vec::new();
    collect(T::KEYS, "", &mut found);
    found.retain(|flag| !T::WITHOUT.contains(&flag.name()));
    found
}

/// Parses `KEY=VALUE`; the value is TOML, or text without quotes.
fn assignment(text: &str) -> Result<Entry, clap::Error> {
    let refused = || {
        let problem =
            format!("--set {text}: expected KEY=VALUE, such as network.hidden=[32,32] or phase[0].rate=1e-3\n");
        clap::Error::raw(clap::error::ErrorKind::ValueValidation, problem)
    };
    let (key, value) = text.split_once('=').ok_or_else(refused)?;
    let (key, value) = (key.trim(), value.trim());
    if key.is_empty() || value.is_empty() {
        return Err(refused());
    }
    let read = toml::from_str::<Table>(&format!("value = {value}")).ok().and_then(|mut table| table.remove("value"));
    Ok(Entry::option(format!("--set {key}"), key, read.unwrap_or_else(|| value.into())))
}

impl<T: Flagged> clap::Args for Flags<T> {
    fn augment_args(command: Command) -> Command {
        let set =
            Arg::new(SET).long(SET).value_name("KEY=VALUE").action(ArgAction::Append).help(
                "Any key of the configuration, such as optimizer.batch=64 or phase[0].rate=1e-3; may be repeated",
            );
        command.args(flags::<T>().iter().map(Flag::argument)).arg(set)
    }
    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<T: Flagged> clap::FromArgMatches for Flags<T> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut entries = Vec::new();
        for flag in flags::<T>() {
            let name = flag.name();
            if matches.value_source(name) != Some(ValueSource::CommandLine) {
                continue;
            }
            let text = if flag.is_switch() { None } else { matches.get_one::<String>(name) };
            let value = text.map_or(Value::Boolean(true), |text| flag.value(text));
            entries.push(Entry::option(format!("--{name}"), &flag.path, value));
        }
        for text in matches.get_many::<String>(SET).into_iter().flatten() {
            entries.push(assignment(text)?);
        }
        Ok(Self { entries, of: PhantomData })
    }
    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Args, FromArgMatches};

    #[test]
    fn options_are_read_by_their_keys() {
        let entries = |line: &str| {
            let command = Flags::<FitConfig>::augment_args(Command::new("fit")).no_binary_name(true);
            let matches = command.try_get_matches_from(line.split(' '))?;
            Ok::<_, clap::Error>(format!("{:?}", Flags::<FitConfig>::from_arg_matches(&matches)?.entries))
        };
        let found = entries("--hidden 8,4 --cyclic x --even-in-v --friction --noise 0.1,2 --name 7 --seed -1").unwrap();
        for part in
            ["Integer(8), Integer(4)", "String(\"x\")", "Boolean(true)", "Integer(16)", "Float(0.1), Integer(2)"]
        {
            assert!(found.contains(part), "{part} is not in {found}");
        }
        assert!(found.contains("String(\"7\")") && found.contains("Integer(-1)"), "{found}");
        let found = entries("--set optimizer.clip=inf --set network.activation=tanh --set shooting.steps=3").unwrap();
        assert!(found.contains("Float(inf)") && found.contains("String(\"tanh\")") && found.contains("Integer(3)"));
        assert!(entries("--set optimizer.clip").is_err() && entries("--hiden 8").is_err());
        let names: Vec<_> = flags::<Config>().iter().map(Flag::name).collect();
        assert!(names.contains(&"penalty") && !names.contains(&"friction"), "{names:?}");
    }
}
