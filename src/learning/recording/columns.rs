//! Meaning of the columns of recorded files.

use crate::lagrangian::SystemInstance;
use crate::names::{pluralize, taken_column, unknown};
use crate::recording::heading::is_same;
use crate::recording::units::factor;
use thiserror::Error;

/// The meaning of the columns. A column is given by its name in the header, with or without its unit in brackets, or by its number from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Coordinates, at least one.
    pub coords: Vec<String>,
    /// Measured velocities, one per coordinate; empty if there are none.
    pub velocity: Vec<String>,
    /// Measured accelerations, one per coordinate; empty if there are none.
    pub acceleration: Vec<String>,
    /// Known external generalized forces, one per coordinate; empty if there are none. A force may also be a formula, after an equals sign,
    /// of the time `t` and of other columns, such as `=0.3*cos(1.2*t)`.
    pub force: Vec<String>,
    /// Standard deviations of the positions, sample by sample, one per coordinate and in its unit; empty if there are none.
    pub error: Vec<String>,
    /// Other measured quantities, such as the voltage of a motor; empty if there are none.
    pub input: Vec<String>,
    /// Time; without it and without a rate, the column called `t` or `time`.
    pub time: Option<String>,
    /// Samples per second of data without times.
    pub rate: Option<f64>,
    /// A column whose value distinguishes the trajectories of one file.
    pub trajectory: Option<String>,
    /// Coordinates that are angles, in rad after conversion.
    pub periodic: Vec<String>,
    /// Column and its unit, such as `deg` or `mm`, or its factor to SI; it overrides a unit in the header.
    pub units: Vec<(String, String)>,
    /// Names of all columns of files without a header, by position.
    pub names: Option<Vec<String>>,
    /// Whether trajectories are side by side, such as those of coordinates `s` and `theta` in `s1`, `theta1`, `s2`, `theta2`. They share a
    /// time column unless there are `t1`, `t2`; after the end of a shorter trajectory its fields are empty.
    pub wide: bool,
    /// Whether trajectories stay whole, for programs that follow them by equations of motion: no gap cuts one, none is too short, and rows
    /// at the same time are repeated measurements of one state.
    pub whole: bool,
}

/// Mistakes in a description of columns that can be found without the data.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}", .0.join("; "))]
pub struct ColumnsError(pub Vec<String>);

/// Name of the time in formulas of forces, whatever its column is called.
pub const TIME: &str = "t";

/// The formula, if a force is given by one instead of a column.
pub fn formula_in(text: &str) -> Option<&str> {
    text.strip_prefix('=')
}

impl Columns {
    /// Completes the columns for a recording of a system. Columns of the coordinates are by default those with their names, and angles
    /// are those of the system; with a table `[measured]` in its file, the columns are those of the measured quantities. Inputs have
    /// the names of the system's inputs. Trajectories stay [whole](Self::whole).
    ///
    /// # Errors
    /// [`ColumnsError`]: another number of coordinates than that of the system, or columns that are given beside a table `[measured]`.
    pub fn of_system(self, system: &SystemInstance<f64>) -> Result<Self, ColumnsError> {
        let completed =
            if system.readings().is_empty() { self.of_coordinates(system) } else { self.of_readings(system) };
        Ok(Self { input: system.inputs().map(str::to_string).collect(), whole: true, ..completed? })
    }

    /// Completes the columns of the coordinates of a system.
    fn of_coordinates(mut self, system: &SystemInstance<f64>) -> Result<Self, ColumnsError> {
        let coordinates = system.system.coordinates(system.coordinates);
        if self.coords.is_empty() {
            self.coords = coordinates.iter().map(|coordinate| coordinate.name.to_string()).collect();
        }
        if self.coords.len() != coordinates.len() {
            let (columns, found) = (pluralize(coordinates.len(), "column", "columns"), self.coords.len());
            let name = &system.system.name;
            let wrong = format!("coords: expected {columns}, as many as {name} has coordinates, found {found}");
            return Err(ColumnsError(vec![wrong]));
        }
        if self.periodic.is_empty() {
            let angles = self.coords.iter().zip(&coordinates).filter(|(_, coordinate)| coordinate.periodic);
            self.periodic = angles.map(|(column, _)| column.clone()).collect();
        }
        Ok(self)
    }

    /// Takes the columns of the measured quantities of a system file.
    fn of_readings(self, system: &SystemInstance<f64>) -> Result<Self, ColumnsError> {
        let given = [
            ("coords", &self.coords),
            ("velocity", &self.velocity),
            ("acceleration", &self.acceleration),
            ("force", &self.force),
            ("error", &self.error),
            ("periodic", &self.periodic),
        ];
        if let Some((what, _)) = given.into_iter().find(|(_, columns)| !columns.is_empty()) {
            let wrong = format!("{what}: the table [measured] of the system says what the columns are");
            return Err(ColumnsError(vec![wrong]));
        }
        let readings = system.readings();
        let angles = readings.iter().filter(|reading| reading.periodic);
        Ok(Self {
            coords: readings.iter().map(|reading| reading.column.clone()).collect(),
            periodic: angles.map(|reading| reading.column.clone()).collect(),
            error: readings.iter().filter_map(|reading| reading.error.clone()).collect(),
            ..self
        })
    }

    /// Every column named, with its meaning.
    pub(crate) fn used(&self) -> impl Iterator<Item = (&'static str, &String)> {
        [
            ("coordinate", self.coords.as_slice()),
            ("velocity", self.velocity.as_slice()),
            ("acceleration", self.acceleration.as_slice()),
            ("force", self.force.as_slice()),
            ("error", self.error.as_slice()),
            ("input", self.input.as_slice()),
            ("time", self.time.as_slice()),
            ("trajectory", self.trajectory.as_slice()),
        ]
        .into_iter()
        .flat_map(|(what, names)| names.iter().map(move |name| (what, name)))
    }

    /// Which coordinates are angles.
    pub(crate) fn periodic(&self) -> Vec<bool> {
        self.coords.iter().map(|name| self.periodic.iter().any(|angle| is_same(angle, name))).collect()
    }

    /// Checks what can be checked without the data.
    ///
    /// # Errors
    /// [`ColumnsError`]: no coordinates, another number of velocities, accelerations, forces or errors than of coordinates, a column used
    /// twice, an angle that is not a coordinate, an unknown unit, a unit of a column that is not used, time and rate both given, a rate
    /// that is not positive, a trajectory column for trajectories side by side. All faults are reported at once.
    pub(crate) fn validate(&self) -> Result<(), ColumnsError> {
        let mut wrong = Vec::new();
        if self.coords.is_empty() {
            wrong.push("expected the columns of the coordinates".to_string());
        }
        if let Err(counts) = self.count_faults() {
            wrong.extend(counts.0);
        }
        let used: Vec<(&str, &String)> = self.used().collect();
        for (k, (what, name)) in used.iter().enumerate() {
            if name.trim().is_empty() {
                wrong.push(format!("{what}: expected the name or number of a column, found nothing"));
            } else if let Some((other, _)) = used[..k].iter().find(|(_, earlier)| earlier == name) {
                wrong.push(format!("column {name} is used twice, as {other} and as {what}"));
            }
        }
        let coordinates: Vec<&str> = self.coords.iter().map(String::as_str).collect();
        if let Some((_, problem)) = taken_column(&coordinates) {
            wrong.push(format!("coordinate: {problem} in the header"));
        }
        for name in self.periodic.iter().filter(|name| !self.coords.iter().any(|coordinate| is_same(coordinate, name)))
        {
            wrong.push(format!("periodic: {}", unknown("coordinate", name, coordinates.iter().copied())));
        }
        match (self.rate, &self.time) {
            (Some(_), Some(time)) => {
                wrong.push(format!("expected either a column of time ({time}) or a rate, found both"));
            }
            (Some(rate), None) if !(rate.is_finite() && rate > 0.0) => {
                wrong.push(format!("rate: expected a finite number of samples per second above 0, found {rate}"));
            }
            _ => {}
        }
        if let (true, Some(column)) = (self.wide, &self.trajectory) {
            wrong.push(format!(
                "expected trajectories either side by side (wide) or distinguished by the column {column}, found both"
            ));
        }
        self.check_units(&mut wrong);
        for (k, name) in self.names.iter().flat_map(|names| names.iter().enumerate()) {
            if self.names.iter().any(|names| names[..k].contains(name)) {
                wrong.push(format!("columns: duplicate name {name}, at position {} again", k + 1));
            }
        }
        if wrong.is_empty() { Ok(()) } else { Err(ColumnsError(wrong)) }
    }

    /// Checks that the number of each kind of column matches the coordinates.
    ///
    /// # Errors
    /// [`ColumnsError`]: another number of velocities, accelerations, forces or errors.
    pub(crate) fn count_faults(&self) -> Result<(), ColumnsError> {
        let lists = [
            ("velocity", &self.velocity),
            ("acceleration", &self.acceleration),
            ("force", &self.force),
            ("error", &self.error),
        ];
        let other = lists.into_iter().filter(|(_, names)| !names.is_empty() && names.len() != self.coords.len());
        let fault = |(what, names): (&str, &Vec<String>)| {
            let (columns, found) = (pluralize(self.coords.len(), "column", "columns"), names.len());
            format!("{what}: expected {columns}, one per coordinate, found {found}")
        };
        let wrong: Vec<String> = other.map(fault).collect();
        if wrong.is_empty() { Ok(()) } else { Err(ColumnsError(wrong)) }
    }

    /// Collects the mistakes in the units.
    fn check_units(&self, wrong: &mut Vec<String>) {
        // The name of the default time column is only known once the data are read.
        let usual: &[&str] = if self.time.is_none() && self.rate.is_none() { &["t", "time"] } else { &[] };
        let known = || self.used().map(|(_, name)| name.as_str()).chain(usual.iter().copied());
        for (k, (name, unit)) in self.units.iter().enumerate() {
            if !known().any(|column| is_same(column, name))
                && !usual.iter().any(|usual| usual.eq_ignore_ascii_case(name))
            {
                wrong.push(format!("units: {}", unknown("column", name, known().collect::<Vec<_>>())));
            } else if self.units[..k].iter().any(|(earlier, _)| earlier == name) {
                wrong.push(format!("units: duplicate column {name}"));
            } else if let Err(problem) = factor(unit) {
                wrong.push(format!("units: {name}: {problem}"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(names: &[&str]) -> Vec<String> {
        names.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_system_names_the_columns_that_are_left_open() {
        let system = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap();
        let (angles, left) = (list(&["theta1", "theta2"]), Columns::default().of_system(&system).unwrap());
        assert_eq!((left.coords, left.periodic, left.whole), (angles.clone(), angles, true));
        let named = Columns { coords: list(&["a", "b"]), periodic: list(&["b"]), ..Columns::default() };
        let named = named.of_system(&system).unwrap();
        assert_eq!((named.coords, named.periodic), (list(&["a", "b"]), list(&["b"])));
        let one = Columns { coords: list(&["a"]), ..Columns::default() };
        let refused = one.of_system(&system).unwrap_err().to_string();
        assert_eq!(refused, "coords: expected 2 columns, as many as double-pendulum has coordinates, found 1");
    }

    #[test]
    fn contradictions_are_named() {
        let several = Columns { force: list(&["f"]), rate: Some(-1.0), ..Columns::default() };
        assert_eq!(several.validate().unwrap_err().0.len(), 3);
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
