//! Meaning of the columns of recorded files.

use crate::names::pluralize;
use crate::names::{taken_column, unknown};
use crate::recording::units::{factor, si};
use thiserror::Error;

/// Which columns hold what. A column is its name in the header, or its number from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Coordinates, at least one.
    pub coords: Vec<String>,
    /// Measured velocities, one per coordinate; empty if there are none.
    pub velocity: Vec<String>,
    /// Measured accelerations, one per coordinate; empty if there are none.
    pub acceleration: Vec<String>,
    /// Known external generalized forces, one per coordinate; empty if there are none.
    pub force: Vec<String>,
    /// Standard deviations of the positions, sample by sample, one per coordinate and in its unit; empty if there are none.
    pub error: Vec<String>,
    /// Time; without it and without a rate, the column called `t` or `time`.
    pub time: Option<String>,
    /// Samples per second of data without times.
    pub rate: Option<f64>,
    /// A column whose value distinguishes the trajectories of one file.
    pub trajectory: Option<String>,
    /// Coordinates that are angles, in rad after conversion.
    pub periodic: Vec<String>,
    /// Column and its unit, such as `deg` or `mm`, or its factor to SI.
    pub units: Vec<(String, String)>,
    /// Names of all columns of files without a header, by position.
    pub names: Option<Vec<String>>,
    /// Whether trajectories stay whole, for those who follow them by equations of motion: no gap cuts one, none is too short, and rows at the
    /// same time are repeated measurements of one state.
    pub whole: bool,
}

/// Why a description of columns makes no sense, whatever the data.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct ColumnsError(pub String);

impl Columns {
    /// SI units of the coordinates as far as they are given, empty texts otherwise.
    pub(crate) fn coordinate_units(&self) -> Vec<String> {
        let unit = |name: &String| self.units.iter().find(|(column, _)| column == name).and_then(|(_, unit)| si(unit));
        self.coords.iter().map(|name| unit(name).unwrap_or_default()).collect()
    }

    /// Every column named, with its meaning.
    pub(crate) fn used(&self) -> impl Iterator<Item = (&'static str, &String)> {
        [
            ("coordinate", self.coords.as_slice()),
            ("velocity", self.velocity.as_slice()),
            ("acceleration", self.acceleration.as_slice()),
            ("force", self.force.as_slice()),
            ("error", self.error.as_slice()),
            ("time", self.time.as_slice()),
            ("trajectory", self.trajectory.as_slice()),
        ]
        .into_iter()
        .flat_map(|(what, names)| names.iter().map(move |name| (what, name)))
    }

    /// Factor of a column to SI.
    pub(crate) fn factor(&self, name: &str) -> f64 {
        self.units.iter().find(|(column, _)| column == name).and_then(|(_, unit)| factor(unit).ok()).unwrap_or(1.0)
    }

    /// Which coordinates are angles.
    pub(crate) fn periodic(&self) -> Vec<bool> {
        self.coords.iter().map(|name| self.periodic.contains(name)).collect()
    }

    /// Checks what can be checked without the data.
    ///
    /// # Errors
    /// [`ColumnsError`]: no coordinates, another number of velocities, accelerations, forces or errors than of coordinates, a
    /// column used twice, an angle that is not a coordinate, an unknown unit, a unit of a column that is not used, time and
    /// rate both given, a rate that is not positive.
    pub(crate) fn validate(&self) -> Result<(), ColumnsError> {
        let wrong = |text: String| Err(ColumnsError(text));
        if self.coords.is_empty() {
            return wrong("expected the columns of the coordinates".to_string());
        }
        for (what, names) in [
            ("velocity", &self.velocity),
            ("acceleration", &self.acceleration),
            ("force", &self.force),
            ("error", &self.error),
        ] {
            if !names.is_empty() && names.len() != self.coords.len() {
                let (n, found) = (self.coords.len(), names.len());
                return wrong(format!(
                    "{what}: expected {}, one per coordinate, found {found}",
                    pluralize(n, "column", "columns")
                ));
            }
        }
        let used: Vec<(&str, &String)> = self.used().collect();
        for (k, (what, name)) in used.iter().enumerate() {
            if name.trim().is_empty() {
                return wrong(format!("{what}: expected the name or number of a column, found nothing"));
            }
            if let Some((other, _)) = used[..k].iter().find(|(_, earlier)| earlier == name) {
                return wrong(format!("column {name} is used twice, as {other} and as {what}"));
            }
        }
        let coordinates: Vec<&str> = self.coords.iter().map(String::as_str).collect();
        if let Some((_, problem)) = taken_column(&coordinates) {
            return wrong(format!("coordinate: {problem} in the header"));
        }
        if let Some(name) = self.periodic.iter().find(|name| !self.coords.contains(name)) {
            return wrong(format!("periodic: {}", unknown("coordinate", name, self.coords.iter().map(String::as_str))));
        }
        match (self.rate, &self.time) {
            (Some(_), Some(time)) => {
                return wrong(format!("expected either a column of time ({time}) or a rate, found both"));
            }
            (Some(rate), None) if !(rate.is_finite() && rate > 0.0) => {
                return wrong(format!("rate: expected a finite number of samples per second above 0, found {rate}"));
            }
            _ => {}
        }
        // The default column of time is known only with the data.
        let known = || used.iter().map(|(_, name)| name.as_str()).chain(["t", "time"]);
        for (k, (name, unit)) in self.units.iter().enumerate() {
            if !known().any(|column| column == name) {
                return wrong(format!("units: {}", unknown("column", name, known().collect::<Vec<_>>())));
            }
            if self.units[..k].iter().any(|(earlier, _)| earlier == name) {
                return wrong(format!("units: duplicate column {name}"));
            }
            factor(unit).map_err(|problem| ColumnsError(format!("units: {name}: {problem}")))?;
        }
        if let Some(names) = &self.names
            && let Some((k, name)) = names.iter().enumerate().find(|(k, name)| names[..*k].contains(name))
        {
            return wrong(format!("columns: duplicate name {name}, at position {} again", k + 1));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(names: &[&str]) -> Vec<String> {
        names.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn contradictions_are_named() {
        let good = Columns { coords: list(&["x", "theta"]), periodic: list(&["theta"]), ..Columns::default() };
        assert_eq!(good.validate(), Ok(()));
        assert_eq!(good.periodic(), [false, true]);
        let says = |columns: Columns, part: &str| {
            let text = columns.validate().unwrap_err().to_string();
            assert!(text.contains(part), "{text}");
        };
        says(Columns::default(), "coordinates");
        says(Columns { velocity: list(&["v"]), ..good.clone() }, "velocity: expected 2 columns");
        says(Columns { time: Some("x".into()), ..good.clone() }, "column x is used twice, as coordinate and as time");
        says(Columns { periodic: list(&["tehta"]), ..good.clone() }, "did you mean \"theta\"?");
        says(Columns { rate: Some(0.0), ..good.clone() }, "above 0");
        says(Columns { rate: Some(1.0), time: Some("t".into()), ..good.clone() }, "found both");
        says(Columns { units: vec![("y".into(), "mm".into())], ..good.clone() }, "unknown column \"y\"");
        says(Columns { units: vec![("x".into(), "parsec".into())], ..good.clone() }, "unknown unit");
        says(Columns { names: Some(list(&["a", "b", "a"])), ..good }, "position 3");
    }
}
