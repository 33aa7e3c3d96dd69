//! The entry of a system in the list of all systems.

use crate::lagrangian::ShownLink;
use crate::lagrangian::system::{Bounds, Parameter, Size, System};
use serde::{Serialize, Serializer};
use serde_json::Value;
use std::collections::BTreeMap;

/// What a list of systems says of one, with the size it has unless another is chosen.
#[derive(Serialize)]
pub struct SystemEntry<'a> {
    /// Name on the command line.
    pub name: &'a str,
    /// Name in words.
    pub title: &'a str,
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// Names of coordinates and velocities.
    pub columns: Vec<String>,
    /// Units of the columns.
    pub units: Vec<String>,
    /// Which coordinates are angles.
    pub periodic: Vec<bool>,
    /// Unit of time.
    pub time_unit: &'a str,
    /// The coordinate that is a time.
    pub time_like: Option<String>,
    /// The mass shell.
    pub constraint: Option<&'a str>,
    /// Formulas of the constraints by name.
    pub constraints: Option<&'a BTreeMap<String, String>>,
    /// Links of a chain or tree.
    pub links: Option<Vec<ShownLink<'a>>>,
    /// The parameters, the size among them.
    pub parameters: Vec<ParameterEntry>,
    /// Units of the inputs by name.
    pub inputs: Option<&'a BTreeMap<String, String>>,
    /// The states of training and of validation.
    pub bounds: BoundsEntry,
}

/// A parameter of a system.
#[derive(Serialize)]
pub struct ParameterEntry {
    /// Its symbol.
    pub symbol: String,
    /// Its value unless it is set, as text; in JSON a number, or the text if that is none.
    #[serde(serialize_with = "as_number")]
    pub default: String,
    /// Its unit.
    pub unit: String,
    /// Allowed values in words.
    pub range: String,
}

fn as_number<S: Serializer>(text: &str, serializer: S) -> Result<S::Ok, S::Error> {
    serde_json::from_str(text).unwrap_or_else(|_| Value::from(text)).serialize(serializer)
}

/// Ranges of states.
#[derive(Serialize)]
pub struct BoundsEntry {
    /// States of training data.
    pub training: StateRanges,
    /// States on which errors are reported.
    pub validation: StateRanges,
}

/// Ranges of coordinates and velocities.
#[derive(Serialize)]
pub struct StateRanges {
    position: Vec<(f64, f64)>,
    velocity: Vec<(f64, f64)>,
}

impl From<Bounds> for StateRanges {
    fn from(bounds: Bounds) -> Self {
        Self { position: bounds.positions, velocity: bounds.velocities }
    }
}

impl<'a> SystemEntry<'a> {
    /// The entry of a system.
    pub fn of(system: &'a System) -> Self {
        let n = system.size.default();
        let coordinates = system.coordinates(n);
        let name = |i: usize| coordinates[i].name.to_string();
        let description = system.description();
        Self {
            name: &system.name,
            title: &system.title,
            coordinates: (0..n).map(name).collect(),
            columns: system.columns(n),
            units: system.units(n),
            periodic: coordinates.iter().map(|c| c.periodic).collect(),
            time_unit: &system.time_unit,
            time_like: system.time_like.map(name),
            constraint: system.constraint,
            constraints: description.map(|own| &own.constraints),
            links: Some(system.shown_links()).filter(|links| !links.is_empty()),
            parameters: parameters(system),
            inputs: description.map(|own| &own.inputs),
            bounds: BoundsEntry { training: system.training(n).into(), validation: system.validation(n).into() },
        }
    }

    /// Describes the system in lines.
    pub fn text(&self) -> String {
        let n = self.coordinates.len();
        let time = self.time_like.as_ref().and_then(|name| self.coordinates.iter().position(|own| own == name));
        let remark = |k: usize| match (self.periodic.get(k), time == Some(k)) {
            (_, true) => "  time-like",
            (Some(true), _) => "  periodic",
            _ => "",
        };
        let mut text = format!("{}  ({})\n", self.name, self.title);
        let StateRanges { position, velocity } = &self.bounds.validation;
        let rows = self.columns.iter().zip(&self.units).zip(position.iter().chain(velocity));
        for (k, ((column, unit), (low, high))) in rows.enumerate() {
            match self.constraint.filter(|_| time.is_some_and(|i| k == n + i)) {
                Some(constraint) => text += &format!("  {column:<12} {unit:<6} {constraint}\n"),
                None => text += &format!("  {column:<12} {unit:<6} {low:>7.3} .. {high:<7.3}{}\n", remark(k)),
            }
        }
        for (name, formula) in self.constraints.iter().copied().flatten() {
            text += &format!("  {name:<12} {formula} = 0\n");
        }
        for (k, link) in self.links.iter().flatten().enumerate() {
            let moves = if link.prismatic { "slides" } else { "turns" };
            let ratio = if link.ratio == 1.0 { String::new() } else { format!("{}*", link.ratio) };
            let on = if link.parent == 0 { "the base".to_string() } else { format!("link {}", link.parent) };
            let name = link.name.map_or(String::new(), |name| format!("  {name}"));
            text +=
                &format!("  {:<12} {moves} by {ratio}{}, on {on}{name}\n", format!("link {}", k + 1), link.coordinate);
        }
        for ParameterEntry { symbol, default, unit, range } in &self.parameters {
            text += &format!("  --param {:<12} {unit:<6} {range}\n", format!("{symbol}={default}"));
        }
        for (name, unit) in self.inputs.iter().copied().flatten() {
            text += &format!("  input {name:<14} {unit}\n");
        }
        text
    }
}

/// The parameters of a system, its size among them.
fn parameters(system: &System) -> Vec<ParameterEntry> {
    let entry = |symbol: &str, default: &str, unit: &str, range: String| ParameterEntry {
        symbol: symbol.to_string(),
        default: default.to_string(),
        unit: unit.to_string(),
        range,
    };
    let own = |p: &Parameter| entry(&p.symbol, &p.default, &p.unit, p.range.text().to_string());
    let mut entries: Vec<_> = system.parameters.iter().map(own).collect();
    if let Size::Chosen { symbol, default, least, most, .. } = system.size {
        entries.push(entry(symbol, &default.to_string(), "1", format!("an integer from {least} to {most}")));
    }
    entries
}
