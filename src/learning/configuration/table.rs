//! The declaration of a table of a configuration file, the single source of its type, defaults, ranges, documentation and options.
//!
//! ```text
//! table! {
//!     /// Full-batch L-BFGS.
//!     pub struct Lbfgs {
//!         /// Iterations at most.
//!         #[key("1 to 2^24", example = "100", flag = "iterations", check = count(1 << 24))]
//!         pub iterations: usize = 100,
//!         /// A table within.
//!         #[table("data", Below::Keys(Data::KEYS))]
//!         pub data: Data = Data::default(),
//!     }
//! }
//! ```
//!
//! The first paragraph of a field's documentation is its comment in printed configurations and its line of the reference; text after a
//! blank line is for readers of the code. `check` is a predicate of a value, of each element of a list, and of an optional value that is
//! there; a fault is worded by the text of the allowed values. Conditions on several keys are checked by hand.

use crate::configuration::ConfigError;
use crate::configuration::error::Faults;
use std::collections::BTreeMap;

/// A key of a configuration file.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// Documentation of its field.
    doc: &'static str,
    /// Allowed values, with their unit.
    pub values: &'static str,
    /// A value in TOML, from which an option is parsed, and which is shown for an optional key.
    pub example: &'static str,
    /// Name of its command-line option; empty for none. With `?` at its end it may be used without a value, and then takes the example.
    pub flag: &'static str,
    /// The keys below it.
    pub below: Below,
}

/// The content below a key.
#[derive(Clone, Copy, Debug)]
pub enum Below {
    /// A value.
    Value,
    /// A table with these keys, or a list of such tables.
    Keys(&'static [Key]),
    /// A table of any names.
    Open,
    /// A table that is taken as a whole.
    Whole,
}

impl Key {
    /// A key without anything else.
    pub const fn new(name: &'static str, doc: &'static str) -> Self {
        Self { name, doc, values: "", example: "", flag: "", below: Below::Value }
    }
    /// With its allowed values.
    pub const fn values(self, values: &'static str) -> Self {
        Self { values, ..self }
    }
    /// With an example.
    pub const fn example(self, example: &'static str) -> Self {
        Self { example, ..self }
    }
    /// With an option.
    pub const fn flag(self, flag: &'static str) -> Self {
        Self { flag, ..self }
    }
    /// A table of another name than its field.
    pub const fn table(self, name: &'static str, below: Below) -> Self {
        Self { name, below, ..self }
    }
    /// The names that its value may have, if it is one of several names.
    pub fn names(&self) -> Option<Vec<&'static str>> {
        let names: Vec<&str> = self.values.split(", ").collect();
        let is_name = |name: &&str| name.chars().all(|c| c.is_alphanumeric() || c == '-');
        (names.len() > 1 && names.iter().all(is_name)).then_some(names)
    }
    /// What it is for: the first paragraph of its documentation.
    pub fn purpose(&self) -> String {
        let lines = self.doc.lines().map(str::trim).take_while(|line| !line.is_empty());
        lines.collect::<Vec<_>>().join(" ")
    }
}

/// The key of a path such as `phase[0].rate`; indices are passed over.
pub fn find_key(keys: &'static [Key], path: &str) -> Option<&'static Key> {
    let (first, rest) = path.split_once('.').map_or((path, None), |(first, rest)| (first, Some(rest)));
    let name = first.split('[').next().unwrap_or(first);
    let key = keys.iter().find(|key| key.name == name)?;
    match (rest, key.below) {
        (Some(rest), Below::Keys(keys)) => find_key(keys, rest),
        _ => Some(key),
    }
}

/// `below.name`, or the name alone at the top of a file.
pub fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_string() } else { format!("{path}.{name}") }
}

/// A predicate of whole numbers from 1 to `most`.
pub(crate) fn count(most: usize) -> impl Fn(&usize) -> bool {
    move |x| *x >= 1 && *x <= most
}

/// A finite number of at least 0.
pub(crate) fn from_zero(x: &f64) -> bool {
    x.is_finite() && *x >= 0.0
}

/// A value that may be out of range, element by element.
pub trait Leaves {
    /// Type of an element.
    type Leaf;
    /// Visits every element with its path and its text.
    fn leaves(&self, path: &str, visit: &mut dyn FnMut(&str, &Self::Leaf, String));
}

macro_rules! leaves {
    ($($type:ty),*) => { $(
        impl Leaves for $type {
            type Leaf = Self;
            fn leaves(&self, path: &str, visit: &mut dyn FnMut(&str, &Self, String)) {
                visit(path, self, self.to_string());
            }
        }
    )* };
}
leaves!(usize, u64, f64, String);

impl<T: Leaves> Leaves for Option<T> {
    type Leaf = T::Leaf;
    fn leaves(&self, path: &str, visit: &mut dyn FnMut(&str, &T::Leaf, String)) {
        self.iter().for_each(|value| value.leaves(path, visit));
    }
}

impl<T: Leaves> Leaves for Vec<T> {
    type Leaf = T::Leaf;
    fn leaves(&self, path: &str, visit: &mut dyn FnMut(&str, &T::Leaf, String)) {
        self.iter().enumerate().for_each(|(k, value)| value.leaves(&format!("{path}[{k}]"), visit));
    }
}

/// A table whose keys have ranges.
pub trait Ranges {
    /// Notes every value out of its range; `path` is the path of the table.
    fn ranges(&self, _path: &str, _faults: &mut Faults) {}
}

impl Ranges for crate::configuration::Regularizer {}
impl Ranges for crate::lagrangian::Description {}
impl<V> Ranges for BTreeMap<String, V> {}

impl<T: Ranges> Ranges for Option<T> {
    fn ranges(&self, path: &str, faults: &mut Faults) {
        self.iter().for_each(|table| table.ranges(path, faults));
    }
}

impl<T: Ranges> Ranges for Vec<T> {
    fn ranges(&self, path: &str, faults: &mut Faults) {
        self.iter().enumerate().for_each(|(k, table)| table.ranges(&format!("{path}[{k}]"), faults));
    }
}

impl Faults {
    /// Notes every element of a value that a predicate refuses.
    pub fn range<T: Leaves>(&mut self, path: &str, value: &T, expected: &'static str, ok: impl Fn(&T::Leaf) -> bool) {
        value.leaves(path, &mut |field, leaf, found| {
            if !ok(leaf) {
                self.0.push(ConfigError { field: field.to_string(), expected: expected.into(), found });
            }
        });
    }
}

/// Declares a table, see the module.
macro_rules! table {
    (
        $(#[doc = $about:literal])*
        pub struct $Name:ident {
            $(
                $(#[doc = $doc:literal])*
                $(#[key($values:expr
                    $(, example = $example:expr)?
                    $(, flag = $flag:literal)?
                    $(, check = $check:expr)?
                )])?
                $(#[table($table:literal, $below:expr)])?
                $(#[serde($($serde:tt)*)])*
                pub $field:ident: $type:ty = $default:expr
            ),* $(,)?
        }
    ) => {
        $(#[doc = $about])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $Name {
            $(
                $(#[doc = $doc])*
                $(#[serde($($serde)*)])*
                pub $field: $type,
            )*
        }

        impl Default for $Name {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }

        impl $Name {
            /// Its keys, in the order of a file.
            pub const KEYS: &'static [$crate::configuration::Key] = &[
                $(
                    $crate::configuration::Key::new(stringify!($field), concat!($($doc, "\n"),*))
                        $(.values($values) $(.example($example))? $(.flag($flag))?)?
                        $(.table($table, $below))?
                ),*
            ];
        }

        impl $crate::configuration::Ranges for $Name {
            fn ranges(&self, path: &str, faults: &mut $crate::configuration::Faults) {
                // A table without checks uses neither.
                let _ = (path, &faults);
                $(
                    $($(
                        let at = $crate::configuration::join(path, stringify!($field));
                        faults.range(&at, &self.$field, $values, $check);
                    )?)?
                    $($crate::configuration::Ranges::ranges(
                        &self.$field,
                        &$crate::configuration::join(path, $table),
                        faults,
                    );)?
                )*
            }
        }
    };
}
pub(crate) use table;
