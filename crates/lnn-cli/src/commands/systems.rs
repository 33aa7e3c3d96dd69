//! `lnn systems`: the systems that can be learned.

use crate::CliError;
use crate::arguments::system_arg;
use crate::terminal::output;
use lnn::lagrangian::constrained_systems;
use lnn::lagrangian::system::{Bounds, Coordinate, Parameter, Size, System};
use serde_json::{Value, json};
use std::borrow::Cow;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// List only this system, by name or by its file.
    #[arg(long, value_name = "NAME|FILE")]
    system: Option<String>,
    /// One JSON object per line instead of a table.
    #[arg(long)]
    json: bool,
}

/// Prints the catalogue.
pub fn run(args: &Args) -> Result<(), CliError> {
    let one = args.system.as_deref().map(system_arg::system).transpose()?;
    let all: Vec<Cow<'static, System>> = match one {
        Some(system) => vec![system],
        None => {
            let constrained = constrained_systems().into_iter().map(Cow::Owned);
            System::unconstrained().iter().map(Cow::Borrowed).chain(constrained).collect()
        }
    };
    if args.json {
        return output::print(&all.iter().map(|system| format!("{}\n", describe(system))).collect::<String>());
    }
    output::print(&all.iter().map(|system| table(system)).collect::<Vec<_>>().join("\n"))
}

/// Symbol, default, unit and allowed values of every parameter.
pub fn parameters(system: &System) -> Vec<[String; 4]> {
    let row = |p: &Parameter| [p.symbol.as_ref(), &p.default, &p.unit, p.range.text()].map(String::from);
    let mut rows: Vec<_> = system.parameters.iter().map(row).collect();
    if let Size::Chosen { symbol, default, least, most, .. } = system.size {
        let range = format!("an integer from {least} to {most}");
        rows.push([symbol.to_string(), default.to_string(), "1".to_string(), range]);
    }
    rows
}

fn describe(system: &System) -> Value {
    let n = system.size.default();
    let coordinates = system.coordinates(n);
    let box_of = |b: Bounds| json!({ "position": b.positions, "velocity": b.velocities });
    let number = |text: &str| serde_json::from_str::<Value>(text).unwrap_or_else(|_| Value::from(text));
    let parameters: Vec<Value> = parameters(system)
        .iter()
        .map(|[symbol, default, unit, range]| {
            json!({ "symbol": symbol, "default": number(default), "unit": unit, "range": range })
        })
        .collect();
    json!({
        "name": system.name,
        "title": system.title,
        "coordinates": coordinates.iter().map(|c| c.name.as_ref()).collect::<Vec<_>>(),
        "columns": system.columns(n),
        "units": system.units(n),
        "periodic": coordinates.iter().map(|c| c.periodic).collect::<Vec<_>>(),
        "time_unit": system.time_unit,
        "time_like": system.time_like.map(|i| coordinates[i].name.as_ref()),
        "constraint": system.constraint,
        "constraints": system.description().map(|description| &description.constraints),
        "links": Some(system.shown_links()).filter(|links| !links.is_empty()),
        "parameters": parameters,
        "inputs": system.description().map(|description| &description.inputs),
        "bounds": { "training": box_of(system.training(n)), "validation": box_of(system.validation(n)) },
    })
}

fn table(system: &System) -> String {
    let n = system.size.default();
    let bounds = system.validation(n);
    let ranges = bounds.positions.iter().chain(&bounds.velocities);
    let remark = |(i, c): (usize, Coordinate)| match (c.periodic, system.time_like == Some(i)) {
        (_, true) => "  time-like",
        (true, _) => "  periodic",
        _ => "",
    };
    let remarks = system.coordinates(n).into_iter().enumerate().map(remark);
    let fixed = system.time_like.filter(|_| system.constraint.is_some()).map(|i| n + i);
    let mut text = format!("{}  ({})\n", system.name, system.title);
    let rows = system.columns(n).into_iter().zip(system.units(n)).zip(ranges);
    for (k, (((column, unit), (low, high)), remark)) in rows.zip(remarks.chain(std::iter::repeat(""))).enumerate() {
        match system.constraint.filter(|_| fixed == Some(k)) {
            Some(constraint) => text += &format!("  {column:<12} {unit:<6} {constraint}\n"),
            None => text += &format!("  {column:<12} {unit:<6} {low:>7.3} .. {high:<7.3}{remark}\n"),
        }
    }
    for (name, formula) in system.description().into_iter().flat_map(|description| &description.constraints) {
        text += &format!("  {name:<12} {formula} = 0\n");
    }
    for (k, link) in system.shown_links().iter().enumerate() {
        let moves = if link.prismatic { "slides" } else { "turns" };
        let ratio = if link.ratio == 1.0 { String::new() } else { format!("{}*", link.ratio) };
        let on = if link.parent == 0 { "the base".to_string() } else { format!("link {}", link.parent) };
        let name = link.name.map_or(String::new(), |name| format!("  {name}"));
        text += &format!("  {:<12} {moves} by {ratio}{}, on {on}{name}\n", format!("link {}", k + 1), link.coordinate);
    }
    for [symbol, default, unit, range] in parameters(system) {
        text += &format!("  --param {:<12} {unit:<6} {range}\n", format!("{symbol}={default}"));
    }
    for (name, unit) in system.description().iter().flat_map(|description| &description.inputs) {
        text += &format!("  input {name:<14} {unit}\n");
    }
    text
}
