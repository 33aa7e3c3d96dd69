//! The names that formulas of a description may use, with their meanings.

use super::checks::check_name;
use super::{Description, DescriptionError};
use crate::lagrangian::expression::{Compiler, Expression, Meaning, Value};
use crate::lagrangian::thresholds::SHOWN_NAMES;
use crate::names::taken_column;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// Meanings by name.
pub(super) type Scope = BTreeMap<String, Meaning>;

/// Name of the time in formulas.
const TIME: &str = "t";

/// Compiles a formula; with `still`, velocities are rejected.
///
/// # Errors
/// The key of the formula and the problem.
pub(super) fn compiled(
    compiler: &mut Compiler,
    scope: &Scope,
    (key, text): (&str, &str),
    still: bool,
) -> Result<Value, DescriptionError> {
    let expression: Expression = text.parse().map_err(DescriptionError::formula(key))?;
    compiler.add(&expression, scope, still).map_err(DescriptionError::formula(key))
}

impl Description {
    /// Returns the meaning of the names of coordinates, velocities, parameters and the time `t`, unless something else has that name; also
    /// whether the equations of motion depend on the time.
    pub(super) fn scope(&self) -> Result<(Scope, bool), DescriptionError> {
        let mut scope = BTreeMap::new();
        let mut add = |key: String, name: &str, meaning: Meaning| {
            check_name(key.clone(), name)?;
            match scope.insert(name.to_string(), meaning) {
                Some(_) => Err(DescriptionError::new(key, format!("the name `{name}` is taken"))),
                None => Ok(()),
            }
        };
        let names: Vec<&str> = self.coordinates.iter().map(|coordinate| coordinate.name.as_str()).collect();
        if let Some((i, problem)) = taken_column(&names) {
            return Err(DescriptionError::new(format!("coordinates[{i}].name"), problem));
        }
        for (i, coordinate) in self.coordinates.iter().enumerate() {
            let key = || format!("coordinates[{i}].name");
            add(key(), &coordinate.name, Meaning::Position(i))?;
            add(key(), &format!("{}_dot", coordinate.name), Meaning::Velocity(i))?;
        }
        for (i, name) in self.parameters.keys().enumerate() {
            add(format!("parameters.{name}"), name, Meaning::Parameter(i))?;
        }
        let timed = self.is_timed();
        if !self.time_is_taken() {
            add("lagrangian".to_string(), TIME, Meaning::Position(self.coordinates.len()))?;
        }
        for (k, name) in self.inputs.keys().enumerate().filter(|(_, name)| self.marks.contains(*name)) {
            add(format!("inputs.{name}"), name, Meaning::Position(self.coordinates.len() + 1 + k))?;
        }
        // Reserve these names, although they have no meaning yet.
        for name in self.definitions.keys() {
            add(format!("definitions.{name}"), name, Meaning::Parameter(usize::MAX))?;
        }
        scope.retain(|name, _| !self.definitions.contains_key(name));
        Ok((scope, timed))
    }

    /// Compiles the definitions in order of dependence.
    pub(super) fn define(&self, compiler: &mut Compiler, scope: &mut Scope) -> Result<(), DescriptionError> {
        let key = |name: &str| format!("definitions.{name}");
        let mut waiting: Vec<Waiting<'_>> = Vec::with_capacity(self.definitions.len());
        for (name, text) in &self.definitions {
            let expression: Expression = text.parse().map_err(DescriptionError::formula(key(name)))?;
            let needs = expression.names().filter_map(|used| Some(self.definitions.get_key_value(used)?.0.as_str()));
            waiting.push(Waiting { name, needs: needs.collect(), expression });
        }
        while !waiting.is_empty() {
            let before = waiting.len();
            let mut still = Vec::new();
            for definition in waiting {
                if definition.needs.iter().any(|used| !scope.contains_key(*used)) {
                    still.push(definition);
                    continue;
                }
                let Waiting { name, expression, .. } = definition;
                let value = compiler.add(&expression, scope, false).map_err(DescriptionError::formula(key(name)))?;
                scope.insert(name.to_string(), Meaning::Value(value));
            }
            if still.len() == before {
                let (name, circle) = circle(&still);
                return Err(DescriptionError::new(key(&name), format!("it depends on itself: {circle}")));
            }
            waiting = still;
        }
        Ok(())
    }

    /// Extends the names by inputs, for formulas of forces.
    pub(super) fn with_inputs(&self, scope: &Scope) -> Result<Scope, DescriptionError> {
        let mut scope = scope.clone();
        for (k, name) in self.inputs.keys().enumerate().filter(|(_, name)| !self.marks.contains(*name)) {
            let key = || format!("inputs.{name}");
            check_name(key(), name)?;
            if name == TIME || scope.insert(name.clone(), Meaning::Position(self.coordinates.len() + 1 + k)).is_some() {
                return Err(DescriptionError::new(key(), format!("the name `{name}` is taken")));
            }
            let is_used = |text: &String| {
                text.parse::<Expression>().is_ok_and(|formula| formula.names().any(|used| used == name))
            };
            if !self.forces.values().any(is_used) {
                return Err(DescriptionError::new(key(), "expected it in a formula of [forces]"));
            }
        }
        Ok(scope)
    }

    /// Returns `true` if there are inputs, or if the Lagrangian, the dissipation function or forces depend on the time `t`. Nothing else
    /// may then be called `t`.
    fn is_timed(&self) -> bool {
        let metric = self.metric.iter().flat_map(|entries| entries.values());
        let mut texts = self.lagrangian.iter().chain(&self.dissipation).chain(self.forces.values()).chain(metric);
        !self.inputs.is_empty() || !self.time_is_taken() && texts.any(|text| self.names_time(text))
    }

    /// Returns `true` if something else is called `t`.
    pub(super) fn time_is_taken(&self) -> bool {
        let names = self.coordinates.iter().map(|coordinate| &coordinate.name);
        names.chain(self.parameters.keys()).chain(self.definitions.keys()).any(|name| name == TIME)
    }

    /// Returns `true` if a formula, or a definition that it uses, contains `t`.
    pub(super) fn names_time(&self, text: &str) -> bool {
        let (mut texts, mut seen) = (vec![text], BTreeSet::new());
        while let Some(text) = texts.pop() {
            // Errors in it are reported when it is compiled.
            let Ok(expression) = text.parse::<Expression>() else { continue };
            for name in expression.names() {
                if name == TIME {
                    return true;
                }
                if let Some((name, text)) = self.definitions.get_key_value(name)
                    && seen.insert(name.as_str())
                {
                    texts.push(text);
                }
            }
        }
        false
    }
}

/// A definition that is not compiled yet.
struct Waiting<'a> {
    name: &'a str,
    /// Definitions that its formula uses.
    needs: BTreeSet<&'a str>,
    expression: Expression,
}

/// Finds definitions that depend on each other; returns the first of them and the cycle in words.
fn circle(waiting: &[Waiting<'_>]) -> (String, String) {
    let next = |name: &str| {
        let found = waiting.iter().find(|known| known.name == name)?;
        found.needs.iter().copied().find(|used| waiting.iter().any(|known| known.name == *used))
    };
    let mut way: Vec<&str> = waiting.first().map(|first| first.name).into_iter().collect();
    while let Some(name) = way.last().and_then(|name| next(name)) {
        if let Some(first) = way.iter().position(|known| *known == name) {
            way.drain(..first);
            way.push(name);
            break;
        }
        way.push(name);
    }
    let name = way.first().map(|name| name.to_string()).unwrap_or_default();
    let text = match way.len() {
        length if length > SHOWN_NAMES => format!("{} -> ..", way[..SHOWN_NAMES].join(" -> ")),
        _ => way.join(" -> "),
    };
    (name, text)
}
