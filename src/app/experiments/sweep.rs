//! Sweeps: runs over the values of some keys of a configuration.

use super::{Reported, Run, slug};
use crate::configuration::Config;
use std::collections::BTreeMap;
use std::str::FromStr;

/// Largest number of letters of a directory name that come from the choices.
const MOST_LETTERS: usize = 100;

/// A key of the configuration and its values, as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variation {
    /// Path of the key, such as `penalty.lambda`.
    pub key: String,
    /// Values.
    pub values: Vec<String>,
}

impl FromStr for Variation {
    type Err = String;

    /// Parses `key=a,b,c`; commas inside brackets, braces and quotes belong to a value.
    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected KEY=VALUE,VALUE,..".to_string();
        let (key, all) = text.split_once('=').ok_or_else(expected)?;
        let (mut values, mut depth, mut quote) = (vec![String::new()], 0i32, None);
        for c in all.chars() {
            match (quote, c) {
                (None, '[' | '{') => depth += 1,
                (None, ']' | '}') => depth -= 1,
                (None, '"' | '\'') => quote = Some(c),
                (Some(open), _) if open == c => quote = None,
                _ => {}
            }
            match values.last_mut() {
                Some(value) if c != ',' || depth > 0 || quote.is_some() => value.push(c),
                _ => values.push(String::new()),
            }
        }
        let values: Vec<String> = values.iter().map(|value| value.trim().to_string()).collect();
        let key = key.trim().to_string();
        if key.is_empty() || values.iter().any(String::is_empty) {
            return Err(expected());
        }
        match values.iter().enumerate().find(|(k, value)| values[..*k].contains(value)) {
            Some((_, value)) => Err(format!("{key} has the value {value} twice")),
            None => Ok(Self { key, values }),
        }
    }
}

/// One value for every key.
pub type Choice = Vec<(String, String)>;

/// All combinations of the values, the last key changing fastest.
pub fn combinations(variations: &[Variation]) -> Vec<Choice> {
    variations.iter().fold(vec![Vec::new()], |all: Vec<Choice>, Variation { key, values }| {
        let longer = |choice: &Choice| {
            let choice = choice.clone();
            let with = move |value: &String| [choice.clone(), vec![(key.clone(), value.clone())]].concat();
            values.iter().map(with).collect::<Vec<_>>()
        };
        all.iter().flat_map(longer).collect()
    })
}

/// Creates the runs of the configurations, each with `seeds` consecutive seeds; all runs of one choice form one row of the table.
pub fn sweep_runs(configurations: Vec<(Choice, Config)>, seeds: usize) -> Vec<Run> {
    let mut used: BTreeMap<String, usize> = BTreeMap::new();
    let named = configurations.into_iter().map(|(choice, config)| {
        let text = choice.iter().map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>().join(", ");
        let label = if text.is_empty() { config.system.clone() } else { text };
        let name: String = slug(&label).chars().take(MOST_LETTERS).collect();
        // Names omit signs and decimal points, so different choices may share a name.
        let again = used.entry(name.clone()).and_modify(|again| *again += 1).or_insert(1);
        let name = if *again == 1 { name } else { format!("{name}-{again}") };
        (name, label, config)
    });
    let named: Vec<(String, String, Config)> = named.collect();
    let run = |k: u64, (name, label, config): &(String, String, Config)| {
        let seed = config.seed.wrapping_add(k);
        let config = Config { seed, ..config.clone() };
        let (name, label) = (format!("{name}-seed{seed}"), label.clone());
        Run { name, label, abscissa: None, group: String::new(), config, reported: Reported::NOTHING }
    };
    (0..seeds as u64).flat_map(|k| named.iter().map(move |one| run(k, one))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::Preset;

    #[test]
    fn values_are_parted_at_commas_outside_of_brackets() {
        let of = |text: &str| text.parse::<Variation>().map(|v| (v.key, v.values));
        let list = |values: &[&str]| values.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(of("a.b = 1, 2,3").unwrap(), ("a.b".to_string(), list(&["1", "2", "3"])));
        assert_eq!(of("h=[8,8],[16]").unwrap().1, list(&["[8,8]", "[16]"]));
        assert_eq!(of("o={ kind = 'a,b' },\"c,d\"").unwrap().1, list(&["{ kind = 'a,b' }", "\"c,d\""]));
        for bad in ["a", "=1", "a=", "a=1,,2", "a=1,1"] {
            assert!(of(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn runs_are_all_combinations_for_every_seed() {
        let variations = ["a=1,2", "b=x,y,z"].map(|text| text.parse().unwrap());
        let choices = combinations(&variations);
        assert_eq!((choices.len(), choices[1][1].1.as_str()), (6, "y"));
        assert_eq!(combinations(&[]), [Vec::new()]);
        let system = crate::lagrangian::SystemInstance::named("harmonic-oscillator", &[]).unwrap();
        let config = Preset::Quick.config(&system).unwrap();
        let pairs = |choices: Vec<Choice>| choices.into_iter().map(|choice| (choice, config.clone())).collect();
        let runs = sweep_runs(pairs(choices), 2);
        assert_eq!((runs.len(), runs[0].label.as_str(), runs[0].name.as_str()), (12, "a = 1, b = x", "a-1-b-x-seed0"));
        assert_eq!((runs[6].label.as_str(), runs[6].config.seed), ("a = 1, b = x", 1));
        // Equal names get a number.
        let signs = sweep_runs(pairs(combinations(&["a=-1,1".parse().unwrap()])), 1);
        assert_ne!(signs[0].name, signs[1].name);
    }
}
