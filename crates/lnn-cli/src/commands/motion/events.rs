//! The events of a roll-out as a table.

use crate::CliError;
use crate::arguments::motion_source::MotionSource;
use crate::thresholds::SHOWN_EVENTS;
use lnn::findings::text_table;
use lnn::names::{pluralize, rounded};
use lnn::report::DataTable;
use lnn::rollout::{Event, Occurrence};
use serde_json::{Value, json};
use std::path::Path;

/// Column names for the energies of impacts.
const ENERGIES: [&str; 3] = ["energy_before", "energy_after", "energy_lost"];

/// Rejects options that cannot be combined with the events of a system.
///
/// # Errors
/// A usage error.
pub fn check(file: Option<&Path>, charges: bool, events: &[Event<f64>]) -> Result<(), CliError> {
    if file.is_some() && events.is_empty() {
        return Err(CliError::usage("--events: the system has none, see the table [events] of a system file"));
    }
    if charges && events.iter().any(Event::is_impact) {
        return Err(CliError::usage("--charges: impacts change them; leave the table [events] out"));
    }
    Ok(())
}

/// Table of times, states and, for impacts, energies; velocities of impacts are those afterwards. `None` for a system without events.
pub fn table(source: &MotionSource, events: &[Occurrence<f64>]) -> Option<DataTable> {
    if source.events.is_empty() {
        return None;
    }
    let named = ["event", source.parameter_name()].into_iter().map(String::from);
    let header = named.chain(source.columns.iter().cloned()).chain(ENERGIES.map(String::from)).collect();
    let row = |event: &Occurrence<f64>| {
        let mut row = vec![json!(event.name), json!(event.t)];
        row.extend(event.q.iter().chain(&event.v).map(|x| json!(x)));
        row.extend(match &event.impact {
            Some(impact) => [impact.energy_before, impact.energy_after, impact.lost()].map(|x| json!(x)),
            None => [Value::Null, Value::Null, Value::Null],
        });
        row
    };
    Some(DataTable { header, rows: events.iter().map(row).collect() })
}

/// Text for a terminal.
pub fn text(table: &DataTable) -> String {
    let count = table.rows.len();
    if count == 0 {
        return "no events\n".to_string();
    }
    let has_impacts = table.rows.iter().any(|row| row.last().is_some_and(|lost| !lost.is_null()));
    let width = table.header.len() - if has_impacts { 0 } else { ENERGIES.len() };
    let cell = |value: &Value| match value {
        Value::String(name) => name.clone(),
        Value::Null => String::new(),
        number => rounded(number.as_f64().unwrap_or(f64::NAN), 10),
    };
    let rows: Vec<Vec<String>> =
        table.rows.iter().take(SHOWN_EVENTS).map(|row| row[..width].iter().map(cell).collect()).collect();
    let more = match count.saturating_sub(SHOWN_EVENTS) {
        0 => String::new(),
        more => format!("and {more} more, which --events writes\n"),
    };
    format!("{}\n{}{more}", pluralize(count, "event", "events"), text_table(&table.header[..width], &rows))
}
