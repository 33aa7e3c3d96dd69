//! The roles of all columns of a table.

use super::angles::{Angle, angle};
use super::names::{is_acceleration, is_force, is_index, is_position, is_torque, is_trajectory, is_velocity};
use super::thresholds::{
    COMPARED_SAMPLES, COPY_ROUNDING, DIFFERENCE_REACHES, EQUAL_CORRELATION, FIXED_OF_DISTANCE, FIXED_RANGE,
    FURTHER_CORRELATION, FURTHER_DIFFERENCE, MUTUAL_DIFFERENCE, NAMED_CORRELATION, ROWS_PER_LABEL, UNNAMED_CORRELATION,
    UNNAMED_DIFFERENCE,
};
use super::time::{self, Time, counts};
use super::{ColumnGuess, Guess};
use crate::lagrangian::NamedFormula;
use crate::recording::LoadedRecording;
use crate::recording::columns::{TIME, formula_in};
use crate::recording::read::RawTable;
use crate::recording::{Columns, DataError, Problem};
use std::path::Path;

/// The role of a column.
#[derive(Clone, Debug, PartialEq)]
enum Role {
    Time,
    Trajectory,
    Coordinate,
    /// A derivative: number of the coordinate, and order.
    Derivative(usize, usize),
    Force,
    /// Specified by an option.
    Given(&'static str),
    Unused,
}

/// A table and the roles of its columns, as far as they are known.
struct Roles<'a> {
    table: &'a RawTable,
    given: &'a Columns,
    time: Option<Time>,
    roles: Vec<Option<(Role, String)>>,
}

/// Guesses the meaning of every column.
pub fn guess(file: &Path, table: &RawTable, given: &Columns) -> Result<Guess, DataError> {
    let mut roles = Roles { table, given, time: None, roles: vec![None; table.names.len()] };
    roles.take_given();
    roles.find_time();
    roles.set_aside();
    roles.find_trajectories(file);
    roles.find_forces();
    roles.find_derivatives();
    roles.find_coordinates();
    roles.leave_out_fixed();
    let (angles, columns) = roles.columns();
    if columns.coords.is_empty() {
        let names = table.names.clone();
        return Err(DataError::File { file: file.display().to_string(), problem: Problem::Names(names) });
    }
    Ok(Guess { table: roles.explain(&angles), columns })
}

impl Roles<'_> {
    fn open(&self) -> Vec<usize> {
        (0..self.roles.len()).filter(|&k| self.roles[k].is_none()).collect()
    }

    fn set(&mut self, column: usize, role: Role, because: impl Into<String>) {
        self.roles[column] = Some((role, because.into()));
    }

    fn of(&self, role: &Role) -> Vec<usize> {
        (0..self.roles.len()).filter(|&k| self.roles[k].as_ref().is_some_and(|(found, _)| found == role)).collect()
    }

    fn restarts(&self) -> &[usize] {
        self.time.as_ref().map_or(&[], |time| &time.restarts)
    }

    /// Assigns the roles that options give.
    fn take_given(&mut self) {
        let place = |name: &String| self.table.names.iter().position(|known| known == name);
        let made_of = |text: &String| formula_in(text)?.parse::<NamedFormula>().ok();
        let inputs = self.given.force.iter().filter_map(made_of).flat_map(|force| force.names);
        let inputs: Vec<String> = inputs.filter(|name| name != TIME).collect();
        let lists: [(&[String], Role); 7] = [
            (self.given.time.as_slice(), Role::Time),
            (self.given.trajectory.as_slice(), Role::Trajectory),
            (&self.given.force, Role::Force),
            (&inputs, Role::Given("input of a force")),
            (&self.given.velocity, Role::Given("velocity")),
            (&self.given.acceleration, Role::Given("acceleration")),
            (&self.given.error, Role::Given("standard error")),
        ];
        let found: Vec<(usize, Role)> = lists
            .into_iter()
            .flat_map(|(names, role)| names.iter().filter_map(place).map(move |k| (k, role.clone())))
            .collect();
        for (k, role) in found {
            self.set(k, role, "as given");
        }
    }

    fn find_time(&mut self) {
        let (table, given) = (self.table, self.given);
        let given_time = self.of(&Role::Time).first().copied();
        self.time = match given_time {
            Some(column) => {
                let restarts = table.numbers[column].as_deref().ok().and_then(time::restarts).unwrap_or_default();
                Some(Time { column, unit: None, restarts, because: "as given".to_string() })
            }
            None if given.rate.is_some() => None,
            None => time::find(&table.names, &table.numbers),
        };
        if let Some(Time { column, because, .. }) = self.time.clone() {
            self.set(column, Role::Time, because);
        }
    }

    /// Excludes columns that are not measurements: text, constants, counters, copies.
    fn set_aside(&mut self) {
        for k in self.open() {
            let Ok(values) = &self.table.numbers[k] else { continue };
            let name = &self.table.names[k];
            let copied = (0..k).find(|&j| self.table.numbers[j].as_ref().is_ok_and(|other| copies(values, other)));
            if values.windows(2).all(|pair| pair[0] == pair[1]) {
                self.set(k, Role::Unused, "it has one value");
            } else if (is_index(name) || self.time.is_some()) && counts(values) {
                self.set(k, Role::Unused, "it counts rows");
            } else if let Some(other) = copied {
                let because = format!("it is {} times a factor", self.table.names[other]);
                self.set(k, Role::Unused, because);
            }
        }
    }

    /// Finds the column that distinguishes trajectories: by its name, or because the time restarts in step with it.
    fn find_trajectories(&mut self, file: &Path) {
        let named = self.of(&Role::Trajectory);
        if !named.is_empty() {
            return;
        }
        let labels = self.open().into_iter().filter(|&k| self.labels(k)).collect::<Vec<_>>();
        let (first, others): (Vec<usize>, Vec<usize>) =
            labels.into_iter().partition(|&k| is_trajectory(&self.table.names[k]));
        let restarts = !self.restarts().is_empty();
        let found =
            first.iter().copied().chain(others.into_iter().filter(|_| restarts)).find(|&k| self.in_order(k, file));
        if let Some(k) = found {
            let because = if first.contains(&k) { "its name" } else { "its value changes where the time restarts" };
            self.set(k, Role::Trajectory, because);
        }
        for k in self.open() {
            if let Err(problem) = &self.table.numbers[k] {
                self.set(k, Role::Unused, problem.clone());
            }
        }
    }

    /// `true` for text, and for whole numbers with few distinct values.
    fn labels(&self, k: usize) -> bool {
        let Ok(values) = &self.table.numbers[k] else { return true };
        let mut distinct: Vec<u64> = values.iter().map(|x| x.to_bits()).collect();
        distinct.sort_unstable();
        distinct.dedup();
        distinct.len() > 1 && distinct.len() * ROWS_PER_LABEL <= values.len() && values.iter().all(|x| x.fract() == 0.0)
    }

    /// `true` if the rows of every trajectory that a column distinguishes are in the order of time.
    fn in_order(&self, k: usize, file: &Path) -> bool {
        let Some(time) = &self.time else { return true };
        let other = self.open().into_iter().find(|&j| j != k && self.table.numbers[j].is_ok());
        let Some(other) = other else { return false };
        let columns = Columns {
            coords: vec![self.table.names[other].clone()],
            time: Some(self.table.names[time.column].clone()),
            trajectory: Some(self.table.names[k].clone()),
            names: self.given.names.clone(),
            ..Columns::default()
        };
        LoadedRecording::read(&[file], &columns).is_ok_and(|read| read.recording.tracks.len() > 1)
    }

    fn find_forces(&mut self) {
        if self.of(&Role::Force).is_empty() {
            let forces: Vec<usize> = self.open().into_iter().filter(|&k| is_force(&self.table.names[k])).collect();
            // If there are no other columns, the forces are taken as coordinates.
            if forces.len() < self.open().len() {
                forces.into_iter().for_each(|k| self.set(k, Role::Force, "its name"));
            }
        }
    }

    /// Finds velocities and accelerations among the remaining columns.
    fn find_derivatives(&mut self) {
        // Once one velocity was found, the others are probably present, possibly with more noise.
        for (order, [least, like]) in [
            (2, [UNNAMED_CORRELATION, UNNAMED_DIFFERENCE]),
            (1, [UNNAMED_CORRELATION, UNNAMED_DIFFERENCE]),
            (1, [FURTHER_CORRELATION, FURTHER_DIFFERENCE]),
        ] {
            let found = |(role, _): &(Role, String)| matches!(role, Role::Derivative(1, _));
            if least == FURTHER_CORRELATION && !self.roles.iter().flatten().any(found) {
                continue;
            }
            let says = if order == 1 { is_velocity } else { is_acceleration };
            for k in self.open() {
                let name = &self.table.names[k];
                let named = says(name);
                if !named && (order == 2 || is_position(name)) {
                    continue;
                }
                let sources = self.open().into_iter().filter(|&j| {
                    let other = &self.table.names[j];
                    let is_free = self.of(&Role::Derivative(order, j)).is_empty();
                    j != k && is_free && !is_velocity(other) && !is_acceleration(other)
                });
                let of = |j: usize| {
                    let (correlation, factor) = self.derivative(j, k, order)?;
                    let back = self.derivative(k, j, 1).is_some_and(|(c, f)| {
                        c.abs() > UNNAMED_CORRELATION && (f.abs() - 1.0).abs() < MUTUAL_DIFFERENCE * UNNAMED_DIFFERENCE
                    });
                    let alike = correlation > least && (factor - 1.0).abs() < like && !back;
                    ((named && correlation > NAMED_CORRELATION) || alike).then_some((j, correlation))
                };
                // On a circle each coordinate is nearly the derivative of the other, so matching names decide.
                let is_named_after =
                    |j: usize| name.starts_with(&*self.table.names[j]) || name.ends_with(&*self.table.names[j]);
                let best = sources.filter_map(of);
                let best = best.max_by(|a, b| is_named_after(a.0).cmp(&is_named_after(b.0)).then(a.1.total_cmp(&b.1)));
                match best {
                    Some((j, _)) => {
                        let because =
                            format!("it is the {}derivative of {}", ["", "", "second "][order], self.table.names[j]);
                        self.set(k, Role::Derivative(order, j), because);
                    }
                    None if named => {
                        let what = ["", "velocity", "acceleration"][order];
                        self.set(
                            k,
                            Role::Unused,
                            format!("its name says {what}, but it is not that of any other column"),
                        );
                    }
                    None => {}
                }
            }
        }
    }

    /// Correlation of column `k` with the derivative of column `j`, and their ratio by least squares.
    fn derivative(&self, j: usize, k: usize, order: usize) -> Option<(f64, f64)> {
        let (x, y) = (self.table.numbers[j].as_ref().ok()?, self.table.numbers[k].as_ref().ok()?);
        let times = self.time.as_ref().and_then(|time| self.table.numbers[time.column].as_ref().ok());
        let scale = self
            .time
            .as_ref()
            .and_then(|time| time.unit)
            .map_or(1.0, |unit| crate::recording::factor(unit).unwrap_or(1.0));
        let step = 1.0 / self.given.rate.unwrap_or(1.0);
        let time = |row: usize| times.map_or(row as f64 * step, |times| times[row] * scale);
        let stride = (x.len() / COMPARED_SAMPLES).max(1);
        let compared = |reach: usize| {
            let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
            for at in (reach..x.len().saturating_sub(reach)).step_by(stride) {
                let (before, after) = (time(at) - time(at - reach), time(at + reach) - time(at));
                if before <= 0.0 || after <= 0.0 {
                    continue;
                }
                let (rise, next) = ((x[at] - x[at - reach]) / before, (x[at + reach] - x[at]) / after);
                let d = if order == 1 { (rise + next) / 2.0 } else { 2.0 * (next - rise) / (before + after) };
                (xy, xx, yy) = (xy + d * y[at], xx + d * d, yy + y[at] * y[at]);
            }
            (xx > 0.0 && yy > 0.0).then(|| (xy / (xx * yy).sqrt(), xy / xx))
        };
        let found: Vec<(f64, f64)> = DIFFERENCE_REACHES.iter().filter_map(|&reach| compared(reach)).collect();
        let most = found.iter().map(|(correlation, _)| *correlation).fold(f64::NEG_INFINITY, f64::max);
        // Among equally good differences, the shortest, which is closest to the derivative.
        found.into_iter().find(|(correlation, _)| *correlation >= most - EQUAL_CORRELATION)
    }

    /// Takes the remaining columns as coordinates; if velocities were measured, only columns named as positions.
    fn find_coordinates(&mut self) {
        let sources: Vec<usize> = self
            .roles
            .iter()
            .flatten()
            .filter_map(|(role, _)| match role {
                Role::Derivative(_, of) => Some(*of),
                _ => None,
            })
            .collect();
        for k in self.open() {
            if sources.is_empty() || sources.contains(&k) || is_position(&self.table.names[k]) {
                let because = if sources.contains(&k) { "another column is its derivative" } else { "it varies" };
                self.set(k, Role::Coordinate, because);
            } else {
                self.set(k, Role::Unused, "no column is its derivative, but other coordinates have one");
            }
        }
        // There must be one force for each coordinate, and one derivative for each or none.
        let coordinates = self.of(&Role::Coordinate);
        let forces = self.of(&Role::Force);
        if !forces.is_empty() && forces.len() != coordinates.len() && self.given.force.is_empty() {
            let because =
                format!("expected a force for each of the {} coordinates, found {}", coordinates.len(), forces.len());
            forces.into_iter().for_each(|k| self.set(k, Role::Unused, because.clone()));
        }
        for order in [1, 2] {
            let of = |roles: &Self, j: usize| roles.of(&Role::Derivative(order, j)).first().copied();
            if !coordinates.iter().all(|&j| of(self, j).is_some()) {
                for &j in &coordinates {
                    for k in self.of(&Role::Derivative(order, j)) {
                        self.set(k, Role::Unused, "not every coordinate has such a column");
                    }
                }
            }
        }
    }

    /// Leaves out positions that hardly move, such as the pivot in a film, unless their names say that they are positions.
    fn leave_out_fixed(&mut self) {
        let extent = |k: usize| {
            let values = self.table.numbers[k].as_deref().unwrap_or_default();
            let (low, high) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
            (high - low, low.abs().min(high.abs()))
        };
        let coordinates = self.of(&Role::Coordinate);
        let Some(widest) = coordinates.iter().copied().max_by(|a, b| extent(*a).0.total_cmp(&extent(*b).0)) else {
            return;
        };
        let fixed = |k: &usize| {
            let (spread, distance) = extent(*k);
            let measured =
                (0..self.roles.len()).any(|j| matches!(&self.roles[j], Some((Role::Derivative(_, of), _)) if of == k));
            !measured
                && !is_position(&self.table.names[*k])
                && spread < FIXED_RANGE * extent(widest).0
                && spread < FIXED_OF_DISTANCE * distance
        };
        let fixed: Vec<usize> = coordinates.into_iter().filter(fixed).collect();
        for k in fixed {
            let because = format!("it hardly moves compared with {}, like a fixed point", self.table.names[widest]);
            self.set(k, Role::Unused, because);
        }
    }

    /// The angles among the coordinates, and the columns as they will be read.
    fn columns(&self) -> (Vec<(usize, Angle)>, Columns) {
        let names = |places: Vec<usize>| places.into_iter().map(|k| self.table.names[k].clone()).collect::<Vec<_>>();
        let coordinates = self.of(&Role::Coordinate);
        let derivative = |order: usize| {
            let places = coordinates.iter().filter_map(|&j| self.of(&Role::Derivative(order, j)).first().copied());
            names(places.collect())
        };
        let units = &self.given.units;
        let known = |name: &String| units.iter().any(|(column, _)| column == name);
        // Joints under torques are angles.
        let forces = self.of(&Role::Force);
        let turned = |place: usize| forces.get(place).is_some_and(|&k| is_torque(&self.table.names[k]));
        let found = |(place, &k): (usize, &usize)| {
            let (name, values) = (&self.table.names[k], self.table.numbers[k].as_ref().ok()?);
            let by_force = || turned(place).then(|| Angle::radians("its force is a torque"));
            Some((k, angle(name, values, self.restarts()).or_else(by_force)?))
        };
        let angles: Vec<(usize, Angle)> = coordinates.iter().enumerate().filter_map(found).collect();
        let mut guessed: Vec<(String, String)> = Vec::new();
        for (k, Angle { degrees, .. }) in &angles {
            let derivatives =
                [(1, "deg/s"), (2, "deg/s2")].map(|(order, unit)| (self.of(&Role::Derivative(order, *k)), unit));
            let own = [(vec![*k], "deg")].into_iter().chain(derivatives);
            for (place, unit) in own.flat_map(|(places, unit)| places.into_iter().map(move |place| (place, unit))) {
                if *degrees {
                    guessed.push((self.table.names[place].clone(), unit.to_string()));
                }
            }
        }
        if let Some(Time { column, unit: Some(unit), .. }) = &self.time {
            guessed.push((self.table.names[*column].clone(), (*unit).to_string()));
        }
        guessed.retain(|(name, _)| !known(name));
        let given = self.given.clone();
        let varies =
            |k: &usize| self.table.numbers[*k].as_ref().is_ok_and(|values| values.iter().any(|x| *x != values[0]));
        let unused = names(self.of(&Role::Unused).into_iter().filter(varies).collect());
        let given_or = |given: Vec<String>, found: Vec<String>| if given.is_empty() { found } else { given };
        let columns = Columns {
            coords: names(coordinates.clone()),
            velocity: given_or(given.velocity, derivative(1)),
            acceleration: given_or(given.acceleration, derivative(2)),
            force: given_or(given.force, names(self.of(&Role::Force))),
            input: given_or(given.input, unused),
            time: self.time.as_ref().map(|time| self.table.names[time.column].clone()),
            trajectory: names(self.of(&Role::Trajectory)).pop(),
            periodic: given_or(given.periodic, names(angles.iter().map(|(k, _)| *k).collect())),
            units: given.units.into_iter().chain(guessed).collect(),
            ..given
        };
        (angles, columns)
    }

    /// One entry for every column.
    fn explain(&self, angles: &[(usize, Angle)]) -> Vec<ColumnGuess> {
        let name = |k: usize| self.table.names[k].clone();
        let entry = |(k, role): (usize, &Option<(Role, String)>)| {
            let (role, because) = role.clone()?;
            let (meaning, because) = match role {
                Role::Time => {
                    let unit = self.time.as_ref().and_then(|time| time.unit);
                    (unit.map_or("time".to_string(), |unit| format!("time in {unit}")), because)
                }
                Role::Trajectory => ("trajectory".to_string(), because),
                Role::Coordinate => match angles.iter().find(|(place, _)| *place == k) {
                    Some((_, Angle { degrees: true, because })) => ("angle in degrees".to_string(), because.clone()),
                    Some((_, Angle { because, .. })) => ("angle".to_string(), because.clone()),
                    None => ("coordinate".to_string(), because),
                },
                Role::Derivative(1, j) => (format!("velocity of {}", name(j)), because),
                Role::Derivative(_, j) => (format!("acceleration of {}", name(j)), because),
                Role::Force => ("force".to_string(), because),
                Role::Given(what) => (what.to_string(), because),
                Role::Unused => ("left out".to_string(), because),
            };
            Some(ColumnGuess { column: name(k), meaning, because })
        };
        self.roles.iter().enumerate().filter_map(entry).collect()
    }
}

/// `true` if a column is another one times a factor, plus a constant, to rounding.
fn copies(values: &[f64], other: &[f64]) -> bool {
    let far = |values: &[f64]| {
        let (low, high) = (0..values.len()).fold((0, 0), |(l, h), k| {
            (if values[k] < values[l] { k } else { l }, if values[k] > values[h] { k } else { h })
        });
        (low, high)
    };
    let (low, high) = far(other);
    let spread = other[high] - other[low];
    if spread == 0.0 {
        return false;
    }
    let factor = (values[high] - values[low]) / spread;
    let size = (values[high] - values[low]).abs();
    let off = |k: usize| (values[k] - values[low] - factor * (other[k] - other[low])).abs();
    size > 0.0 && (0..values.len()).all(|k| off(k) <= COPY_ROUNDING * size)
}
