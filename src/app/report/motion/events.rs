//! The events of a motion as a table.

use super::record::MotionRecord;
use crate::findings::Findings;
use crate::names::{pluralize, rounded};
use crate::report::DataTable;
use crate::report::thresholds::SHOWN_EVENTS;
use crate::rollout::Occurrence;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

/// Names of the columns of the energies of impacts.
const ENERGIES: [&str; 3] = ["energy_before", "energy_after", "energy_lost"];

/// Times, states and, for impacts, energies; velocities of impacts are those afterwards.
#[derive(Clone, Debug, PartialEq)]
pub struct EventTable {
    /// A row for each event.
    pub table: DataTable,
}

impl MotionRecord {
    /// The table of the events of the motion.
    pub fn events(&self, events: &[Occurrence<f64>]) -> EventTable {
        let named = ["event", self.parameter()].into_iter().map(String::from);
        let header = named.chain(self.columns.iter().cloned()).chain(ENERGIES.map(String::from)).collect();
        let row = |event: &Occurrence<f64>| {
            let mut row = vec![json!(event.name), json!(event.t)];
            row.extend(event.q.iter().chain(&event.v).map(|x| json!(x)));
            row.extend(match &event.impact {
                Some(impact) => [impact.energy_before, impact.energy_after, impact.lost()].map(|x| json!(x)),
                None => [Value::Null, Value::Null, Value::Null],
            });
            row
        };
        EventTable { table: DataTable { header, rows: events.iter().map(row).collect() } }
    }
}

/// A list with an object for each event.
impl Serialize for EventTable {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.table.objects().serialize(serializer)
    }
}

impl EventTable {
    /// The number of events and a table of the first ones.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        let DataTable { header, rows } = &self.table;
        if rows.is_empty() {
            findings.line("no events");
            return findings;
        }
        let has_impacts = rows.iter().any(|row| row.last().is_some_and(|lost| !lost.is_null()));
        let width = header.len() - if has_impacts { 0 } else { ENERGIES.len() };
        let cell = |value: &Value| match value {
            Value::String(name) => name.clone(),
            Value::Null => String::new(),
            number => rounded(number.as_f64().unwrap_or(f64::NAN), 10),
        };
        findings.line(pluralize(rows.len(), "event", "events"));
        let shown = rows.iter().take(SHOWN_EVENTS);
        findings.table(&header[..width], shown.map(|row| row[..width].iter().map(cell).collect::<Vec<_>>()));
        if let more @ 1.. = rows.len().saturating_sub(SHOWN_EVENTS) {
            findings.line(format!("and {more} more, which --events writes"));
        }
        findings
    }
}
